"""What the kernels of this room read and write: the rules of each trial, and what the cars' past has left behind."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING, Final

import numpy as np

from dubins_traffic.cars.tables import CarTable
from dubins_traffic.kernels.arrays import BLOCK, WIDE, Floats, Ints
from dubins_traffic.kernels.tables import Tables

if TYPE_CHECKING:
    from dubins_traffic.rules.parameters import RuleParameters

RADIUS: Final = 0
HALF_LENGTH: Final = 1
HALF_WIDTH: Final = 2
ROUNDING: Final = 3
LANE_WIDTH: Final = 4
FREE_NEEDED: Final = 5
TURN_BACK: Final = 6
LEFT_SET: Final = 7
LEFT_RELEASE: Final = 8
CROSS2: Final = 9
APPROACH2: Final = 10
QUEUE2: Final = 11
STOP_MOVE2: Final = 12
STAND_MOVE2: Final = 13
EXCUSE: Final = 14
BLOCKED_AHEAD: Final = 15
OVERTAKING_BEHIND: Final = 16
OVERTAKING_AHEAD: Final = 17
STOP2: Final = 18
LINGER_GROWTH: Final = 19
REALS: Final = 20

NET: Final = 0
STOP_TICKS: Final = 1
STAND_TICKS: Final = 2
GROUP_TICKS: Final = 3
FORFEIT_TICKS: Final = 4
CROSSING_DEGREE: Final = 5
JUDGED3: Final = 6
LINGER_TICKS: Final = 7
WHOLES: Final = 8

TOP: Final = 0
PROGRESS: Final = 1
LATERAL: Final = 2
REACH: Final = 3
GAP2: Final = 4
MEASURES: Final = 5

APPROACH_SINCE: Final = 0
TICKET: Final = 1
FORFEITS: Final = 2
FIRST_SINCE: Final = 3
RANK: Final = 4
ZONE: Final = 5
WAIT_SINCE: Final = 6
MARKS: Final = 7

NEXT_IN_LANE: Final = 0
NEXT_ON_SEGMENT: Final = 1
NEXT_IN_QUEUE: Final = 2
MEMBER: Final = 3
GROUP: Final = 4
DUE: Final = 5
LINKS: Final = 6

LANE: Final = 0
SEGMENT: Final = 1
QUEUE: Final = 2
CROSSERS: Final = 3
NOW: Final = 4
HEADS: Final = 5

VALID_CELL_LOW_X: Final = 0
VALID_CELL_HIGH_X: Final = 1
VALID_CELL_LOW_Y: Final = 2
VALID_CELL_HIGH_Y: Final = 3
VALID_CELL_SEGMENT: Final = 4
VALID_CELL_VERTEX: Final = 5
VALID_CELL: Final = 6

VALID_LOW_X, VALID_HIGH_X, VALID_LOW_Y, VALID_HIGH_Y, VERTEX_X, VERTEX_Y, RING_LOW, RING_HIGH = range(8)
FROM_X, FROM_Y, AXIS_X, AXIS_Y, BASE, SIGN, TOP_SO_FAR, FORK_X, FORK_Y, FORK_SURE = range(8, 18)
ASIDE_LOW, ASIDE_HIGH, ALONG_LOW, ALONG_HIGH = range(18, 22)
HERE_X, HERE_Y, THEN_X, THEN_Y, AWAY2, WAY_SO_FAR, HOLDS, WAS_STILL = range(22, 30)
TOP_THEN, LINGERS_FROM, WAS_LINGERING = range(30, 33)
CALM: Final = 33

GRAIN = 1e-9
"""Metres by which limits that a judgement compares are eased for the car that would be in breach.

