"""Drawing instances: instance = draw(configuration, seed, trial), a function of these three and of nothing else."""

from __future__ import annotations

from collections.abc import Sequence
from enum import IntEnum

from dubins_traffic.cars.state import Pose
from dubins_traffic.errors import InputError
from dubins_traffic.kernels.philox import Draws
from dubins_traffic.problem import limits
from dubins_traffic.problem.configuration import Configuration, PlannedAgent, check_goal, pose_of
from dubins_traffic.problem.cycles import cycle_lanes, draw_cycle
from dubins_traffic.problem.demands import check_demands
from dubins_traffic.problem.formulas import check_formulas
from dubins_traffic.problem.instance import EAgent, Instance, Problem
from dubins_traffic.problem.kinds import loops
from dubins_traffic.problem.starts import Ground, Wish, draw_starts
from dubins_traffic.roads.clearance import LEAST_RADIUS, SEGMENT_SLACK
from dubins_traffic.roads.generate import random_network, thinned_grid
from dubins_traffic.roads.network import RoadNetwork


class Stream(IntEnum):
    """Streams of random numbers, one a purpose: what is drawn for one never shifts another."""

    NETWORK = 1
    GOALS = 2
    DURATION = 3
    STARTS = 4
    CYCLES = 5


def draw(configuration: Configuration, seed: int = 0, trial: int = 0) -> Instance:
    """Return trial number `trial` of a configuration.

    Parameters
    ----------
    configuration : Configuration
        What to draw from.
    seed : int
        Root seed, 0 <= seed < 2**64.
    trial : int
        Number of the trial, from 0. It does not depend on any other trial nor on how many there are.

    Raises
    ------
    InputError
        If the seed or number is out of range, the cars don't fit, a goal is off the network, or the rules are asked
        for where they aren't defined.
    """
    check_numbers(seed, trial)
    try:
        return _draw(configuration, int(seed), int(trial))
    except InputError as error:
        raise error.within(file=configuration.file) from None


def check_numbers(seed: int, trial: int) -> None:
    """Refuse a seed or a number of a trial that is out of range."""
    for name, value, end in (("seed", seed, limits.SEEDS), ("trial", trial, limits.TRIALS)):
        if isinstance(value, bool) or not 0 <= value < end:
            raise InputError(
                f"not a {name}", field=name, value=value, expected=f"an integer >= 0 and < {end}"
            )


def draw_goals(network: RoadNetwork, bounds: tuple[int, int], draws: Draws) -> tuple[tuple[int, int], ...]:
    """Return goals, as many as drawn from `bounds` (both included), distinct while there are intersections."""
    count = draws.between(*bounds)
    places = len(network.intersections)
    picks = draws.sample(min(count, places), places)
    picks += [draws.below(places) for _ in range(count - places)]
    return tuple(network.intersections[v] for v in picks)


def draw_duration(bounds: tuple[int, int], draws: Draws) -> float:
    """Return a duration of whole seconds, uniform over `bounds`, both included."""
    return float(draws.between(*bounds))


def origin_start(network: RoadNetwork, w: float) -> Pose | None:
    """Return the ego's start of 2016, the world's origin with heading 0, or None if that is off the road."""
    on_road = bool(network.on_road([0.0, 0.0], 2.0 * w))
    return Pose(0.0, 0.0, 1.0, 0.0) if on_road else None


def complete_agents(
    network: RoadNetwork, planned: Sequence[PlannedAgent], draws: Draws
) -> tuple[EAgent, ...]:
    """Return the e-agents with everything about them drawn."""
    agents: list[EAgent] = []
    for agent in (plan.agent for plan in planned):
        parameters = dict(agent.parameters)
        if loops(agent.kind, parameters) and parameters["cycle"] is None:
            parameters["cycle"] = draw_cycle(network, draws)
        agents.append(EAgent(agent.kind, agent.name, agent.type, parameters))
    return tuple(agents)


