"""The compiled law of the controller `lanes`, over a batch of trials.

It follows a path (`policies.lanes.paths`), keeps behind cars, waits at occupied intersections, backs up from a car
that waits for it to keep away, passes what stands in its way, and asks for another route when it can't.
"""

from __future__ import annotations

from math import sqrt

from dubins_traffic.kernels.compile import jit
from dubins_traffic.policies.lanes.gaps import (
    NOBODY,
    O_GAP,
    O_SEEN,
    O_SPEED,
    O_STILL,
    O_YAW,
    OC,
    OS,
    OX,
    OY,
    PX,
    PY,
    RETURN,
    SPACING,
    TX,
    TY,
    next_gate,
    offset_at,
    sample_path,
)
from dubins_traffic.policies.lanes.knowledge import (
    AIM,
    BACK_SPEED,
    BACKING,
    BARRED,
    BEGIN,
    DISC,
    FASTEST,
    FOLLOW,
    FROM,
    GAIN,
    HALF_LENGTH,
    HALF_WIDTH,
    LEFT,
    MARK,
    MOVES,
    MOVING_MARGIN,
    ODO,
    PASSING_SPEED,
    PERIOD,
    PROGRESS,
    RADIUS,
    RAMP,
    REACH,
    ROUNDING,
    SHUFFLED,
    SHUTTLE,
    SIGMA,
    SLOWEST,
    STANDS,
    STILL_MARGIN,
    STUCK,
    TRIED,
    TURN_SHARE,
    TURNS,
    UNTIL,
    WAITED,
    YAW_MOST,
    Knowledge,
)
from dubins_traffic.policies.lanes.paths import HIGH, LENGTH, LOW, NO_STOP, PIVOT, WAITING_GAP
from dubins_traffic.policies.lanes.tracking import AHEAD, ahead_on, locate, place_on, steer
from dubins_traffic.policies.lanes.waiting import conflict, gap_now, is_oncoming, stand
from dubins_traffic.policies.safety import NEAR, VERGE, leaves_road, may_hit, motion_is_safe
from dubins_traffic.roads.table import RoadTable


@jit
def decide(known: Knowledge, roads: RoadTable) -> None:
    """Choose the commands of all trials of a batch."""
    for b in range(known.span.shape[0]):
        known.blocker[b] = NOBODY
        near = _watch(known, b)
        _find_place(known, b)
        speed = known.car[b, FASTEST]
        if near or known.part_off[b + 1] > known.part_off[b]:
            speed = _speed_in_traffic(known, b)
        wanted = speed
        speed, yaw_rate = _follow(known, b, speed)
        speed, yaw_rate = _last_look(known, roads, b, speed, yaw_rate)
        _note_progress(known, b, wanted, speed, yaw_rate)
        known.command[b, 0] = speed
        known.command[b, 1] = yaw_rate


@jit
def _watch(known: Knowledge, b: int) -> bool:
    """Count how long each sensed car has stood; return whether there is any."""
    found = False
    others = known.others[b]
    for n in range(others.shape[0]):
        if others[n, O_SEEN] == 0.0:
            others[n, O_STILL] = 0.0
            continue
        found = True
        others[n, O_GAP] = gap_now(known, b, n)
        if abs(others[n, O_SPEED]) > MOVES or abs(others[n, O_YAW]) > TURNS:
            others[n, O_STILL] = 0.0
        else:
            others[n, O_STILL] += known.car[b, PERIOD]
    return found


@jit
def _note_progress(known: Knowledge, b: int, wanted: float, speed: float, yaw_rate: float) -> None:
    """Count for how long the car has wanted to move and has not; forget its waits once it has got on.

    A turn in place counts little: half a turn less than HELD_UP.
    """
    memory = known.memory[b]
    if speed != 0.0:
        memory[STUCK] = 0.0
        if abs(memory[ODO] - memory[MARK]) > PROGRESS:
            memory[MARK] = memory[ODO]
            memory[WAITED] = 0.0
            memory[TRIED] = 0.0
            if wanted > 0.0:
                memory[BACKING] = 0.0
    elif wanted != 0.0:
        turned = abs(yaw_rate) * known.car[b, PERIOD]
        memory[STUCK] += TURN_SHARE * turned if turned > 0.0 else known.car[b, PERIOD]
        if wanted < 0.0 and memory[STUCK] > 0.2:
            memory[BACKING] = BARRED


