"""Driving to a point: the turn-then-drive law of 2016, and the curve law for cars that can't turn in place."""

from __future__ import annotations

from math import sqrt

from dubins_traffic.cars.state import Command, Pose
from dubins_traffic.kernels.arrays import INFINITE
from dubins_traffic.kernels.compile import jit

STEEP = 1.0
"""Tangent of the bearing error beyond which a car that drives curves turns in place, if it can."""


@jit
def turn_then_drive(
    pose: Pose, goal_x: float, goal_y: float, most: Command, tangent: float, miss: float, period: float
) -> tuple[float, float]:
    """Return (speed, yaw rate): turn in place while the bearing error is too large, else drive straight.

    Parameters
    ----------
    pose : Pose
        Of the car.
    goal_x, goal_y : float
        The point to drive to, metres.
    most : Command
        How fast to drive (m/s) and to turn (rad/s).
    tangent : float
        Tangent of the bearing error beyond which the car turns, in rad.
    miss : float
        Largest lateral distance of the goal from the line ahead, metres, that is left alone: it tightens the
        tolerance for goals farther than ``miss / tangent``. Infinite for the plain law.
    period : float
        Seconds of a tick. Neither motion overshoots within a tick, so the law works at any control rate; where
        ``yaw_rate * period`` is below the tolerance, as at 30 Hz, this changes nothing.

    Notes
    -----
    With the goal straight behind, the car turns right, as in 2016 (an error of pi is wrapped to -pi).
    """
    speed, yaw_rate = most
    dx = goal_x - pose.x
    dy = goal_y - pose.y
    ahead = pose.c * dx + pose.s * dy
    left = pose.c * dy - pose.s * dx
    if ahead > 0.0 and abs(left) <= min(tangent * ahead, miss):
        return speed if speed * period <= ahead else ahead / period, 0.0
    if ahead <= 0.0 and left == 0.0:
        if ahead == 0.0:
            return 0.0, 0.0
        return 0.0, -yaw_rate
    turn = yaw_rate
    if ahead > 0.0:
        whole = period * sqrt(ahead * ahead + left * left)
        turn = yaw_rate if yaw_rate * whole <= abs(left) else abs(left) / whole
    return 0.0, turn if left > 0.0 else -turn


@jit
def turn_or_pursue(
    pose: Pose, goal_x: float, goal_y: float, most: Command, slowest: float, radius: float, period: float
) -> tuple[float, float]:
    """Return (speed, yaw rate): as `pursue`, but a car without a turning `radius` (m) turns in place to what is aside.

    The goal is (`goal_x` (m), `goal_y` (m)), `slowest` (m/s) the least speed; the rest is as for `turn_then_drive`.
    """
    if radius == 0.0:
        _, turn = turn_then_drive(pose, goal_x, goal_y, most, STEEP, INFINITE, period)
        if turn != 0.0:
            return 0.0, turn
    return pursue(pose, goal_x, goal_y, most, slowest, radius)


@jit
def pursue(
    pose: Pose, goal_x: float, goal_y: float, most: Command, slowest: float, radius: float
) -> tuple[float, float]:
    """Return (speed, yaw rate) of the arc through the goal that leaves along the heading (pure pursuit).

    The goal is (`goal_x` (m), `goal_y` (m)). The arc is never tighter than `radius` (m; 0: any, down to a millimetre);
    with the goal behind, the tightest one is taken, to the left when it lies straight behind. `most` (m/s and rad/s)
    says how fast to drive and to turn; where the arc asks for a larger yaw rate, the car slows, to `slowest` (m/s) at
    least.

    Source: R. C. Coulter, "Implementation of the pure pursuit path tracking algorithm", CMU-RI-TR-92-01, 1992.
    """
    speed, yaw_rate = most
    dx = goal_x - pose.x
    dy = goal_y - pose.y
    d2 = dx * dx + dy * dy
    if d2 <= 0.0:
        return speed, 0.0
    ahead = pose.c * dx + pose.s * dy
    left = pose.c * dy - pose.s * dx
    sharpest = 1.0 / max(radius, 1e-3)
    bend = min(2.0 * abs(left) / d2, sharpest)
    if ahead < 0.0:
        bend = sharpest
    if bend * speed > yaw_rate:
        speed = max(yaw_rate / bend, slowest)
    turn = min(bend * speed, yaw_rate)
    return speed, turn if left >= 0.0 else -turn
