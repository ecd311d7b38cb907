"""The one-tick lemma of the shield, but for contacts: from a quiet frame it leads to a quiet one, and breaks nothing.

The shield's `refusal` and the referee's `locate`, `_label_blocked` and `_judge_car` are run on the same unknown car,
the one at the frame before, the other at the frame after. What both ask of the geometry, such as the nearest segment or
the coordinates in a lane, are functions of which nothing is assumed but that they are functions, and what the premises
below say. So the proof holds for segments and bodies of any shape. And it holds in floating point: both call the same
functions of the same numbers, and the only arithmetic besides is that of margins of millimetres, whose rounding is
below 1e-15 m.
"""

from __future__ import annotations

from collections.abc import Callable
from contextlib import ExitStack, contextmanager
from types import SimpleNamespace
from typing import TYPE_CHECKING, Any, Final

from dubins_traffic.cars.state import EGO
from dubins_traffic.rules import breaches, frame, lane_state, location, referee_kernel
from dubins_traffic.rules.breach_log import RULES
from dubins_traffic.rules.propositions import FLAG
from dubins_traffic.shield import checks, nearest_command
from dubins_traffic.shield.tables import REASON
from proofs.claims import RefutedError
from proofs.terms import (
    BITS,
    SQUARE,
    Explorer,
    Flags,
    Real,
    Whole,
    explorer,
    greatest,
    least,
    real_of,
    replaced,
    whole_of,
    z3,
)

if TYPE_CHECKING:
    from collections.abc import Iterator

GRAIN: Final = z3.Q(1, 10**9)
"""The tolerance of a judgement, metres (`rules.tables.GRAIN`)."""
OTHER: Final = 1
"""Another car, which may be in a disc."""


_R, _Z = z3.RealSort(), z3.IntSort()
NEAREST, OFF2 = z3.Function("nearest_segment", _R, _R, _Z), z3.Function("off2", _R, _R, _R)
VERTEX, AWAY2 = z3.Function("nearest_vertex", _R, _R, _Z), z3.Function("vertex_distance2", _Z, _R, _R, _R)
SEGMENT2 = z3.Function("distance2", _Z, _R, _R, _R)
BODY2 = z3.Function("distance2_to_body", _Z, _R, _R, _R, _R, _R)
ALONG, ACROSS = z3.Function("progress", _Z, _R, _R, _R), z3.Function("lateral", _Z, _R, _R, _R)
TX, TY = z3.Function("lane_direction_x", _Z, _R, _R, _R), z3.Function("lane_direction_y", _Z, _R, _R, _R)
EXTENT = z3.Function("half_extent", _R, _R, _R, _R, _R)
AWAY = z3.Function("lane_away", _Z, _R, _R, _Z)
HEADING = z3.Function("lane_by_heading", _Z, _R, _R, _R, _R, _Z)
DEGREE, END, LENGTH = (
    z3.Function("degree", _Z, _Z),
    z3.Function("lane_end", _Z, _Z),
    z3.Function("length", _Z, _R),
)
ITS_CROSSES = z3.Int("its_crosses")


class Of:
    """A table whose rows are made of their index."""

    def __init__(self, row: Callable[[Any], Any]) -> None:
        self._row = row

    def __getitem__(self, index: Any) -> Any:
        return self._row(index)


class _Grid(dict[Any, Any]):
    """Rows by (trial, car), or by trial."""

    def __init__(self, value: Any) -> None:
        super().__init__({(0, EGO): value})

    def __missing__(self, _key: object) -> _Grid:
        return self


