"""The tables of the law of the road (`policies.rules.policy`): the drivers of a batch, and scratch."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any, Final, NamedTuple

import numpy as np
import numpy.typing as npt

from dubins_traffic.cars.state import Labels, State
from dubins_traffic.cars.tables import ObstacleTable, pack_cars
from dubins_traffic.kernels.arrays import Floats, Ints, distinct
from dubins_traffic.kernels.records import Rows, record, table
from dubins_traffic.kernels.tables import Tables
from dubins_traffic.policies.rules.abilities import DAWDLE, least_speed, near_of, sight_of, through_speed
from dubins_traffic.policies.rules.kept import KeptCommands, KeptPath
from dubins_traffic.roads.table import RoadTable
from dubins_traffic.rules.judged import distinct_problems
from dubins_traffic.rules.parameters import RuleParameters

if TYPE_CHECKING:
    from dubins_traffic.problem.instance import Problem


class _Kind(NamedTuple):
    """How a car chooses its exits, values of `Driver.kind`."""

    ABSENT: int = 0
    """The rules do not drive it."""
    ROUND: int = 1
    """By the shortest round of its goals."""
    WANDER: int = 2
    """By chance."""
    LOOP: int = 3
    """Along lanes that are given, again and again."""
    PLACES: int = 4
    """To goals drawn by chance."""
    NEMESIS: int = 5
    """To where the ego goes."""


KIND: Final = _Kind()
GOES = {"wander": KIND.WANDER, "loop": KIND.LOOP, "places": KIND.PLACES}


class _Violation(NamedTuple):
    """Which rules a car breaks at present, bits of `Driver.violations`."""

    ROLLING: int = 1
    """It does not stop before a crossing."""
    LEFT_SIDE: int = 2
    """It drives on the left."""
    TAILGATING: int = 4
    """It follows close."""


VIOLATION: Final = _Violation()


class _Company(NamedTuple):
    """What is known of the cars around a car."""

    ALONE: int = 0
    """That they make no difference to it."""
    UNSURE: int = 1
    """Nothing, but it can be found by looking at all of them."""
    CROWDED: int = 2
    """Nothing."""
    UNROLLED: int = 3
    """Nothing, and they stand as its road is unrolled."""


COMPANY: Final = _Company()


@record
class Driver:
    """A car that the law drives: its parameters and its memory."""

    kind: int
    """How the car chooses its way: `KIND`."""
    first: int
    """Its first row of `Drivers.stage`: the lanes of a loop, or the goals' vertices."""
    last: int
    """The row after its last."""
    goal_first: int
    """The first row of `Drivers.stage` that is one of the goals of its trial, if the car minds them."""
    goal_last: int
    """The row after the last."""
    speed: float
    """How fast the car drives, m/s."""
    rolls: float
    """On which share of its lanes it does not stop before a crossing."""
    lefts: float
    """On which share it drives on the left."""
    blocks: float
    """On which share it stands in the disc ahead."""
    tailgates: float
    """On which share it drives too close."""
    parks: float
    """At which share of the goals it parks."""
    park_time: float
    """For how long it parks at most, seconds."""
    departs: float
    """For how long from the beginning it parks, seconds."""
    whims: int
    """1 if it does as it likes, as far as the law allows (kind `free`), so that others can't rely on its driving on."""
    place: int = -1
    """The row of `Drivers.stage` it is at, -1: none."""
    goal: int = -1
    """The vertex it drives to."""
    lane: int = -1
    """The lane driven, -1 before the first."""
    next_lane: int = -1
    """The lane to take at its end."""
    turn: int
    """Ticks for which it has been its turn to enter the crossing ahead."""
    owed: int
    """The same, over all of this wait."""
    waited: int
    """Ticks for which something has been in its way."""
    violations: int
    """Which rules it breaks on this lane: bits of `VIOLATION`."""
    watched: int
    """Ticks for which what it may pass has not moved."""
    kept_out: int
    """Ticks for which it has stood before a bend or dead end that it may not enter."""
    within: int
    """Ticks for which its body has met the crossing at the end of its lane."""
    aside: float
    """How far left of its way it passes what stands, metres, 0 if it passes nothing."""
    until: float
    """Metres before the end of the lane (negative) at which it returns."""
    hold: float
    """For how long it will still stand in the disc ahead, seconds."""
    watch_x: float
    """Where that stands which it may pass, metres."""
    watch_y: float
    """Where that stands which it may pass, metres."""
    choice: int
    """Its first row of `Drivers.choice`."""
    choices: int
    """For how many of its first legs something is chosen (`policies.rules.chosen`)."""
    leg: int = -1
    """The leg it is on, where something is chosen."""
    usual_speed: float
    """How fast it drives where nothing else is chosen, m/s."""
    pause: float
    """For how long it will still pause in its lane, seconds."""
    pause_at: float
    """After which share of the lane."""
    line_hold: float
    """For how long it holds at the line when it is its turn, seconds."""
    keeps: float
    """The gap it keeps behind what is ahead in its lane, metres, 0: the law's."""


