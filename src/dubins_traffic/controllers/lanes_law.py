"""The compiled law of the controller `lanes`, over a batch of trials.

It follows a path (`driving.paths`), keeps behind cars, waits at occupied intersections, backs up from a car that waits
for it to keep away, passes what stands in its way, and asks for another route when it can't.
"""

from __future__ import annotations

from math import sqrt
from typing import NamedTuple

from dubins_traffic.driving.gaps import (
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
    P_HIGH,
    P_LOW,
    PX,
    PY,
    RETURN,
    SPACING,
    TX,
    TY,
    first_conflict,
    gap_to,
    next_gate,
    offset_at,
    sample_path,
)
from dubins_traffic.driving.paths import HIGH, LENGTH, LOW, NO_STOP, PIVOT, WAITING_GAP
from dubins_traffic.driving.safety import motion_is_safe
from dubins_traffic.driving.tracking import AHEAD, ahead_on, locate, place_on, steer
from dubins_traffic.kernels.arrays import Floats, Ints
from dubins_traffic.kernels.compile import jit
from dubins_traffic.kernels.trig import advance
from dubins_traffic.roads.lookup import nearest_segment
from dubins_traffic.roads.table import RoadTable

HALF_LENGTH, HALF_WIDTH, ROUNDING, REACH, SLOWEST, FASTEST, YAW_MOST, RADIUS, DISC, PERIOD, FOLLOW = range(11)
CAR_FIELDS = 11

SIGMA, ODO, LEFT, BEGIN, AIM, FROM, RAMP, UNTIL, WAITED, BACKING, TRIED, SHUFFLED, STUCK = range(13)
MEMORY_FIELDS = 13

NEAR = 1.06
"""Within this of the ego, centre to centre, a cautious car does not move, metres."""
CLEAR = 1.2
"""So far the ego backs up from it."""
GAIN = 2.0
"""Speed falls by this much per metre of missing gap, 1/s."""
BACK_SPEED = 0.3
PASSING_SPEED = 0.45
STANDS = 1.0
"""A car counts as standing when it has neither moved nor turned for so long, seconds."""
PATIENCE = 2.5
"""Seconds to wait before passing what stands."""
RETRY = 0.5
"""Seconds between two looks for a way past."""
DESPAIR = 7.0
"""Seconds to wait before asking for another route."""
SIDESTEP = 0.1
"""Offsets are tried in steps of this, metres."""
STILL_MARGIN = 0.05
PASSING_MARGIN = 0.09
MOVING_MARGIN = 0.1
WARY_MARGIN = 0.5
"""Gaps kept: from what stands, the same when a way past is chosen, from what moves, and the same when passing."""
VERGE = 0.02
"""What the car's centre keeps from the edge of the road whatever happens, metres."""
HELD_UP = 0.4
"""Seconds without leave to move after which the car looks for another way."""
BARRED = -1.0
"""The car has backed up, or tried to, and moves on first."""
MOVES, TURNS = 0.02, 0.05
SHUTTLE = 10
"""Ticks of each stroke of a car that has to shuttle to turn round."""


class Desk(NamedTuple):
    """What the law knows and remembers of each trial of a batch.

    `path` (rows, paths.FIELDS): all trials' paths; `span` (B, 3): first row, end, and number of the row after the
    last; `row` (B,): the row a car is on. `memory` (B, MEMORY_FIELDS), `ego` (B, 4): pose; `others`
    (B, N, gaps.OTHER_FIELDS); `car` (B, CAR_FIELDS): body, bounds, radius of discs, period, gap to follow at.
    `part` and `part_off`: obstacles as in `cars.tables`. `net` (B,): number of the network in
    the table of roads. `sample`: a workspace. `command` (B, 2): the answer.
    `blocker` (B,): who has kept the car waiting for too long (a car, -1 - part, or NOBODY): a new path is asked for.
    """

    path: Floats
    span: Ints
    row: Ints
    memory: Floats
    ego: Floats
    others: Floats
    car: Floats
    part: Floats
    part_off: Ints
    net: Ints
    sample: Floats
    command: Floats
    blocker: Ints


