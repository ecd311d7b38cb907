"""Steering to a line: the command toward it, staying right of the centre line, the last check (compiled)."""

from __future__ import annotations

from math import sqrt
from typing import NamedTuple

import numpy as np

from dubins_traffic.cars.state import EGO, Command, Pose
from dubins_traffic.kernels.arrays import Floats
from dubins_traffic.kernels.compile import jit, jit_inline, jit_rare
from dubins_traffic.policies.rules.narrow import within_lane
from dubins_traffic.policies.rules.passing import WARY, along, aside
from dubins_traffic.policies.rules.returning import NARROWLY, last_return
from dubins_traffic.policies.rules.seeing import ABRUPT, ASTRAY
from dubins_traffic.policies.rules.standing import becomes_left, may_drive_on, stays_right
from dubins_traffic.policies.rules.tables import KIND, VIOLATION, Traffic, Vehicle
from dubins_traffic.policies.rules.turn_arcs import ReferencePath
from dubins_traffic.policies.safety import GUARD, may_hit, may_meet, travel_of
from dubins_traffic.roads.lookup import INFINITE
from dubins_traffic.rules.propositions import FLAG

HURRY, WIDE = 0.25, 0.4
"""Distance in which a car returns to its way: the greater of metres and units of its turning radius."""
SLANT, STEEP = 0.7, 0.9
"""Sine of the largest angle to its way at which a car drives: in general; and when it pulls out or has to return."""
ALIGNED, NIMBLE = 0.8, 0.98
"""Cosine of the angle to where it should head beyond which a car turns in place; the same when it pulls out."""
CREEPS, SLIDES = 0.05, 0.2
"""A car that has to return and may not drive faster than the first goes straight to the right at the second, m/s. At
that a rectangle in a disc backs away from who is so close before it that it can't drive otherwise."""
CLOSE = 0.002
"""Least distance from the disc ahead at which it does so right of the centre line, metres."""
EXACT = 0.9999
"""Cosine of the angle to that direction within which it drives."""
SQUARE = 0.999
"""Sine of the angle at which it does."""
SLIGHT = 0.1
"""A car farther from its way than this, metres, drives on straight where another one bars its way back: else it would
turn to it and stand there for good."""
GAIN = 8.0
"""Yaw rate for each unit of the sine of that angle, 1/s."""


class Line(NamedTuple):
    """The line that a car drives along: its offset to the left of it, m, the line's direction, and the speed, m/s."""

    left: float
    px: float
    py: float
    speed: float


class Motion(NamedTuple):
    """A command, m/s and rad/s, and whether it is safe."""

    speed: float
    yaw_rate: float
    safe: bool