@record
class Vehicle:
    """What the cars of a trial can do, and what the rules ask of them there."""

    reach: float
    """The body's farthest point, metres."""
    half_length: float
    """Of the body, a rounded box, metres."""
    half_width: float
    """Of the body, metres."""
    rounding: float
    """Of the body, metres."""
    middle: float
    """How far right of the centre line lanes are driven, metres."""
    disc: float
    """R, metres."""
    yaw_most: float
    """Largest yaw rate, rad/s."""
    tightest: float
    """Least turning radius, metres."""
    period: float
    """Seconds of a tick."""
    degree: float
    """Least degree of a crossing."""
    fastest: float
    """Largest speed, m/s."""
    slowest: float
    """Smallest speed, m/s."""
    near: float
    """The gap up to which others are looked at for whether a motion might bring about a contact, metres."""
    late: float
    """Ticks by which commands take effect late."""
    unsure: float
    """How far any point of the car may be from where its driver expects it, metres."""
    blur: float
    """How far any point of another may be from where it is seen, metres."""
    sight: float
    """What is farther away than this does not matter to a car's next tick, metres."""
    forfeit: float
    """Seconds after which who does not enter on its turn loses its place."""
    through_speed: float
    """Least speed in a disc, m/s."""
    over: float
    """How far left of the centre line a body may reach, metres."""
    behind: float
    """How far behind what stands makes a car overtake, metres."""
    fore: float
    """How far ahead, metres."""
    needed: float
    """What must be free of the right lane, metres."""
    left_time: float
    """For how long a car may be left, seconds."""
    stand_time: float
    """After how long a car that does not move stands, seconds."""
    backs_up: float
    """How far anybody may back up, metres."""
    exit_room: float
    """How far from the disc who stands in a lane leaves it free (E4), metres."""
    rest_time: float
    """For how long an e-agent may stand with a free way (E5), seconds."""
    approaches: float
    """How near to a crossing a car takes its place in the order, metres."""
    goal_time: float
    """Within how many seconds every goal has to be free once (E6)."""
    dawdle: float
    """Speed at which a nemesis drives in front of the ego, m/s."""


@record
class Leg:
    """What is chosen for a leg of a car: a lane and the disc at its end (`policies.rules.chosen`); NaN is nothing."""

    exit: float
    """The exit at its end, counted counter-clockwise from the way back, which is 0; only crossings have a choice."""
    speed: float
    """How fast the car drives outside discs, m/s."""
    pause: float
    """For how long it pauses in its lane, before it comes near to the crossing, seconds."""
    pause_at: float
    """After which share of the lane it does; 0.5 if not a number."""
    hold: float
    """For how long of its own turn it holds at the line of the crossing, seconds."""
    dwell: float
    """For how long it stands in the disc, seconds."""
    gap: float
    """What it keeps behind what is ahead in its lane, metres."""


class Drivers(Tables):
    """The cars of a batch that the law drives.

    `active` (B,): whether there is one in the trial; `net` (B,): number of the road network; `seed` (B,) uint64 and
    `trial` (B,): of the random numbers; `vehicle` (B,), `car` (B, N), `way` (B, N) and `command` (B, ceil(N / BLOCK));
    `stage` (M,): lanes of loops, and goals; `distance` (M, L): for a goal, metres from the beginning of each lane to
    the end of the lane by which the goal is reached; (0, 0) where nobody drives a round; `choice` (C,): what is chosen
    for the legs of cars, one car's after another's (`policies.rules.chosen`).
    """

    active: Ints
    net: Ints
    seed: npt.NDArray[np.uint64]
    trial: Ints
    vehicle: Rows[Vehicle]
    car: Rows[Driver]
    way: Rows[KeptPath]
    command: Rows[KeptCommands]
    stage: Ints
    distance: Floats
    choice: Rows[Leg]


