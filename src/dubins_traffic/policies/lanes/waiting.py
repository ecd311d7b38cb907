"""How the controller `lanes` waits: it backs up, passes what stands in its way, or asks for another route."""

from __future__ import annotations

from dubins_traffic.cars.state import Pose
from dubins_traffic.kernels.compile import jit
from dubins_traffic.policies.lanes.gaps import Manoeuvre, first_conflict, gap_between, pose_of
from dubins_traffic.policies.lanes.knowledge import NOBODY, Knowledge
from dubins_traffic.policies.safety import body_at


@jit
def gap_from(known: Knowledge, x: float, y: float, n: int) -> float:
    """Return the gap, metres, between car n and the ego if its centre were at (x, y)."""
    ego, vehicle = known.follower, known.vehicle
    body = body_at(Pose(x, y, ego.c, ego.s), vehicle)
    return gap_between(body, body_at(pose_of(known.other[n]), vehicle))


@jit
def stand(known: Knowledge, speed: float, cause: int, first: int) -> float:
    """Return the speed of the ego, which the body `cause` (number) keeps to `speed`; in time begin to back up or pass.

    The conflict begins at the sample `first` (number). An ego kept waiting for long asks for another route.
    """
    ego, manner = known.follower, known.manner
    if ego.backs_from >= 0 and cause != NOBODY and _backs_up(known, ego.backs_from):
        return -manner.back_speed
    stuck = ego.stuck > manner.held_up
    if stuck and cause == NOBODY:
        cause = _nearest_body(known)
        if cause == NOBODY:
            _return(known)
    if cause == NOBODY or (speed > 0.03 and not stuck):
        return speed
    ego.waited += known.vehicle.period
    ego.tried += known.vehicle.period
    still = known.still[cause] if cause >= 0 else 1e9
    comes = cause >= 0 and is_oncoming(known, cause)
    hasty = stuck or comes
    if (
        ego.waited > (manner.held_up if hasty else manner.patience)
        and still > (0.0 if hasty else manner.stands)
        and ego.tried >= (manner.held_up if comes else manner.retry)
    ):
        ego.tried = 0.0
        if _find_way_past(known, first):
            ego.stuck = 0.0
            ego.backs_from = -1
            ego.is_barred = 0
            return min(known.vehicle.fastest, manner.passing_speed)
    if cause >= 0 and _backs_up(known, cause):
        return -manner.back_speed
    if ego.waited > manner.despair:
        ego.blocker = cause
    return 0.0


@jit
def _return(known: Knowledge) -> None:
    """Give up the manoeuvre, and go back to the path from here."""
    ego = known.follower
    ramp = 0.2 + abs(ego.left)
    _begin(known, Manoeuvre(ego.left, 0.0, ramp, ramp))
    ego.stuck = 0.0


@jit
def _begin(known: Knowledge, manoeuvre: Manoeuvre) -> None:
    ego = known.follower
    ego.begin, ego.aim, ego.ramp, ego.until = manoeuvre
    ego.since = ego.odometer


@jit
def is_oncoming(known: Knowledge, n: int) -> bool:
    """Tell whether car n comes toward the ego, within 60 degrees."""
    car = known.other[n]
    return car.c * known.follower.c + car.s * known.follower.s < -0.5


@jit
def _backs_up(known: Knowledge, cause: int) -> bool:
    """Tell whether to back up from a car that stands so near that it may be waiting for the ego to move away.

    Once begun, this goes on until there is enough room, the car moves off or something is behind.
    """
    ego, manner, car = known.follower, known.manner, known.other[cause]
    dx = car.x - ego.x
    dy = car.y - ego.y
    far2 = dx * dx + dy * dy
    begins = ego.backs_from < 0 and ego.is_barred == 0
    if begins and far2 < manner.near * manner.near and ego.waited > 0.6 and known.still[cause] > 0.5:
        ego.backs_from = cause
    if ego.backs_from >= 0 and (car.tick != ego.tick or far2 > manner.clear * manner.clear or not _free_behind(known)):
        ego.backs_from = -1
        ego.is_barred = 1
    return ego.backs_from >= 0


@jit
def _nearest_body(known: Knowledge) -> int:
    """Return the sensed car nearest to the ego, or an obstacle's part if there is no car within 1 m."""
    best = 1.0
    who = -1 if known.obstacles.parts.shape[0] > 0 else NOBODY
    for n in range(known.other.shape[0]):
        if known.other[n].tick == known.follower.tick and known.gap[n] < best:
            best = known.gap[n]
            who = n
    return who


@jit
def _free_behind(known: Knowledge) -> bool:
    """Tell whether the ego can back up a little: its bounds allow it, on the road, and no body is close behind."""
    ego = known.follower
    piece = known.path[ego.row]
    if known.vehicle.slowest >= 0.0 or ego.left < piece.low or ego.left > piece.high:
        return False
    x, y, c, s = ego.x, ego.y, ego.c, ego.s
    for n in range(known.other.shape[0]):
        car = known.other[n]
        if car.tick != ego.tick or (car.x - x) * c + (car.y - y) * s > 0.0:
            continue
        if gap_from(known, x - 0.1 * c, y - 0.1 * s, n) < known.manner.still_margin:
            return False
    return True


@jit
def _find_way_past(known: Knowledge, first: int) -> bool:
    """Look for the least offset at which the ego gets past what stands in its way, and begin that manoeuvre."""
    manner, sample, now = known.manner, known.sample, known.follower.left
    last = sample.shape[0] - 1
    ramp = min(0.7, max(0.15, manner.spacing * first - 0.1))
    low, high = sample[0].low, sample[0].high
    steps = int((high - low) / manner.sidestep) + 1
    for k in range(2 * steps + 1):
        aim = manner.sidestep * ((k + 1) // 2)
        if k % 2 == 0:
            aim = -aim
        if aim < low or aim > high:
            continue
        end = _passed(known, Manoeuvre(now, aim, ramp, 0.0), last)
        if end >= 0:
            _begin(known, Manoeuvre(now, aim, ramp, manner.spacing * end))
            return True
    return False


@jit
def _passed(known: Knowledge, way: Manoeuvre, last: int) -> int:
    """Return the sample at which the ego can return to its path after a manoeuvre, -1 if that leads not past."""
    manner = known.manner
    for end in range(8, last - 8, 5):
        tried = Manoeuvre(way.begin, way.aim, way.ramp, manner.spacing * end)
        first, _, _ = first_conflict(known, min(last, end + 12), 0.0, tried, manner.passing_margin, manner.wary_margin)
        if first < 0:
            return end
        if first <= end - 8:
            return -1
    return -1