def agent_wishes(
    network: RoadNetwork, planned: Sequence[PlannedAgent], agents: Sequence[EAgent]
) -> list[Wish]:
    """Return where each e-agent is to start: as planned, else drawn; a loop on its cycle."""
    wishes: list[Wish] = []
    for plan, agent in zip(planned, agents, strict=True):
        lanes = None
        if loops(agent.kind, agent.parameters):
            try:
                lanes = cycle_lanes(network, agent.parameters["cycle"])
            except InputError as error:
                raise error.within(field=f"{plan.field}.parameters") from None
        wishes.append(Wish(plan.start, lanes, f"{plan.field}.start"))
    return wishes


def _draw(configuration: Configuration, seed: int, trial: int) -> Instance:
    settings = configuration.settings
    network = configuration.network or _draw_network(configuration, Draws(seed, trial, Stream.NETWORK))
    car = configuration.car
    radius = settings.radius
    rules = settings.rule_parameters
    if rules:
        check_demands(network, radius, car, settings.sensing_radius, rules)
    agents = complete_agents(network, configuration.agents, Draws(seed, trial, Stream.CYCLES))
    names = ("ego", *(agent.name for agent in agents))
    problem = Problem(
        network=network,
        goals=_goals(network, configuration, Draws(seed, trial, Stream.GOALS)),
        intersection_radius=radius,
        car=car,
        rate=settings.rate,
        sensing_radius=settings.sensing_radius,
        laser=settings.laser_value,
        obstacles=settings.obstacle_values,
        e_agents=names[1:],
        rules=rules,
        formulas=settings.formulas,
    )
    check_formulas(problem, names)
    ego = Wish(_ego_start(network, configuration), None, "ego.start")
    wishes = [ego, *agent_wishes(network, configuration.agents, agents)]
    ground = Ground(network, car, radius, problem.obstacles)
    return Instance(
        problem=problem,
        starts=tuple(draw_starts(ground, names, wishes, Draws(seed, trial, Stream.STARTS))),
        duration=_duration(configuration, Draws(seed, trial, Stream.DURATION)),
        e_agents=agents,
        seed=seed,
        trial=trial,
        disturbances=settings.disturbances.core(),
        end_on_collision=settings.end_on_collision,
        simulator=settings.simulator,
    )


def _goals(network: RoadNetwork, configuration: Configuration, draws: Draws) -> tuple[tuple[int, int], ...]:
    settings = configuration.settings
    if settings.goals is not None:
        return tuple(check_goal(network, goal, k) for k, goal in enumerate(settings.goals))
    low, high = settings.number_goals_bounds
    return draw_goals(network, (low, high), draws)


def _duration(configuration: Configuration, draws: Draws) -> float:
    settings = configuration.settings
    if settings.duration is not None:
        return settings.duration
    low, high = settings.duration_bounds
    return draw_duration((low, high), draws)


def _ego_start(network: RoadNetwork, configuration: Configuration) -> Pose | None:
    start = configuration.settings.ego.start
    if start == "drawn":
        return None
    if start == "origin":
        return origin_start(network, configuration.car.w)
    return pose_of(*start)


def _draw_network(configuration: Configuration, draws: Draws) -> RoadNetwork:
    """Return the network of one trial, with room for the rules of a configuration that asks for a random one."""
    settings, car = configuration.settings, configuration.car
    network = settings.network
    if network is None:
        raise InputError("missing", field="network", expected="random or grid")
    if network.grid is not None:
        grid = network.grid
        try:
            return thinned_grid(
                draws,
                grid.rows,
                grid.columns,
                grid.removed,
                length=grid.length,
                rigid_motion=grid.rigid_motion,
            )
        except InputError as error:
            raise error.within(field="network.grid") from None
    wanted = network.random
    if wanted is None:
        raise InputError("missing", field="network", expected="random or grid")
    slack = settings.rule_parameters.get("segment_slack", SEGMENT_SLACK)
    try:
        return random_network(
            draws,
            wanted.intersections,
            wanted.segments,
            minimum_angle=wanted.min_angle,
            w=car.w,
            radius=max(settings.radius, LEAST_RADIUS * car.w),
            reach=car.body.reach,
            slack=slack,
            rigid_motion=wanted.rigid_motion,
        )
    except InputError as error:
        raise error.within(field="network.random") from None
