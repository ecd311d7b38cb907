"""Which e-agents must stand: those with a body near in the sector that the laser of 2016 covers (compiled)."""

from __future__ import annotations

from math import sqrt

from dubins_traffic.agents.tables import HELD, Agent, Scene, Team
from dubins_traffic.cars.near import candidates
from dubins_traffic.cars.state import Pose
from dubins_traffic.cars.tables import box_of
from dubins_traffic.kernels.boxes import Box, nearest_in_box, separation
from dubins_traffic.kernels.compile import jit

COS_EDGE = -0.4161468365471424
SIN_EDGE = 0.9092974268256817
"""Cosine and sine of 2.0 rad, the edge of the sector on either side of the heading."""
ELBOW = 0.1
"""Length of the strip ahead that a car whose patience has ended keeps free, beyond what it drives in a tick, metres."""
SHOULDER = 0.03
"""Width of the strip to either side of the body that such a car keeps free, metres."""


@jit
def sees(x: float, y: float, c: float, s: float, stop: float, box: Box) -> bool:
    """Tell whether a rounded box has a point nearer than `stop` (m) to (x, y) and at most 2.0 rad off the heading.

    Exact: either the point of the box that is nearest lies in the sector, or else the nearest one in the sector
    lies on one of the sector's edges.
    """
    r = box.rounding
    px, py = nearest_in_box(x, y, box)
    dx = px - x
    dy = py - y
    d = sqrt(dx * dx + dy * dy)
    if d - r >= stop:
        return False
    if d <= r or c * dx + s * dy >= COS_EDGE * d:
        return True
    half = 0.5 * stop
    for side in range(2):
        sine = SIN_EDGE if side == 0 else -SIN_EDGE
        ec = c * COS_EDGE - s * sine
        es = s * COS_EDGE + c * sine
        edge = Box(x + half * ec, y + half * es, ec, es, half, 0.0, 0.0)
        gap, _, _, _, _ = separation(edge, box)
        if gap < 0.0:
            return True
    return False


@jit
def in_way(pose: Pose, front: float, side: float, box: Box) -> bool:
    """Tell whether a rounded box meets the strip from a pose to `front` (m) ahead, `side` (m) to either side."""
    x, y, c, s = pose
    half = 0.5 * front
    gap, _, _, _, _ = separation(Box(x + half * c, y + half * s, c, s, half, side, 0.0), box)
    return gap <= 0.0


@jit
def consider(pose: Pose, team: Team, agent: Agent, box: Box) -> int:
    """Return the bits of HELD with which one body holds a car at a pose."""
    x, y, c, s = pose
    stop = agent.stop
    if not sees(x, y, c, s, stop, box):
        return 0
    if agent.patience < 0:
        return HELD.SEES
    bits = HELD.SEES
    half_length, rounding = team.half_length, team.rounding
    front = half_length + rounding + ELBOW + agent.speed * team.period
    side = team.half_width + rounding + SHOULDER
    if in_way(pose, front, side, box):
        bits |= HELD.BARRED
    if half_length > 0.0:
        px, py = nearest_in_box(x, y, box)
        room = team.span - stop + SHOULDER + box.rounding
        if (px - x) * (px - x) + (py - y) * (py - y) < room * room:
            bits |= HELD.TIGHT
    return bits


@jit
def look(scene: Scene, b: int) -> int:
    """Set `Workspace.held` of each car of trial b by the bodies near it.

    Returns the number of pairs of bodies near each other; if it exceeds the buffer of pairs, `held` is not set.
    """
    state, obstacles, work = scene.state, scene.obstacles, scene.space
    team = scene.agents.team[b]
    agents = scene.agents.agent
    span = team.span
    seen = candidates(b, span, span, state, obstacles, work.search)
    if seen > work.search.pair.shape[0]:
        return seen
    for n in range(state.count[b]):
        work.held[n] = 0
    p = team.half_length
    q = team.half_width
    r = team.rounding
    for k in range(seen):
        i = work.search.pair[k].one
        j = work.search.pair[k].other
        pose = Pose(state.x[b, i], state.y[b, i], state.c[b, i], state.s[b, i])
        if j < 0:
            work.held[i] |= consider(pose, team, agents[b, i], box_of(obstacles.parts[-1 - j]))
            continue
        other = Pose(state.x[b, j], state.y[b, j], state.c[b, j], state.s[b, j])
        for _ in range(2):
            if work.held[i] == 0 or agents[b, i].patience >= 0:
                box = Box(other.x, other.y, other.c, other.s, p, q, r)
                work.held[i] |= consider(pose, team, agents[b, i], box)
            i, j = j, i
            pose, other = other, pose
    return seen
