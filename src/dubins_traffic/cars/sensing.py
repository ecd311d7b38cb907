"""What a car senses: the cars within a radius, with seeded noise, and a laser scan."""

from __future__ import annotations

from collections.abc import Iterable
from functools import cached_property
from math import sqrt
from typing import Any

import numpy as np

from dubins_traffic.cars.state import EGO, NONE, Labels, Pose, State
from dubins_traffic.cars.tables import CarTable, ObstacleTable, box_at, box_of
from dubins_traffic.kernels.arrays import Floats, Ints
from dubins_traffic.kernels.boxes import NEVER, Box
from dubins_traffic.kernels.compile import jit, jit_inline
from dubins_traffic.kernels.random import DRAW, cut_bell
from dubins_traffic.kernels.records import Rows, numbers, record, table
from dubins_traffic.kernels.tables import Tables
from dubins_traffic.kernels.trig import sincos


@record
class SeenPose:
    """Pose and twist of a car that is seen: centre, m, heading, a unit vector, speed, m/s, and yaw rate, rad/s."""

    x: float
    y: float
    c: float
    s: float
    speed: float
    yaw_rate: float


@record
class SeenLabels:
    """Index and `cars.state.Propositions` of a car that is seen; `car` is NONE in a row without a car."""

    car: int = NONE
    segment: int = NONE
    at: int = NONE
    crosses: int = NONE
    lane: int = NONE
    bits: int = NONE


class Seen(Tables):
    """The cars that a car sees, itself first: `poses` (N,) and `labels` (N,)."""

    poses: Rows[SeenPose]
    labels: Rows[SeenLabels]

    @cached_property
    def pose_rows(self) -> Floats:
        """The poses as an array (N, 6), a view."""
        return numbers(self.poses, np.float64)

    @cached_property
    def label_rows(self) -> Ints:
        """The labels as an array (N, 6), a view."""
        return numbers(self.labels, np.int64)


@record
class Ray:
    """The direction of a laser's ray in the car's frame: a unit vector."""

    c: float
    s: float


class Surroundings(Tables):
    """What a laser's ray may meet: the cars of a batch, and its obstacles."""

    state: State
    cars: CarTable
    obstacles: ObstacleTable


def nothing_seen(cars: int) -> Seen:
    """Return the tables for what a car sees of up to `cars` cars, still empty."""
    return Seen(table(SeenPose, cars), table(SeenLabels, cars))


def rays_at(angles: Iterable[float]) -> Rows[Ray]:
    """Return the rays at bearings `angles`, radians, left positive, 0 straight ahead."""
    directions = [sincos(float(angle)) for angle in angles]
    rays = table(Ray, len(directions))
    for ray, (c, s) in enumerate(directions):
        rays[ray].c = c
        rays[ray].s = s
    return rays


@jit_inline
def within_sight(dx: float, dy: float, sight2: float) -> bool:
    """Tell whether a centre `dx` (m) and `dy` (m) from a car's is within its sensing radius.

    `sight2` (m2) is the square of that; negative: everything is seen. Whoever asks what a car senses asks here.
    """
    return sight2 < 0.0 or dx * dx + dy * dy <= sight2


@jit
def mark_sensed(trials: Ints, sight2: Floats, state: State, sensed: Ints) -> None:
    """Write to `sensed` (K, N) 1 for the ego of each of `trials` (K,), and for the cars within its radius.

    `sight2` (B,) are the squares of the radii of all trials, square metres.
    """
    for k in range(trials.shape[0]):
        b: int = trials[k]
        for n in range(state.count[b]):
            dx = state.x[b, n] - state.x[b, EGO]
            dy = state.y[b, n] - state.y[b, EGO]
            sensed[k, n] = 1 if within_sight(dx, dy, sight2[b]) else 0


@jit
def neighbours(b: int, viewer: int, radius: float, seen: Seen, state: State, labels: Labels) -> int:
    """Write car `viewer` (index), then the others within `radius` (m) by index, into `seen`; return how many rows.

    In the row after them `SeenLabels.car` is NONE. If the labels in `seen` were the same before, the number of rows is
    returned negated, so that the caller need not convert them again.
    """
    limit = radius * radius
    x = state.x[b, viewer]
    y = state.y[b, viewer]
    other = _view(b, viewer, 0, seen, state, labels)
    count = 1
    for n in range(state.count[b]):
        dx = state.x[b, n] - x
        dy = state.y[b, n] - y
        if n != viewer and within_sight(dx, dy, limit):
            other |= _view(b, n, count, seen, state, labels)
            count += 1
    if count < seen.labels.shape[0]:
        other |= seen.labels[count].car ^ NONE
        seen.labels[count].car = NONE
    return count if other != 0 else -count


@jit
def _view(b: int, n: int, row: int, seen: Seen, state: State, labels: Labels) -> int:
    """Write car n into a row of `seen`; return 0 if the labels in that row were the same before."""
    pose = seen.poses[row]
    pose.x = state.x[b, n]
    pose.y = state.y[b, n]
    pose.c = state.c[b, n]
    pose.s = state.s[b, n]
    pose.speed = state.speed[b, n]
    pose.yaw_rate = state.yaw_rate[b, n]
    label = seen.labels[row]
    bits = np.int64(labels.bits[b, n])
    other = (label.car ^ n) | (label.segment ^ labels.segment[b, n]) | (label.at ^ labels.at[b, n])
    other |= (label.crosses ^ labels.crosses[b, n]) | (label.lane ^ labels.lane[b, n]) | (label.bits ^ bits)
    label.car = n
    label.segment = labels.segment[b, n]
    label.at = labels.at[b, n]
    label.crosses = labels.crosses[b, n]
    label.lane = labels.lane[b, n]
    label.bits = int(bits)
    return other


