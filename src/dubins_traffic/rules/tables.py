"""What the kernels of this room read and write: the rules of each trial, and what the cars' past has left behind."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any, TypeVar, cast

import numpy as np

from dubins_traffic.cars.state import Labels, State
from dubins_traffic.cars.tables import CarTable
from dubins_traffic.kernels.arrays import BLOCK, WIDE, Floats, Ints
from dubins_traffic.kernels.columns import columns
from dubins_traffic.kernels.records import Grid, Rows, record, table
from dubins_traffic.kernels.tables import Tables
from dubins_traffic.roads.lookup import ValidCell
from dubins_traffic.roads.table import RoadTable
from dubins_traffic.rules.obstacles import ObstacleLanes

if TYPE_CHECKING:
    from dubins_traffic.rules.parameters import RuleParameters

R = TypeVar("R")

GRAIN = 1e-9
"""Metres by which limits that a judgement compares are eased for the car that would be in breach.

The tolerance of docs/rules.md#tolerance. It is added to the distance of `still`, and taken from that of `lingers`, too:
cars often go exactly that far, and rounding must not decide.
"""
NEVER_AGAIN = 1e300
"""A tick, or a distance, that is never reached."""


@record
class TrialRules:
    """The rules of one trial: metres, but for those that end in 2, square metres, and those that end in ticks."""

    radius: float
    """R, of the intersections' discs."""
    half_length: float
    half_width: float
    rounding: float
    """With the two before: the body of the cars, a rounded box."""
    lane_width: float
    free_needed: float
    """How much of a right lane must be free for it not to be blocked."""
    turn_back: float
    """How far progress falls before a lane state flips."""
    left_set: float
    left_release: float
    cross2: float
    """Squared distance of the body, without its rounding, from a vertex, nearer than which it meets the disc."""
    approach2: float
    """As `cross2`: up to there it approaches."""
    stop2: float
    """As `cross2`: up to there it may stop."""
    queue2: float
    """As `cross2`: up to there it keeps its place."""
    stop_move2: float
    """Squared distance up to which a car has moved that has stopped."""
    stand_move2: float
    """Squared distance up to which a car has moved that is still."""
    excuse: float
    blocked_ahead: float
    overtaking_behind: float
    overtaking_ahead: float
    linger_growth: float
    """A car whose greatest progress has grown by less in `linger_ticks` lingers."""
    hem2: float
    """Squared distance of the centre of a car up to which it may hem in one that overtakes."""
    net: int
    """Number of the trial's roads in the table of the batch."""
    stop_ticks: int
    stand_ticks: int
    group_ticks: int
    forfeit_ticks: int
    linger_ticks: int
    crossing_degree: int
    """Least degree of a vertex that is a crossing."""
    judged3: int
    """Whether entries against rule 3 count."""


@record
class CarMemory:
    """What the propositions remember of one car: metres in its lane state, 0 without one; ticks, -1: there is none."""

    top: float
    """Greatest progress since the lane state was set."""
    progress: float
    """s, of the centre."""
    lateral: float
    """l, of the centre, left positive."""
    reach: float
    """Largest lateral coordinate of the body."""
    gap2: float
    """Squared distance of the body, without its rounding, from the crossing ahead, -1 if there is none."""
    approach_since: int = -1
    """First tick of the present run of approach."""
    ticket: int = -1
    """Tick of the ticket."""
    forfeits: int = 0
    """New tickets in this wait."""
    first_since: int = -1
    """First tick of the present run of being first at a clear crossing."""
    wait_since: int = -1
    """Tick of the first stop in this wait."""
    left_since: int = -1
    """Tick in which it became left."""
    stirred: int = -1
    """Latest tick in which it was not still, of those in which anybody is left."""
    rank: int = -1
    """Place in the order of the crossing ahead, 0 first; -1 without a ticket."""
    zone: int = -1
    """Whether it is where cars approach and queue, 0 or 1; -1 before the first frame."""
    next_in_lane: int = -1
    next_on_segment: int = -1
    next_in_queue: int = -1
    """The car after this one in the list of its lane, its segment, its queue; -1: none. All but the first: scratch."""
    in_group: int = 0
    """Scratch: whether its ticket has come into a group while a queue is put in order."""