@jit
def decide(desk: Desk, roads: RoadTable) -> None:
    """Choose the commands of all trials of a batch."""
    for b in range(desk.span.shape[0]):
        desk.blocker[b] = NOBODY
        near = _watch(desk, b)
        _find_place(desk, b)
        speed = desk.car[b, FASTEST]
        if near or desk.part_off[b + 1] > desk.part_off[b]:
            speed = _speed_in_traffic(desk, b)
        wanted = speed
        speed, yaw_rate = _follow(desk, b, speed)
        speed, yaw_rate = _last_look(desk, roads, b, speed, yaw_rate)
        _note_progress(desk, b, wanted, speed, yaw_rate)
        desk.command[b, 0] = speed
        desk.command[b, 1] = yaw_rate


@jit
def _watch(desk: Desk, b: int) -> bool:
    """Count how long each sensed car has stood; return whether there is any."""
    found = False
    others = desk.others[b]
    for n in range(others.shape[0]):
        if others[n, O_SEEN] == 0.0:
            others[n, O_STILL] = 0.0
            continue
        found = True
        others[n, O_GAP] = _gap(desk, b, n)
        if abs(others[n, O_SPEED]) > MOVES or abs(others[n, O_YAW]) > TURNS:
            others[n, O_STILL] = 0.0
        else:
            others[n, O_STILL] += desk.car[b, PERIOD]
    return found


@jit
def _gap(desk: Desk, b: int, n: int) -> float:
    car = desk.car[b]
    o = desk.others[b, n]
    ego = desk.ego[b]
    return gap_to(
        ego[0], ego[1], ego[2], ego[3], car[HALF_LENGTH], car[HALF_WIDTH], car[ROUNDING],
        o[OX], o[OY], o[OC], o[OS], car[HALF_LENGTH], car[HALF_WIDTH], car[ROUNDING],
    )  # fmt: skip


@jit
def _note_progress(desk: Desk, b: int, wanted: float, speed: float, yaw_rate: float) -> None:
    """Count for how long the last look has kept the car from moving."""
    memory = desk.memory[b]
    if wanted != 0.0 and speed == 0.0 and yaw_rate == 0.0:
        memory[STUCK] += desk.car[b, PERIOD]
        if wanted < 0.0 and memory[STUCK] > 0.2:
            memory[BACKING] = BARRED
    elif speed != 0.0:
        memory[STUCK] = 0.0


@jit
def _find_place(desk: Desk, b: int) -> None:
    memory = desk.memory[b]
    span = desk.span[b]
    row, sigma, left, travelled = locate(
        desk.path, desk.row[b], memory[SIGMA], desk.ego[b, 0], desk.ego[b, 1], span[0], span[1], span[2]
    )
    desk.row[b] = row
    memory[SIGMA] = sigma
    memory[LEFT] = left
    memory[ODO] += travelled
    if memory[ODO] - memory[FROM] > memory[UNTIL] + RETURN:
        memory[BEGIN] = 0.0
        memory[AIM] = 0.0


@jit
def _speed_in_traffic(desk: Desk, b: int) -> float:
    """Return the speed that traffic allows; negative to back up."""
    memory = desk.memory[b]
    car = desk.car[b]
    span = desk.span[b]
    sample_path(desk.path, desk.row[b], memory[SIGMA], span[0], span[1], span[2], desk.sample)
    begin, aim, ramp, until = memory[BEGIN], memory[AIM], memory[RAMP], memory[UNTIL]
    last = desk.sample.shape[0] - 1
    first, who, nearest = _conflict(
        desk, b, last, memory[ODO] - memory[FROM], begin, aim, ramp, until, STILL_MARGIN, MOVING_MARGIN
    )
    speed = car[FASTEST] if begin == 0.0 and aim == 0.0 else min(car[FASTEST], PASSING_SPEED)
    speed = min(speed, _following_speed(desk, b, first, who, nearest))
    line, gate_x, gate_y = next_gate(
        desk.path, desk.row[b], memory[SIGMA], WAITING_GAP - 0.02, span[0], span[1], span[2]
    )
    cause = who
    if line < NO_STOP:
        occupant = _occupant(desk, b, gate_x, gate_y)
        if occupant == NOBODY and who != NOBODY and _stops_inside(desk, b, who, nearest, gate_x, gate_y):
            occupant = who
        if occupant != NOBODY:
            allowed = max(0.0, GAIN * line)
            if allowed < speed:
                speed = allowed
                cause = occupant
    return _stand(desk, b, speed, cause, first)


@jit
def _conflict(
    desk: Desk,
    b: int,
    last: int,
    done: float,
    begin: float,
    aim: float,
    ramp: float,
    until: float,
    still: float,
    moving: float,
) -> tuple[int, int, int]:
    car = desk.car[b]
    return first_conflict(
        desk.sample, last, done, begin, aim, ramp, until,
        car[HALF_LENGTH], car[HALF_WIDTH], car[ROUNDING], car[REACH],
        desk.others[b], desk.part, desk.part_off[b], desk.part_off[b + 1], still, moving,
    )  # fmt: skip