@jit
def _find_place(known: Knowledge, b: int) -> None:
    memory = known.memory[b]
    span = known.span[b]
    row, sigma, left, travelled = locate(
        known.path, known.row[b], memory[SIGMA], known.ego[b, 0], known.ego[b, 1], span[0], span[1], span[2]
    )
    known.row[b] = row
    memory[SIGMA] = sigma
    memory[LEFT] = left
    memory[ODO] += travelled
    if memory[ODO] - memory[FROM] > memory[UNTIL] + RETURN:
        memory[BEGIN] = 0.0
        memory[AIM] = 0.0


@jit
def _speed_in_traffic(known: Knowledge, b: int) -> float:
    """Return the speed that traffic allows; negative to back up."""
    memory = known.memory[b]
    car = known.car[b]
    span = known.span[b]
    sample_path(known.path, known.row[b], memory[SIGMA], span[0], span[1], span[2], known.sample)
    begin, aim, ramp, until = memory[BEGIN], memory[AIM], memory[RAMP], memory[UNTIL]
    last = known.sample.shape[0] - 1
    first, who, nearest = conflict(
        known, b, last, memory[ODO] - memory[FROM], begin, aim, ramp, until, STILL_MARGIN, MOVING_MARGIN
    )
    speed = car[FASTEST] if begin == 0.0 and aim == 0.0 else min(car[FASTEST], PASSING_SPEED)
    speed = min(speed, _following_speed(known, b, first, who, nearest))
    line, gate_x, gate_y = next_gate(
        known.path, known.row[b], memory[SIGMA], WAITING_GAP - 0.02, span[0], span[1], span[2]
    )
    cause = who
    if line < NO_STOP:
        occupant = _occupant(known, b, gate_x, gate_y)
        if occupant == NOBODY and who != NOBODY and _stops_inside(known, b, who, nearest, gate_x, gate_y):
            occupant = who
        if occupant != NOBODY:
            allowed = max(0.0, GAIN * line)
            if allowed < speed:
                speed = allowed
                cause = occupant
    return stand(known, b, speed, cause, first)


@jit
def _following_speed(known: Knowledge, b: int, first: int, who: int, nearest: int) -> float:
    """Return the speed at which the gap to what is in the way becomes and stays the one to follow at."""
    if who == NOBODY:
        return known.car[b, FASTEST]
    if who < 0:
        return max(0.0, GAIN * (SPACING * first - 0.35))
    o = known.others[b, who]
    along = o[O_SPEED] * (o[OC] * known.sample[nearest, TX] + o[OS] * known.sample[nearest, TY])
    dx = o[OX] - known.ego[b, 0]
    dy = o[OY] - known.ego[b, 1]
    far = SPACING * nearest
    if not is_oncoming(known, b, who):
        far = min(far, sqrt(dx * dx + dy * dy))
    return max(0.0, max(0.0, along) + GAIN * (far - known.car[b, FOLLOW]))


@jit
def _occupant(known: Knowledge, b: int, gate_x: float, gate_y: float) -> int:
    """Return a car whose body meets the disc and that has moved of late, or NOBODY."""
    radius = known.car[b, DISC] + known.car[b, REACH]
    others = known.others[b]
    for n in range(others.shape[0]):
        if others[n, O_SEEN] == 0.0 or others[n, O_STILL] >= STANDS:
            continue
        dx = others[n, OX] - gate_x
        dy = others[n, OY] - gate_y
        if dx * dx + dy * dy < radius * radius:
            return n
    return NOBODY


@jit
def _stops_inside(known: Knowledge, b: int, who: int, nearest: int, gate_x: float, gate_y: float) -> bool:
    """Whether the car would have to stop behind a standing `who` before it has left the disc again."""
    if who >= 0 and known.others[b, who, O_STILL] == 0.0:
        return False
    k = nearest - int(known.car[b, FOLLOW] / SPACING)
    if k < 0:
        return True
    dx = known.sample[k, PX] - gate_x
    dy = known.sample[k, PY] - gate_y
    radius = known.car[b, DISC] + known.car[b, REACH]
    return dx * dx + dy * dy < radius * radius


