"""Samples of the path ahead, and the first body that a car following them would come too near to (compiled)."""

from __future__ import annotations

from math import sqrt
from typing import NamedTuple

from dubins_traffic.cars.state import Pose
from dubins_traffic.cars.tables import box_of
from dubins_traffic.kernels.boxes import Box, separation
from dubins_traffic.kernels.compile import jit
from dubins_traffic.policies.lanes.knowledge import NOBODY, Follower, Knowledge, SeenCar
from dubins_traffic.policies.lanes.tracking import ahead_on, next_row, place_on
from dubins_traffic.policies.safety import body_at


class Manoeuvre(NamedTuple):
    """A manoeuvre aside and back: an offset to the left that goes from `begin` to `aim` metres within `ramp` metres.

    From `until` metres on it goes back to 0 within `Manner.returns`.
    """

    begin: float
    aim: float
    ramp: float
    until: float


@jit
def manoeuvre_of(ego: Follower) -> Manoeuvre:
    """Return the ego's present manoeuvre."""
    return Manoeuvre(ego.begin, ego.aim, ego.ramp, ego.until)


@jit
def offset_at(distance: float, manoeuvre: Manoeuvre, returns: float) -> float:
    """Return the offset to the left after `distance` (m) of a manoeuvre; `returns` (m) is `Manner.returns`."""
    if distance >= manoeuvre.until:
        return manoeuvre.aim * max(0.0, 1.0 - (distance - manoeuvre.until) / returns)
    if distance >= manoeuvre.ramp:
        return manoeuvre.aim
    return manoeuvre.begin + (manoeuvre.aim - manoeuvre.begin) * max(distance, 0.0) / manoeuvre.ramp


@jit
def sample_path(known: Knowledge) -> None:
    """Fill the samples with the path ahead of the ego."""
    row, sigma = known.follower.row, known.follower.sigma
    for k in range(known.sample.shape[0]):
        row, sigma = ahead_on(known, row, sigma, False)
        piece = known.path[row]
        sample = known.sample[k]
        sample.x, sample.y, sample.tx, sample.ty = place_on(piece, sigma)
        sample.low = piece.low
        sample.high = piece.high
        sigma += known.manner.spacing


@jit
def gap_between(one: Box, other: Box) -> float:
    """Return the gap between two rounded boxes, metres; for two discs by their centres alone."""
    if one.half_length + one.half_width + other.half_length + other.half_width == 0.0:
        dx = other.x - one.x
        dy = other.y - one.y
        return sqrt(dx * dx + dy * dy) - one.rounding - other.rounding
    gap, _, _, _, _ = separation(one, other)
    return gap


@jit
def pose_of(car: SeenCar) -> Pose:
    """Return the pose of a seen car."""
    return Pose(car.x, car.y, car.c, car.s)


@jit
def first_conflict(
    known: Knowledge, last: int, done: float, manoeuvre: Manoeuvre, still_margin: float, moving_margin: float
) -> tuple[int, int, int]:
    """Return (first, who, nearest): the first sample at which the car would come too near to a body, and that body.

    `first` is of the samples 1 to `last` (number), `who` a car or obstacle part -1 - p, and `nearest` the sample
    nearest to it; (-1, NOBODY, -1) if there is none. Of the manoeuvre `done` (m) are behind the car. Too near is less
    than `still_margin` (m) to a standing body or `moving_margin` (m) to a moving one; a gap that is smaller already may
    stay so.
    """
    vehicle, obstacles, tick = known.vehicle, known.obstacles, known.follower.tick
    before = body_at(Pose(0.0, 0.0, 0.0, 0.0), vehicle)
    for k in range(last + 1):
        place = known.sample[k]
        offset = offset_at(done + known.manner.spacing * k, manoeuvre, known.manner.returns)
        if k > 0:
            offset = min(max(offset, place.low), place.high)
        x = place.x - offset * place.ty
        y = place.y + offset * place.tx
        body = body_at(Pose(x, y, place.tx, place.ty), vehicle)
        for n in range(known.other.shape[0]):
            car = known.other[n]
            margin = still_margin if known.still[n] > 0.0 else moving_margin
            margin = min(margin, max(known.gap[n] - 0.005, 0.0))
            dx = car.x - x
            dy = car.y - y
            near = 2.0 * vehicle.reach + margin
            is_near = car.tick == tick and k > 0 and dx * dx + dy * dy < near * near
            if is_near and comes_nearer(before, body, body_at(pose_of(car), vehicle), margin):
                return k, n, nearest_sample(known, k, car.x, car.y)
        for p in range(obstacles.parts.shape[0]):
            part = obstacles.parts[p]
            dx = part.x - x
            dy = part.y - y
            near = vehicle.reach + part.reach + still_margin
            is_near = k > 0 and dx * dx + dy * dy < near * near
            if is_near and comes_nearer(before, body, box_of(part), still_margin):
                return k, -1 - p, nearest_sample(known, k, part.x, part.y)
        before = body
    return -1, NOBODY, -1


@jit
def comes_nearer(before: Box, after: Box, other: Box, margin: float) -> bool:
    """Tell whether a body that goes from `before` to `after` comes nearer than `margin` (m) to another."""
    gap = gap_between(after, other)
    return gap < margin and gap < gap_between(before, other)


@jit
def nearest_sample(known: Knowledge, k: int, x: float, y: float) -> int:
    """Return the sample nearest to a point, searched from `k` (number) on until distances grow again."""
    best = 1e300
    for m in range(k, known.sample.shape[0]):
        dx = x - known.sample[m].x
        dy = y - known.sample[m].y
        d2 = dx * dx + dy * dy
        if d2 > best:
            return m - 1
        best = d2
    return known.sample.shape[0] - 1


@jit
def next_gate(known: Knowledge) -> tuple[int, float]:
    """Return the row of the path with the next line to wait at within 4 m, and the metres to that; (-1, 0) if none."""
    row = known.follower.row
    far = -known.follower.sigma
    for _ in range(64):
        piece = known.path[row]
        to_line = far + piece.stop
        if piece.waits != 0 and to_line >= -known.manner.past_line:
            return (row, to_line) if to_line <= 4.0 else (-1, 0.0)
        far += piece.length
        if far > 4.0:
            break
        row = next_row(row, known)
    return -1, 0.0