@jit
def _following_speed(desk: Desk, b: int, first: int, who: int, nearest: int) -> float:
    """Return the speed at which the gap to what is in the way becomes and stays the one to follow at."""
    if who == NOBODY:
        return desk.car[b, FASTEST]
    if who < 0:
        return max(0.0, GAIN * (SPACING * first - 0.35))
    o = desk.others[b, who]
    along = o[O_SPEED] * (o[OC] * desk.sample[nearest, TX] + o[OS] * desk.sample[nearest, TY])
    dx = o[OX] - desk.ego[b, 0]
    dy = o[OY] - desk.ego[b, 1]
    far = SPACING * nearest
    if not _is_oncoming(desk, b, who):
        far = min(far, sqrt(dx * dx + dy * dy))
    return max(0.0, max(0.0, along) + GAIN * (far - desk.car[b, FOLLOW]))


@jit
def _occupant(desk: Desk, b: int, gate_x: float, gate_y: float) -> int:
    """Return a car whose body meets the disc and that has moved of late, or NOBODY."""
    radius = desk.car[b, DISC] + desk.car[b, REACH]
    others = desk.others[b]
    for n in range(others.shape[0]):
        if others[n, O_SEEN] == 0.0 or others[n, O_STILL] >= STANDS:
            continue
        dx = others[n, OX] - gate_x
        dy = others[n, OY] - gate_y
        if dx * dx + dy * dy < radius * radius:
            return n
    return NOBODY


@jit
def _stops_inside(desk: Desk, b: int, who: int, nearest: int, gate_x: float, gate_y: float) -> bool:
    """Whether the car would have to stop behind a standing `who` before it has left the disc again."""
    if who >= 0 and desk.others[b, who, O_STILL] == 0.0:
        return False
    k = nearest - int(desk.car[b, FOLLOW] / SPACING)
    if k < 0:
        return True
    dx = desk.sample[k, PX] - gate_x
    dy = desk.sample[k, PY] - gate_y
    radius = desk.car[b, DISC] + desk.car[b, REACH]
    return dx * dx + dy * dy < radius * radius


@jit
def _stand(desk: Desk, b: int, speed: float, cause: int, first: int) -> float:
    """Count how long the car has been kept waiting by `cause`; back up, pass or ask for another route in time."""
    memory = desk.memory[b]
    period = desk.car[b, PERIOD]
    if memory[BACKING] > 0.0 and cause != NOBODY and _backs_up(desk, b, int(memory[BACKING]) - 1):
        return -BACK_SPEED
    stuck = memory[STUCK] > HELD_UP
    if stuck and cause == NOBODY:
        cause = _nearest_body(desk, b)
    if cause == NOBODY or (speed > 0.03 and not stuck):
        if speed > 0.2 or cause == NOBODY:
            memory[WAITED] = 0.0
            memory[TRIED] = 0.0
            memory[BACKING] = 0.0
        return speed
    memory[WAITED] += period
    memory[TRIED] += period
    still = desk.others[b, cause, O_STILL] if cause >= 0 else 1e9
    comes = cause >= 0 and _is_oncoming(desk, b, cause)
    hasty = stuck or comes
    if (
        memory[WAITED] > (HELD_UP if hasty else PATIENCE)
        and still > (0.0 if hasty else STANDS)
        and memory[TRIED] >= (HELD_UP if comes else RETRY)
    ):
        memory[TRIED] = 0.0
        if _find_way_past(desk, b, first):
            memory[WAITED] = 0.0
            memory[STUCK] = 0.0
            memory[BACKING] = 0.0
            return min(desk.car[b, FASTEST], PASSING_SPEED)
    if cause >= 0 and _backs_up(desk, b, cause):
        return -BACK_SPEED
    if memory[WAITED] > DESPAIR:
        desk.blocker[b] = cause
    return 0.0


@jit
def _is_oncoming(desk: Desk, b: int, n: int) -> bool:
    o = desk.others[b, n]
    return o[OC] * desk.ego[b, 2] + o[OS] * desk.ego[b, 3] < -0.5