@jit_inline
def move(
    b: int, n: int, allowed: float, left: float, offset: float, px: float, py: float, bend: float, outside: bool,
    way: ReferencePath, near: int, trusted: int, traffic: Traffic,
) -> tuple[float, float]:  # fmt: skip
    """Return the command that leads to the line `offset` to the left of the way, if it is safe and lawful.

    It is driven at the speed `allowed` (m/s) at most.
    """
    state, labels, drivers = traffic.state, traffic.labels, traffic.drivers
    vehicle = drivers.vehicle[b]
    c, s, limit = state.c[b, n], state.s[b, n], vehicle.yaw_most
    passes = drivers.car[b, n].aside != 0.0
    steep = STEEP if passes or np.int64(labels.bits[b, n]) & FLAG.LEFT != 0 else SLANT
    if not outside and left - offset > ASTRAY:
        steep = ABRUPT
    aligned = NIMBLE if passes and left < offset else ALIGNED
    allowed = slowed(allowed, bend, limit)
    speed, yaw_rate = steer(
        c, s, left - offset, px, py, bend, allowed, steep, aligned, limit, vehicle.tightest, vehicle.period
    )
    if passes or vehicle.tightest > 0.0:
        speed, yaw_rate = keep_right(b, n, speed, yaw_rate, outside, way, traffic)
    safe = is_safe(b, n, speed, yaw_rate, near, trusted, traffic, vehicle)
    # A car that turns in place to where it may not drive would turn back in the next tick, and so on for ever.
    leans = offset < 0.0 or (offset > 0.0 and not (passes or outside))
    off_line = leans or abs(left) > SLIGHT
    if safe and speed == 0.0 and vehicle.tightest == 0.0 and (passes or steep == ABRUPT or off_line):
        safe = leads_on(b, n, Line(left - offset, px, py, allowed), steep, near, trusted, traffic)
    returns = outside and offset == 0.0 and np.int64(labels.bits[b, n]) & FLAG.LEFT != 0
    if returns and (near > 0 or allowed < CREEPS) and vehicle.tightest == 0.0:
        motion = Motion(speed, yaw_rate, safe)
        speed, yaw_rate, safe = come_back(b, n, motion, Line(left, px, py, allowed), way, near, traffic)
    if not safe and offset == 0.0 and (passes or returns or abs(left) > SLIGHT):
        if returns or (outside and left > max(SLIGHT, vehicle.middle - vehicle.reach)):
            allowed = min(allowed, room_to_return(b, n, way, traffic) / vehicle.period)
        speed, yaw_rate = steer(
            c, s, 0.0, px, py, bend, allowed, steep, aligned, limit, vehicle.tightest, vehicle.period
        )
        safe = is_safe(b, n, speed, yaw_rate, near, trusted, traffic, vehicle)
        if outside and not (passes or returns):
            # Close to the centre line who leans to the left turns straight first, and drives on then.
            safe = safe and not becomes_left(b, n, speed, yaw_rate, way, traffic)
    elif not safe and (passes or steep == ABRUPT or leans):
        across, narrow = 1.0 if left > offset else -1.0, within_lane(drivers.car[b, n].aside, vehicle)
        if leans and not passes and across * offset > 0.0:
            # Who leans past a body and is farther from it than he would be drives straight on, and not up to it.
            across = 0.0
        speed, yaw_rate = steer(
            c, s, across, px, py, bend, allowed, NIMBLE if narrow else SQUARE, aligned, limit, vehicle.tightest,
            vehicle.period,
        )  # fmt: skip
        if passes:
            speed, yaw_rate = keep_right(b, n, speed, yaw_rate, outside, way, traffic)
        safe = is_safe(b, n, speed, yaw_rate, near, trusted, traffic, vehicle)
        if passes and outside and vehicle.tightest == 0.0:
            line = Line(across, px, py, allowed)
            speed, yaw_rate, safe = go_aside(b, n, Motion(speed, yaw_rate, safe), line, way, near, traffic)
    if not safe:
        speed = 0.0
        if vehicle.half_length > 0.0 and not is_safe(b, n, speed, yaw_rate, near, trusted, traffic, vehicle):
            yaw_rate = 0.0
            ahead = allowed if c * px + s * py > ALIGNED else 0.0
            back = 0.0 if outside else max(vehicle.slowest, -SLIDES)
            if ahead > 0.0 and goes_on(b, n, ahead, outside, way, near, traffic):
                speed = ahead
            elif back < 0.0 and goes_on(b, n, back, outside, way, near, traffic):
                speed = back
    return speed, yaw_rate


@jit_rare
def go_aside(b: int, n: int, motion: Motion, line: Line, way: ReferencePath, near: int, traffic: Traffic) -> Motion:
    """Return the motion of a passing car: aside and back, if `motion` straight aside is not safe or leads to no place.

    So it gets past what it touches, or is as near to as it may be. `near` (count) cars are listed.
    """
    if motion.safe and (motion.speed != 0.0 or leads_on(b, n, line, SQUARE, near, -1, traffic)):
        return motion
    state, vehicle = traffic.state, traffic.drivers.vehicle[b]
    speed, yaw_rate = steer(
        state.c[b, n], state.s[b, n], -line.left, -line.px, -line.py, 0.0, line.speed, STEEP, EXACT, vehicle.yaw_most,
        0.0, vehicle.period,
    )  # fmt: skip
    speed, yaw_rate = keep_right(b, n, speed, yaw_rate, True, way, traffic)
    return Motion(speed, yaw_rate, is_safe(b, n, speed, yaw_rate, near, -1, traffic, vehicle))


