"""Following the ego along its own path, which a ring buffer remembers."""

from __future__ import annotations

from math import sqrt

from dubins_traffic.agents.tables import STEP, Agent, Agents, Point, Team, Trail
from dubins_traffic.cars.state import Command, Pose
from dubins_traffic.kernels.boxes import NEVER
from dubins_traffic.kernels.compile import jit
from dubins_traffic.kernels.records import Rows
from dubins_traffic.policies.waypoint import pursue, turn_then_drive

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
    tick: int, b: int, n: int, pose: Pose, ego: Pose, free: bool, agents: Agents
) -> tuple[bool, bool, float, float]:
    """Return whether the ego is in sight, whether the car shall drive on lanes, else its speed and yaw rate.

    A car that is not `free` (bool) only looks.
    """
    team, agent = agents.team[b], agents.agent[b, n]
    path, f = agents.point, agent.trail
    trail = agents.trail[f]
    scale = team.w / 0.3
    sight = agent.sight
    dx = pose.x - ego.x
    dy = pose.y - ego.y
    seen = dx * dx + dy * dy <= sight * sight
    if seen:
        observe(tick, ego.x, ego.y, STEP * scale, path, f, trail)
    if free and on_path(pose.x, pose.y, JOIN * scale, path, f, trail):
        agent.lane = -1
        speed, yaw_rate = track(pose, seen, team, agent, path, f, trail)
        return seen, False, speed, yaw_rate
    return seen, free, 0.0, 0.0


@jit
def observe(tick: int, x: float, y: float, step: float, path: Rows[Point], f: int, trail: Trail) -> None:
    """Remember the ego's place on path `f` (row), each `step` (m); one that comes back elsewhere begins a new path."""
    dx = x - trail.x
    dy = y - trail.y
    moved = sqrt(dx * dx + dy * dy)
    if trail.written == 0 or (moved > JUMP and tick - trail.seen > 1):
        trail.written = 0
        trail.aimed = -1
        moved = 0.0
    driven = trail.driven + moved
    trail.seen = tick
    trail.x = x
    trail.y = y
    trail.driven = driven
    written = trail.written
    newest = (written - 1) % path.shape[1]
    if written == 0 or driven - path[f, newest].driven >= step:
        point = path[f, written % path.shape[1]]
        point.x = x
        point.y = y
        point.driven = driven
        trail.written = written + 1
        if written + 1 - trail.aimed >= path.shape[1]:
            trail.aimed = -1


@jit
def on_path(x: float, y: float, near: float, path: Rows[Point], f: int, trail: Trail) -> bool:
    """Return whether the car is on path `f` (row): from when any point of it is within `near` (m), the newest first."""
    if trail.aimed < 0:
        written = trail.written
        for k in range(written - 1, max(written - path.shape[1], -1), -1):
            point = path[f, k % path.shape[1]]
            dx = point.x - x
            dy = point.y - y
            if dx * dx + dy * dy < near * near:
                trail.aimed = k
                return True
    return trail.aimed >= 0


@jit
def track(
    pose: Pose, seen: bool, team: Team, agent: Agent, path: Rows[Point], f: int, trail: Trail
) -> tuple[float, float]:
    """Return (speed, yaw rate) along path `f` (row); gives it up at its end when the ego is not `seen` (bool)."""
    x, y = pose.x, pose.y
    near = max(AHEAD * team.w / 0.3, team.radius)
    aimed = trail.aimed
    gx, gy, d = _aim(x, y, aimed, path, f)
    while d < near and aimed + 1 < trail.written:
        aimed += 1
        gx, gy, d = _aim(x, y, aimed, path, f)
    trail.aimed = aimed
    speed = agent.speed
    yaw = agent.yaw_rate
    if seen:
        room = trail.driven - path[f, aimed % path.shape[1]].driven + d - agent.gap
        if room <= 0.0:
            return 0.0, 0.0
        speed = min(speed, room / max(EASE, 2.0 * team.period))
    elif d < near:
        trail.aimed = -1
        trail.written = 0
        return 0.0, 0.0
    most = Command(speed, yaw)
    if team.curves == 0:
        _, turn = turn_then_drive(pose, gx, gy, most, STEEP, NEVER, team.period)
        if turn != 0.0:
            return 0.0, turn
    return pursue(pose, gx, gy, most, team.slowest, team.radius)


@jit
def _aim(x: float, y: float, aimed: int, path: Rows[Point], f: int) -> tuple[float, float, float]:
    point = path[f, aimed % path.shape[1]]
    gx = point.x
    gy = point.y
    return gx, gy, sqrt((gx - x) * (gx - x) + (gy - y) * (gy - y))