@jit
def _backs_up(desk: Desk, b: int, cause: int) -> bool:
    """Whether to back up from a car that stands so near that it may be waiting for the ego to go away.

    Once begun, this goes on until there is enough room, the car moves off or something is behind.
    """
    memory = desk.memory[b]
    o = desk.others[b, cause]
    dx = o[OX] - desk.ego[b, 0]
    dy = o[OY] - desk.ego[b, 1]
    far2 = dx * dx + dy * dy
    if memory[BACKING] == 0.0 and far2 < NEAR * NEAR and memory[WAITED] > 0.6 and o[O_STILL] > 0.5:
        memory[BACKING] = cause + 1.0
    if memory[BACKING] > 0.0 and (o[O_SEEN] == 0.0 or far2 > CLEAR * CLEAR or not _free_behind(desk, b)):
        memory[BACKING] = BARRED
    return memory[BACKING] > 0.0


@jit
def _nearest_body(desk: Desk, b: int) -> int:
    """Return the sensed car nearest to the ego, or an obstacle's part if there is no car within 1 m."""
    best = 1.0
    who = -1 if desk.part_off[b + 1] > desk.part_off[b] else NOBODY
    others = desk.others[b]
    for n in range(others.shape[0]):
        if others[n, O_SEEN] != 0.0 and others[n, O_GAP] < best:
            best = others[n, O_GAP]
            who = n
    return who


@jit
def _free_behind(desk: Desk, b: int) -> bool:
    """Whether the car may back up a little: able to, on the road, nobody close behind."""
    car = desk.car[b]
    path = desk.path[desk.row[b]]
    left = desk.memory[b, LEFT]
    if car[SLOWEST] >= 0.0 or left < path[LOW] or left > path[HIGH]:
        return False
    x, y, c, s = desk.ego[b, 0], desk.ego[b, 1], desk.ego[b, 2], desk.ego[b, 3]
    bx = x - 0.1 * c
    by = y - 0.1 * s
    others = desk.others[b]
    for n in range(others.shape[0]):
        o = others[n]
        if o[O_SEEN] == 0.0 or (o[OX] - x) * c + (o[OY] - y) * s > 0.0:
            continue
        gap = gap_to(
            bx, by, c, s, car[HALF_LENGTH], car[HALF_WIDTH], car[ROUNDING],
            o[OX], o[OY], o[OC], o[OS], car[HALF_LENGTH], car[HALF_WIDTH], car[ROUNDING],
        )  # fmt: skip
        if gap < STILL_MARGIN:
            return False
    return True


