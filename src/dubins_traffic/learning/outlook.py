"""The tables from which flat observations are made: each trial's scales, its goals, and distances to them."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import TYPE_CHECKING, Final, NamedTuple, cast

import numpy as np

from dubins_traffic.cars.sensing import Ray, Surroundings, rays_at
from dubins_traffic.cars.state import Labels, State
from dubins_traffic.cars.tables import CarTable, ObstacleTable
from dubins_traffic.kernels.arrays import Floats, Ints
from dubins_traffic.kernels.records import Rows, record, table
from dubins_traffic.kernels.tables import Tables
from dubins_traffic.learning.clocks import Clock, clocks
from dubins_traffic.roads.network import RoadNetwork
from dubins_traffic.roads.table import RoadTable
from dubins_traffic.routing.tours import lane_graph

if TYPE_CHECKING:
    from dubins_traffic.problem.instance import Problem


class _Size(NamedTuple):
    """How many numbers there are in each part of a flat observation."""

    FLAGS: int = 18
    """Flags of a car's propositions, lowest bit first."""
    OWN: int = 20
    """The car itself, with its flags."""
    LANE: int = 6
    CROSSING: int = 6
    """The next one."""
    GOAL: int = 8
    CLOCKS: int = 4
    OBSTACLE: int = 4
    """Each part of an obstacle."""
    OBSTACLES: int = 3
    """How many of these are shown."""
    CAR: int = 27
    """Each other car, with its flags."""


SIZE: Final = _Size()


@record
class Outlook:
    """The scales of the flat observations of one trial, and the goal that its ego seeks."""

    net: int
    """The trial's road network."""
    first_goal: int
    """Its first row of `OutlookTables.goal`."""
    last_goal: int
    """The row after its last."""
    target: int = -1
    """The row of the goal that the ego seeks, -1 without goals."""
    last_at: int = -1
    """The intersection whose disc has held the ego's centre last, -1: none."""
    visits: int
    """Visits of goals so far."""
    rounds: int
    """Rounds through all goals so far."""
    goals: int
    """Goals visited in the present round."""
    swept: int = -1
    """Number of the laser's last sweep, -1 before the first."""
    radius: float
    """Of the intersections' discs, metres."""
    sight: float
    """The sensing radius, metres."""
    sight2: float
    """Its square, or more where all that is listed is seen."""
    half_width: float
    """Of the roads, 2w, metres."""
    speed: float
    """The car's top speed, m/s."""
    yaw_rate: float
    """Its top yaw rate, rad/s."""


@record
class SoughtGoal:
    """A goal of a trial."""

    vertex: int
    """Its intersection."""
    inside: int
    """1 if the ego's centre has been in its disc last, of all discs."""
    fresh: int = 1
    """1 if coming into its disc is a visit: there was none yet, or the ego has been in another disc since."""
    route: int
    """The row of `OutlookTables.metres` with the way to it."""


@record
class Sweeps:
    """The laser of a batch; `rate` is 0 without one."""

    rate: float
    """Sweeps a second."""
    control: float = 1.0
    """Ticks a second."""
    shortest: float
    """Metres."""
    longest: float
    """Metres."""


class OutlookTables(Tables):
    """All tables from which the flat observations of a batch are made.

    Attributes
    ----------
    state, labels : State, Labels
        The present frame, (B, N).
    roads : RoadTable
        The roads of the batch.
    trial : (B,) Outlook
        Scales of each trial, and the goal that its ego seeks.
    clock : (B,) Clock
        For how long its ego has stood, waited, been first, been left.
    goal : (G,) SoughtGoal
        The goals of one trial after another, each once.
    done : (G,)
        1 for the goals that have been visited in the present round.
    metres : (M, L)
        Distance from the start of each lane to a goal, for each distinct pair of network and goal; inf for no way.
    near : (K,)
        Scratch: the cars that are shown, then the obstacles, nearest first.
    apart : (K,)
        Scratch: their squared distances, square metres.
    laser : (1,) Sweeps
        The laser.
    rays : (R,) Ray
        Directions of its rays.
    ranges : (B, R)
        The last scan of each ego, metres.
    around : Surroundings
        The bodies that rays may meet.
    """

    state: State
    labels: Labels
    roads: RoadTable
    trial: Rows[Outlook]
    clock: Rows[Clock]
    goal: Rows[SoughtGoal]
    done: Ints
    metres: Floats
    near: Ints
    apart: Floats
    laser: Rows[Sweeps]
    rays: Rows[Ray]
    ranges: Floats
    around: Surroundings


