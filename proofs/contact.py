"""The one-tick lemma of the shield for contacts: whatever another car does in a tick, the shielded one is not at fault.

`keeps_clear`, `gather_close` and `motion_is_safe` are run on unknown poses, gaps and bounds, for any length of a tick.
Of motion and geometry the proofs use, with u from 0 to 1 for the time in the tick:

1. Between two moments no point of a car gets farther than its share of `moved_by` (docs/semantics.md: arcs at constant
   speed), so a gap changes by no more. No point of another car gets farther than u times `travel_of`.
2. f(u), how far ahead of the centre of a disc the other is and can have got, has a second derivative of at most
   (w T)^2 times the distance of the centres, as h' = w h_perp and p' = v h. A function with |f"| <= M is between two
   moments a quarter apart at most M/128 above the greater of its values there (linear interpolation).
3. A disc closes in on what it touches if its velocity and the way from centre to centre have a positive product.
"""

from __future__ import annotations

from contextlib import contextmanager
from types import SimpleNamespace
from typing import TYPE_CHECKING, Any, Final

from dubins_traffic.cars.state import EGO, Command, Pose
from dubins_traffic.policies import safety
from dubins_traffic.shield import checks
from proofs.claims import RefutedError
from proofs.terms import SQUARE, Explorer, Real, Truth, greatest, least, real_of, replaced, truth_of, z3

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator

QUARTERS: Final = 5
"""Poses of a tick that are looked at."""
EXTENT = z3.Function("extent", z3.RealSort(), z3.RealSort(), z3.RealSort())
"""Half the extent of the other body across a direction, given by its two components, metres."""


class Meeting:
    """A car with a command, and another body; `premises` are what is assumed of them.

    `own` (m) is how far the car's points get in the tick, `step` (m) how far those of the other car, and `travel` (m)
    how far they are then from where they have been seen: farther, if commands come late or poses are noisy.
    """

    def __init__(self, *, disc: bool) -> None:
        self.car = SimpleNamespace(
            half_length=0.0 if disc else Real("half_length"), half_width=0.0 if disc else Real("half_width"),
            rounding=Real("reach") if disc else 0.0, reach=Real("reach"), period=Real("period"),
            slowest=Real("slowest"), fastest=Real("fastest"), yaw_most=Real("yaw_most"), late=0.0, unsure=0.0, blur=0.0,
        )  # fmt: skip
        self.command: Any = Command(Real("speed"), Real("yaw_rate"))  # pyright: ignore[reportArgumentType]
        self.poses = [tuple(Real(f"{name}{k}") for name in "xycs") for k in range(QUARTERS)]
        self.pose: Any = Pose(*self.poses[0])  # pyright: ignore[reportArgumentType]
        self.gaps = [Real(f"gap{k}") for k in range(QUARTERS)]
        self.other: Any = SimpleNamespace(**{name: Real(f"other_{name}") for name in "xycs"})
        self.own, self.travel, self.time, self.step = (Real(name) for name in ("own", "travel", "u", "step"))
        self._next = 0

    @property
    def premises(self) -> list[Any]:
        """What is assumed of the car, of its command and of the gaps."""
        car, own, u = self.car, self.own.term, self.time.term
        sizes = (car.half_length, car.half_width, car.yaw_most, car.fastest)
        return [
            real_of(self.command.speed) <= car.fastest.term, real_of(self.command.speed) >= car.slowest.term,
            real_of(abs(self.command.yaw_rate)) <= car.yaw_most.term, car.slowest.term <= 0,
            car.period.term > 0, car.reach.term > 0, *(real_of(size) >= 0 for size in sizes),
            own >= 0, own <= self.step.term, self.step.term <= self.travel.term,
            u >= 0, u <= 1, *(gap.term >= 0 for gap in self.gaps),
            *([] if isinstance(car.half_length, float) else [car.half_length.term > 0]),
        ]  # fmt: skip

    def looks_from(self, k: int) -> None:
        """Let the next pose that is looked at be that of quarter k."""
        self._next = k

    def advance(self, *_: Any) -> tuple[Real, ...]:
        """Return the next pose."""
        self._next += 1
        return self.poses[self._next - 1]

    def separation(self, body: Any, _other: Any) -> tuple[Real, ...]:
        """Return the gap at a pose; nobody asks where it is."""
        k = next(k for k, pose in enumerate(self.poses) if pose[0] is body.x)
        return (self.gaps[k],) + (Real("where"),) * 4

    def reached(self) -> Any:
        """Return how far the other car's points are at time u from where they have been seen, at most."""
        return self.travel.term - self.step.term + self.step.term * self.time.term

    def gap_then(self) -> tuple[Any, list[Any]]:
        """Return the gap at time u to where the other was at the beginning, and what is known of it (1.)."""
        gap, u = z3.Real("gap_then"), self.time.term
        shares = [z3.If(u >= z3.Q(k, 4), u - z3.Q(k, 4), z3.Q(k, 4) - u) for k in range(QUARTERS)]
        return gap, [gap >= own.term - self.own.term * share for own, share in zip(self.gaps, shares, strict=True)]