@jit
def _find_way_past(desk: Desk, b: int, first: int) -> bool:
    """Look for the least offset at which the car gets past what stands in its way, and take it."""
    memory = desk.memory[b]
    sample = desk.sample
    now = memory[LEFT]
    last = sample.shape[0] - 1
    ramp = min(0.7, max(0.15, SPACING * first - 0.1))
    low, high = sample[0, P_LOW], sample[0, P_HIGH]
    steps = int((high - low) / SIDESTEP) + 1
    for k in range(2 * steps + 1):
        aim = SIDESTEP * ((k + 1) // 2)
        if k % 2 == 0:
            aim = -aim
        if aim < low or aim > high:
            continue
        end = _passed(desk, b, now, aim, ramp, last)
        if end >= 0:
            memory[BEGIN] = now
            memory[AIM] = aim
            memory[FROM] = memory[ODO]
            memory[RAMP] = ramp
            memory[UNTIL] = SPACING * end
            return True
    return False


@jit
def _passed(desk: Desk, b: int, now: float, aim: float, ramp: float, last: int) -> int:
    """Return the sample at which a car with the offset `aim` can return to its path, or -1 if it is no way past."""
    for end in range(8, last - 8, 5):
        first, _, _ = _conflict(
            desk, b, min(last, end + 12), 0.0, now, aim, ramp, SPACING * end, PASSING_MARGIN, WARY_MARGIN
        )
        if first < 0:
            return end
        if first <= end - 8:
            return -1
    return -1


@jit
def _follow(desk: Desk, b: int, speed: float) -> tuple[float, float]:
    """Return the command that follows the path at `speed`, backwards if it is negative."""
    car = desk.car[b]
    if speed == 0.0 and car[SLOWEST] <= 0.0:
        return 0.0, 0.0
    memory = desk.memory[b]
    span = desk.span[b]
    row = desk.row[b]
    sigma = memory[SIGMA]
    if speed >= 0.0:
        aim_row, aim_sigma = ahead_on(desk.path, row, sigma, AHEAD, span[0], span[1], span[2], True)
        distance = memory[ODO] - memory[FROM] + AHEAD
        if desk.path[row, PIVOT] != 0.0:
            speed = min(speed, max(desk.path[row, LENGTH] - sigma, 0.01) / car[PERIOD])
    else:
        aim_row, aim_sigma = row, sigma - AHEAD
        distance = memory[ODO] - memory[FROM] - AHEAD
    px, py, tx, ty = place_on(desk.path, aim_row, aim_sigma)
    offset = offset_at(distance, memory[BEGIN], memory[AIM], memory[RAMP], memory[UNTIL])
    if aim_row != row or desk.path[row, LOW] <= memory[LEFT] <= desk.path[row, HIGH]:
        offset = min(max(offset, desk.path[aim_row, LOW]), desk.path[aim_row, HIGH])
    if speed < 0.0:
        offset = memory[LEFT]
    speed, yaw_rate, turns = steer(
        desk.ego[b, 0], desk.ego[b, 1], desk.ego[b, 2], desk.ego[b, 3],
        px - offset * ty, py + offset * tx, speed, car[YAW_MOST], car[RADIUS],
    )  # fmt: skip
    if turns and car[RADIUS] > 0.0:
        return _shuffle(desk, b, yaw_rate)
    return max(speed, car[SLOWEST]), yaw_rate


@jit
def _shuffle(desk: Desk, b: int, yaw_rate: float) -> tuple[float, float]:
    """Return the command of a car with a turning radius that has to turn on the spot: to and fro, or a full turn."""
    memory = desk.memory[b]
    car = desk.car[b]
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
def _last_look(desk: Desk, roads: RoadTable, b: int, speed: float, yaw_rate: float) -> tuple[float, float]:
    """Return the command, or a turn in place, or standing: the first that leads into no contact and off no road."""
    if _is_safe(desk, roads, b, speed, yaw_rate):
        return speed, yaw_rate
    if desk.car[b, SLOWEST] > 0.0:
        return desk.car[b, SLOWEST], yaw_rate
    if desk.car[b, RADIUS] == 0.0 and _is_safe(desk, roads, b, 0.0, yaw_rate):
        return 0.0, yaw_rate
    return 0.0, 0.0


@jit
def _stays_on_road(desk: Desk, roads: RoadTable, b: int, speed: float, yaw_rate: float) -> bool:
    x, y, c, s = desk.ego[b, 0], desk.ego[b, 1], desk.ego[b, 2], desk.ego[b, 3]
    nx, ny, _, _ = advance(x, y, c, s, speed, yaw_rate, desk.car[b, PERIOD])
    edge = roads.half_width[desk.net[b]] - VERGE
    _, d2 = nearest_segment(roads, desk.net[b], nx, ny)
    if d2 <= edge * edge:
        return True
    _, before = nearest_segment(roads, desk.net[b], x, y)
    return d2 < before


@jit
def _is_safe(desk: Desk, roads: RoadTable, b: int, speed: float, yaw_rate: float) -> bool:
    if speed != 0.0 and not _stays_on_road(desk, roads, b, speed, yaw_rate):
        return False
    car = desk.car[b]
    period = car[PERIOD]
    x, y, c, s = desk.ego[b, 0], desk.ego[b, 1], desk.ego[b, 2], desk.ego[b, 3]
    a, h, r, reach = car[HALF_LENGTH], car[HALF_WIDTH], car[ROUNDING], car[REACH]
    travel = max(car[FASTEST], -car[SLOWEST]) * period
    if a + h > 0.0:
        travel += car[YAW_MOST] * reach * period
    others = desk.others[b]
    for n in range(others.shape[0]):
        o = others[n]
        dx = o[OX] - x
        dy = o[OY] - y
        near = 2.0 * reach + 0.2
        if o[O_SEEN] != 0.0 and dx * dx + dy * dy < near * near and not motion_is_safe(
            x, y, c, s, speed, yaw_rate, period, a, h, r, reach,
            o[OX], o[OY], o[OC], o[OS], a, h, r, travel,
        ):  # fmt: skip
            return False
    for p in range(desk.part_off[b], desk.part_off[b + 1]):
        o = desk.part[p]
        dx = o[0] - x
        dy = o[1] - y
        near = reach + o[7] + 0.2
        if dx * dx + dy * dy < near * near and not motion_is_safe(
            x, y, c, s, speed, yaw_rate, period, a, h, r, reach,
            o[0], o[1], o[2], o[3], o[4], o[5], o[6], 0.0,
        ):  # fmt: skip
            return False
    return True
