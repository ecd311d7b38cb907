"""Draws the starts of many trials (compiled), as `problem.starts` does in the usual case that all cars fit."""

from __future__ import annotations

from collections.abc import Sequence
from math import sqrt
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from dubins_traffic.cars.state import Pose
from dubins_traffic.kernels.arrays import Floats, Ints
from dubins_traffic.kernels.compile import jit
from dubins_traffic.kernels.random import DOWN, GRID, UP, block
from dubins_traffic.problem.places import SLACK, Places
from dubins_traffic.problem.starts import Ground, Wish, gap_radius

NO_CAR = np.uint64(0xFFFFFFFF)
"""Stands where a running trial's random numbers have a car (`kernels.philox.Draws`)."""
CUTS = 24
"""Number of intervals per car for which there is scratch; a trial that needs more is drawn in plain Python."""


class Room(NamedTuple):
    """Scratch for one trial, two lists of intervals that take turns.

    `lane` (2, K) and `span` (2, K, 2): lane and ends (m) of each interval; `ends` (K,): what is free up to its end, m.
    """

    lane: Ints
    span: Floats
    ends: Floats


class Lots(NamedTuple):
    """Where the cars of trials on one ground may stand.

    `line` (L, 4): start and direction of each lane's centre line; `lane`, `low`, `high` (K,): the free intervals of
    the lanes, in order; `given` (G, 2): positions of the cars whose starts are given; `order` (D,): the others, in the
    order in which they are drawn; `allowed` (D, L): where each of these may be, or (0, 0) for all lanes; `radius`: how
    far centres are apart, metres.
    """

    line: Floats
    lane: Ints
    low: Floats
    high: Floats
    given: Floats
    order: Ints
    allowed: npt.NDArray[np.bool_]
    radius: float


def lots(ground: Ground, outside: Places, wishes: Sequence[Wish]) -> Lots:
    """Return the lots of a ground, of which `outside` is free, for cars with `wishes`."""
    line, intervals = outside.tables()
    given = [(wish.pose.x, wish.pose.y) for wish in wishes if wish.pose is not None]
    drawn = [n for n, wish in enumerate(wishes) if wish.pose is None]
    order = sorted(drawn, key=lambda n: wishes[n].lanes is None)
    choosy = any(wish.lanes is not None for wish in wishes)
    allowed = np.ones((len(order), len(line)) if choosy else (0, 0), dtype=np.bool_)
    for k, n in enumerate(order):
        own = wishes[n].lanes
        if own is not None:
            allowed[k] = False
            allowed[k, list(own)] = True
    return Lots(
        line,
        *intervals,
        np.array(given, dtype=np.float64).reshape(len(given), 2),
        np.array(order, dtype=np.int64),
        allowed,
        gap_radius(ground.car) + SLACK,
    )


def place_cars(
    own: Lots, wishes: Sequence[Wish], seed: int, trials: Sequence[int], stream: int
) -> list[list[Pose] | None]:
    """Return the start poses of the cars of each trial; None if they don't fit with the full gap."""
    poses = np.zeros((len(trials), len(own.order), 4))
    placed = np.zeros(len(trials), dtype=np.int64)
    size = len(own.lane) + CUTS * len(wishes)
    room = Room(np.zeros((2, size), dtype=np.int64), np.zeros((2, size, 2)), np.zeros(size))
    place_trials(np.uint64(seed), np.array(trials, dtype=np.int64), stream, own, room, poses, placed)
    base = [wish.pose for wish in wishes]
    order: list[int] = own.order.tolist()
    found: list[list[Pose] | None] = []
    for rows, done in zip(poses.tolist(), placed.tolist(), strict=True):
        if done < len(order):
            found.append(None)
            continue
        whole = list(base)
        for n, row in zip(order, rows, strict=True):
            whole[n] = Pose._make(row)
        found.append([pose for pose in whole if pose is not None])
    return found


