"""Following the ego along its own path, which a ring buffer remembers."""

from __future__ import annotations

from math import sqrt

from dubins_traffic.agents.tables import (
    AIMED,
    CURVES,
    GAP,
    LANE,
    PERIOD,
    RADIUS,
    SEEN,
    SIGHT,
    SLOWEST,
    SPEED,
    STEP,
    TRAIL,
    WRITTEN,
    YAW_RATE,
    W,
)
from dubins_traffic.kernels.arrays import Floats, Ints
from dubins_traffic.kernels.boxes import NEVER
from dubins_traffic.kernels.compile import jit
from dubins_traffic.policies.waypoint import pursue, turn_then_drive

Numbers = tuple[float, float, float, float]
JUMP = 0.5
"""An ego that comes back into sight farther than this from where it was lost has left its path, metres."""
JOIN = 0.75
"""A car begins to follow when it comes this near to the ego's path, metres (for w = 0.3 m)."""
AHEAD = 0.25
"""It drives to the point of the path about this far ahead, metres (for w = 0.3 m)."""
EASE = 0.25
"""It closes what is too much of the gap as if to do so in this time, seconds."""
STEEP = 1.0
"""Tangent of the bearing error beyond which it turns in place."""


@jit
def follow(
    tick: int,
    n: int,
    pose: Numbers,
    ego: Numbers,
    free: bool,
    build: Floats,
    ints: Ints,
    floats: Floats,
    paths: Floats,
    marks: Ints,
    lasts: Floats,
) -> tuple[bool, bool, float, float]:
    """Return whether the ego is in sight, whether the car shall drive on lanes, else its speed and yaw rate.

    A car that is not `free` only looks.
    """
    f = ints[n, TRAIL]
    path = paths[f]
    mark = marks[f]
    last = lasts[f]
    scale = build[W] / 0.3
    sight = floats[n, SIGHT]
    dx = pose[0] - ego[0]
    dy = pose[1] - ego[1]
    seen = dx * dx + dy * dy <= sight * sight
    if seen:
        observe(tick, ego[0], ego[1], STEP * scale, path, mark, last)
    if free and on_path(pose[0], pose[1], JOIN * scale, path, mark):
        ints[n, LANE] = -1
        speed, yaw_rate = track(n, pose, seen, build, floats, path, mark, last)
        return seen, False, speed, yaw_rate
    return seen, free, 0.0, 0.0


@jit
def observe(tick: int, x: float, y: float, step: float, path: Floats, mark: Ints, last: Floats) -> None:
    """Remember the ego's place; one that comes back into sight elsewhere begins a new path."""
    dx = x - last[0]
    dy = y - last[1]
    moved = sqrt(dx * dx + dy * dy)
    if mark[WRITTEN] == 0 or (moved > JUMP and tick - mark[SEEN] > 1):
        mark[WRITTEN] = 0
        mark[AIMED] = -1
        moved = 0.0
    mark[SEEN] = tick
    last[0] = x
    last[1] = y
    last[2] += moved
    newest = (mark[WRITTEN] - 1) % path.shape[0]
    if mark[WRITTEN] == 0 or last[2] - path[newest, 2] >= step:
        row = mark[WRITTEN] % path.shape[0]
        for k in range(3):
            path[row, k] = last[k]
        mark[WRITTEN] += 1
        if mark[WRITTEN] - mark[AIMED] >= path.shape[0]:
            mark[AIMED] = -1


@jit
def on_path(x: float, y: float, near: float, path: Floats, mark: Ints) -> bool:
    """Return whether the car is on the ego's path: from when any point of it is near, the newest first."""
    if mark[AIMED] < 0:
        for k in range(mark[WRITTEN] - 1, max(mark[WRITTEN] - path.shape[0], -1), -1):
            dx = path[k % path.shape[0], 0] - x
            dy = path[k % path.shape[0], 1] - y
            if dx * dx + dy * dy < near * near:
                mark[AIMED] = k
                return True
    return mark[AIMED] >= 0


@jit
def track(
    n: int, pose: Numbers, seen: bool, build: Floats, floats: Floats, path: Floats, mark: Ints, last: Floats
) -> tuple[float, float]:
    """Return (speed, yaw rate) along the ego's path; gives the path up at its end when the ego is out of sight."""
    x, y, c, s = pose
    near = max(AHEAD * build[W] / 0.3, build[RADIUS])
    aimed = mark[AIMED]
    gx, gy, d = _aim(x, y, aimed, path)
    while d < near and aimed + 1 < mark[WRITTEN]:
        aimed += 1
        gx, gy, d = _aim(x, y, aimed, path)
    mark[AIMED] = aimed
    speed = floats[n, SPEED]
    yaw = floats[n, YAW_RATE]
    if seen:
        room = last[2] - path[aimed % path.shape[0], 2] + d - floats[n, GAP]
        if room <= 0.0:
            return 0.0, 0.0
        speed = min(speed, room / max(EASE, 2.0 * build[PERIOD]))
    elif d < near:
        mark[AIMED] = -1
        mark[WRITTEN] = 0
        return 0.0, 0.0
    if build[CURVES] == 0.0:
        _, turn = turn_then_drive(x, y, c, s, gx, gy, STEEP, NEVER, speed, yaw, build[PERIOD])
        if turn != 0.0:
            return 0.0, turn
    return pursue(x, y, c, s, gx, gy, speed, build[SLOWEST], yaw, build[RADIUS])


@jit
def _aim(x: float, y: float, aimed: int, path: Floats) -> tuple[float, float, float]:
    gx = path[aimed % path.shape[0], 0]
    gy = path[aimed % path.shape[0], 1]
    return gx, gy, sqrt((gx - x) * (gx - x) + (gy - y) * (gy - y))