def new_outlook(
    problems: Sequence[Problem],
    nets: Ints,
    roads: RoadTable,
    around: tuple[State, Labels, CarTable, ObstacleTable],
    shown: int,
) -> OutlookTables:
    """Return the tables of a batch before its first frame.

    Parameters
    ----------
    problems
        One for each trial; all with the same laser, or all without.
    nets, roads
        The number of each trial's network in the table of the roads.
    around
        State and labels, and the cars and obstacles of the batch.
    shown
        Number of other cars that are shown.
    """
    state, labels, cars, obstacles = around
    trial = table(Outlook, len(problems))
    trial["net"] = nets
    trial["radius"] = [problem.intersection_radius for problem in problems]
    trial["sight"] = [problem.sensing_radius for problem in problems]
    trial["sight2"] = [problem.sensing_radius * problem.sensing_radius for problem in problems]
    trial["half_width"] = [problem.car.lane_width for problem in problems]
    trial["speed"] = [problem.car.bounds.speed for problem in problems]
    trial["yaw_rate"] = [problem.car.bounds.yaw_rate for problem in problems]
    goal, metres = _goals(problems, trial)
    laser, rays = _laser(problems[0])
    return OutlookTables(
        state=state, labels=labels, roads=roads, trial=trial, clock=clocks(problems), goal=goal,
        done=np.zeros(len(goal), dtype=np.int64), metres=metres,
        near=np.zeros(max(SIZE.OBSTACLES, shown), dtype=np.int64), apart=np.zeros(max(SIZE.OBSTACLES, shown)),
        laser=laser, rays=rays, ranges=np.full((len(problems), len(rays)), np.inf),
        around=Surroundings(state, cars, obstacles),
    )  # fmt: skip


def _goals(problems: Sequence[Problem], trial: Rows[Outlook]) -> tuple[Rows[SoughtGoal], Floats]:
    """Return the goals of the trials, and the distances to them; fill in which goals are whose in `trial`."""
    known: dict[int, tuple[RoadNetwork, dict[int, int]]] = {}
    rows: list[tuple[int, int]] = []
    begins = [0]
    count = 0
    for problem in problems:
        _, ways = known.setdefault(id(problem.network), (problem.network, {}))
        for vertex in dict.fromkeys(problem.goal_vertices):
            if vertex not in ways:
                ways[vertex] = count
                count += 1
            rows.append((vertex, ways[vertex]))
        begins.append(len(rows))
    trial["first_goal"], trial["last_goal"] = begins[:-1], begins[1:]
    goal = table(SoughtGoal, len(rows))
    goal["vertex"], goal["route"] = [vertex for vertex, _ in rows], [way for _, way in rows]
    metres = np.full((count, max(network.lanes for network, _ in known.values())), np.inf)
    for network, ways in known.values():
        metres[list(ways.values()), : network.lanes] = metres_to_vertices(network, ways)
    return goal, metres


def metres_to_vertices(network: RoadNetwork, vertices: Iterable[int]) -> list[Floats]:
    """Return, for each of `vertices`, the distance to it from the start of each lane along lanes, (L,); inf: no way."""
    known = cast("dict[int, Floats]", network.known.setdefault(Outlook, {}))
    wanted = list(vertices)
    missing = [vertex for vertex in wanted if vertex not in known]
    if missing:
        graph = lane_graph(network)
        length = np.array(graph.length)
        for vertex, way in zip(missing, graph.metres_into(missing), strict=True):
            known[vertex] = way + length
    return [known[vertex] for vertex in wanted]


def _laser(problem: Problem) -> tuple[Rows[Sweeps], Rows[Ray]]:
    sweeps, laser = table(Sweeps, 1), problem.laser
    if laser is None:
        return sweeps, table(Ray, 0)
    sweep = sweeps[0]
    sweep.rate, sweep.control = laser.rate, problem.rate
    sweep.shortest, sweep.longest = laser.range_min, laser.range_max
    return sweeps, rays_at(np.linspace(laser.angle_min, laser.angle_max, laser.rays))
