"""What `lawful` cars owe in one tick can be kept: E1 by standing, E2 by the law's commands, E3 without breaking E1.

E1 is in `quiet.keeps_while_standing`. For E2 the law's last step, `steering.move`, is run on unknown numbers: what it
asks, such as where to steer, is anything. It must return a command that it has found safe, of which `contact` proves
the rest, or stand. For E3 the judgement of who has to enter is run, and then the judgement of an entry from the same
frame.
"""

from __future__ import annotations

from types import SimpleNamespace
from typing import TYPE_CHECKING, Any

from dubins_traffic.cars.state import EGO
from dubins_traffic.policies.rules import steering
from dubins_traffic.rules import breaches
from dubins_traffic.rules.breach_log import RULES
from dubins_traffic.rules.propositions import FLAG
from proofs.claims import RefutedError
from proofs.quiet import PLAIN, Of
from proofs.terms import Explorer, Flags, Real, Truth, Whole, replaced, truth_of, z3

if TYPE_CHECKING:
    from collections.abc import Callable

AGENT = 1
"""The e-agent that is looked at."""


def _same(value: Any) -> Of:
    """Return a table in which every row is the same."""
    return Of(lambda _index: value)


class _Until:
    """Where a car returns: it may fall back already, or not."""

    __hash__ = None

    def __eq__(self, _other: object) -> Any:
        return _either()


class Drive:
    """A car that the law is about to drive, and what it has found to be safe so far."""

    def __init__(self, *, disc: bool) -> None:
        self.found: list[tuple[Any, Any, Truth]] = []
        """Commands, and whether they are safe."""
        vehicle = SimpleNamespace(
            yaw_most=Real("yaw_most"), tightest=Real("tightest"), half_length=0.0 if disc else Real("half_length"),
            period=Real("period"), slowest=Real("slowest"), reach=Real("reach"), middle=Real("middle"),
        )  # fmt: skip
        self.disc = disc
        self.premises = [vehicle.tightest.term >= 0, *([] if disc else [vehicle.half_length.term > 0])]
        pose = {name: _same(Real(name)) for name in "xycs"}
        car = SimpleNamespace(aside=Real("aside"), until=_Until())
        self.traffic = SimpleNamespace(
            state=SimpleNamespace(**pose), labels=SimpleNamespace(bits=_same(Flags("bits"))),
            drivers=SimpleNamespace(vehicle=[vehicle], car=_same(car)), scratch=SimpleNamespace(near=[EGO]),
        )  # fmt: skip

    def is_safe(self, _b: int, _n: int, speed: Any, yaw_rate: Any, *_: Any) -> Truth:
        """Note what is asked; the answer may be either."""
        answer = _either()
        self.found.append((speed, yaw_rate, answer))
        return answer

    def drive(self, near: int) -> tuple[Any, Any]:
        """Run the law's last step with `near` cars listed; return the command."""
        names = ("allowed", "left", "offset", "px", "py", "bend")
        with replaced(steering, self._instead()):
            found: tuple[Any, Any] = steering.move(
                0, AGENT, *(Real(name) for name in names), _either(), SimpleNamespace(), near, -1, self.traffic
            )  # fmt: skip
        return found

    def _instead(self) -> dict[str, Any]:
        """Return what stands for what `steering` calls."""
        return PLAIN | {
            "is_safe": self.is_safe, "is_safe_from": _either_way, "steer": _pair, "keep_right": _pair,
            "heading": _pair, "slowed": _any_real, "room_to_return": _any_real, "along": _any_real,
            "aside": _any_real, "travel_of": _any_real, "last_return": _any_real, "backs_off": _any_real,
            "within_lane": _either_way, "stays_right": _either_way, "becomes_left": _either_way,
        }  # fmt: skip


def _either() -> Truth:
    return Truth(z3.FreshBool("either"))


def _either_way(*_: Any) -> Truth:
    return _either()


def _any_real(*_: Any) -> Real:
    return Real(z3.FreshReal("any"))


def _pair(*_: Any) -> tuple[Real, Real]:
    return _any_real(), _any_real()


def drives_clear_or_stands() -> int:
    """Prove that the law's last step returns a command that is safe, or stands."""
    count = 0
    for disc in (True, False):
        for near in (0, 1):
            count += _drives_clear(lambda disc=disc: Drive(disc=disc), near)
    return count


def _drives_clear(make: Callable[[], Drive], near: int) -> int:
    through = Explorer(*make().premises)
    drives: list[Drive] = []

    def tick() -> tuple[Any, Any]:
        drives.append(make())
        return drives[-1].drive(near)

    count = 0
    for speed, yaw_rate in through.runs(tick):
        count += 1
        own = drives[-1]
        safe = [
            answer
            for one, other, answer in own.found
            if one is speed and (other is yaw_rate or (_is_zero(other) and _is_zero(yaw_rate)))
        ]
        if any(not through.may(z3.Not(truth_of(answer))) for answer in safe):
            continue
        # A disc that turns in place stays where it is; other bodies stand if they do not turn either.
        if not (_is_zero(speed) and (own.disc or _is_zero(yaw_rate))):
            raise RefutedError("the law drives a car by a command that it has not found safe")
    return count


def _is_zero(value: Any) -> bool:
    return isinstance(value, float) and value == 0.0


def may_enter_when_it_must() -> int:
    """Prove that a car whose time to enter runs (E3) breaks none of 3.stop, 3.order and 3.clear by entering.

    It enters in the next frame. Of labels it is assumed what their definitions say: who is first has nobody ahead, and
    who is at a clear crossing has nobody else's body in it.
    """
    bits, its = Flags("bits"), Whole("its_crosses")
    lane, v = Whole("lane"), Whole("v")
    premises = [
        lane.term >= 0, v.term >= 0, bits.has(FLAG.STOPPED),
        z3.Implies(bits.has(FLAG.FIRST), z3.Not(bits.has(FLAG.AHEAD))),
        z3.Implies(bits.has(FLAG.CLEAR), its.term != v.term),
    ]  # fmt: skip
    through = Explorer(*premises)
    broken: list[int] = []
    cars: list[Any] = []

    def frame() -> Any:
        broken.clear()
        car = SimpleNamespace(bits=bits, lane=lane, first_since=-1, crosses=Whole("crosses"), number=AGENT)
        cars[:] = [car]
        log = SimpleNamespace(car={(0, AGENT): car, (0, EGO): SimpleNamespace(crosses=its)})
        kept = SimpleNamespace(forfeits=0, ticket=-1, wait_since=-1)
        tables = SimpleNamespace(
            log=log, terms=[SimpleNamespace(enter_ticks=300, most_tickets=1)],
            memory=SimpleNamespace(car={(0, AGENT): kept}), spacing=SimpleNamespace(near=[EGO, AGENT]),
            labels=SimpleNamespace(lane=_same(lane), bits=_same(bits)),
        )  # fmt: skip
        tick = 7
        with replaced(breaches, {"add": lambda _log, _car, rule, *_: broken.append(rule)}):
            breaches.judge_queue(0, AGENT, tick, v, tables)
            if car.first_since >= 0:
                breaches.judge_entry(0, AGENT, tick + 1, v, True, 2, tables)
        return car.first_since

    count = 0
    for since in through.runs(frame):
        if isinstance(since, int) and since >= 0:
            count += 1
            if broken:
                raise RefutedError(f"a car that must enter breaks {RULES[broken[0]]} by that")
    if not count:
        raise RefutedError("no car has to enter")
    return count