@contextmanager
def instead(meeting: Meeting, **more: Any) -> Iterator[None]:
    """Let `policies.safety` call terms, and what `more` names."""
    names: dict[str, Any] = {
        "advance": meeting.advance, "separation": meeting.separation, "min": least, "max": greatest,
        "half_extent": lambda tx, ty, *_: Real(EXTENT(tx.term, ty.term)), "moved_by": lambda *_: meeting.own,
        "stride_of": lambda _: meeting.step,
    }  # fmt: skip
    with replaced(safety, names | more):
        yield


def runs(meeting: Meeting, code: Callable[[], Any], *premises: Any) -> Iterator[tuple[Explorer, Any]]:
    """Run code on all its paths, and yield with each what it returns."""
    through = Explorer(*meeting.premises, *premises)
    for found in through.runs(code):
        yield through, found


def nobody_gets_farther() -> int:
    """Prove that no command within bounds moves a point of a car farther than `travel_of` says."""
    count = 0
    for disc in (True, False):
        own = Meeting(disc=disc)
        with instead(own, moved_by=safety.moved_by, stride_of=safety.stride_of):
            for through, (far, most) in runs(
                own, lambda own=own: (safety.moved_by(own.command, own.car), safety.travel_of(own.car))
            ):
                count += 1
                if through.may(real_of(far) > real_of(most)):
                    raise RefutedError("a command moves a car farther than `travel_of` says")
    return count


def _kept_clear(own: Meeting) -> Any:
    own.looks_from(1)
    return safety.keeps_clear(own.pose, own.command, own.car, own.other, own.travel)


def nothing_is_touched() -> int:
    """Prove that a car that moves touches no other, where `keeps_clear` finds that far enough away."""
    count = 0
    for disc in (True, False):
        own = Meeting(disc=disc)
        gap, known = own.gap_then()
        with instead(own, stays_ahead=lambda *_: False):
            for through, clear in runs(own, lambda own=own: _kept_clear(own)):
                if clear is not True:
                    continue
                count += 1
                meets = gap - own.reached() <= 0
                if through.may(own.own.term > 0, meets, *known):
                    raise RefutedError("a car is touched that keeps clear")
    return count


def a_disc_leads_away() -> int:
    """Prove that a disc for which `stays_ahead` closes in on no other disc, whatever that does in the tick."""
    own = Meeting(disc=True)
    travel, step = own.travel.term, own.step.term
    ahead, bend, along = z3.Real("ahead"), z3.Real("bend"), z3.Real("along")
    count = 0

    def look() -> Any:
        own.looks_from(0)
        return safety.stays_ahead(own.pose, own.command, own.car, own.other, own.travel)

    with instead(own):
        for through, stays in runs(own, look):
            if stays is not True:
                continue
            count += 1
            way = 1 if through.may(real_of(own.command.speed) > 0) else -1
            dx, dy = (real_of(getattr(own.other, name)) - own.poses[0][k].term for k, name in enumerate("xy"))
            turn = real_of(abs(own.command.yaw_rate) * own.car.period)
            drive = real_of(abs(own.command.speed) * own.car.period)
            apart = real_of(abs(Real(dx))) + real_of(abs(Real(dy))) + drive
            found = [
                way * ((own.other.x.term - x.term) * c.term + (own.other.y.term - y.term) * s.term)
                for x, y, c, s in own.poses
            ]
            then = [f + travel - step + step * z3.Q(k, 4) for k, f in enumerate(found)]
            known = [bend <= turn * turn * apart, z3.Or([ahead <= f + bend / 128 for f in then])]
            if through.may(ahead > 0, *known):
                raise RefutedError("the other is ahead of a disc that leads away")
            # Of `ahead` the other's way is at most `reached` along the heading (Cauchy and Schwarz).
            if through.may(ahead <= 0, along <= own.reached(), ahead - own.reached() + along > 0):
                raise RefutedError("a disc that leads away closes in")
    return count


