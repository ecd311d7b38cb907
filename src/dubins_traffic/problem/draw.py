"""Drawing instances: ``draw(configuration, seed, trial)`` depends on these three arguments alone.

Each part of an instance has a stream of random numbers of its own; what the instances of a configuration have in
common is worked out once, by its `Recipe`.
"""

from __future__ import annotations

from collections.abc import Collection, Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from enum import IntEnum
from itertools import islice, repeat

from dubins_traffic.cars.body import Car, Obstacle
from dubins_traffic.cars.read_only import read_only
from dubins_traffic.cars.state import Pose
from dubins_traffic.errors import InputError
from dubins_traffic.kernels.philox import Draws
from dubins_traffic.problem import limits
from dubins_traffic.problem.configuration import Configuration, PlannedAgent, check_goal, pose_of
from dubins_traffic.problem.formulas import check_formulas
from dubins_traffic.problem.goals import Reach, draw_goals
from dubins_traffic.problem.instance import EAgent, Instance, Problem
from dubins_traffic.problem.kinds import KEEP_RULES, loops
from dubins_traffic.problem.obstructions import check_obstructions
from dubins_traffic.problem.overlap import Shape, obstacle_shape, overlap
from dubins_traffic.problem.preconditions import check_demands
from dubins_traffic.problem.starts import (
    Areas,
    Ground,
    Lots,
    Wish,
    areas_of,
    check_given,
    draw_starts,
    lots,
    place_cars,
)
from dubins_traffic.roads.clearance import LEAST_RADIUS, SEGMENT_SLACK
from dubins_traffic.roads.formats.rnd import grid_segments
from dubins_traffic.roads.generate import random_network, thinned_grid
from dubins_traffic.roads.network import RoadNetwork

TOGETHER = 64
"""Number of instances that are drawn at a time."""
BESIDE = 0.02
"""Gap that a car needs beside it to pass an obstacle within its lane, metres."""


