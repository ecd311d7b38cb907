"""What the law of the road (`policies.rules.policy`) reads and writes: the drivers of a batch, and room to work in."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

from dubins_traffic.cars.tables import pack_cars
from dubins_traffic.kernels.arrays import BLOCK, Floats, Ints
from dubins_traffic.kernels.tables import Tables
from dubins_traffic.rules.judged import kinds_of
from dubins_traffic.rules.parameters import RuleParameters

if TYPE_CHECKING:
    from dubins_traffic.problem.instance import Problem

ABSENT, ROUND, WANDER, LOOP, PLACES, NEMESIS = range(6)
GOES = {"wander": WANDER, "loop": LOOP, "places": PLACES}

KIND, FIRST, LAST, PLACE, GOAL, LANE, NEXT, TURN, OWED, WAITED, VIOLATIONS, WATCHED, KEPT_OUT = range(13)
INTS = 13
"""Columns of `Drivers.ints`.

KIND: how the car chooses its way, ABSENT where the law does not drive. FIRST, LAST: its rows of `stage` are FIRST to
LAST - 1: the lanes of a loop, or the goals' vertices. It remembers PLACE: the row of `stage` it is at, -1: none; GOAL:
the vertex it drives to; LANE: the lane driven, -1 before the first; NEXT: the lane to take at its end; TURN: ticks for
which it has been its turn to enter the crossing ahead; OWED: the same, over all of this wait; WAITED: ticks for which
something has been in its way; VIOLATIONS: which rules it breaks on this lane; WATCHED: ticks for which what it may
pass has not moved; KEPT_OUT: ticks for which it has stood before a bend or dead end that it may not enter.
"""

SPEED, ROLLS, LEFTS, BLOCKS, TAILGATES, PARKS, PARK_TIME, ASIDE, UNTIL, HOLD, WATCH_X, WATCH_Y, DEPARTS = (
    range(13)
)
FLOATS = 13
"""Columns of `Drivers.floats`.

SPEED: how fast the car drives, m/s. ROLLS, LEFTS, BLOCKS, TAILGATES, PARKS: on which share of its lanes it breaks a
rule. PARK_TIME: for how long it parks at most, s. It remembers ASIDE: how far left of its way it passes what stands,
metres, 0 if it passes nothing; UNTIL: metres before the end of the lane (negative) at which it returns; HOLD: for how
long it will still stand in the disc ahead, s; WATCH_X, WATCH_Y: where that stands which it may pass.
DEPARTS: seconds from the beginning for which it parks.
"""

REACH, HALF_LENGTH, HALF_WIDTH, ROUNDING, MIDDLE, DISC, YAW_MOST, TIGHTEST, PERIOD = range(9)
DEGREE, FASTEST, SLOWEST, FORFEIT, THROUGH_SPEED, OVER, BEHIND, FORE, NEEDED, LEFT_TIME = range(9, 19)
STAND_TIME, BACKS_UP, EXIT_GAP, REST_TIME, APPROACHES = range(19, 24)
VEHICLE = 24
"""Columns of `Drivers.build`: the body's farthest point, its rounded box, how far right of the centre line lanes are
driven, R, metres; largest yaw rate, rad/s; least turning radius, metres; seconds of a tick; least degree of a
crossing; the car's largest and smallest speed, m/s; seconds after which who does not enter on its turn loses its
place; least speed in a disc, m/s; how far left of the centre line a body may reach, how far behind and ahead what
stands makes a car overtake, and what must be free of the right lane, metres; for how long it may be left, and after
how long a car that does not move stands, s; how far anybody may back up, and how far from the disc who stands in a lane
leaves it free (E4), metres; for how long an e-agent may stand with a free way (E5), s;
how near to a crossing a car takes its place in the order, metres.
"""

IN, OUT, CROSSING, LENGTH = range(4)
WAY = 4
COAST_LOW, COAST_HIGH, COAST_PAST, COAST_SPEED, COAST_BEND, COAST_LANE, COAST_CROSSES, OUT_LENGTH = range(
    16, 24
)
WAYS = 24
"""Columns of `Drivers.way`: the two lanes whose way the row holds (-1: none yet), whether there is a crossing between
them, metres of the first, and from WAY on the fields of the `policies.rules.turn_arcs.ReferencePath`. Of a car that
just drives on (`policies.rules.command_cache`): the stretch on which it goes on so, metres along the first lane from
the arc's centre (from LOW to HIGH) and along the second (to PAST), its speed, m/s, the curvature of its line, 1/m,
the lane of its lane state and the disc that its body meets. OUT_LENGTH: metres of the second lane.
"""

LONGEST_WAY = 2.21
"""Length of the longest way through a disc, in units of R + rho."""
PROMPT = 0.8

ROLLING, LEFT_SIDE, TAILGATING = 1, 2, 4
"""Bits of VIOLATIONS."""


ALONE, UNSURE, CROWDED = range(3)
"""What is known of the cars around one: that they make no difference to it; nothing, but it can be found by looking at
all of them; nothing.
"""

DUE, LATE_SPEED, LATE_LEFT, LATE_X, LATE_Y, LATE_BEND, LATE_C, LATE_S, LATE_YAW = range(9)
LATE = 9
"""`Scratch.late`: blocks of BLOCK cars, each LATE columns of BLOCK numbers.

