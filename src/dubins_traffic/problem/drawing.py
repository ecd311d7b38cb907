"""Draws the parts of an instance; each part has a stream of random numbers of its own."""

from __future__ import annotations

from collections.abc import Sequence
from enum import IntEnum

from dubins_traffic.cars.body import Car, Obstacle
from dubins_traffic.cars.state import Pose
from dubins_traffic.errors import InputError
from dubins_traffic.kernels.philox import Draws
from dubins_traffic.problem.configuration import PlannedAgent
from dubins_traffic.problem.cycles import cycle_lanes, draw_cycle
from dubins_traffic.problem.instance import EAgent
from dubins_traffic.problem.kinds import KEEP_RULES, loops
from dubins_traffic.problem.overlap import Shape, obstacle_shape, overlap
from dubins_traffic.problem.starts import Wish
from dubins_traffic.roads.network import RoadNetwork

BESIDE = 0.02
"""Gap that a car needs beside it to pass an obstacle within its lane, metres."""
MOST_STEPS = 10_000
"""Intersections that are tried as goals that are far apart, before they count as not found."""


class Stream(IntEnum):
    """Streams of random numbers, one for each purpose: drawing from one never shifts another."""

    NETWORK = 1
    GOALS = 2
    DURATION = 3
    STARTS = 4
    CYCLES = 5


def draw_goals(
    network: RoadNetwork, bounds: tuple[int, int], draws: Draws, apart: int = 1
) -> tuple[tuple[float, float], ...]:
    """Return goals, their number drawn from `bounds` (both included); they differ as far as intersections suffice.

    With `apart` of 2 or more every two goals are at least so many segments apart along the roads: each is drawn evenly
    among the intersections that are far enough from those before it, and others are tried where that leads nowhere.

    Raises
    ------
    InputError
        If no such goals are found.
    """
    count = draws.between(*bounds)
    places = len(network.intersections)
    if apart > 1:
        picks = _far_apart(network, count, apart, draws.shuffled(places))
    else:
        picks = draws.sample(min(count, places), places)
        picks += [draws.below(places) for _ in range(count - places)]
    return tuple(network.intersections[v] for v in picks)


def _far_apart(network: RoadNetwork, count: int, apart: int, order: Sequence[int]) -> list[int]:
    """Return `count` vertices, the first ones possible in `order`, every two of which are `apart` segments apart."""
    places: list[int] = []
    near = [0] * len(order)
    place = steps = 0
    while len(places) < count:
        place = next((k for k in range(place, len(order)) if not near[order[k]]), len(order))
        steps += 1
        if steps > MOST_STEPS or (place == len(order) and not places):
            raise InputError(
                f"{count} goals so far apart are not found on a road network of {len(order)} intersections",
                field="goal_segments_apart",
                value=apart,
                expected="a smaller number, or fewer goals (number_goals_bounds)",
            )
        change = -1 if place == len(order) else 1
        chosen = places.pop() if change < 0 else place
        for v in _within(network, order[chosen], apart - 1):
            near[v] += change
        if change > 0:
            places.append(chosen)
        place = chosen + 1
    return [order[k] for k in places]


def _within(network: RoadNetwork, start: int, most: int) -> set[int]:
    """Return the vertices at most `most` segments from `start` along the roads, itself included."""
    found = latest = {start}
    for _ in range(most):
        latest = {network.lane_ends(lane)[1] for v in latest for lane in network.arms(v)} - found
        if not latest:
            break
        found = found | latest
    return found


def draw_duration(bounds: tuple[int, int], draws: Draws) -> float:
    """Return a duration of whole seconds, uniform over `bounds`, both included."""
    return float(draws.between(*bounds))


def origin_start(network: RoadNetwork, w: float) -> Pose | None:
    """Return the ego's start of 2016, the world's origin with heading 0, or None if that is off the road."""
    on_road = bool(network.on_road([0.0, 0.0], 2.0 * w))
    return Pose(0.0, 0.0, 1.0, 0.0) if on_road else None


def drawn_cycle(agent: EAgent) -> bool:
    """Tell whether the cycle of a planned e-agent is drawn."""
    own = agent.driver
    return loops(own.kind, own.parameters) and own.parameters["cycle"] is None


def complete_agents(
    network: RoadNetwork, planned: Sequence[PlannedAgent], draws: Draws
) -> tuple[EAgent, ...]:
    """Return the e-agents with all that is random about them drawn."""
    agents: list[EAgent] = []
    for agent in (plan.agent for plan in planned):
        parameters = dict(agent.parameters)
        if drawn_cycle(agent):
            cycle = {"cycle": draw_cycle(network, draws)}
            nudged = agent.driver is not agent
            parameters |= {"parameters": {**parameters["parameters"], **cycle}} if nudged else cycle
        agents.append(EAgent(agent.kind, agent.name, agent.type, parameters))
    return tuple(agents)


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