@record
class Heads:
    """The first cars of lists, -1: none. Row k: of lane k, of segment k, of the queue at vertex k."""

    lane: int = -1
    segment: int = -1
    """Scratch."""
    queue: int = -1
    """Scratch."""
    crossers: int = 0
    """How many cars cross vertex k."""


@columns(BLOCK)
class Kept:
    """Of BLOCK cars, number by number: where what a car's place says is the same, and what is found of it in a frame.

    The loop over the cars of `rules.label_cache.look_who_holds` reads and writes these columns several cars at once.
    """

    valid_low_x: Floats
    valid_high_x: Floats
    valid_low_y: Floats
    valid_high_y: Floats
    """A rectangle in which labels are the same, as far as the nearest segment is."""
    vertex_x: Floats
    vertex_y: Floats
    ring_low: Floats
    ring_high: Floats
    """They are so, too, at squared distances from a vertex between these two only."""
    from_x: Floats
    from_y: Floats
    axis_x: Floats
    axis_y: Floats
    base: Floats
    sign: Floats
    """How far a car is in its lane: `base` and `sign` times the metres from a point along an axis."""
    top_so_far: Floats
    """The most of that so far."""
    arm_x: Floats
    arm_y: Floats
    right_x: Floats
    right_y: Floats
    left_x: Floats
    left_y: Floats
    arm_least: Floats
    """Where the nearest of the roads that meet in the vertex is the same: where all three products of these vectors and
    the way from the vertex are greater than the last, metres."""
    aside_low: Floats
    aside_high: Floats
    along_low: Floats
    along_high: Floats
    """Between which metres to the left of the axis, and along it, a car is on the road and not left as it is now."""
    here_x: Floats
    here_y: Floats
    then_x: Floats
    then_y: Floats
    """Where it is in this frame and where it was `stand_time` ago."""
    away2: Floats
    """Its squared distance from the vertex."""
    way_so_far: Floats
    """Its progress."""
    holds: Floats
    """Whether it holds on to its labels: 0, 1, or `rules.label_cache.IF_NEAREST`."""
    was_still: Floats
    top_then: Floats
    """The greatest progress `linger_time` ago."""
    lingers_from: Floats
    """The tick from which on that says whether the car lingers."""
    was_lingering: Floats