class World:
    """A car in a frame, its command, and the car in the next frame.

    `premises` are what is assumed of the frame before; what is assumed of the geometry is added where it is asked for.
    """

    def __init__(self, *, crossings: bool = True) -> None:
        self.before = tuple(Real(name) for name in ("x", "y", "c", "s"))
        self.after = self.before
        self.added: list[int] = []
        names = ("radius", "half_length", "half_width", "rounding", "left_set", "left_release", "turn_back")
        self.own = SimpleNamespace(
            **{name: Real(name) for name in (*names, "cross2", "queue2", "stop2")}, net=0, judged3=1,
            crossing_degree=Whole("crossing_degree"),
        )  # fmt: skip
        own = self.own
        self.vehicle = SimpleNamespace(
            half_length=own.half_length, half_width=own.half_width, rounding=own.rounding, disc=own.radius,
            over=own.left_set, degree=own.crossing_degree, period=Real("period"), unsure=0.0,
        )  # fmt: skip
        self.roads = SimpleNamespace(
            half_width=[Real("half_road")], vert_off=[0], seg_off=[0],
            degree=Of(lambda v: Whole(DEGREE(whole_of(v))) if crossings else -1),
            vertex=Of(lambda v: SimpleNamespace(x=v, y=v)),
            segment=Of(lambda k: SimpleNamespace(length=Real(LENGTH(whole_of(k))), piece=-1)),
        )  # fmt: skip
        self.bits = Flags("bits")
        self.lane, self.at, self.crosses, self.tick = (Whole(n) for n in ("lane", "at", "crosses", "tick"))
        self.labels = SimpleNamespace(
            bits=_Grid(self.bits), lane=_Grid(self.lane), at=_Grid(self.at), crosses=_Grid(self.crosses),
            segment=_Grid(Whole("segment")),
        )  # fmt: skip
        self.car = SimpleNamespace(
            top=Real("top"), held_top=Real("held_top"), progress=Real("progress"), lateral=Real("lateral"),
            reach=Real("reach"), gap2=Real("gap2"), zone=0, approach_since=-1, wait_since=-1, left_since=-1,
        )  # fmt: skip
        self.ego = SimpleNamespace(
            top=Real("shields_top"), turn_back=own.turn_back, left_release=own.left_release,
            last_tick=-2, last_lane=-1, last_at=-1, aimed=1, kept=0,
        )  # fmt: skip

    @property
    def premises(self) -> list[Any]:
        """What is assumed of parameters (`rules.tables`) and of the frame before: it is quiet, and as labelled."""
        own, bits = self.own, self.bits
        lane, at, crosses = self.lane.term, self.at.term, self.crosses.term
        x, y, c, s = (value.term for value in self.before)
        half, held = self.roads.half_width[0].term, least(self.car.top, self.car.held_top).term
        segment = z3.If(lane >= 0, lane / 2, -1)
        near = SEGMENT2(segment, x, y) <= SQUARE(half)
        extent = EXTENT(TX(lane, x, y), TY(lane, x, y), c, s)
        return [
            *(getattr(own, name).term >= 0 for name in ("half_length", "half_width", "rounding", "left_release")),
            own.left_release.term <= own.left_set.term, own.radius.term > 0, half >= z3.Q(1, 10),
            own.turn_back.term > z3.Q(2, 100), self.tick.term > 0, own.crossing_degree.term > 0,
            own.cross2.term == SQUARE(own.radius.term + own.rounding.term),
            lane >= -1, crosses >= -1, (lane < 0) == (at >= 0),
            at == z3.If(AWAY2(VERTEX(x, y), x, y) < SQUARE(own.radius.term), VERTEX(x, y), -1),
            z3.Not(bits.has(FLAG.LEFT | FLAG.TURNED)), z3.Implies(bits.has(FLAG.STOPPED), lane >= 0),
            z3.Implies(lane >= 0, ACROSS(lane, x, y) + extent <= own.left_set.term),
            z3.Implies(own.half_length.term + own.half_width.term == 0, extent == own.rounding.term),
            VERTEX(x, y) >= 0,
            OFF2(x, y) <= SQUARE(half + GRAIN),
            z3.Implies(lane >= 0, held - ALONG(lane, x, y) < own.turn_back.term),
            z3.Implies(lane >= 0, z3.Or(NEAREST(x, y) == segment, OFF2(x, y) > SQUARE(half), near)),
            z3.Implies(z3.And(bits.has(FLAG.CLEAR), lane >= 0), END(lane) != ITS_CROSSES),
            # The shield measures backing from no less than the referee does: `top_is_kept`.
            held <= self.ego.top.term,
        ]  # fmt: skip

    @property
    def squared(self) -> list[Any]:
        """What the premises have the squares of."""
        own, half = self.own, self.roads.half_width[0].term
        return [own.radius.term, own.radius.term + own.rounding.term, half, half + GRAIN]

    @property
    def traffic(self) -> Any:
        """What the shield is given."""
        drivers = SimpleNamespace(vehicle=[self.vehicle], net=[0])
        return SimpleNamespace(state=_state(self.before), labels=self.labels, roads=self.roads, drivers=drivers)

    @property
    def shields(self) -> Any:
        """The shield's memory."""
        return SimpleNamespace(ego=[self.ego])

    @property
    def tables(self) -> Any:
        """What the labeller and the referee are given, of the next frame."""
        x, y, *_ = self.after
        judged = SimpleNamespace(
            bits=self.bits, lane=self.lane, crosses=self.crosses, at=self.at, off_road=-1, left_since=-1,
            free_since=-1, unblocked_since=-1, number=EGO, due=0,
        )  # fmt: skip
        cars = {(0, EGO): judged, (0, OTHER): SimpleNamespace(crosses=Whole(ITS_CROSSES))}
        memory = SimpleNamespace(
            car=_Grid(self.car), cell=_Grid(SimpleNamespace(vertex=Whole(VERTEX(x.term, y.term)))), kept=_Grid(0),
            growth=_Grid(0), head=_Grid(0),
        )  # fmt: skip
        return SimpleNamespace(
            state=_state(self.after), roads=self.roads, labels=self.labels, memory=memory, rules=[self.own],
            log=SimpleNamespace(car=cars), obstacles=SimpleNamespace(base=[-1]), spacing=SimpleNamespace(near=[OTHER]),
            terms=[SimpleNamespace(return_ticks=300)],
        )  # fmt: skip

    def advance(self, *_: Any) -> tuple[Real, ...]:
        """Move the car to a pose of which nothing is known."""
        self.after = tuple(Real(name) for name in ("x1", "y1", "c1", "s1"))
        return self.after