@jit_rare
def goes_on(b: int, n: int, speed: float, outside: bool, way: ReferencePath, near: int, traffic: Traffic) -> bool:
    """Tell whether a car to which another one is as close as may be can drive straight past it, on or back."""
    vehicle = traffic.drivers.vehicle[b]
    on = is_safe(b, n, speed, 0.0, near, -1, traffic, vehicle)
    return on and (not outside or stays_right(b, n, speed, 0.0, way, traffic))


@jit_rare
def come_back(b: int, n: int, motion: Motion, line: Line, way: ReferencePath, near: int, traffic: Traffic) -> Motion:
    """Return the motion of a car that is left and returns between other cars; `Motion` tells whether it is safe.

    `motion` (m/s, rad/s) is the one it would have otherwise; `near` (count) cars are listed. It does not turn toward a
    car that bars its way back, and goes straight to the right where there is room for that only. Once it falls back
    it does so to the end.
    """
    state, vehicle = traffic.state, traffic.drivers.vehicle[b]
    safe = motion.safe
    if safe and motion.speed == 0.0 and line.speed >= CREEPS:
        safe = leads_on(b, n, line, STEEP, near, -1, traffic)
    here = along(way, state.x[b, n], state.y[b, n])
    if traffic.drivers.car[b, n].until == -INFINITE:
        retreat = fall_back(b, n, here, line, way, near, traffic)
        if retreat.safe:
            return retreat
    far = here < last_return(vehicle) + NARROWLY
    back = 0.0 if far else backs_off(here, line.left, vehicle)
    if safe and line.speed >= CREEPS:
        return motion
    if back <= SLANT:
        # Near the disc straight to the right to the end, or a little back: it would come into the disc, still left.
        left, on = line.left if far else 1.0, sqrt(1.0 - back * back)
        right = Line(left, line.px * on + line.py * back, line.py * on - line.px * back, SLIDES)
        if leads_on(b, n, right, SQUARE, near, -1, traffic):
            speed, yaw_rate = steer(
                state.c[b, n], state.s[b, n], left, right.px, right.py, 0.0, SLIDES, SQUARE, EXACT,
                vehicle.yaw_most, 0.0, vehicle.period,
            )  # fmt: skip
            return Motion(speed, yaw_rate, is_safe(b, n, speed, yaw_rate, near, -1, traffic, vehicle))
    retreat = fall_back(b, n, here, line, way, near, traffic)
    return retreat if retreat.safe else Motion(motion.speed, motion.yaw_rate, safe)


@jit_rare
def fall_back(b: int, n: int, here: float, line: Line, way: ReferencePath, near: int, traffic: Traffic) -> Motion:
    """Return the motion of a passing car back behind one that has moved up, ahead of which it can't return any more.

    It is at `here` (m) along the lane, and ends its manoeuvre; without such a car (`near` are listed) nothing is safe.
    """
    state, scratch, vehicle = traffic.state, traffic.scratch, traffic.drivers.vehicle[b]
    room = 2.0 * vehicle.reach + travel_of(vehicle) + GUARD + WARY
    last = max(here, last_return(vehicle))
    clear = 0.0
    for k in range(near):
        j = scratch.near[k]
        key, its = along(way, state.x[b, j], state.y[b, j]), aside(way, state.x[b, j], state.y[b, j])
        if its < vehicle.middle and key - room < here and last < key + room:
            clear = max(clear, its + room)
    if clear == 0.0:
        return Motion(0.0, 0.0, False)
    gear = -1.0 if vehicle.slowest < 0.0 else 1.0
    # Not yet clear it goes to the left as steeply as it may: less steeply it might come nearer to who is behind it. If
    # it still would, it turns until it goes more steeply.
    away = 1.0 if clear > line.left else clear - line.left
    traffic.drivers.car[b, n].until = -INFINITE
    motion = Motion(0.0, 0.0, False)
    for most, aligned in ((SLANT, ALIGNED), (STEEP, EXACT)):
        speed, yaw_rate = steer(
            gear * state.c[b, n], gear * state.s[b, n], away, -line.px, -line.py, 0.0, SLIDES, most, aligned,
            vehicle.yaw_most, 0.0, vehicle.period,
        )  # fmt: skip
        speed = max(gear * speed, vehicle.slowest)
        motion = Motion(speed, yaw_rate, is_safe(b, n, speed, yaw_rate, near, -1, traffic, vehicle))
        if motion.safe:
            break
    return motion


