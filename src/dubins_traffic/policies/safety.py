"""The last check before a tick: refuses motions that could lead to a contact or off the road (compiled)."""

from __future__ import annotations

from typing import Protocol

from dubins_traffic.cars.state import Command, Pose
from dubins_traffic.cars.tables import ObstacleTable, box_of
from dubins_traffic.kernels.boxes import Box, separation
from dubins_traffic.kernels.compile import jit, jit_inline, jit_rare
from dubins_traffic.kernels.trig import advance
from dubins_traffic.roads.lookup import nearest_segment
from dubins_traffic.roads.table import RoadTable
from dubins_traffic.rules.shape import half_extent

GUARD = 0.01
"""Gap kept in addition to the other body's worst motion, metres."""
NEAR = 0.2
"""Bodies farther away than this are ignored if they are out of reach in a tick, metres."""
VERGE = 0.02
"""Distance that an ego's centre keeps from the edge of the road, metres."""


class Mover(Protocol):
    """A car's body, a rounded box, and what it can do.

    Attributes
    ----------
    half_length, half_width, rounding, reach : float
        The box, and the farthest of its points, metres.
    slowest, fastest : float
        Its smallest and largest speed, m/s.
    yaw_most : float
        Its largest yaw rate, rad/s.
    tightest : float
        Its least turning radius, metres.
    period : float
        Seconds of a tick.
    near : float
        What is farther away than this is not looked at: no tick leads there, metres.
    late : float
        Ticks by which its commands take effect late: others move meanwhile.
    unsure, blur : float
        How far any point of it may be from where its driver expects it, and of a car from where it is seen, metres.
    """

    half_length: float
    half_width: float
    rounding: float
    reach: float
    slowest: float
    fastest: float
    yaw_most: float
    tightest: float
    period: float
    near: float
    late: float
    unsure: float
    blur: float


@jit_inline
def body_at(pose: Pose, car: Mover) -> Box:
    """Return the body of a car at a pose."""
    return Box(pose.x, pose.y, pose.c, pose.s, car.half_length, car.half_width, car.rounding)


@jit_inline
def stride_of(car: Mover) -> float:
    """Return how far a car's centre may get in a tick, metres."""
    return max(car.fastest, -car.slowest) * car.period


@jit_inline
def travel_of(car: Mover) -> float:
    """Return how far any point of another car may get until the tick of a command is over, metres.

    It includes how wrongly both are seen.
    """
    travel = stride_of(car)
    if car.half_length > 0.0:
        travel += car.yaw_most * car.reach * car.period
    return travel * (1.0 + car.late) + (car.unsure + car.blur)


@jit_rare
def leaves_road(pose: Pose, command: Command, period: float, roads: RoadTable, net: int) -> bool:
    """Tell whether a motion for one tick takes the centre to VERGE from the road's edge, or farther beyond that."""
    edge = float(roads.half_width[net]) - VERGE
    nx, ny, _, _ = advance(pose.x, pose.y, pose.c, pose.s, command.speed, command.yaw_rate, period)
    _, after = nearest_segment(roads, net, nx, ny)
    if after <= edge * edge:
        return False
    _, before = nearest_segment(roads, net, pose.x, pose.y)
    return after >= before


@jit
def motion_is_safe(pose: Pose, command: Command, car: Mover, other: Box, travel: float) -> bool:
    """Tell whether a motion of a car for one tick can't touch another body, or leads away from it.

    No point of the other gets farther than `travel` (m) in the tick, 0 if it can't move. Where a rectangle and another
    that moves are close, that is not enough: see `keeps_clear`.

    Notes
    -----
    A car that stands is never at fault in a collision, and neither is one that moves away.
    """
    driven = moved_by(command, car)
    if driven == 0.0:
        return True
    gap, least, last = gaps(pose, command, car, other, driven + travel + GUARD)
    return least > travel + GUARD or (least == gap and last - gap > 0.2 * driven)


@jit_inline
def keeps_clear(pose: Pose, command: Command, car: Mover, other: Box, travel: float) -> bool:
    """Tell whether a motion keeps a car from all that another may reach in the tick, or closes in on it in no contact.

    Of a rectangle that turns a corner may swing toward the other while the gap grows, and the other may come to touch
    another side: so only one that drives straight on may be touched (`slides_on`). `travel` (m) is as in
    `motion_is_safe`. All cars are alike.
    """
    driven = moved_by(command, car)
    _, least, _ = gaps(pose, command, car, other, driven + travel + GUARD)
    if driven == 0.0 or least > travel + GUARD:
        return True
    if car.half_length == 0.0:
        return stays_ahead(pose, command, car, other, travel)
    return command.yaw_rate == 0.0 and slides_on(pose, command.speed, car, other)


