"""The compiled policy of the controller `lanes`.

It follows a path (`policies.lanes.paths`), keeps behind cars, waits at occupied intersections, backs up from a car
that waits for it to keep away, passes what stands in its way, and asks for another route when it can't.
"""

from __future__ import annotations

from math import sqrt

from dubins_traffic.cars.sensing import within_sight
from dubins_traffic.cars.state import EGO, Command, Pose, State
from dubins_traffic.kernels.compile import jit
from dubins_traffic.policies.lanes.gaps import (
    first_conflict,
    manoeuvre_of,
    next_gate,
    offset_at,
    pose_of,
    sample_path,
)
from dubins_traffic.policies.lanes.knowledge import NOBODY, Knowledge
from dubins_traffic.policies.lanes.paths import PathRow
from dubins_traffic.policies.lanes.tracking import ahead_on, locate, place_on, steer
from dubins_traffic.policies.lanes.waiting import gap_from, is_oncoming, stand
from dubins_traffic.policies.safety import leaves_road, may_hit, may_meet, travel_of
from dubins_traffic.roads.table import RoadTable


@jit
def decide(tick: int, x: float, y: float, c: float, s: float, known: Knowledge, roads: RoadTable) -> None:
    """Choose the command of an ego at a pose; `roads` holds the trial's network alone."""
    ego = known.follower
    ego.tick, ego.x, ego.y, ego.c, ego.s = tick, x, y, c, s
    ego.blocker = NOBODY
    near = _watch(known)
    _find_place(known)
    wanted = known.vehicle.fastest
    if near or known.obstacles.parts.shape[0] > 0:
        wanted = _speed_in_traffic(known)
    speed, yaw_rate = _follow(known, wanted)
    if not _is_safe(known, roads, Command(speed, yaw_rate)):
        slowest = known.vehicle.slowest
        speed, yaw_rate = (slowest, yaw_rate) if slowest > 0.0 else (0.0, 0.0)
    ego.speed = speed
    ego.yaw_rate = yaw_rate
    _note_progress(known, wanted)


@jit
def decide_in(b: int, tick: int, radius: float, state: State, known: Knowledge, roads: RoadTable) -> None:
    """Choose the command of the ego of trial b of a batch, which sees the cars within `radius` (m)."""
    x = state.x[b, EGO]
    y = state.y[b, EGO]
    for n in range(1, state.count[b]):
        dx = state.x[b, n] - x
        dy = state.y[b, n] - y
        if within_sight(dx, dy, radius * radius):
            car = known.other[n - 1]
            car.tick, car.x, car.y, car.c, car.s = (
                tick,
                state.x[b, n],
                state.y[b, n],
                state.c[b, n],
                state.s[b, n],
            )
            car.speed, car.yaw_rate = state.speed[b, n], state.yaw_rate[b, n]
    decide(tick, x, y, state.c[b, EGO], state.s[b, EGO], known, roads)


@jit
def _watch(known: Knowledge) -> bool:
    """Count how long each sensed car has stood; return whether there is any."""
    sensed = False
    ego, manner = known.follower, known.manner
    for n in range(known.other.shape[0]):
        car = known.other[n]
        if car.tick != ego.tick:
            known.still[n] = 0.0
            continue
        sensed = True
        known.gap[n] = gap_from(known, ego.x, ego.y, n)
        if abs(car.speed) > manner.moves or abs(car.yaw_rate) > manner.turns:
            known.still[n] = 0.0
        else:
            known.still[n] += known.vehicle.period
    return sensed


@jit
def _note_progress(known: Knowledge, wanted: float) -> None:
    """Count for how long the car has wanted to move and has not; forget its waits once it has got on.

    A turn in place counts little: half a turn less than `Manner.held_up`.
    """
    ego, manner, period = known.follower, known.manner, known.vehicle.period
    if ego.speed != 0.0:
        ego.stuck = 0.0
        if abs(ego.odometer - ego.mark) > manner.progress:
            ego.mark = ego.odometer
            ego.waited = 0.0
            ego.tried = 0.0
            if wanted > 0.0:
                ego.backs_from = -1
                ego.is_barred = 0
    elif wanted != 0.0:
        turned = abs(ego.yaw_rate) * period
        ego.stuck += manner.turn_share * turned if turned > 0.0 else period
        if wanted < 0.0 and ego.stuck > 0.2:
            ego.backs_from = -1
            ego.is_barred = 1


@jit
def _find_place(known: Knowledge) -> None:
    ego = known.follower
    ego.odometer += locate(known)
    if ego.odometer - ego.since > ego.until + known.manner.returns:
        ego.begin = 0.0
        ego.aim = 0.0


@jit
def _speed_in_traffic(known: Knowledge) -> float:
    """Return the speed that traffic allows, m/s; negative to back up."""
    ego, manner, fastest = known.follower, known.manner, known.vehicle.fastest
    sample_path(known)
    first, who, nearest = first_conflict(
        known, known.sample.shape[0] - 1, ego.odometer - ego.since, manoeuvre_of(ego),
        manner.still_margin, manner.moving_margin,
    )  # fmt: skip
    speed = fastest if ego.begin == 0.0 and ego.aim == 0.0 else min(fastest, manner.passing_speed)
    speed = min(speed, _following_speed(known, first, who, nearest))
    row, to_line = next_gate(known)
    cause = who
    if row >= 0:
        gate = known.path[row]
        occupant = _occupant(known, gate)
        if occupant == NOBODY and who != NOBODY and _stops_inside(known, who, nearest, gate):
            occupant = who
        if occupant != NOBODY:
            allowed = max(0.0, manner.gain * to_line)
            if allowed < speed:
                speed = allowed
                cause = occupant
    return stand(known, speed, cause, first)


