"""How the controller `lanes` waits: it backs up, passes what stands in its way, or asks for another route."""

from __future__ import annotations

from dubins_traffic.kernels.compile import jit
from dubins_traffic.policies.lanes.gaps import (
    NOBODY,
    O_GAP,
    O_SEEN,
    O_STILL,
    OC,
    OS,
    OX,
    OY,
    P_HIGH,
    P_LOW,
    SPACING,
    first_conflict,
    gap_to,
)
from dubins_traffic.policies.lanes.knowledge import (
    AIM,
    BACK_SPEED,
    BACKING,
    BARRED,
    BEGIN,
    CLEAR,
    DESPAIR,
    FASTEST,
    FROM,
    HALF_LENGTH,
    HALF_WIDTH,
    HELD_UP,
    LEFT,
    NEAR,
    ODO,
    PASSING_MARGIN,
    PASSING_SPEED,
    PATIENCE,
    PERIOD,
    RAMP,
    REACH,
    RETRY,
    ROUNDING,
    SIDESTEP,
    SLOWEST,
    STANDS,
    STILL_MARGIN,
    STUCK,
    TRIED,
    UNTIL,
    WAITED,
    WARY_MARGIN,
    Knowledge,
)
from dubins_traffic.policies.lanes.paths import HIGH, LOW


@jit
def gap_now(known: Knowledge, b: int, n: int) -> float:
    """Return the gap between the ego and car n, metres."""
    car = known.car[b]
    o = known.others[b, n]
    ego = known.ego[b]
    return gap_to(
        ego[0], ego[1], ego[2], ego[3], car[HALF_LENGTH], car[HALF_WIDTH], car[ROUNDING],
        o[OX], o[OY], o[OC], o[OS], car[HALF_LENGTH], car[HALF_WIDTH], car[ROUNDING],
    )  # fmt: skip


@jit
def conflict(
    known: Knowledge,
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
    """Return what `policies.lanes.gaps.first_conflict` says of the ego's manoeuvre: first sample, who, nearest
    sample.
    """
    car = known.car[b]
    return first_conflict(
        known.sample, last, done, begin, aim, ramp, until,
        car[HALF_LENGTH], car[HALF_WIDTH], car[ROUNDING], car[REACH],
        known.others[b], known.part, known.part_off[b], known.part_off[b + 1], still, moving,
    )  # fmt: skip


@jit
def stand(known: Knowledge, b: int, speed: float, cause: int, first: int) -> float:
    """Count how long the car has been kept waiting by `cause`; back up, pass or ask for another route in time."""
    memory = known.memory[b]
    period = known.car[b, PERIOD]
    if memory[BACKING] > 0.0 and cause != NOBODY and _backs_up(known, b, int(memory[BACKING]) - 1):
        return -BACK_SPEED
    stuck = memory[STUCK] > HELD_UP
    if stuck and cause == NOBODY:
        cause = _nearest_body(known, b)
        if cause == NOBODY:
            _return(known, b)
    if cause == NOBODY or (speed > 0.03 and not stuck):
        return speed
    memory[WAITED] += period
    memory[TRIED] += period
    still = known.others[b, cause, O_STILL] if cause >= 0 else 1e9
    comes = cause >= 0 and is_oncoming(known, b, cause)
    hasty = stuck or comes
    if (
        memory[WAITED] > (HELD_UP if hasty else PATIENCE)
        and still > (0.0 if hasty else STANDS)
        and memory[TRIED] >= (HELD_UP if comes else RETRY)
    ):
        memory[TRIED] = 0.0
        if _find_way_past(known, b, first):
            memory[STUCK] = 0.0
            memory[BACKING] = 0.0
            return min(known.car[b, FASTEST], PASSING_SPEED)
    if cause >= 0 and _backs_up(known, b, cause):
        return -BACK_SPEED
    if memory[WAITED] > DESPAIR:
        known.blocker[b] = cause
    return 0.0


@jit
def _return(known: Knowledge, b: int) -> None:
    """Give up what the car was about, and go back to the path from where it is."""
    memory = known.memory[b]
    memory[BEGIN] = memory[LEFT]
    memory[AIM] = 0.0
    memory[FROM] = memory[ODO]
    memory[RAMP] = memory[UNTIL] = 0.2 + abs(memory[LEFT])
    memory[STUCK] = 0.0


@jit
def is_oncoming(known: Knowledge, b: int, n: int) -> bool:
    """Whether car n faces the ego's way back, within 60 degrees."""
    o = known.others[b, n]
    return o[OC] * known.ego[b, 2] + o[OS] * known.ego[b, 3] < -0.5


@jit
def _backs_up(known: Knowledge, b: int, cause: int) -> bool:
    """Whether to back up from a car that stands so near that it may be waiting for the ego to go away.

    Once begun, this goes on until there is enough room, the car moves off or something is behind.
    """
    memory = known.memory[b]
    o = known.others[b, cause]
    dx = o[OX] - known.ego[b, 0]
    dy = o[OY] - known.ego[b, 1]
    far2 = dx * dx + dy * dy
    if memory[BACKING] == 0.0 and far2 < NEAR * NEAR and memory[WAITED] > 0.6 and o[O_STILL] > 0.5:
        memory[BACKING] = cause + 1.0
    if memory[BACKING] > 0.0 and (o[O_SEEN] == 0.0 or far2 > CLEAR * CLEAR or not _free_behind(known, b)):
        memory[BACKING] = BARRED
    return memory[BACKING] > 0.0


@jit
def _nearest_body(known: Knowledge, b: int) -> int:
    """Return the sensed car nearest to the ego, or an obstacle's part if there is no car within 1 m."""
    best = 1.0
    who = -1 if known.part_off[b + 1] > known.part_off[b] else NOBODY
    others = known.others[b]
    for n in range(others.shape[0]):
        if others[n, O_SEEN] != 0.0 and others[n, O_GAP] < best:
            best = others[n, O_GAP]
            who = n
    return who


@jit
def _free_behind(known: Knowledge, b: int) -> bool:
    """Whether the car may back up a little: able to, on the road, nobody close behind."""
    car = known.car[b]
    path = known.path[known.row[b]]
    left = known.memory[b, LEFT]
    if car[SLOWEST] >= 0.0 or left < path[LOW] or left > path[HIGH]:
        return False
    x, y, c, s = known.ego[b, 0], known.ego[b, 1], known.ego[b, 2], known.ego[b, 3]
    bx = x - 0.1 * c
    by = y - 0.1 * s
    others = known.others[b]
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
def _find_way_past(known: Knowledge, b: int, first: int) -> bool:
    """Look for the least offset at which the car gets past what stands in its way, and take it."""
    memory = known.memory[b]
    sample = known.sample
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
        end = _passed(known, b, now, aim, ramp, last)
        if end >= 0:
            memory[BEGIN] = now
            memory[AIM] = aim
            memory[FROM] = memory[ODO]
            memory[RAMP] = ramp
            memory[UNTIL] = SPACING * end
            return True
    return False


@jit
def _passed(known: Knowledge, b: int, now: float, aim: float, ramp: float, last: int) -> int:
    """Return the sample at which a car with the offset `aim` can return to its path, or -1 if it is no way past."""
    for end in range(8, last - 8, 5):
        first, _, _ = conflict(
            known, b, min(last, end + 12), 0.0, now, aim, ramp, SPACING * end, PASSING_MARGIN, WARY_MARGIN
        )
        if first < 0:
            return end
        if first <= end - 8:
            return -1
    return -1