class Scratch(Tables):
    """Scratch: the cars of each segment as lists, those near a car, hops to the targets, costs of the exits, and the
    lanes that the ego will probably take; `apart` (N,): for who does not know how far cars are apart, 0; `listed` (1,):
    who is in the lists; `real` (4, N), `real_part` (4, P): where cars and obstacles are while a road is unrolled;
    `tight` (1,): half a lane in units of its least radius, else 0.
    """

    head: Ints
    link: Ints
    near: Ints
    hops: Ints
    queue: Ints
    cost: Floats
    chain: Ints
    apart: Floats
    listed: Ints
    real: Floats
    real_part: Floats
    tight: Floats


class Traffic(Tables):
    """All tables by which the law drives cars of a batch, and its scratch."""

    state: State
    labels: Labels
    roads: RoadTable
    obstacles: ObstacleTable
    drivers: Drivers
    scratch: Scratch


def scratch(cars: int, segments: int, obstacles: ObstacleTable) -> Scratch:
    """Return scratch for trials of up to `cars` cars on up to `segments` segments, with these obstacles."""
    parts = int(np.diff(obstacles.off).max(initial=0))
    return Scratch(
        head=np.full(segments, -1, dtype=np.int64), link=np.zeros(cars, dtype=np.int64),
        near=np.zeros(8 * cars, dtype=np.int64), hops=np.zeros(2 * segments, dtype=np.int64),
        queue=np.zeros(2 * segments, dtype=np.int64), cost=np.zeros(4), chain=np.zeros(4, dtype=np.int64),
        apart=np.zeros(cars), listed=np.zeros(1, dtype=np.int64),
        real=np.zeros((4, cars)), real_part=np.zeros((4, parts)), tight=np.zeros(1),
    )  # fmt: skip


def vehicles_of(problems: Sequence[Problem], disturbed: Sequence[bool] = ()) -> Rows[Vehicle]:
    """Return `Drivers.vehicle`; those that are `disturbed` reckon with late commands and noisy poses."""
    kinds, index = distinct_problems(problems)
    made: Any = _vehicles_of(kinds)
    rows = made[index]
    first, alike = distinct([(number, id(problem.network)) for number, problem in zip(index, problems, strict=True)])
    least = np.array([least_speed(problems[k]) for k in first])
    rows["dawdle"] = np.maximum(DAWDLE, least)[alike]
    for k in np.flatnonzero(disturbed).tolist():
        row, problem = rows[k], problems[k]
        row.late, row.unsure, row.blur = problem.command_delay, problem.unsure, problem.blur
        row.over -= row.unsure
        row.near = near_of(problem.car, problem.period * (1.0 + row.late)) + 2.0 * row.unsure
    return rows


def _vehicles_of(problems: Sequence[Problem]) -> Rows[Vehicle]:
    cars = pack_cars([problem.car for problem in problems])
    rows = table(Vehicle, len(problems))
    for name in ("reach", "half_length", "half_width", "rounding"):
        rows[name] = getattr(cars, name)
    rows["middle"] = cars.w
    rows["yaw_most"] = cars.yaw_rate
    rows["tightest"] = cars.turning_radius
    rows["fastest"] = cars.speed_high
    rows["slowest"] = cars.speed_low
    widths = (2.0 * (cars.half_width + cars.rounding)).tolist()
    for k, (problem, width) in enumerate(zip(problems, widths, strict=True)):
        row, rules = rows[k], RuleParameters.from_mapping(problem.rules)
        row.disc = problem.intersection_radius
        row.period = problem.period
        row.degree = rules.crossing_degree
        row.near = near_of(problem.car, problem.period)
        row.sight = sight_of(problem.car.w)
        row.forfeit = rules.forfeit_time
        row.through_speed = through_speed(problem)
        row.over = rules.left_set
        row.behind = rules.overtaking_behind
        row.fore = rules.overtaking_ahead
        row.needed = rules.width_needed(width, problem.car.point_speed * problem.period)
        row.left_time = rules.left_time
        row.stand_time = rules.stand_time
        row.backs_up = rules.turn_back
        row.exit_room = rules.room_beyond(row.reach, 3)
        row.rest_time = rules.rest_time
        row.approaches = rules.approach_distance
        row.goal_time = rules.goal_time
    return rows