@jit
def place_trials(
    seed: np.uint64, trials: Ints, stream: int, own: Lots, room: Room, poses: Floats, placed: Ints
) -> None:
    """Place the cars of all trials.

    Parameters
    ----------
    seed : uint64
        The seed of all random numbers.
    trials : (B,) int64
        Numbers of the trials.
    stream : int
        Number of the draw in the counter of random numbers.
    own : Lots
        What the trials have in common.
    room : Room
        Scratch for one trial.
    poses : (B, D, 4) float64
        Set to x, y (m), cos, sin of each car that is drawn.
    placed : (B,) int64
        Set to the number of cars that have found a place.
    """
    for b in range(trials.shape[0]):
        count = own.lane.shape[0]
        for k in range(count):
            room.lane[0, k] = own.lane[k]
            room.span[0, k, 0] = own.low[k]
            room.span[0, k, 1] = own.high[k]
        side = 0
        for g in range(own.given.shape[0]):
            count = _cut_out(own, own.given[g, 0], own.given[g, 1], side, count, room)
            side = 1 - side
            if count < 0:
                break
        for k in range(own.order.shape[0]):
            if count < 0:
                break
            words = block(seed, trials[b], NO_CAR, k // 2, stream)
            first = words[0] if k % 2 == 0 else words[2]
            second = words[1] if k % 2 == 0 else words[3]
            share = np.float64((first << UP) | (second >> DOWN)) * GRID
            spot, along = _choose(own, k, share, side, count, room)
            if spot < 0:
                break
            line, pose = own.line[room.lane[side, spot]], poses[b, k]
            pose[0], pose[1] = line[0] + along * line[2], line[1] + along * line[3]
            pose[2], pose[3] = line[2], line[3]
            placed[b] = k + 1
            count = _cut_out(own, pose[0], pose[1], side, count, room)
            side = 1 - side


@jit
def _choose(own: Lots, car: int, share: float, side: int, count: int, room: Room) -> tuple[int, float]:
    """Return an interval and the metres along its lane at a share of all that is free; -1 if nothing is."""
    lane, span, ends = room.lane[side], room.span[side], room.ends
    total = 0.0
    last = -1
    for k in range(count):
        width = span[k, 1] - span[k, 0]
        if own.allowed.shape[0] > 0 and not own.allowed[car, lane[k]]:
            width = 0.0
        total += width
        ends[k] = total
        if width > 0.0:
            last = k
    if not total > 0.0:
        return -1, 0.0
    pick = total * share
    chosen = last
    for k in range(last):
        if ends[k] > pick:
            chosen = k
            break
    width = span[chosen, 1] - span[chosen, 0]
    if own.allowed.shape[0] > 0 and not own.allowed[car, lane[chosen]]:
        width = 0.0
    along = span[chosen, 0] + (pick - (ends[chosen] - width))
    return chosen, min(max(along, span[chosen, 0]), span[chosen, 1])


@jit
def _cut_out(own: Lots, x: float, y: float, side: int, count: int, room: Room) -> int:
    """Take a disc out of the intervals; return how many there are then, -1 if there is no room for them."""
    lane, span, new_lane, new_span = (
        room.lane[side],
        room.span[side],
        room.lane[1 - side],
        room.span[1 - side],
    )
    total = 0
    square = own.radius * own.radius
    for k in range(count):
        if total + 2 > new_lane.shape[0]:
            return -1
        line = own.line[lane[k]]
        rx = x - line[0]
        ry = y - line[1]
        along = rx * line[2] + ry * line[3]
        left = line[2] * ry - line[3] * rx
        rest = square - left * left
        half = sqrt(max(rest, 0.0))
        low = along - half
        high = along + half
        if rest > 0.0 and low < span[k, 1] and high > span[k, 0] and low < high:
            if low >= span[k, 0]:
                new_lane[total] = lane[k]
                new_span[total, 0] = span[k, 0]
                new_span[total, 1] = low
                total += 1
            if high <= span[k, 1]:
                new_lane[total] = lane[k]
                new_span[total, 0] = high
                new_span[total, 1] = span[k, 1]
                total += 1
        else:
            new_lane[total] = lane[k]
            new_span[total, 0] = span[k, 0]
            new_span[total, 1] = span[k, 1]
            total += 1
    return total