@jit_inline
def backs_off(here: float, left: float, vehicle: Vehicle) -> float:
    """Return the sine of the angle back at which a car `left` (m) of its lane's middle keeps off the disc ahead.

    It is at `here` (m) along the lane and goes to the right: along the disc first, so that it is far enough back at the
    centre line, right of which it gets away from the disc.
    """
    over, room = left - vehicle.middle, vehicle.disc + vehicle.reach + CLOSE
    return (room + here) / over + over / room if over > CLOSE and room + here > 0.0 else 0.0


@jit_inline
def leads_on(b: int, n: int, line: Line, most: float, near: int, trusted: int, traffic: Traffic) -> bool:
    """Tell whether a car may drive, once it has turned in place, as `heading` says of its line and `most` (ratio).

    `near` (count) cars are listed, `trusted` (index) need not be minded.
    """
    state, vehicle = traffic.state, traffic.drivers.vehicle[b]
    pose = Pose(state.x[b, n], state.y[b, n], *heading(line, most))
    return is_safe_from(pose, b, Command(line.speed, 0.0), near, trusted, traffic, vehicle)


@jit_inline
def heading(line: Line, most: float) -> tuple[float, float]:
    """Return the direction in which a car drives to its line, at an angle whose sine is `most` (ratio) at most."""
    sine = min(max(-line.left / HURRY, -most), most)
    cosine = sqrt(1.0 - sine * sine)
    return line.px * cosine - line.py * sine, line.py * cosine + line.px * sine


@jit_rare
def keep_right(
    b: int, n: int, speed: float, yaw_rate: float, outside: bool, way: ReferencePath, traffic: Traffic
) -> tuple[float, float]:
    """Return a command that does not make the car left unless it overtakes: otherwise it drives on, waits or backs up.

    It drives on along its lane where nothing is ahead, past who stands beside it and may drive off.
    """
    state, labels, drivers = traffic.state, traffic.labels, traffic.drivers
    vehicle = drivers.vehicle[b]
    bits = np.int64(labels.bits[b, n])
    left = drivers.car[b, n].violations & VIOLATION.LEFT_SIDE != 0 or bits & FLAG.LEFT != 0
    if left or speed == 0.0 or not outside or stays_right(b, n, speed, yaw_rate, way, traffic):
        return speed, yaw_rate
    leans = way.tx * state.s[b, n] - way.ty * state.c[b, n] > 0.0
    if drivers.car[b, n].aside != 0.0 and bits & FLAG.OVERTAKING != 0 and may_drive_on(b, n, way, traffic):
        on = steer(
            state.c[b, n], state.s[b, n], 0.0, way.tx, way.ty, 0.0, speed, SLANT, ALIGNED, vehicle.yaw_most,
            vehicle.tightest, vehicle.period,
        )  # fmt: skip
        if stays_right(b, n, on[0], on[1], way, traffic):
            return on
    if drivers.car[b, n].aside != 0.0 or not leans or vehicle.slowest >= 0.0:
        return 0.0, 0.0
    speed = min(speed, -vehicle.slowest)
    return -speed, -min(speed / vehicle.tightest, vehicle.yaw_most)


@jit_rare
def room_to_return(b: int, n: int, way: ReferencePath, traffic: Traffic) -> float:
    """Return how far a car that can't return yet may drive on and still return before the disc, metres.

    An e-agent takes no place in the order of a crossing meanwhile, since it could not enter on its turn (E3).
    """
    vehicle = traffic.drivers.vehicle[b]
    here = along(way, traffic.state.x[b, n], traffic.state.y[b, n])
    return max(last_return(vehicle) - (vehicle.approaches if n != EGO else 0.0) - here, 0.0)


@jit_inline
def follows_line(b: int, n: int, left: float, traffic: Traffic) -> bool:
    """Tell whether a car with nothing close around it, `left` (m) of its line, may just follow that."""
    labels, obstacles, drivers = traffic.labels, traffic.obstacles, traffic.drivers
    car = drivers.car[b, n]
    free = obstacles.off[b] == obstacles.off[b + 1] and car.kind != KIND.ROUND
    bound = car.aside != 0.0 or drivers.vehicle[b].tightest > 0.0
    astray = labels.lane[b, n] < 0 and left > ASTRAY
    return free and not bound and not astray and np.int64(labels.bits[b, n]) & FLAG.LEFT == 0


