"""Following a path: where a car is on it, what lies ahead, and the command that keeps it there.

A car may follow at an offset to the left of the path.
"""

from __future__ import annotations

from math import sqrt

from dubins_traffic.cars.state import Command, Pose
from dubins_traffic.kernels.compile import jit
from dubins_traffic.kernels.trig import advance
from dubins_traffic.policies.lanes.knowledge import Knowledge
from dubins_traffic.policies.lanes.paths import PathRow
from dubins_traffic.policies.safety import Mover
from dubins_traffic.policies.waypoint import pursue


@jit
def place_on(piece: PathRow, sigma: float) -> tuple[float, float, float, float]:
    """Return point and unit tangent of a path `sigma` (m) after the start of a piece (beyond it: continued)."""
    bend = piece.bend
    if bend != 0.0:
        sigma = min(max(sigma, -0.5 / abs(bend)), 0.5 / abs(bend))
    return advance(piece.x, piece.y, piece.c, piece.s, 1.0, bend, sigma)


@jit
def project(piece: PathRow, sigma: float, x: float, y: float) -> tuple[float, float]:
    """Return (sigma, left): metres along a piece and left of it, by two Newton steps from `sigma` (m)."""
    left = 0.0
    for _ in range(2):
        px, py, tx, ty = place_on(piece, sigma)
        left = (y - py) * tx - (x - px) * ty
        along = (x - px) * tx + (y - py) * ty
        sigma += along / max(1.0 - piece.bend * left, 0.25)
    return sigma, left


@jit
def next_row(row: int, known: Knowledge) -> int:
    """Return the row of the path after `row` (row)."""
    return row + 1 if row + 1 < known.path.shape[0] else known.follower.loop


@jit
def locate(known: Knowledge) -> float:
    """Bring the ego's place on its path up to date; return the metres along the path since, negative backwards."""
    travelled = 0.0
    ego = known.follower
    for _ in range(6):
        piece = known.path[ego.row]
        sigma = ego.sigma
        now, left = project(piece, sigma, ego.x, ego.y)
        early = known.manner.reached if piece.pivot != 0 else 0.0
        if now >= piece.length - early:
            travelled += piece.length - sigma
            ego.row = next_row(ego.row, known)
            ego.sigma = 0.0
        elif now < -0.01 and sigma <= 0.0 and ego.row > 0 and known.path[ego.row - 1].pivot == 0:
            ego.row -= 1
            ego.sigma = known.path[ego.row].length - 1e-6
        else:
            if ego.row > 0:
                now = max(now, min(sigma, 0.0))
            ego.sigma = now
            ego.left = left
            return travelled + now - sigma
    ego.left = 0.0
    return travelled


@jit
def ahead_on(known: Knowledge, row: int, sigma: float, corners: bool) -> tuple[int, float]:
    """Return (row, sigma) of the place `sigma` (m) after the start of `row` (row).

    With `corners` (whether they count) it is not beyond the next corner, where the piece is continued instead.
    """
    for _ in range(64):
        piece = known.path[row]
        if sigma <= piece.length or (corners and piece.pivot != 0):
            break
        sigma -= piece.length
        row = next_row(row, known)
    return row, sigma


@jit
def steer(pose: Pose, goal_x: float, goal_y: float, speed: float, car: Mover) -> tuple[float, float, bool]:
    """Return (speed, yaw rate, turns) of the arc through (`goal_x` (m), `goal_y` (m)), or of a turn in place.

    A car turns in place while the point lies more than 60 degrees off its heading. Backwards (`speed` < 0) the
    point should lie behind. The speed falls where the arc asks for too large a yaw rate.
    """
    way = -1.0 if speed < 0.0 else 1.0
    pose = Pose(pose.x, pose.y, way * pose.c, way * pose.s)
    dx = goal_x - pose.x
    dy = goal_y - pose.y
    d2 = dx * dx + dy * dy
    if d2 < 1e-12:
        return speed, 0.0, False
    if pose.c * dx + pose.s * dy < 0.5 * sqrt(d2):
        turn = car.yaw_most if pose.c * dy - pose.s * dx >= 0.0 else -car.yaw_most
        return 0.0, turn if speed >= 0.0 else 0.0, speed >= 0.0
    speed, yaw_rate = pursue(pose, goal_x, goal_y, Command(way * speed, car.yaw_most), 0.0, car.tightest)
    return way * speed, yaw_rate, False