def _state(pose: tuple[Real, ...]) -> Any:
    return SimpleNamespace(**{name: _Grid(value) for name, value in zip("xycs", pose, strict=True)})


def geometry(world: World) -> dict[str, Any]:
    """Return what stands for the functions of `roads.lookup` and `rules.shape`, and add what they are known to be.

    A squared distance is not negative; the nearest segment is as far as `nearest_segment` says; the body of a round car
    is as far from a point as its centre; and the body met just the disc of `crosses` in the frame before.
    """
    own = world.own
    is_round = own.half_length.term + own.half_width.term == 0

    def nearest_segment(_r: Any, _n: Any, x: Real, y: Real) -> tuple[Whole, Real]:
        near, off2 = NEAREST(x.term, y.term), OFF2(x.term, y.term)
        explorer().solver.add(near >= 0, off2 >= 0, SEGMENT2(near, x.term, y.term) == off2)
        return Whole(near), Real(off2)

    def vertex_distance2(_r: Any, _n: Any, v: Any, x: Real, y: Real) -> Real:
        found = AWAY2(whole_of(v), x.term, y.term)
        explorer().solver.add(found >= 0)
        if x is world.before[0]:
            meets = (found < own.cross2.term) == (world.crosses.term == whole_of(v))
            explorer().solver.add(z3.Implies(is_round, meets))
        return Real(found)

    def nearest_vertex(roads: Any, net: Any, x: Real, y: Real) -> tuple[Whole, Real]:
        near = VERTEX(x.term, y.term)
        explorer().solver.add(near >= 0)
        return Whole(near), vertex_distance2(roads, net, Whole(near), x, y)

    def distance2_to_body(v: Any, _v: Any, x: Real, y: Real, c: Real, s: Real, *_: Any) -> Real:
        at = whole_of(v)
        found = BODY2(at, x.term, y.term, c.term, s.term)
        explorer().solver.add(found >= 0, z3.Implies(is_round, found == AWAY2(at, x.term, y.term)))
        if x is world.before[0]:
            explorer().solver.add((found < own.cross2.term) == (world.crosses.term == at))
        return Real(found)

    def half_extent(tx: Real, ty: Real, c: Real, s: Real, _body: Any) -> Real:
        found = EXTENT(tx.term, ty.term, c.term, s.term)
        explorer().solver.add(z3.Implies(is_round, found == own.rounding.term))
        return Real(found)

    def half_across(_b: int, _n: int, tx: Real, ty: Real, state: Any, body: Any) -> Real:
        return half_extent(tx, ty, state.c[0, EGO], state.s[0, EGO], body)

    def lane_away(_r: Any, _n: Any, v: Any, x: Real, y: Real) -> Whole:
        found = AWAY(whole_of(v), x.term, y.term)
        explorer().solver.add(found >= 0)
        return Whole(found)

    def lane_by_heading(_r: Any, _n: Any, segment: Any, pose: Any) -> Whole:
        found = HEADING(whole_of(segment), *(value.term for value in pose))
        explorer().solver.add(found / 2 == whole_of(segment))
        return Whole(found)

    def pair(first: Any, second: Any) -> Callable[..., tuple[Real, Real]]:
        return lambda _r, _n, lane, x, y: tuple(Real(f(whole_of(lane), x.term, y.term)) for f in (first, second))

    return {
        "nearest_segment": nearest_segment, "nearest_vertex": nearest_vertex, "vertex_distance2": vertex_distance2,
        "distance2": lambda _r, _n, k, x, y: Real(SEGMENT2(whole_of(k), x.term, y.term)),
        "distance2_to_body": distance2_to_body, "half_extent": half_extent, "half_across": half_across,
        "lane_coordinates": pair(ALONG, ACROSS), "lane_direction_at": pair(TX, TY),
        "lane_end": lambda _r, _n, lane: Whole(END(whole_of(lane))),
        "lane_away": lane_away, "lane_by_heading": lane_by_heading,
        "_look_up": lambda x, y, t, own, _cell: nearest_segment(t, own.net, x, y),
    }  # fmt: skip