DUE: 1 if a command has been put off. Allowed speed, m/s; metres left of the line to follow; its direction (X, Y); its
curvature, 1/m; the heading (C, S); and the yaw rate that is found, rad/s, as the speed is then found in LATE_SPEED.
"""


class Drivers(Tables):
    """The cars of a batch that the law drives.

    `active` (B,): whether there is one in the trial; `net` (B,): number of the road network; `seed` (B,) uint64 and
    `trial` (B,): of the random numbers; `build` (B, VEHICLE), `ints` (B, N, INTS), `floats` (B, N, FLOATS) and `way`
    (B, N, WAYS): columns as above; `stage` (M,): lanes of loops, and goals; `distance` (M, L): for a goal, metres from
    the beginning of each lane to the end of the lane by which the goal is reached; (0, 0) where nobody drives a round.
    """

    active: Ints
    net: Ints
    seed: npt.NDArray[np.uint64]
    trial: Ints
    build: Floats
    ints: Ints
    floats: Floats
    way: Floats
    stage: Ints
    distance: Floats


class Scratch(Tables):
    """Scratch: the cars of each segment as lists, those near a car, hops to the targets, costs of the exits, and the
    lanes that the ego will probably take; `late`: commands put off; `apart` (N,): for
    who does not know how far cars are apart, 0; `listed` (1,): who is in the lists.
    """

    head: Ints
    link: Ints
    near: Ints
    hops: Ints
    queue: Ints
    cost: Floats
    chain: Ints
    late: Floats
    apart: Floats
    listed: Ints


def blank(cars: int) -> tuple[Ints, Floats]:
    """Return the rows (cars, INTS) and (cars, FLOATS) of cars that the law does not drive."""
    ints = np.zeros((cars, INTS), dtype=np.int64)
    ints[:, (PLACE, GOAL, LANE, NEXT)] = -1
    return ints, np.zeros((cars, FLOATS))


def no_ways(trials: int, cars: int) -> Floats:
    """Return `Drivers.way` before the first tick."""
    return np.full((trials, cars, WAYS), -1.0)


def scratch(cars: int, segments: int) -> Scratch:
    """Return scratch for trials of up to `cars` cars on up to `segments` segments."""
    return Scratch(
        head=np.full(segments, -1, dtype=np.int64),
        link=np.zeros(cars, dtype=np.int64),
        near=np.zeros(8 * cars, dtype=np.int64),
        hops=np.zeros(2 * segments, dtype=np.int64),
        queue=np.zeros(2 * segments, dtype=np.int64),
        cost=np.zeros(4),
        chain=np.zeros(4, dtype=np.int64),
        late=np.zeros((cars + BLOCK - 1) // BLOCK * BLOCK * LATE),
        apart=np.zeros(cars),
        listed=np.zeros(1, dtype=np.int64),
    )


def through_speed(problem: Problem) -> float:
    """Return the speed at which the longest way through a disc takes PROMPT of the time that E4 allows, m/s."""
    longest = LONGEST_WAY * (problem.intersection_radius + problem.car.body.reach)
    allowed = RuleParameters.from_mapping(problem.rules).exit_time
    return longest / (PROMPT * allowed) if allowed > 0.0 else problem.car.bounds.speed


def build_of(problems: Sequence[Problem]) -> Floats:
    """Return `Drivers.build`."""
    kinds, index = kinds_of(problems)
    return _build_of(kinds)[index]


def _build_of(problems: Sequence[Problem]) -> Floats:
    cars = pack_cars([problem.car for problem in problems])
    rules = [RuleParameters.from_mapping(problem.rules) for problem in problems]
    columns = (
        cars.reach,
        cars.half_length,
        cars.half_width,
        cars.rounding,
        cars.w,
        np.array([problem.intersection_radius for problem in problems]),
        cars.yaw_rate,
        cars.turning_radius,
        np.array([problem.period for problem in problems]),
        np.array([own.crossing_degree for own in rules]),
        cars.speed_high,
        cars.speed_low,
        np.array([own.forfeit_time for own in rules]),
        np.array([through_speed(problem) for problem in problems]),
        np.array([own.left_set for own in rules]),
        np.array([own.overtaking_behind for own in rules]),
        np.array([own.overtaking_ahead for own in rules]),
        np.array([own.blocked_gap for own in rules]) + 2.0 * (cars.half_width + cars.rounding),
        np.array([own.left_time for own in rules]),
        np.array([own.stand_time for own in rules]),
        np.array([own.turn_back for own in rules]),
        np.array([own.exit_gap for own in rules]),
        np.array([own.rest_time for own in rules]),
        np.array([own.approach_distance for own in rules]),
    )
    return np.stack([column.astype(np.float64) for column in columns], axis=1)