@jit_inline
def follow_line(
    b: int, n: int, speed: float, left: float, px: float, py: float, bend: float, traffic: Traffic,
    commands: Floats,
) -> None:  # fmt: skip
    """Write the command of a car `left` (m) of its line, whose direction is (px, py) and curvature `bend` (1/m)."""
    state, vehicle = traffic.state, traffic.drivers.vehicle[b]
    speed = slowed(speed, bend, vehicle.yaw_most)
    commands[b, n, 0], commands[b, n, 1] = steer(
        state.c[b, n], state.s[b, n], left, px, py, bend, speed, SLANT, ALIGNED, vehicle.yaw_most, 0.0, vehicle.period
    )  # fmt: skip


@jit_inline
def slowed(speed: float, bend: float, limit: float) -> float:
    """Return the speed at which a car follows a line of curvature `bend`, 1/m, with a yaw rate of `limit` at most."""
    if abs(bend) * speed > 0.8 * limit:
        return 0.8 * limit / abs(bend)
    return speed


@jit_inline
def steer(
    c: float, s: float, left: float, px: float, py: float, bend: float, speed: float, most: float, aligned: float,
    limit: float, tightest: float, period: float,
) -> tuple[float, float]:  # fmt: skip
    """Return (speed, yaw rate) of a car `left` of the line it should drive, whose direction is (px, py).

    `bend` is the line's curvature, 1/m, for which `speed` is `slowed`, `most` the sine of the largest angle to that
    line, `aligned` the cosine beyond which the car turns in place, unless it has a turning radius `tightest`, metres;
    `limit` is its largest yaw rate. All is worked out whatever the case, so that the loop of
    `command_cache.check_command_caches` has no branches.
    """
    sine = min(max(-left / max(HURRY, WIDE * tightest), -most), most)
    cosine = sqrt(1.0 - sine * sine)
    hx = px * cosine - py * sine
    hy = py * cosine + px * sine
    cross = c * hy - s * hx
    dot = c * hx + s * hy
    in_a_tick = abs(cross) / period
    spin = min(limit, in_a_tick) if dot > 0.0 else limit
    spin = spin if cross >= 0.0 else -spin
    yaw_rate = speed * bend + GAIN * cross
    if tightest > 0.0:
        limit = min(limit, speed / tightest)
        if dot < 0.0:
            yaw_rate = limit if cross >= 0.0 else -limit
    yaw_rate = min(max(yaw_rate, -limit), limit)
    yaw_rate = yaw_rate if speed != 0.0 else 0.0
    turns = dot < aligned and tightest == 0.0
    return 0.0 if turns or speed == 0.0 else speed, spin if turns else yaw_rate


@jit
def is_safe(
    b: int, n: int, speed: float, yaw_rate: float, near: int, trusted: int, traffic: Traffic, vehicle: Vehicle
) -> bool:
    """Tell whether a command can't bring about a contact, whatever the others but `trusted` do in this tick."""
    state = traffic.state
    pose = Pose(state.x[b, n], state.y[b, n], state.c[b, n], state.s[b, n])
    return is_safe_from(pose, b, Command(speed, yaw_rate), near, trusted, traffic, vehicle)


@jit_inline
def is_safe_from(
    pose: Pose, b: int, command: Command, near: int, trusted: int, traffic: Traffic, vehicle: Vehicle
) -> bool:
    """Do as `is_safe`, of a car at a pose; `near` (count) cars are listed, `trusted` (index) need not be minded."""
    state, obstacles, scratch = traffic.state, traffic.obstacles, traffic.scratch
    travel = travel_of(vehicle)
    for k in range(near):
        j = scratch.near[k]
        other = Pose(state.x[b, j], state.y[b, j], state.c[b, j], state.s[b, j])
        if j != trusted and may_meet(pose, command, vehicle, other, travel):
            return False
    return not may_hit(b, pose, command, vehicle, obstacles, vehicle.near, 0.0)