def _nothing(*_: Any) -> int:
    """Keep a cache or a list that no clause here reads."""
    return 0


def _same(value: Any) -> Any:
    return value


PLAIN: Final[dict[str, Any]] = {
    "min": least, "max": greatest, "float": _same, "int": _same, "np": SimpleNamespace(int64=_same),
    "sqrt": lambda _: Real(z3.FreshReal("root")),
}  # fmt: skip
"""What numbers call otherwise than terms do. No clause here reads a root: it only says how long a cache is valid."""


@contextmanager
def instead(world: World, shield: dict[str, Any], located: dict[str, Any]) -> Iterator[None]:
    """Let the modules of shield, labeller and referee call terms.

    What `shield` and `located` name are left out of `shield.checks` and of `rules.location`.
    """
    asked = PLAIN | geometry(world)
    cached = dict.fromkeys(
        ("_change_lists", "note_growth", "keep_region", "keep_arm", "growth_row", "keep_road"), _nothing
    )
    flags = {
        "still": lambda *_: Flags("still") & FLAG.STILL, "lingers": lambda *_: Flags("lingers") & FLAG.LINGERS,
        "_change_crossing": lambda *_: False,
    }  # fmt: skip
    alone = {"_cars_beside": lambda *_: (False, False), "forget_region": _nothing}

    def enter(b: int, n: int, tick: Any, v: Any, stopped: Any, tables: Any) -> None:
        breaches.judge_entry(b, n, tick, v, stopped, 1, tables)

    def add(_log: Any, _car: Any, rule: int, *_: Any) -> None:
        world.added.append(rule)

    changes = (
        (checks, asked | {"advance": world.advance, "may_touch": lambda *_: False} | shield),
        (nearest_command, asked), (lane_state, asked), (location, asked | cached | flags | located),
        (frame, asked | alone), (referee_kernel, asked | {"_judge_entry": enter}),
        (breaches, {"add": add}),
    )  # fmt: skip
    with ExitStack() as stack:
        for module, names in changes:
            stack.enter_context(replaced(module, names))
        yield