@jit
def _following_speed(known: Knowledge, first: int, who: int, nearest: int) -> float:
    """Return the speed, m/s, that brings the gap to the body in the way to the one to follow at, and keeps it there."""
    manner, ego = known.manner, known.follower
    if who == NOBODY:
        return known.vehicle.fastest
    if who < 0:
        return max(0.0, manner.gain * (manner.spacing * first - 0.35))
    car, place = known.other[who], known.sample[nearest]
    along = car.speed * (car.c * place.tx + car.s * place.ty)
    dx = car.x - ego.x
    dy = car.y - ego.y
    far = manner.spacing * nearest
    if not is_oncoming(known, who):
        far = min(far, sqrt(dx * dx + dy * dy))
    return max(0.0, max(0.0, along) + manner.gain * (far - manner.follow))


@jit
def _occupant(known: Knowledge, gate: PathRow) -> int:
    """Return a car whose body meets the disc and that has moved lately, or NOBODY."""
    for n in range(known.other.shape[0]):
        car = known.other[n]
        is_awake = car.tick == known.follower.tick and known.still[n] < known.manner.stands
        if is_awake and _in_disc(known, gate, car.x, car.y):
            return n
    return NOBODY


@jit
def _in_disc(known: Knowledge, gate: PathRow, x: float, y: float) -> bool:
    """Tell whether a car with its centre at a point may meet the disc behind a line to wait at."""
    dx = x - gate.gate_x
    dy = y - gate.gate_y
    radius = known.vehicle.disc + known.vehicle.reach
    return dx * dx + dy * dy < radius * radius


@jit
def _stops_inside(known: Knowledge, who: int, nearest: int, gate: PathRow) -> bool:
    """Tell whether the ego would have to stop behind a standing `who` before it has left the disc again."""
    if who >= 0 and known.still[who] == 0.0:
        return False
    k = nearest - int(known.manner.follow / known.manner.spacing)
    return k < 0 or _in_disc(known, gate, known.sample[k].x, known.sample[k].y)


@jit
def _follow(known: Knowledge, speed: float) -> tuple[float, float]:
    """Return the command that follows the path at `speed`, backwards if it is negative."""
    vehicle, ego, ahead = known.vehicle, known.follower, known.manner.ahead
    if speed == 0.0 and vehicle.slowest <= 0.0:
        return 0.0, 0.0
    here = known.path[ego.row]
    offset = ego.left
    if speed >= 0.0:
        row, sigma = ahead_on(known, ego.row, ego.sigma + ahead, True)
        aim = known.path[row]
        if here.pivot != 0:
            speed = min(speed, max(here.length - ego.sigma, 0.01) / vehicle.period)
        distance = ego.odometer - ego.since + ahead
        offset = offset_at(distance, manoeuvre_of(ego), known.manner.returns)
        if row != ego.row or here.low <= ego.left <= here.high:
            offset = min(max(offset, aim.low), aim.high)
    else:
        aim, sigma = here, ego.sigma - ahead
    px, py, tx, ty = place_on(aim, sigma)
    pose = Pose(ego.x, ego.y, ego.c, ego.s)
    speed, yaw_rate, turns = steer(pose, px - offset * ty, py + offset * tx, speed, vehicle)
    if turns and vehicle.tightest > 0.0:
        return _shuffle(known, yaw_rate)
    return max(speed, vehicle.slowest), yaw_rate


@jit
def _shuffle(known: Knowledge, yaw_rate: float) -> tuple[float, float]:
    """Return the command of a car with a turning radius that has to turn in place: to and fro, or a full circle."""
    ego, vehicle, manner = known.follower, known.vehicle, known.manner
    ego.shuffled += 1
    speed = min(vehicle.fastest, manner.back_speed)
    if vehicle.slowest <= -0.05:
        if ego.shuffled >= 2 * manner.shuttle:
            ego.shuffled = 0
        if ego.shuffled >= manner.shuttle:
            speed = -min(-vehicle.slowest, speed)
    speed = max(speed, vehicle.slowest)
    most = min(abs(yaw_rate), abs(speed) / vehicle.tightest)
    return speed, most if yaw_rate > 0.0 else -most


@jit
def _is_safe(known: Knowledge, roads: RoadTable, command: Command) -> bool:
    """Tell whether a command leads neither into a contact nor off the road in a tick, whatever the others do."""
    ego, vehicle = known.follower, known.vehicle
    pose = Pose(ego.x, ego.y, ego.c, ego.s)
    if command.speed != 0.0 and leaves_road(pose, command, vehicle.period, roads, 0):
        return False
    travel = travel_of(vehicle)
    for n in range(known.other.shape[0]):
        car = known.other[n]
        if car.tick == ego.tick and may_meet(pose, command, vehicle, pose_of(car), travel):
            return False
    return not may_hit(0, pose, command, vehicle, known.obstacles, vehicle.near, 0.0)
