"""The labeller's tables: the rules of each trial, and the memory of cars and trials."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any, TypeVar, cast

import numpy as np

from dubins_traffic.cars.state import Labels, State
from dubins_traffic.cars.tables import CarTable
from dubins_traffic.kernels.arrays import BLOCK, WIDE, Floats, Ints
from dubins_traffic.kernels.records import Grid, Rows, columns, record, table
from dubins_traffic.kernels.tables import Tables
from dubins_traffic.roads.lookup import ValidCell
from dubins_traffic.roads.table import RoadTable
from dubins_traffic.rules.obstacles import ObstacleLanes

if TYPE_CHECKING:
    from dubins_traffic.rules.parameters import RuleParameters

R = TypeVar("R")

GRAIN = 1e-9
"""Metres by which the limits of a judgement are eased in favour of the car that would be in breach.

The tolerance of docs/rules.md#tolerance. It is also added to the distance of `still` and taken from that of `lingers`,
since cars often drive exactly that far and rounding must not decide.

Norm: docs/rules.md#tolerance.
"""
NEVER_AGAIN = 1e300
"""A tick, or a distance, that is never reached."""


@record
class TrialRules:
    """The rules of one trial: metres; square metres where the name ends in 2; ticks where it ends in ticks."""

    radius: float
    """R, the radius of the intersections' discs."""
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
    """The body meets a disc if its squared distance from the vertex, without its rounding, is less."""
    approach2: float
    """As `cross2`, for `approach`."""
    stop2: float
    """As `cross2`, for getting `stopped`."""
    queue2: float
    """As `cross2`, for keeping the place in the queue."""
    stop_move2: float
    """A car that has moved at most this far in `stop_ticks`, squared, has stopped."""
    stand_move2: float
    """A car that has moved at most this far in `stand_ticks`, squared, is still."""
    excuse: float
    blocked_ahead: float
    overtaking_behind: float
    overtaking_ahead: float
    linger_growth: float
    """A car whose greatest progress has grown by less in `linger_ticks` lingers."""
    hem2: float
    """A car may hem in one that overtakes if the squared distance of their centres is at most this."""
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
    """Whether entries against rule 3 count as breaches, 0 or 1."""


@record
class CarMemory:
    """The labeller's memory of one car: metres in its lane (0 without lane state), and ticks (-1 for none)."""

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
    held_top: float = NEVER_AGAIN
    """Progress from which its backing is measured, if that is less than `top`: it was held while the car overtook."""
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
    """Latest tick in which it was not still, of those in which some car is left."""
    rank: int = -1
    """Place in the order of the crossing ahead, 0 first; -1 without a ticket."""
    zone: int = -1
    """Whether it is near enough to a crossing to approach or queue, 0 or 1; -1 before the first frame."""
    next_in_lane: int = -1
    next_on_segment: int = -1
    next_in_queue: int = -1
    """The car after this one in the list of its lane, its segment, its queue; -1: none. All but the first: scratch."""
    in_group: int = 0
    """Scratch: whether it is in a group while its queue is put in order."""


@record
class Heads:
    """The first cars of lists, -1: none. Row k holds those of lane k, of segment k, and of the queue at vertex k.

    Attributes
    ----------
    lane, segment, queue : int
        A car, 0 to N - 1; the last two are scratch.
    crossers : int
        How many cars cross vertex k.
    """

    lane: int = -1
    segment: int = -1
    queue: int = -1
    crossers: int = 0


@columns(BLOCK)
class ValidRegions:
    """The regions in which the cached labels of BLOCK cars are valid, and what a frame's check of them has found.

    `rules.label_cache.check_label_caches` reads and writes these columns for several cars at once. Lengths are in
    metres.
    """

    valid_low_x: Floats
    valid_high_x: Floats
    valid_low_y: Floats
    valid_high_y: Floats
    """The labels are valid in this rectangle, and ..."""
    vertex_x: Floats
    vertex_y: Floats
    ring_low: Floats
    ring_high: Floats
    """... where the squared distance from this vertex is between `ring_low` and `ring_high`, ..."""
    from_x: Floats
    from_y: Floats
    axis_x: Floats
    axis_y: Floats
    base: Floats
    sign: Floats
    """Progress in the lane is `base` plus `sign` times the distance from (`from_x`, `from_y`) along the axis."""
    top_so_far: Floats
    """The greatest progress so far."""
    arm_x: Floats
    arm_y: Floats
    right_x: Floats
    right_y: Floats
    left_x: Floats
    left_y: Floats
    arm_least: Floats
    """... where the nearest road at the vertex is the same: the products of each of these three vectors with that from
    the vertex to the car are greater than `arm_least` (m), ..."""
    aside_low: Floats
    aside_high: Floats
    along_low: Floats
    along_high: Floats
    """... and between these offsets to the left of the axis, and along it."""
    here_x: Floats
    here_y: Floats
    then_x: Floats
    then_y: Floats
    """Where the car is in this frame, and where it was `stand_time` ago."""
    away2: Floats
    """Its squared distance from the vertex in this frame."""
    way_so_far: Floats
    """Its progress in this frame."""
    holds: Floats
    """Whether its cached labels are valid: 0, 1, or `rules.label_cache.IF_NEAREST`."""
    was_still: Floats
    top_then: Floats
    """The greatest progress `linger_time` ago."""
    lingers_from: Floats
    """The tick from which on a car with little growth since `top_then` lingers."""
    was_lingering: Floats