@jit
def _follow(known: Knowledge, b: int, speed: float) -> tuple[float, float]:
    """Return the command that follows the path at `speed`, backwards if it is negative."""
    car = known.car[b]
    if speed == 0.0 and car[SLOWEST] <= 0.0:
        return 0.0, 0.0
    memory = known.memory[b]
    span = known.span[b]
    row = known.row[b]
    sigma = memory[SIGMA]
    if speed >= 0.0:
        aim_row, aim_sigma = ahead_on(known.path, row, sigma, AHEAD, span[0], span[1], span[2], True)
        distance = memory[ODO] - memory[FROM] + AHEAD
        if known.path[row, PIVOT] != 0.0:
            speed = min(speed, max(known.path[row, LENGTH] - sigma, 0.01) / car[PERIOD])
    else:
        aim_row, aim_sigma = row, sigma - AHEAD
        distance = memory[ODO] - memory[FROM] - AHEAD
    px, py, tx, ty = place_on(known.path, aim_row, aim_sigma)
    offset = offset_at(distance, memory[BEGIN], memory[AIM], memory[RAMP], memory[UNTIL])
    if aim_row != row or known.path[row, LOW] <= memory[LEFT] <= known.path[row, HIGH]:
        offset = min(max(offset, known.path[aim_row, LOW]), known.path[aim_row, HIGH])
    if speed < 0.0:
        offset = memory[LEFT]
    speed, yaw_rate, turns = steer(
        known.ego[b, 0], known.ego[b, 1], known.ego[b, 2], known.ego[b, 3],
        px - offset * ty, py + offset * tx, speed, car[YAW_MOST], car[RADIUS],
    )  # fmt: skip
    if turns and car[RADIUS] > 0.0:
        return _shuffle(known, b, yaw_rate)
    return max(speed, car[SLOWEST]), yaw_rate


@jit
def _shuffle(known: Knowledge, b: int, yaw_rate: float) -> tuple[float, float]:
    """Return the command of a car with a turning radius that has to turn on the spot: to and fro, or a full turn."""
    memory = known.memory[b]
    car = known.car[b]
    memory[SHUFFLED] += 1.0
    speed = min(car[FASTEST], BACK_SPEED)
    if car[SLOWEST] <= -0.05:
        if memory[SHUFFLED] >= 2.0 * SHUTTLE:
            memory[SHUFFLED] = 0.0
        if memory[SHUFFLED] >= SHUTTLE:
            speed = -min(-car[SLOWEST], speed)
    speed = max(speed, car[SLOWEST])
    most = min(abs(yaw_rate), abs(speed) / car[RADIUS])
    return speed, most if yaw_rate > 0.0 else -most


@jit
def _last_look(
    known: Knowledge, roads: RoadTable, b: int, speed: float, yaw_rate: float
) -> tuple[float, float]:
    """Return the command, unless it might lead into a contact or off the road: then the car stands if it can."""
    if _is_safe(known, roads, b, speed, yaw_rate):
        return speed, yaw_rate
    if known.car[b, SLOWEST] > 0.0:
        return known.car[b, SLOWEST], yaw_rate
    return 0.0, 0.0


@jit
def _is_safe(known: Knowledge, roads: RoadTable, b: int, speed: float, yaw_rate: float) -> bool:
    car = known.car[b]
    period = car[PERIOD]
    x, y, c, s = known.ego[b, 0], known.ego[b, 1], known.ego[b, 2], known.ego[b, 3]
    edge = float(roads.half_width[known.net[b]]) - VERGE
    if speed != 0.0 and leaves_road(x, y, c, s, speed, yaw_rate, period, edge, roads, known.net[b]):
        return False
    a, h, r, reach = car[HALF_LENGTH], car[HALF_WIDTH], car[ROUNDING], car[REACH]
    travel = max(car[FASTEST], -car[SLOWEST]) * period
    if a + h > 0.0:
        travel += car[YAW_MOST] * reach * period
    others = known.others[b]
    for n in range(others.shape[0]):
        o = others[n]
        dx = o[OX] - x
        dy = o[OY] - y
        near = 2.0 * reach + NEAR
        if o[O_SEEN] != 0.0 and dx * dx + dy * dy < near * near and not motion_is_safe(
            x, y, c, s, speed, yaw_rate, period, a, h, r, reach,
            o[OX], o[OY], o[OC], o[OS], a, h, r, travel,
        ):  # fmt: skip
            return False
    return not may_hit(
        x, y, c, s, speed, yaw_rate, period, a, h, r, reach,
        known.part, known.part_off[b], known.part_off[b + 1], NEAR, 0.0,
    )  # fmt: skip