def no_way_is_longer_along_a_heading() -> int:
    """Prove that a way of the length r leads at most r along any heading."""
    c, s, x, y, r = z3.Reals("c s x y r")
    solver = z3.Solver()
    solver.add(c * c + s * s == 1, x * x + y * y <= r * r, r >= 0, c * x + s * y > r)
    if solver.check() != z3.unsat:
        raise RefutedError("a way leads farther than it is long")
    return 1


def a_rectangle_leads_away() -> int:
    """Prove that a rectangle which slides past another is touched at its sides or its rear only, if at all.

    All that the other may reach is behind the line of its front, throughout the tick, or beside its way.
    """
    own = Meeting(disc=False)
    count = 0
    speed, car = own.command.speed, own.car
    with instead(own, Box=lambda *_: None):
        for through, slides in runs(own, lambda: safety.slides_on(own.pose, speed, car, own.other)):
            if slides is False:
                continue
            count += 1
            clear = truth_of(slides) if isinstance(slides, Truth) else z3.BoolVal(True)
            way = 1 if through.may(speed.term > 0) else -1
            x, y, c, s = (value.term for value in own.poses[0])
            dx, dy = own.other.x.term - x, own.other.y.term - y
            foremost = way * (dx * c + dy * s) + EXTENT(-s, c)
            front = car.half_length.term + own.own.term * own.time.term
            aside = real_of(abs(Real(dy * c - dx * s))) - EXTENT(c, s)
            if through.may(clear, foremost >= front, aside <= car.half_width.term):
                raise RefutedError("a rectangle that slides past another may run into it")
    return count


def nobody_near_is_overlooked() -> int:
    """Prove that who is not listed by `gather_close` can't be touched in the tick."""
    own, count = Meeting(disc=True), 0
    distance, listed = Real("distance"), SimpleNamespace(near=[0, 0])
    places = {name: {(0, n): Real(f"{name}_of_{n}") for n in range(2)} for name in "xy"}
    state: Any = SimpleNamespace(count=[2], **places)
    with replaced(checks, {"within_sight": lambda *_: True, "travel_of": lambda _: own.travel}):
        for through, near in runs(
            own,
            lambda: checks.gather_close(0, state, -1.0, own.car, listed),  # pyright: ignore[reportArgumentType]
        ):
            if near != 0:
                continue
            count += 1
            dx, dy = (real_of(pair[0, 1] - pair[0, EGO]) for pair in (state.x, state.y))
            through.solver.add(distance.term >= 0, through.square(distance.term) == SQUARE(dx) + SQUARE(dy))
            then = distance.term - 2 * own.car.reach.term - own.own.term * own.time.term
            if through.may(then - own.reached() <= 0):
                raise RefutedError("a car that can be touched is not listed")
    return count


def no_obstacle_is_hit() -> int:
    """Prove that a motion which `motion_is_safe` finds so hits no obstacle, and ends no nearer than it has to begin."""
    count = 0
    for disc in (True, False):
        own = Meeting(disc=disc)
        gap, known = own.gap_then()
        far = own.travel.term / 8
        premises = [own.gaps[0].term > far, far <= real_of(safety.GUARD), own.own.term > 0]
        with instead(own):
            for through, safe in runs(own, lambda own=own: _passes(own), *premises):
                holds = truth_of(safe)
                if not through.may(holds):
                    continue
                count += 1
                if through.may(holds, gap <= 0, *known):
                    raise RefutedError("an obstacle is hit")
                if through.may(holds, own.gaps[-1].term <= far, own.gaps[-1].term >= own.gaps[0].term - own.own.term):
                    raise RefutedError("a tick ends nearer to an obstacle than the next one may begin")
    return count


def _passes(own: Meeting) -> Any:
    own.looks_from(1)
    return safety.motion_is_safe(own.pose, own.command, own.car, own.other, 0.0)