The tolerance of docs/rules.md#tolerance. It is added to the distance of `still`, and taken from that of `lingers`, too:
cars often go exactly that far, and rounding must not decide.
"""
NEVER_AGAIN = 1e300
"""A tick, or a distance, that is never reached."""


class RuleTable(Tables):
    """The rules of each trial: `real` (B, REALS) float64 and `whole` (B, WHOLES) int64, columns as named above.

    `CROSS2`, `APPROACH2`, `STOP2` and `QUEUE2` are squared distances of the body, without its rounding, from a vertex:
    nearer it meets the disc, and up to there it approaches, may stop, or keeps its place.
    """

    real: Floats
    whole: Ints


class Memory(Tables):
    """What the propositions remember, all of it explicit.

    Attributes
    ----------
    measure : (B, N, MEASURES) float64
        Greatest progress since the lane state was set (`TOP`), progress s and lateral offset l of the centre
        (`PROGRESS`, `LATERAL`), largest lateral coordinate of the body (`REACH`), all metres in the lane state
        and 0 without one; squared distance of the body, without its rounding, from the crossing ahead (`GAP2`,
        -1 if there is none).
    mark : (B, N, MARKS) int64
        First tick of the present run of approach (`APPROACH_SINCE`), tick of the ticket (`TICKET`), new tickets
        in this wait (`FORFEITS`), first tick of the present run of being first at a clear crossing
        (`FIRST_SINCE`) and place in the order (`RANK`, 0 first); -1 (forfeits: 0) where there is none;
        whether it is where cars approach and queue (`ZONE`, else 0); tick of the first stop in this wait
        (`WAIT_SINCE`, -1: none).
    valid_cell : (B, N, VALID_CELL) float64
        A rectangle about the place where the centre was last looked up, in which nearest segment (-1: one of those
        that meet in the nearest vertex) and vertex (`VALID_CELL_SEGMENT`, `VALID_CELL_VERTEX`) are the same for
        certain; empty before.
    kept : (B, C) float64
        Columns of BLOCK cars each, see `rules.label_cache.place`. Where all that a place says is the same, as far as
        the nearest segment is: within a rectangle (`VALID_LOW_X` to `VALID_HIGH_Y`), and at squared distances from a
        vertex (`VERTEX_X`, `VERTEX_Y`) between `RING_LOW` and `RING_HIGH`. How far a car is in its lane: `BASE` and
        `SIGN` times the metres from (`FROM_X`, `FROM_Y`) along (`AXIS_X`, `AXIS_Y`), and the most of that so far;
        between which metres to the left of that axis, and along it, it is on the road and not left as it is now.
        Where the nearest road is the same: up to `FORK_SURE` metres from (`FORK_X`, `FORK_Y`), along x and along y.
        Of this frame: where the car is and was `stand_time` ago, its squared distance from the vertex, its progress,
        whether it holds on to its labels, and whether it was still. The greatest progress `linger_time` ago
        (`TOP_THEN`), the tick from which on that says whether the car lingers (`LINGERS_FROM`), and whether it does.
    trail : (B, M, 2, N) float64
        Positions at the last M ticks, tick k in row k mod M.
    growth : (B, L, P) float64
        `TOP` of the cars, in P places, a multiple of WIDE, at the last ticks, as many as `linger_time` has in the
        trial: tick k in row k mod that number.
    link : (B, N, LINKS) int64
        The cars of one lane, in any order, segment and queue as linked lists; members and groups of a queue; which cars
        are to be looked at in this frame, in order (`DUE`). All but the lists of the lanes is scratch.
    head : (B, H, HEADS) int64
        The first car of each lane, segment, queue (-1: none), and how many cars cross a vertex; in the first row, which
        row of `trail` is the present one (`NOW`). Segments and queues are scratch.
    """

    measure: Floats
    mark: Ints
    valid_cell: Floats
    kept: Floats
    trail: Floats
    growth: Floats
    link: Ints
    head: Ints

    @staticmethod
    def empty(trials: int, cars: int, depth: int, heads: int, linger: int) -> Memory:
        """Return the memory of `trials` x `cars` cars before their first frame.

        `depth` and `linger` are the rows of `trail` and `growth`, `heads` those of `head`.
        """
        mark = np.full((trials, cars, MARKS), -1, dtype=np.int64)
        mark[:, :, FORFEITS] = 0
        head = np.full((trials, heads, HEADS), -1, dtype=np.int64)
        head[:, :, CROSSERS] = 0
        return Memory(
            np.zeros((trials, cars, MEASURES)),
            mark,
            np.zeros((trials, cars, VALID_CELL)),
            np.zeros((trials, -(-cars // BLOCK) * BLOCK * CALM)),
            np.zeros((trials, depth, 2, cars)),
            np.zeros((trials, linger, -(-cars // WIDE) * WIDE)),
            np.full((trials, cars, LINKS), -1, dtype=np.int64),
            head,
        )


def ticks(duration: float, rate: float) -> int:
    """Return the number of ticks of a duration in seconds (docs/rules.md#time): ceil(duration * rate - 1e-9)."""
    return math.ceil(duration * rate - 1e-9)


def pack_rules(
    parameters: Sequence[RuleParameters],
    radii: Sequence[float],
    rates: Sequence[float],
    cars: CarTable,
) -> RuleTable:
    """Return the rules of each trial as a table; `NET` and `JUDGED3` are left to fill in.

    Parameters
    ----------
    parameters, radii, rates
        The parameters, the intersection radius R (m) and the control rate (Hz) of each trial.
    cars
        The car of each trial.
    """
    real = np.zeros((len(parameters), REALS))
    whole = np.zeros((len(parameters), WHOLES), dtype=np.int64)
    for b, (own, radius, rate) in enumerate(zip(parameters, radii, rates, strict=True)):
        rounding = float(cars.rounding[b])
        width = 2.0 * (float(cars.half_width[b]) + rounding)
        cross = radius + rounding
        approach = cross + own.approach_distance
        queue = cross + own.queue_distance + GRAIN
        stop = own.still_speed * own.stop_time + GRAIN
        stand = own.still_speed * own.stand_time + GRAIN
        linger = ticks(own.linger_time, rate)
        real[b, RADIUS] = radius
        real[b, HALF_LENGTH] = cars.half_length[b]
        real[b, HALF_WIDTH] = cars.half_width[b]
        real[b, ROUNDING] = rounding
        real[b, LANE_WIDTH] = 2.0 * cars.w[b]
        real[b, FREE_NEEDED] = width + own.blocked_gap
        real[b, TURN_BACK] = own.turn_back
        real[b, LEFT_SET] = own.left_set
        real[b, LEFT_RELEASE] = own.left_release
        real[b, CROSS2] = cross * cross
        real[b, APPROACH2] = approach * approach
        real[b, STOP2] = (approach + GRAIN) * (approach + GRAIN)
        real[b, QUEUE2] = queue * queue
        real[b, STOP_MOVE2] = stop * stop
        real[b, STAND_MOVE2] = stand * stand
        real[b, EXCUSE] = own.excuse_distance
        real[b, BLOCKED_AHEAD] = own.blocked_ahead
        real[b, OVERTAKING_BEHIND] = own.overtaking_behind
        real[b, OVERTAKING_AHEAD] = own.overtaking_ahead
        real[b, LINGER_GROWTH] = (own.linger_distance - GRAIN) * (1.0 if linger > 0 else NEVER_AGAIN)
        whole[b, STOP_TICKS] = ticks(own.stop_time, rate)
        whole[b, STAND_TICKS] = ticks(own.stand_time, rate)
        whole[b, GROUP_TICKS] = ticks(own.group_time, rate)
        whole[b, FORFEIT_TICKS] = ticks(own.forfeit_time, rate)
        whole[b, CROSSING_DEGREE] = own.crossing_degree
        whole[b, LINGER_TICKS] = linger
    return RuleTable(real, whole)