def draw(configuration: Configuration, seed: int = 0, trial: int = 0) -> Instance:
    """Return trial number `trial` of a configuration.

    Parameters
    ----------
    configuration : Configuration
        The configuration.
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
        return _recipe(configuration).draw(int(seed), int(trial))
    except InputError as error:
        raise error.within(file=configuration.file) from None


def draw_many(configuration: Configuration, seed: int, trials: Iterable[int]) -> Iterator[Instance]:
    """Yield the instances that `draw` returns for the numbers `trials`, much faster.

    The parameters and errors are those of `draw`; an error is raised when its trial is reached.
    """
    numbers = iter(trials)
    while some := [int(trial) for trial in islice(numbers, TOGETHER)]:
        for trial in some:
            check_numbers(seed, trial)
        try:
            yield from _recipe(configuration).draw_many(int(seed), some)
        except InputError as error:
            raise error.within(file=configuration.file) from None


def check_numbers(seed: int, trial: int) -> None:
    """Refuse a seed or a number of a trial that is out of range."""
    for name, value, end in (("seed", seed, limits.SEEDS), ("trial", trial, limits.TRIALS)):
        if isinstance(value, bool) or not 0 <= value < end:
            raise InputError(f"not a {name}", field=name, value=value, expected=f"an integer >= 0 and < {end}")


def _recipe(configuration: Configuration) -> Recipe:
    recipe = configuration.kept.get(_RECIPE)
    if not isinstance(recipe, Recipe):
        recipe = configuration.kept[_RECIPE] = Recipe(configuration)
    return recipe


_RECIPE = "recipe"


@dataclass(slots=True)
class Site:
    """A road network with the e-agents on it, and where they are to start; `lots` are made when needed."""

    network: RoadNetwork
    agents: tuple[EAgent, ...]
    wishes: list[Wish]
    ground: Ground
    lots: Lots | None = None


class Recipe:
    """Draws the instances of a configuration.

    Where the road network is the same in all trials, and no cycles are drawn on it, all instances share one site.
    """

    def __init__(self, configuration: Configuration) -> None:
        settings = configuration.settings
        self._configuration = configuration
        self._settings = settings
        self._car = configuration.car
        self._radius = settings.radius
        self._rules = read_only(settings.rule_parameters)  # one for all trials: see `distinct_problems`
        self._obstacles = settings.obstacle_values
        self._laser = settings.laser
        self._disturbances = settings.disturbances
        self._agents = tuple([plan.agent for plan in configuration.agents])
        self._names = ("ego", *(agent.name for agent in self._agents))
        self._steady = not any(map(drawn_cycle, self._agents))
        self._network = configuration.network
        self._site: Site | None = None
        self._areas_kept: tuple[RoadNetwork, Areas] | None = None

    def draw(self, seed: int, trial: int) -> Instance:
        """Return the instance of a trial."""
        site = self._site_of(seed, trial)
        return self._instance(site, seed, trial, None)

    def draw_many(self, seed: int, trials: Sequence[int]) -> Iterator[Instance]:
        """Yield the instances of some trials, which are those of `draw`; trials on one site are drawn in one call."""
        k = 0
        while k < len(trials):
            site = self._site_of(seed, trials[k])
            some = trials[k:] if site is self._site else trials[k : k + 1]
            starts: Iterable[list[Pose] | None] = repeat(None, len(some))
            if self._settings.goal_round_share is None:
                starts = place_cars(self._lots(site), site.wishes, seed, some, Stream.STARTS)
            for trial, poses in zip(some, starts, strict=True):
                yield self._instance(site, seed, trial, poses)
            k += len(some)

    def _instance(self, site: Site, seed: int, trial: int, starts: list[Pose] | None) -> Instance:
        settings = self._settings
        duration = self._duration(seed, trial)
        goals, lanes = self._goals(site.network, seed, trial, duration)
        problem = Problem(
            network=site.network,
            goals=goals,
            intersection_radius=self._radius,
            car=self._car,
            rate=settings.rate,
            sensing_radius=settings.sensing_radius,
            laser=self._laser,
            obstacles=self._obstacles,
            e_agents=self._names[1:],
            rules=self._rules,
            formulas=settings.formulas,
        )
        check_formulas(problem, self._names)
        check_obstructions(problem)
        if starts is None:
            draws = Draws(seed, trial, Stream.STARTS)
            wishes = site.wishes if lanes is None else [site.wishes[0]._replace(lanes=lanes), *site.wishes[1:]]
            starts = draw_starts(self._areas(site), self._car, wishes, draws)
        return Instance(
            problem=problem,
            starts=tuple(starts),
            duration=duration,
            e_agents=site.agents,
            seed=seed,
            trial=trial,
            disturbances=self._disturbances,
            end_on_collision=settings.end_on_collision,
            simulator=settings.simulator,
        )

    def _site_of(self, seed: int, trial: int) -> Site:
        if self._site is not None:
            return self._site
        network = self._network or self._draw_network(Draws(seed, trial, Stream.NETWORK))
        if self._rules:
            check_demands(network, self._radius, self._car, self._settings.sensing_radius, self._rules)
        planned, agents = self._configuration.agents, self._agents
        if not self._steady:
            agents = complete_agents(network, planned, Draws(seed, trial, Stream.CYCLES))
        others = agent_wishes(network, planned, agents, self._car, self._obstacles)
        wishes = [Wish(self._ego_start(network), None, "ego.start"), *others]
        ground = Ground(network, self._car, self._radius, self._obstacles)
        check_given(ground, self._names, wishes)
        site = Site(network, agents, wishes, ground)
        if self._is_fixed(network):
            self._network = network
            self._site = site if self._steady else None
        return site

    def _is_fixed(self, network: RoadNetwork) -> bool:
        """Tell whether a network is the same in all trials: nothing about it is random."""
        wanted = self._settings.network
        if self._network is not None or wanted is None or wanted.grid is None:
            return self._network is not None
        grid = wanted.grid
        return not grid.rigid_motion and network.segments == grid_segments(grid.rows, grid.columns)

    def _areas(self, site: Site) -> Areas:
        if self._areas_kept is not None and self._areas_kept[0] is site.network:
            return self._areas_kept[1]
        areas = areas_of(site.ground)
        self._areas_kept = site.network, areas
        return areas

    def _lots(self, site: Site) -> Lots:
        if site.lots is None:
            site.lots = lots(self._car, (self._areas(site).outside,), site.wishes)
        return site.lots

    def _goals(
        self, network: RoadNetwork, seed: int, trial: int, duration: float
    ) -> tuple[tuple[tuple[float, float], ...], Collection[int] | None]:
        """Return the goals, and the lanes on which the ego is to start, None for any."""
        settings = self._settings
        if settings.goals is not None:
            return tuple(check_goal(network, goal, k) for k, goal in enumerate(settings.goals)), None
        low, high = settings.number_goals_bounds
        draws = Draws(seed, trial, Stream.GOALS)
        share, speed = settings.goal_round_share, self._car.bounds.speed
        reach = None if share is None else Reach(share, share * duration * speed)
        picks, way = draw_goals(network, (low, high), draws, settings.goal_segments_apart, reach)
        return tuple(network.intersections[v] for v in picks), None if way is None else set(way.lanes)

    def _duration(self, seed: int, trial: int) -> float:
        settings = self._settings
        if settings.duration is not None:
            return settings.duration
        low, high = settings.duration_bounds
        return draw_duration((low, high), Draws(seed, trial, Stream.DURATION))

    def _ego_start(self, network: RoadNetwork) -> Pose | None:
        start = self._settings.ego.start
        if start == "drawn":
            return None
        if start == "origin":
            return origin_start(network, self._car.w)
        return pose_of(*start)

    def _draw_network(self, draws: Draws) -> RoadNetwork:
        """Return the network of one trial, with room for the rules of a configuration that asks for a random one."""
        settings, car = self._settings, self._car
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
        slack = self._rules.get("segment_slack", SEGMENT_SLACK)
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
                bent=wanted.bent,
            )
        except InputError as error:
            raise error.within(field="network.random") from None


class Stream(IntEnum):
    """Streams of random numbers, one for each purpose: drawing from one never shifts another."""

    NETWORK = 1
    GOALS = 2
    DURATION = 3
    STARTS = 4
    CYCLES = 5


def draw_duration(bounds: tuple[int, int], draws: Draws) -> float:
    """Return a duration of whole seconds, uniform over `bounds`, both included."""
    return float(draws.between(*bounds))


def origin_start(network: RoadNetwork, w: float) -> Pose | None:
    """Return the ego's start of 2016, the world's origin with heading 0, or None if that is off the road."""
    on_road = bool(network.on_road([0.0, 0.0], 2.0 * w))
    return Pose(0.0, 0.0, 1.0, 0.0) if on_road else None


def drawn_cycle(agent: EAgent) -> bool:
    """Tell whether the cycle of a planned e-agent is drawn."""
    driver = agent.driver
    return loops(driver.kind, driver.parameters) and driver.parameters["cycle"] is None


def complete_agents(network: RoadNetwork, planned: Sequence[PlannedAgent], draws: Draws) -> tuple[EAgent, ...]:
    """Return the e-agents with all that is random about them drawn; the planned ones themselves where nothing is."""
    return tuple([_completed(network, plan.agent, draws) for plan in planned])


def _completed(network: RoadNetwork, agent: EAgent, draws: Draws) -> EAgent:
    if not drawn_cycle(agent):
        return agent
    cycle = {"cycle": draw_cycle(network, draws)}
    nudged = agent.driver is not agent
    given = {"parameters": {**agent.parameters["parameters"], **cycle}} if nudged else cycle
    return replace(agent, parameters={**agent.parameters, **given})


def agent_wishes(
    network: RoadNetwork,
    planned: Sequence[PlannedAgent],
    agents: Sequence[EAgent],
    car: Car,
    obstacles: Sequence[Obstacle],
) -> list[Wish]:
    """Return where each e-agent is to start: as planned, otherwise drawn; one of kind `loop` on its cycle.

    An e-agent that keeps the rules starts on a lane without obstacles in the way, if there is one: in front of an
    obstacle that it can't pass it might never be able to keep them.
    """
    wishes: list[Wish] = []
    clear = _clear_lanes(network, car, obstacles)
    for plan, given in zip(planned, agents, strict=True):
        agent = given.driver
        lanes = None
        if loops(agent.kind, agent.parameters):
            try:
                lanes = cycle_lanes(network, agent.parameters["cycle"])
            except InputError as error:
                raise error.within(field=f"{plan.field}.parameters") from None
        if agent.kind in KEEP_RULES and clear is not None:
            lanes = clear if lanes is None else [lane for lane in lanes if lane in clear] or lanes
        wishes.append(Wish(plan.start, lanes, f"{plan.field}.start"))
    return wishes


def _clear_lanes(network: RoadNetwork, car: Car, obstacles: Sequence[Obstacle]) -> list[int] | None:
    """Return the lanes in whose middle a car meets no obstacle; None if that is all of them or none."""
    if not obstacles:
        return None
    shapes = [obstacle_shape(obstacle) for obstacle in obstacles]
    beside = 0.5 * car.body.width + BESIDE
    swept = [Shape(network.lane_line(lane, -car.w), beside) for lane in range(network.lanes)]
    clear = [lane for lane, way in enumerate(swept) if not any(overlap(way, shape) for shape in shapes)]
    return clear if 0 < len(clear) < network.lanes else None


def draw_cycle(network: RoadNetwork, draws: Draws) -> list[list[float]]:
    """Return the lattice points of a random cycle along lanes; it turns round at dead ends only.

    A random walk along lanes is cut where it comes back to an intersection from which it may go on as it did.
    """
    walk = [draws.below(network.lanes)]
    while True:
        following = network.successors(walk[-1])
        start = network.lane_ends(walk[-1])[1]
        for k, lane in enumerate(walk):
            if network.lane_ends(lane)[0] == start and lane in following:
                return [list(network.intersections[network.lane_ends(lane)[0]]) for lane in walk[k:]]
        walk.append(following[draws.below(len(following))])


def cycle_lanes(network: RoadNetwork, points: Sequence[Sequence[float]]) -> tuple[int, ...]:
    """Return the lanes of a cycle of lattice points, the last joined to the first (which may stand again at the end).

    Raises
    ------
    InputError
        If a point is no intersection or two that follow one another are not joined by a segment.
    """
    if len(points) > 1 and list(points[0]) == list(points[-1]):
        points = points[:-1]
    lanes: list[int] = []
    for k, point in enumerate(points):
        following = points[(k + 1) % len(points)]
        try:
            start = network.vertex((point[0], point[1]))
            end = network.vertex((following[0], following[1]))
        except InputError as error:
            raise error.within(field=f"cycle[{k}]") from None
        lane = next((lane for lane in network.arms(start) if network.lane_ends(lane)[1] == end), None)
        if lane is None:
            expected = "points that follow one another along segments, the last joined to the first"
            raise InputError("no segment to the next point", field=f"cycle[{k}]", value=point, expected=expected)
        lanes.append(lane)
    return tuple(lanes)