@jit
def blur(seen: Seen, count: int, seed: Any, trial: int, tick: int, position: float, heading: float) -> None:
    """Add normal noise to the poses seen: standard deviations `position` (m, each axis) and `heading` (rad).

    It is at most CUT of them. `neighbours` has filled the first `count` (count) rows of `seen`.
    """
    for k in range(count):
        pose, car = seen.poses[k], seen.labels[k].car
        pose.x, pose.y, pose.c, pose.s = blurred(
            Pose(pose.x, pose.y, pose.c, pose.s), seed, trial, car, tick, position, heading
        )


@jit_inline
def blurred(pose: Pose, seed: Any, trial: int, car: int, tick: int, position: float, heading: float) -> Pose:
    """Return the pose of `car` (index) with the noise of `blur`: deviations `position` (m) and `heading` (rad)."""
    c, s = sincos(heading * cut_bell(seed, trial, car, tick, DRAW.HEADING))
    return Pose(
        pose.x + position * cut_bell(seed, trial, car, tick, DRAW.POSITION),
        pose.y + position * cut_bell(seed, trial, car, tick, DRAW.POSITION + 3),
        pose.c * c - pose.s * s,
        pose.s * c + pose.c * s,
    )


@jit
def ray_box(px: float, py: float, ex: float, ey: float, box: Box) -> float:
    """Return how far the ray from (px, py) along a unit vector goes until it meets a rounded box, metres, or NEVER.

    The vector has the components `ex` (unit) and `ey` (unit). A rounded box is the union of two crossed boxes and four
    discs at the corners. 0 if the ray begins inside.
    """
    _, _, c, s, a, b, r = box
    dx = px - box.x
    dy = py - box.y
    u = dx * c + dy * s
    v = dy * c - dx * s
    eu = ex * c + ey * s
    ev = ey * c - ex * s
    best = NEVER
    if a + b > 0.0:
        best = min(_ray_slab(u, v, eu, ev, a + r, b), _ray_slab(u, v, eu, ev, a, b + r))
    if r > 0.0:
        for k in range(4):
            cu = a if k < 2 else -a
            cv = b if k % 2 == 0 else -b
            best = min(best, _ray_disc(u - cu, v - cv, eu, ev, r))
    return best


@jit
def _ray_disc(u: float, v: float, eu: float, ev: float, r: float) -> float:
    along = u * eu + v * ev
    outside = u * u + v * v - r * r
    if outside <= 0.0:
        return 0.0
    square = along * along - outside
    if along >= 0.0 or square < 0.0:
        return NEVER
    return -along - sqrt(square)


@jit
def _ray_slab(u: float, v: float, eu: float, ev: float, a: float, b: float) -> float:
    near = 0.0
    far = NEVER
    for k in range(2):
        p, e, h = (u, eu, a) if k == 0 else (v, ev, b)
        if abs(e) < 1e-12:
            if abs(p) > h:
                return NEVER
        else:
            t0 = (-h - p) / e
            t1 = (h - p) / e
            near = max(near, min(t0, t1))
            far = min(far, max(t0, t1))
    return near if near <= far else NEVER


@jit
def scan(
    b: int, viewer: int, shortest: float, longest: float, rays: Rows[Ray], ranges: Floats, around: Surroundings
) -> None:  # fmt: skip
    """Write the laser ranges of car `viewer` (index) in metres into `ranges` (R,).

    As in REP 117 of ROS, of the rays `rays` (R,) one that meets nothing within `longest` (m) reads +inf, and one that
    meets a body nearer than `shortest` (m) reads -inf.
    """
    state, cars, obstacles = around.state, around.cars, around.obstacles
    box = box_at(b, viewer, state, cars)
    for k in range(rays.shape[0]):
        ranges[k] = NEVER
    far = longest + cars.reach[b]
    for n in range(state.count[b]):
        dx = state.x[b, n] - box.x
        dy = state.y[b, n] - box.y
        if n != viewer and dx * dx + dy * dy < far * far:
            _sweep(box, box_at(b, n, state, cars), rays, ranges)
    for p in range(obstacles.off[b], obstacles.off[b + 1]):
        part = obstacles.parts[p]
        dx = part.x - box.x
        dy = part.y - box.y
        far = longest + part.reach
        if dx * dx + dy * dy < far * far:
            _sweep(box, box_of(part), rays, ranges)
    for k in range(rays.shape[0]):
        if ranges[k] > longest:
            ranges[k] = np.inf
        elif ranges[k] < shortest:
            ranges[k] = -np.inf


@jit
def _sweep(body: Box, box: Box, rays: Rows[Ray], ranges: Floats) -> None:
    """Lower each of the ranges (R,) to the distance at which its ray meets the body `box`, if that is less."""
    for k in range(rays.shape[0]):
        ray = rays[k]
        ex = ray.c * body.c - ray.s * body.s
        ey = ray.c * body.s + ray.s * body.c
        ranges[k] = min(ranges[k], ray_box(body.x, body.y, ex, ey, box))
