"""Following the ego along its own path, which a ring buffer holds (compiled)."""

from __future__ import annotations

from math import sqrt

from dubins_traffic.agents.tables import STEP, Agent, Agents, Point, Team, Trail
from dubins_traffic.cars.sensing import within_sight
from dubins_traffic.cars.state import Command, Pose
from dubins_traffic.kernels.compile import jit
from dubins_traffic.kernels.records import Rows
from dubins_traffic.policies.waypoint import turn_or_pursue

JUMP = 0.5
"""If the ego comes back into sight farther than this from where it was lost, a new path begins, metres."""
JOIN = 0.75
"""A car begins to follow when it comes this near to the ego's path, metres (for w = 0.3 m)."""
AHEAD = 0.25
"""The car drives to the point of the path about this far ahead, metres (for w = 0.3 m)."""
EASE = 0.25
"""Time constant with which the car closes a gap that is too large, seconds."""


@jit
def follow(
    tick: int, b: int, n: int, pose: Pose, ego: Pose, free: bool, agents: Agents
) -> tuple[bool, bool, float, float]:
    """Return (ego in sight, car drives on lanes, speed, yaw rate); speed and yaw rate count if it does not.

    A car that is not `free` (bool) to move only observes the ego.
    """
    team, agent = agents.team[b], agents.agent[b, n]
    path, f = agents.point, agent.trail
    trail = agents.trail[f]
    scale = team.w / 0.3
    sight = agent.sight
    dx = pose.x - ego.x
    dy = pose.y - ego.y
    seen = within_sight(dx, dy, sight * sight)
    if seen:
        observe(tick, ego.x, ego.y, STEP * scale, path, f, trail)
    if free and on_path(pose.x, pose.y, JOIN * scale, path, f, trail):
        agent.lane = -1
        speed, yaw_rate = track(pose, seen, team, agent, path, f, trail)
        return seen, False, speed, yaw_rate
    return seen, free, 0.0, 0.0


@jit
def observe(tick: int, x: float, y: float, step: float, path: Rows[Point], f: int, trail: Trail) -> None:
    """Append the ego's place to path `f` (row), every `step` (m); begin a new path if it reappears elsewhere."""
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
    """Tell whether the car is on path `f` (row): it is once any point, the newest first, is within `near` (m)."""
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
    """Return (speed, yaw rate) along path `f` (row); at its end leave the path if the ego is not `seen` (bool)."""
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
    return turn_or_pursue(pose, gx, gy, most, team.slowest, team.radius, team.period)


@jit
def _aim(x: float, y: float, aimed: int, path: Rows[Point], f: int) -> tuple[float, float, float]:
    point = path[f, aimed % path.shape[1]]
    gx = point.x
    gy = point.y
    return gx, gy, sqrt((gx - x) * (gx - x) + (gy - y) * (gy - y))