NO_LANE: Final = {"lane_here": lambda *_: (0, True), "along_lane": lambda *_: (0, 0.0, 0.0, False)}
NO_REACH: Final = {"_reach": lambda *_: (0.0, 0.0)}
NO_ENTRY: Final = {"_entry_flags": lambda *_: Flags(bits=[False] * BITS)}
"""What the labeller finds that a clause does not depend on: left out, the code has fewer paths."""


def keeps(refused: dict[str, Any], located: dict[str, Any], *, lane: bool, stands: bool = False) -> int:
    """Prove that a command that `refusal` lets through breaks no rule that is judged from what is not left out.

    `refused` and `located` are left out of the shield's look and of the labeller's; `lane` tells whether the car must
    not be left in the next frame either. With `stands` the car stands instead, and nobody looks. Returns the number of
    paths on which the command is let through.
    """
    through = Explorer(*World().premises, squared=World().squared)
    worlds: list[World] = []

    def tick() -> int:
        world = World(crossings=not lane)
        worlds.append(world)
        with instead(world, refused, located):
            reason: int = REASON.NOTHING
            if not stands:
                reason = checks.refusal(0, Real("speed"), Real("yaw_rate"), 0, world.traffic, world.shields)
            if reason == REASON.NOTHING:
                tables = world.tables
                location.locate(0, EGO, world.tick, tables)
                if lane:
                    frame._label_blocked(0, EGO, world.tick, tables)
                referee_kernel._judge_car(0, EGO, world.tick, tables)
        return reason

    count = 0
    for reason in through.runs(tick):
        if reason != REASON.NOTHING:
            continue
        count += 1
        world = worlds[-1]
        if world.added:
            raise RefutedError(f"a command is let through that breaks {RULES[world.added[0]]}")
        if lane and through.may(world.labels.bits[0, EGO].has(FLAG.LEFT)):
            raise RefutedError("a command is let through by which the car is left in the next frame")
    return count


def _passes(*_: Any) -> int:
    return REASON.NOTHING


def stays_on_the_road() -> int:
    """Prove it of 1.road."""
    return keeps({"_enters": _passes, "_leaves_lane": _passes}, NO_LANE | NO_REACH | NO_ENTRY, lane=False)


def keeps_its_lane() -> int:
    """Prove it of 2.left and 2.turn, and that the next frame is quiet."""
    return keeps({"_enters": _passes}, NO_ENTRY, lane=True)


def enters_on_its_turn() -> int:
    """Prove it of 3.stop, 3.order and 3.clear."""
    return keeps({"_leaves_lane": _passes}, NO_LANE | NO_REACH, lane=False)


def keeps_while_standing() -> int:
    """Prove of a car that stands that it breaks none of 1.road and rules 2 and 3, and that the next frame is quiet."""
    in_its_lane = keeps({}, NO_ENTRY, lane=True, stands=True)
    return in_its_lane + keeps({}, NO_LANE | NO_REACH, lane=False, stands=True)


def top_is_kept() -> int:
    """Prove that the shield keeps the greatest progress as the labeller does; backing is measured from no more."""
    world = World()
    same = z3.Implies(world.lane.term >= 0, world.ego.top.term == world.car.top.term)
    through = Explorer(*world.premises, same, squared=world.squared)

    def tick() -> World:
        own = World()
        own.advance()
        own.ego.last_lane, own.ego.last_at, own.ego.last_tick = own.lane, own.at, own.tick - 1
        with instead(own, {}, NO_REACH | NO_ENTRY):
            location.locate(0, EGO, own.tick, own.tables)
            traffic = own.traffic
            traffic.state = _state(own.after)
            nearest_command._remember(0, own.tick, traffic, own.shields)
        return own

    count = 0
    for own in through.runs(tick):
        assert isinstance(own, World)
        count += 1
        now = whole_of(own.labels.lane[0, EGO])
        if through.may(now >= 0, real_of(own.ego.top) != real_of(own.car.top)):
            raise RefutedError("the shield's greatest progress is another than the labeller's")
        if through.may(now >= 0, real_of(least(own.car.top, own.car.held_top)) > real_of(own.car.top)):
            raise RefutedError("backing is measured from more than the greatest progress")
    return count