@jit_inline
def stays_ahead(pose: Pose, command: Command, car: Mover, other: Box, travel: float) -> bool:
    """Tell whether all that another disc may have reached lies behind a disc's centre, throughout a tick.

    Then the disc closes in on it in no contact. How far behind the other's nearest reach is, f, is found at five times;
    between two of them it is less by T^2/128 sup |f"| at most (linear interpolation), where |f"| <= w^2 d + |w v|, with
    the yaw rate w, the speed v and the distance d of the centres. `travel` (m) is as in `motion_is_safe`.
    """
    way = 1.0 if command.speed > 0.0 else -1.0
    turn, own = abs(command.yaw_rate) * car.period, abs(command.speed) * car.period
    x, y, c, s = pose
    dx, dy = other.x - x, other.y - y
    between = turn * (turn * (abs(dx) + abs(dy) + own) + own) / 128.0
    stride = stride_of(car)
    for k in range(5):
        nx, ny, nc, ns = advance(x, y, c, s, command.speed, command.yaw_rate, 0.25 * k * car.period)
        gone = 0.25 * k * stride + (travel - stride)
        if way * ((other.x - nx) * nc + (other.y - ny) * ns) + gone + between > 0.0:
            return False
    return True


@jit_rare
def slides_on(pose: Pose, speed: float, car: Mover, other: Box) -> bool:
    """Tell whether all that another car may reach in a tick lies behind a rectangle's front, or beside its way.

    The rectangle drives straight at `speed` (m/s), its front is where it drives: what touches its sides or its rear
    meanwhile is at fault alone (docs/rules.md#at-fault).
    """
    turn = min(car.yaw_most * car.period * (1.0 + car.late), 1.0)
    far = car.half_length + stride_of(car) * (1.0 + car.late) + 2.0 * car.unsure
    long, broad = far + car.half_width * turn, car.half_width + far * turn
    reach = Box(other.x, other.y, other.c, other.s, long, broad, 0.0)
    dx, dy = other.x - pose.x, other.y - pose.y
    ahead, aside = dx * pose.c + dy * pose.s, abs(dy * pose.c - dx * pose.s)
    ahead = ahead if speed > 0.0 else -ahead
    behind = ahead + half_extent(-pose.s, pose.c, other.c, other.s, reach) + GUARD <= car.half_length
    return behind or aside - half_extent(pose.c, pose.s, other.c, other.s, reach) >= car.half_width + GUARD


@jit_inline
def moved_by(command: Command, car: Mover) -> float:
    """Return how far the farthest point of a car gets in a tick, metres, at most."""
    turns = abs(command.yaw_rate) * car.reach if car.half_length + car.half_width > 0.0 else 0.0
    return (abs(command.speed) + turns) * car.period


@jit
def gaps(pose: Pose, command: Command, car: Mover, other: Box, far: float) -> tuple[float, float, float]:
    """Return the gap between a car and another body before a tick, the least of five in it, and that after it, metres.

    The other stands. Where the first is more than `far` (m), all three are that one.
    """
    x, y, c, s = pose
    gap, _, _, _, _ = separation(body_at(pose, car), other)
    least = gap
    last = gap
    if gap > far:
        return gap, least, last
    for k in range(1, 5):
        nx, ny, nc, ns = advance(x, y, c, s, command.speed, command.yaw_rate, 0.25 * k * car.period)
        last, _, _, _, _ = separation(body_at(Pose(nx, ny, nc, ns), car), other)
        least = min(least, last)
    return gap, least, last


@jit_inline
def may_meet(pose: Pose, command: Command, car: Mover, other: Pose, travel: float) -> bool:
    """Tell whether a motion for one tick might touch a car of the same kind at a pose, if that is within `car.near`.

    The rest is as in `keeps_clear`; `travel` (m).
    """
    dx = other.x - pose.x
    dy = other.y - pose.y
    far = 2.0 * car.reach + car.near
    return dx * dx + dy * dy < far * far and not keeps_clear(pose, command, car, body_at(other, car), travel)


@jit_inline
def may_hit(
    b: int, pose: Pose, command: Command, car: Mover, obstacles: ObstacleTable, near: float, spread: float
) -> bool:
    """Tell whether a motion for one tick might touch an obstacle of trial b.

    Looked at are those within `near` (m) of what the car reaches; each is kept clear by `spread` (m) more than GUARD.
    The rest is as in `motion_is_safe`.
    """
    for k in range(obstacles.off[b], obstacles.off[b + 1]):
        part = obstacles.parts[k]
        dx = part.x - pose.x
        dy = part.y - pose.y
        far = car.reach + part.reach + near
        is_near = dx * dx + dy * dy < far * far
        if is_near and not motion_is_safe(pose, command, car, box_of(part), spread):
            return True
    return False
