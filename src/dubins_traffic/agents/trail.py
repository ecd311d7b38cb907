"""Following the ego along its own path, which a ring buffer remembers."""

from __future__ import annotations

from math import sqrt

from dubins_traffic.agents.tables import (
    CURVES,
    PERIOD,
    RADIUS,
    SLOWEST,
    SPEED,
    STEP,
    YAW_RATE,
    Cast,
    Memory,
    W,
)
from dubins_traffic.cars.state import State
from dubins_traffic.driving.waypoint import pursue, turn_then_drive
from dubins_traffic.kernels.boxes import NEVER
from dubins_traffic.kernels.compile import jit

WRITTEN, AIMED, SEEN = range(3)
JUMP = 0.5
"""An ego that comes back into sight farther than this from where it was lost has left its path, metres."""
JOIN = 0.5
"""A car begins to follow when it comes this near to the ego's path, metres (for w = 0.3 m)."""
AHEAD = 0.25
"""It drives to the point of the path about this far ahead, metres (for w = 0.3 m)."""
EASE = 0.25
"""Seconds in which it would close what is too much of the gap, at the speed it then drives."""
WIDEST = 1.0
"""Tangent of the bearing error beyond which it turns in place."""


@jit
def observe(tick: int, state: State, b: int, n: int, cast: Cast, memory: Memory) -> bool:
    """Remember the ego's path; return whether the ego is in sight."""
    f = memory.trail[b, n]
    x = state.x[b, 0]
    y = state.y[b, 0]
    dx = state.x[b, n] - x
    dy = state.y[b, n] - y
    if dx * dx + dy * dy > cast.sight[b, n] * cast.sight[b, n]:
        return False
    last = memory.last[f]
    mark = memory.mark[f]
    path = memory.path[f]
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
    newest = path[(mark[WRITTEN] - 1) % path.shape[0]]
    if mark[WRITTEN] == 0 or last[2] - newest[2] >= STEP * cast.build[b, W] / 0.3:
        row = path[mark[WRITTEN] % path.shape[0]]
        row[0] = x
        row[1] = y
        row[2] = last[2]
        mark[WRITTEN] += 1
        if mark[WRITTEN] - mark[AIMED] >= path.shape[0]:
            mark[AIMED] = -1
    return True


@jit
def on_path(state: State, b: int, n: int, cast: Cast, memory: Memory) -> bool:
    """Return whether the car is on the ego's path: from when it comes near any point of it, the newest first."""
    f = memory.trail[b, n]
    if memory.mark[f, AIMED] >= 0:
        return True
    path = memory.path[f]
    written = memory.mark[f, WRITTEN]
    near = JOIN * cast.build[b, W] / 0.3
    for k in range(written - 1, max(written - path.shape[0], -1), -1):
        row = path[k % path.shape[0]]
        dx = row[0] - state.x[b, n]
        dy = row[1] - state.y[b, n]
        if dx * dx + dy * dy < near * near:
            memory.mark[f, AIMED] = k
            memory.lane[b, n] = -1
            return True
    return False


@jit
def track(state: State, b: int, n: int, seen: bool, cast: Cast, memory: Memory) -> tuple[float, float]:
    """Return (speed, yaw rate) along the ego's path; gives the path up at its end when the ego is out of sight."""
    f = memory.trail[b, n]
    x = state.x[b, n]
    y = state.y[b, n]
    path = memory.path[f]
    newest = memory.mark[f, WRITTEN] - 1
    aimed = memory.mark[f, AIMED]
    near = max(AHEAD * cast.build[b, W] / 0.3, cast.build[b, RADIUS])
    while True:
        row = path[aimed % path.shape[0]]
        dx = row[0] - x
        dy = row[1] - y
        d = sqrt(dx * dx + dy * dy)
        if d >= near or aimed == newest:
            break
        aimed += 1
    memory.mark[f, AIMED] = aimed
    speed = cast.law[b, n, SPEED]
    if seen:
        room = memory.last[f, 2] - row[2] + d - cast.gap[b, n]
        if room <= 0.0:
            return 0.0, 0.0
        speed = min(speed, room / max(EASE, 2.0 * cast.build[b, PERIOD]))
    elif d < near:
        memory.mark[f, AIMED] = -1
        memory.mark[f, WRITTEN] = 0
        return 0.0, 0.0
    c = state.c[b, n]
    s = state.s[b, n]
    yaw_rate = cast.law[b, n, YAW_RATE]
    if cast.build[b, CURVES] == 0.0:
        _, turn = turn_then_drive(
            x, y, c, s, row[0], row[1], WIDEST, NEVER, speed, yaw_rate, cast.build[b, PERIOD]
        )
        if turn != 0.0:
            return 0.0, turn
    return pursue(x, y, c, s, row[0], row[1], speed, cast.build[b, SLOWEST], yaw_rate, cast.build[b, RADIUS])
