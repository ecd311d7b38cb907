"""What the kernels of the referee read and write: the terms of each trial, running clocks, and breaches found."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Final

import numpy as np

from dubins_traffic.cars.tables import CarTable
from dubins_traffic.kernels.arrays import Floats, Ints
from dubins_traffic.kernels.tables import Tables
from dubins_traffic.rules.tables import GRAIN, ticks

if TYPE_CHECKING:
    from dubins_traffic.rules.parameters import RuleParameters

COLLISION: Final = 0
ROAD: Final = 1
LEFT_UNBLOCKED: Final = 2
RETURN: Final = 3
STOP: Final = 4
ORDER: Final = 5
CLEARANCE: Final = 6
FAULT: Final = 7
ENTER: Final = 8
TICKETS: Final = 9
EXIT: Final = 10
REST: Final = 11
GOAL: Final = 12

RULES: Final[tuple[str, ...]] = (
    "1.collision", "1.road", "2.left", "2.return", "3.stop", "3.order", "3.clear",
    "E2", "E3.enter", "E3.tickets", "E4", "E5", "E6",
)  # fmt: skip
"""Names of the rules, by number. Rules 2 and 3 of an e-agent are E1."""

MOST: Final = 10
"""Most breaches that one car can begin in one frame."""

JUDGED: Final = 0
RETURN_TICKS: Final = 1
ENTER_TICKS: Final = 2
MOST_TICKETS: Final = 3
EXIT_TICKS: Final = 4
REST_TICKS: Final = 5
GOAL_TICKS: Final = 6
SHARED_TICKS: Final = 7
WHOLES: Final = 8

EXIT2: Final = 0
WAY: Final = 1
EXIT_GAP: Final = 2
LANE_MIDDLE: Final = 3
GOAL_GAP: Final = 4
LONE: Final = 5
REALS: Final = 6

OFF_ROAD: Final = 0
LEFT_SINCE: Final = 1
UNBLOCKED_SINCE: Final = 2
FIRST_SINCE: Final = 3
EXIT_SINCE: Final = 4
EXIT_PAUSED: Final = 5
REST_SINCE: Final = 6
AT_SINCE: Final = 7
IN_SINCE: Final = 8
CAME_BY: Final = 9
EXIT_COUNTS: Final = 10
CLOCKS: Final = 11

NEVER: Final = -2
"""In `OFF_ROAD`: the car has never been on the road."""

NEVER_DUE: Final = 1 << 62
"""A tick that never comes."""

BITS: Final = 0
LANE: Final = 1
CROSSES: Final = 2
AT: Final = 3
PAST: Final = 4

OF_TRIAL: Final = 0
OF_RULE: Final = 1
OF_CAR: Final = 2
AT_TICK: Final = 3
SINCE_TICK: Final = 4
AT_VERTEX: Final = 5
ON_LANE: Final = 6
COLUMNS: Final = 7


class RefereeParameters(Tables):
    """The terms by which each trial is judged.

    Attributes
    ----------
    real : (B, REALS) float64
        Squared distance of a centre from a vertex up to which it is in the way of those who leave (`EXIT2`); distance
        of others from a vertex from which on none of them meets the disc or is in anybody's way out of it (`LONE`);
        E5's way ahead (`WAY`); E4's free length of an exit (`EXIT_GAP`); E6's distance of the ego from an exit
        (`GOAL_GAP`); distance of the right lane's middle from the centre line (`LANE_MIDDLE`). Metres, eased by GRAIN
        for the car that would be in breach.
    whole : (B, WHOLES) int64
        Whether the trial is judged at all, and the durations of the rules in ticks; E3's most new tickets.
    goal_off : (B + 1,) int64
        Goals of trial b are goal[goal_off[b]] to goal[goal_off[b + 1] - 1].
    goal : (G,) int64
        Vertices, each goal of a trial once.
    """

    real: Floats
    whole: Ints
    goal_off: Ints
    goal: Ints


class BreachLog(Tables):
    """What the referee remembers, and what he has found.

    Attributes
    ----------
    past : (B, N, PAST) int64
        Flags, lane state, disc that the body meets and disc that holds the centre, of the frame before.
    due : (B, N) int64
        Tick in which each car has to be looked at though its labels stay as they are and nobody comes near.
    clock : (B, N, CLOCKS) int64
        First tick of the present run of: off the road (ego; `NEVER` before it has been on one), left, left and not
        overtaking, first at a clear crossing, in a disc with a free exit, lingering with a free way, where it
        is: at a vertex or none, in the disc that its body meets; -1 where there is no run. `EXIT_PAUSED`: how many
        ticks of a run in a disc with a free exit do not count; `EXIT_COUNTS`: the run's first tick while they do, else
        -1; `CAME_BY`: the lane by which it came into the disc
        that its body meets, -1 if it started there.
    goal_clock : (G,) int64
        First tick of the present run of a goal being taken; -1 while it is free.
    goal_paused : (G,) int64
        How many ticks of that run do not count.
    goal_due : (B,) int64
        Tick in which the goals have to be looked at though no car comes or goes.
    look : (N,) int64
        Scratch: the cars to be looked at.
    row : (K, COLUMNS) int64
        Breaches found: trial, number of the rule, car, tick, tick since which, vertex, lane.
    filled : (1,) int64
        How many rows are filled.
    """

    past: Ints
    due: Ints
    clock: Ints
    goal_clock: Ints
    goal_paused: Ints
    goal_due: Ints
    look: Ints
    row: Ints
    filled: Ints

    @staticmethod
    def empty(trials: int, cars: int, goals: int, frames: int = 1) -> BreachLog:
        """Return the breach_log of `trials` x `cars` cars before their first frame, with room for `frames` frames."""
        past = np.full((trials, cars, PAST), -1, dtype=np.int64)
        past[:, :, BITS] = 0
        clock = np.full((trials, cars, CLOCKS), -1, dtype=np.int64)
        clock[:, :, OFF_ROAD] = NEVER
        room = (MOST * trials * cars + goals) * frames
        return BreachLog(
            past,
            np.zeros((trials, cars), dtype=np.int64),
            clock,
            np.full(goals, -1, dtype=np.int64),
            np.zeros(goals, dtype=np.int64),
            np.zeros(trials, dtype=np.int64),
            np.zeros(cars, dtype=np.int64),
            np.zeros((room, COLUMNS), dtype=np.int64),
            np.zeros(1, dtype=np.int64),
        )

    @property
    def room_of_a_frame(self) -> int:
        """The most rows that one frame can fill."""
        return MOST * self.past.shape[0] * self.past.shape[1] + len(self.goal_clock)


def pack_terms(
    parameters: Sequence[RuleParameters],
    judged: Sequence[bool],
    radii: Sequence[float],
    rates: Sequence[float],
    cars: CarTable,
) -> tuple[Floats, Ints]:
    """Return `RefereeParameters.real` and `RefereeParameters.whole` of each trial.

    Parameters
    ----------
    parameters, judged
        The parameters of the rules, and whether the trial is judged by them.
    radii, rates
        Intersection radius R (m) and control rate (Hz).
    cars
        The car of each trial.
    """
    real = np.zeros((len(parameters), REALS))
    whole = np.zeros((len(parameters), WHOLES), dtype=np.int64)
    for b, (own, radius, rate) in enumerate(zip(parameters, radii, rates, strict=True)):
        far = radius + own.exit_gap + GRAIN
        real[b, EXIT2] = far * far
        real[b, LONE] = far + 2.0 * float(cars.reach[b])
        real[b, WAY] = own.way_distance + GRAIN
        real[b, EXIT_GAP] = own.exit_gap + GRAIN
        real[b, GOAL_GAP] = own.goal_gap + GRAIN
        real[b, LANE_MIDDLE] = cars.w[b]
        whole[b, JUDGED] = judged[b]
        whole[b, RETURN_TICKS] = ticks(own.left_time, rate)
        whole[b, ENTER_TICKS] = ticks(own.enter_time, rate)
        whole[b, MOST_TICKETS] = own.tickets
        whole[b, EXIT_TICKS] = ticks(own.exit_time, rate)
        whole[b, REST_TICKS] = ticks(own.rest_time, rate)
        whole[b, GOAL_TICKS] = ticks(own.goal_time, rate)
        whole[b, SHARED_TICKS] = ticks(own.shared_time, rate)
    return real, whole