class Memory(Tables):
    """What the propositions remember, all of it explicit.

    Attributes
    ----------
    car : (B, N) CarMemory
        What is remembered of each car.
    cell : (B, N) ValidCell
        A rectangle about the place where the centre was last looked up, in which nearest segment and vertex are the
        same for certain.
    kept : (B, ceil(N / BLOCK)) Kept
        Where labels are the same for certain, in columns: car n is number n % BLOCK of block n // BLOCK.
    trail_x, trail_y : (B, M, N) float64
        Positions at the last M ticks, metres, tick k in row k mod M.
    growth : (B, L, P) float64
        `top` of the cars, in P places, a multiple of WIDE, at the last ticks, as many as `linger_time` has in the
        trial: tick k in row k mod that number.
    head : (B, H) Heads
        Where the lists of cars begin.
    due : (B, N) int64
        Scratch: which cars are to be looked at in this frame, in order.
    member : (B, N) int64
        Scratch: the members of a queue, lowest index first.
    """

    car: Grid[CarMemory]
    cell: Grid[ValidCell]
    kept: Grid[Kept]
    trail_x: Floats
    trail_y: Floats
    growth: Floats
    head: Grid[Heads]
    due: Ints
    member: Ints

    @staticmethod
    def empty(trials: int, cars: int, depth: int, heads: int, linger: int) -> Memory:
        """Return the memory of `trials` x `cars` cars before their first frame.

        `depth` and `linger` are the rows of `trail_x` and `growth`, `heads` those of `head`.
        """
        return Memory(
            car=table(CarMemory, (trials, cars)),
            cell=table(ValidCell, (trials, cars)),
            kept=table(Kept, (trials, -(-cars // BLOCK))),
            trail_x=np.zeros((trials, depth, cars)),
            trail_y=np.zeros((trials, depth, cars)),
            growth=np.zeros((trials, linger, -(-cars // WIDE) * WIDE)),
            head=table(Heads, (trials, heads)),
            due=np.zeros((trials, cars), dtype=np.int64),
            member=np.zeros((trials, cars), dtype=np.int64),
        )


class LabelTables(Tables):
    """All that labels of a batch are found from, and the labels: what `rules.frame.label_frame` takes."""

    state: State
    roads: RoadTable
    obstacles: ObstacleLanes
    rules: Rows[TrialRules]
    labels: Labels
    memory: Memory


def ticks(duration: float, rate: float) -> int:
    """Return the number of ticks of a duration in seconds (docs/rules.md#time): ceil(duration * rate - 1e-9)."""
    return math.ceil(duration * rate - 1e-9)


def spread(rows: Rows[R], index: Ints) -> Rows[R]:
    """Return the rows of these numbers, (B,), as a table of their own."""
    return cast(Any, rows)[index]


def pack_rules(
    parameters: Sequence[RuleParameters],
    radii: Sequence[float],
    rates: Sequence[float],
    cars: CarTable,
) -> Rows[TrialRules]:
    """Return the rules of each trial as a table; `net` and `judged3` are left to fill in.

    Parameters
    ----------
    parameters, radii, rates
        The parameters, the intersection radius R (m) and the control rate (Hz) of each trial.
    cars
        The car of each trial.
    """
    rules = table(TrialRules, len(parameters))
    for b, (given, radius, rate) in enumerate(zip(parameters, radii, rates, strict=True)):
        own = rules[b]
        rounding = float(cars.rounding[b])
        width = 2.0 * (float(cars.half_width[b]) + rounding)
        cross = radius + rounding
        approach = cross + given.approach_distance
        queue = cross + given.queue_distance + GRAIN
        stop = given.still_speed * given.stop_time + GRAIN
        stand = given.still_speed * given.stand_time + GRAIN
        linger = ticks(given.linger_time, rate)
        own.radius = radius
        own.half_length = float(cars.half_length[b])
        own.half_width = float(cars.half_width[b])
        own.rounding = rounding
        own.lane_width = 2.0 * float(cars.w[b])
        own.free_needed = width + given.blocked_gap
        own.turn_back = given.turn_back
        own.left_set = given.left_set
        own.left_release = given.left_release
        own.cross2 = cross * cross
        own.approach2 = approach * approach
        own.stop2 = (approach + GRAIN) * (approach + GRAIN)
        own.queue2 = queue * queue
        own.stop_move2 = stop * stop
        own.stand_move2 = stand * stand
        own.excuse = given.excuse_distance
        own.blocked_ahead = given.blocked_ahead
        own.overtaking_behind = given.overtaking_behind
        own.overtaking_ahead = given.overtaking_ahead
        hem = 2.0 * float(cars.reach[b]) + given.overtaking_behind
        own.hem2 = hem * hem
        own.linger_growth = (given.linger_distance - GRAIN) * (1.0 if linger > 0 else NEVER_AGAIN)
        own.stop_ticks = ticks(given.stop_time, rate)
        own.stand_ticks = ticks(given.stand_time, rate)
        own.group_ticks = ticks(given.group_time, rate)
        own.forfeit_ticks = ticks(given.forfeit_time, rate)
        own.linger_ticks = linger
        own.crossing_degree = given.crossing_degree
    return rules