class Memory(Tables):
    """The labeller's memory from frame to frame.

    Attributes
    ----------
    car : (B, N) CarMemory
        The memory of each car.
    cell : (B, N) ValidCell
        A rectangle in which the nearest segment and vertex, as last looked up, are certain to be the same.
    kept : (B, ceil(N / BLOCK)) ValidRegions
        Regions in which cached labels are valid, in columns: car n is number n % BLOCK of block n // BLOCK.
    trail_x, trail_y : (B, M, N) float64
        Positions at the last M ticks, metres, tick k in row k mod M.
    growth : (B, L, P) float64
        `top` of the cars, in P places, a multiple of WIDE, at the last ticks, as many as `linger_time` has in the
        trial: tick k in row k mod that number.
    head : (B, H) Heads
        The first cars of the lists.
    due : (B, N) int64
        Scratch: the cars that may be near a crossing in this frame, by index.
    member : (B, N) int64
        Scratch: the members of a queue, lowest index first.
    """

    car: Grid[CarMemory]
    cell: Grid[ValidCell]
    kept: Grid[ValidRegions]
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
            kept=table(ValidRegions, (trials, -(-cars // BLOCK))),
            trail_x=np.zeros((trials, depth, cars)),
            trail_y=np.zeros((trials, depth, cars)),
            growth=np.zeros((trials, linger, -(-cars // WIDE) * WIDE)),
            head=table(Heads, (trials, heads)),
            due=np.zeros((trials, cars), dtype=np.int64),
            member=np.zeros((trials, cars), dtype=np.int64),
        )


class LabelTables(Tables):
    """The tables that `rules.frame.label_frame` takes: the state of a batch, its roads and rules, memory and labels."""

    state: State
    roads: RoadTable
    obstacles: ObstacleLanes
    rules: Rows[TrialRules]
    labels: Labels
    memory: Memory


def ticks(duration: float, rate: float) -> int:
    """Return the number of ticks of a duration in seconds (docs/rules.md#time): ceil(duration * rate - 1e-9).

    Norm: docs/rules.md#time.
    """
    return math.ceil(duration * rate - 1e-9)


def spread(rows: Rows[R], index: Ints) -> Rows[R]:
    """Return a new table (B,) whose row b is row `index[b]` of `rows`."""
    return cast(Any, rows)[index]


def pack_rules(
    parameters: Sequence[RuleParameters], radii: Sequence[float], rates: Sequence[float], cars: CarTable
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
        row = rules[b]
        rounding = float(cars.rounding[b])
        width = 2.0 * (float(cars.half_width[b]) + rounding)
        cross = radius + rounding
        approach = cross + given.approach_distance
        queue = cross + given.queue_distance + GRAIN
        stop = given.still_speed * given.stop_time + GRAIN
        stand = given.still_speed * given.stand_time + GRAIN
        linger = ticks(given.linger_time, rate)
        row.radius = radius
        row.half_length = float(cars.half_length[b])
        row.half_width = float(cars.half_width[b])
        row.rounding = rounding
        row.lane_width = 2.0 * float(cars.w[b])
        row.free_needed = given.width_needed(width, float(cars.point_speed[b]) / rate)
        row.turn_back = given.turn_back
        row.left_set = given.left_set
        row.left_release = given.left_release
        row.cross2 = cross * cross
        row.approach2 = approach * approach
        row.stop2 = (approach + GRAIN) * (approach + GRAIN)
        row.queue2 = queue * queue
        row.stop_move2 = stop * stop
        row.stand_move2 = stand * stand
        row.excuse = given.excuse_distance
        row.blocked_ahead = given.blocked_ahead
        row.overtaking_behind = given.overtaking_behind
        row.overtaking_ahead = given.overtaking_ahead
        hem = 2.0 * float(cars.reach[b]) + given.overtaking_behind
        row.hem2 = hem * hem
        row.linger_growth = (given.linger_distance - GRAIN) * (1.0 if linger > 0 else NEVER_AGAIN)
        row.stop_ticks = ticks(given.stop_time, rate)
        row.stand_ticks = ticks(given.stand_time, rate)
        row.group_ticks = ticks(given.group_time, rate)
        row.forfeit_ticks = ticks(given.forfeit_time, rate)
        row.linger_ticks = linger
        row.crossing_degree = given.crossing_degree
    return rules
