"""The game of cells as a specification over propositions, for tools that read GR(1) or temporal logic.

The cell of a car is a number, written in bits: ``ego_0``, ``ego_1``, ... for the ego, lowest first, ``car1_0``, ...
for the first e-agent. Cells are numbered as in `RoadCells`: nodes, then lanes. ``first_1_2`` says that car 1 is
before car 2 in the order of one crossing, ``first_0_1`` that the ego is before car 1; false of cars that do not wait
for one crossing. The environment chooses the cells of the e-agents and the order among them, then the system that of
the ego.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import combinations, permutations
from typing import Final

from dubins_traffic.errors import InputError
from dubins_traffic.logic.formula import (
    Formula,
    Op,
    always,
    conj,
    disj,
    eventually,
    iff,
    implies,
    negation,
    next_,
    prop,
)
from dubins_traffic.logic.rewrite import simplify
from dubins_traffic.specifications.exports import FORMATS, Specification
from dubins_traffic.synthesis.assumption import Arriving, Forfeits, Leaving, Order
from dubins_traffic.synthesis.board import Board

EGO: Final = 0
PERIOD: Final = 1.0
"""A tick is a turn: specifications of games have no bounds in seconds."""
MOST_CARS: Final = 4
"""E-agents of the largest game that is written as a specification: cars have names in it, so it grows fast."""


FORMS: Final = {".structuredslugs": "slugs", ".tlsf": "tlsf", ".py": "tulip"}
"""Endings of files of specifications, and the formats of `specifications.exports` that they stand for."""


def specification_text(board: Board, starts: Sequence[int], ending: str) -> str:
    """Return the game as a specification in the format that an ending of files stands for.

    InputError as `specification`, and for another ending.
    """
    if ending not in FORMS:
        expected = f"a name that ends in {', '.join(FORMS)}"
        raise InputError("not a file of a specification", field="--spec", value=ending, expected=expected)
    return FORMATS[FORMS[ending]](specification(board, starts), PERIOD)


def bits_of(cells: int) -> int:
    """Return how many bits the number of a cell takes."""
    return max(1, (cells - 1).bit_length())


def car_bits(car: int, cells: int) -> tuple[str, ...]:
    """Return the propositions that hold the cell of a car, lowest bit first."""
    stem = "ego" if car == EGO else f"car{car}"
    return tuple(f"{stem}_{bit}" for bit in range(bits_of(cells)))


def order_name(first: int, second: int) -> str:
    """Return the proposition that one car is before another, `first` less than `second`."""
    return f"first_{first}_{second}"


def inputs_of(board: Board) -> tuple[str, ...]:
    """Return what the environment chooses: the cells of the e-agents and the order among them."""
    cars = range(1, board.others + 1)
    bits = [name for car in cars for name in car_bits(car, board.road_cells.cells)]
    return (*bits, *(order_name(i, j) for i, j in _pairs(board) if i != EGO))


def outputs_of(board: Board) -> tuple[str, ...]:
    """Return what the system chooses: the cell of the ego, and whom it is before."""
    bits = car_bits(EGO, board.road_cells.cells)
    return (*bits, *(order_name(i, j) for i, j in _pairs(board) if i == EGO))


def _pairs(board: Board) -> list[tuple[int, int]]:
    if board.assumption.order is Order.NONE:
        return []
    return list(combinations(range(board.others + 1), 2))


def specification(board: Board, starts: Sequence[int]) -> Specification:
    """Return the game as a specification.

    Parameters
    ----------
    starts : sequence of int
        The cells in which the cars start, the ego first; no two the same.

    Raises
    ------
    InputError
        If what is assumed of the e-agents can't be said, there are too many of them, or `starts` are no starts.
    """
    assumed = board.assumption
    wanted = {
        "E1": assumed.order is not Order.IGNORED,
        "E2": assumed.yields,
        "E3": assumed.forfeits is Forfeits.NEVER,
        "E5": assumed.arrives is not Arriving.NEVER,
    }
    for part, is_sayable in wanted.items():
        if not is_sayable:
            raise InputError(
                f"a game without {part}, or with a weaker form, has no specification",
                field="assume",
                value=str(assumed),
                expected="the explicit graph",
            )
    if any(not node.crossing and len(node.exits) > 1 for node in board.road_cells.nodes):
        raise InputError(
            "roads that meet without being a crossing have no specification",
            field="order_degree",
            value=board.road_cells.order_degree,
            expected="at most 3, or the explicit graph",
        )
    if board.others > MOST_CARS:
        raise InputError("too many e-agents for a specification", value=board.others, expected=f"at most {MOST_CARS}")
    if len(starts) != board.others + 1 or len(set(starts)) != len(starts):
        raise InputError("not starts of the game", value=str(list(starts)), expected="a cell of its own a car")
    return _Writer(board).specification(starts)


@dataclass(frozen=True)
class _Writer:
    """Writes one game; cars are 0, the ego, and 1 to n."""

    board: Board

    @cached_property
    def _nodes(self) -> range:
        return range(len(self.board.road_cells.nodes))

    @cached_property
    def _cars(self) -> range:
        return range(self.board.others + 1)

    @cached_property
    def _pairs(self) -> list[tuple[int, int]]:
        return _pairs(self.board)

    def specification(self, starts: Sequence[int]) -> Specification:
        environment = [self._at(car, starts[car]) for car in self._cars[1:]]
        environment += [
            negation(prop(order_name(i, j)))
            for i, j in self._pairs
            if i and not self._may_wait_together(starts[i], starts[j])
        ]
        environment += [always(part) for part in self._steps_of_others()]
        environment += [always(eventually(negation(owed))) for owed in self._debts()]
        system = [self._at(EGO, starts[EGO])]
        system += [negation(prop(order_name(i, j))) for i, j in self._pairs if i == EGO]
        system += [always(part) for part in self._steps_of_ego()]
        system += [
            always(eventually(disj(*(self._at(EGO, node) for node in nodes))))
            for nodes in self.board.road_cells.targets
        ]
        names = inputs_of(self.board), outputs_of(self.board)
        return Specification(_simple(environment), _simple(system), *names)

    def _at(self, car: int, cell: int) -> Formula:
        names = car_bits(car, self.board.road_cells.cells)
        parts = [prop(name) if cell >> bit & 1 else negation(prop(name)) for bit, name in enumerate(names)]
        return conj(*parts)

    def _goes_to(self, car: int, cell: int) -> Formula:
        """Say that a car is in a cell next."""
        names = car_bits(car, self.board.road_cells.cells)
        return conj(
            *(next_(prop(name)) if cell >> bit & 1 else negation(next_(prop(name))) for bit, name in enumerate(names))
        )

    def _stays(self, car: int) -> Formula:
        return conj(*(iff(next_(prop(name)), prop(name)) for name in car_bits(car, self.board.road_cells.cells)))

    def _among(self, car: int, cells: Iterable[int], *, later: bool = False) -> Formula:
        where = self._goes_to if later else self._at
        return disj(*(where(car, cell) for cell in cells))

    def _inbound(self, node: int) -> list[int]:
        return [len(self._nodes) + lane for lane in self.board.road_cells.nodes[node].inbound]

    def _exits(self, node: int) -> list[int]:
        return [len(self._nodes) + lane for lane in self.board.road_cells.nodes[node].exits]

    def _crossings(self) -> list[int]:
        """Return the nodes at which several lanes end and an order is kept."""
        return [v for v in self._nodes if len(self._inbound(v)) > 1 and self.board.road_cells.nodes[v].crossing]

    def _may_wait_together(self, cell: int, other: int) -> bool:
        return any({cell, other} <= set(self._inbound(v)) for v in self._crossings())

    def _together(self, i: int, j: int, *, later: bool = False) -> Formula:
        """Say that two cars wait at one crossing."""
        return disj(
            *(
                conj(
                    self._among(i, self._inbound(v), later=later),
                    self._among(j, self._inbound(v), later=later),
                )
                for v in self._crossings()
            )
        )

    def _before(self, i: int, j: int, *, later: bool = False) -> Formula:
        bit = prop(order_name(min(i, j), max(i, j)))
        bit = next_(bit) if later else bit
        return bit if i < j else negation(bit)

    def _first(self, i: int) -> Formula:
        """Say that nobody waits at the same crossing before a car."""
        if not self._pairs:
            return conj()
        return conj(*(disj(negation(self._together(i, j)), self._before(i, j)) for j in self._cars if j != i))

    def _clear(self, node: int, mover: int) -> Formula:
        return conj(*(negation(self._at(j, node)) for j in self._cars if j != mover))

    def _free_exit(self, node: int) -> Formula:
        return disj(*(conj(*(negation(self._at(j, lane)) for j in self._cars)) for lane in self._exits(node)))

    def _unmet_by_ego(self, node: int) -> Formula:
        other = self.board.road_cells.opposite(node)
        return conj() if other < 0 else negation(self._at(EGO, other))

    def _steps_of_others(self) -> Iterator[Formula]:
        cells = self.board.road_cells.cells
        for i in self._cars[1:]:
            moves = [self._stays(i)]
            for v in self._nodes:
                moves.append(conj(self._at(i, v), self._among(i, self._exits(v), later=True)))
                waits = self._among(i, self._inbound(v))
                first = self._first(i) if self.board.road_cells.nodes[v].crossing else conj()
                moves.append(conj(waits, self._clear(v, i), first, self._goes_to(i, v)))
            yield disj(*moves)
            for cell in range(cells):
                others = [self._at(EGO, cell), *(self._goes_to(j, cell) for j in self._cars[1:i])]
                yield implies(self._goes_to(i, cell), negation(disj(*others)))
        for i, j in self._pairs:
            if i:
                yield from self._order_of(i, j)
        for three in combinations(self._cars[1:], 3) if self._pairs else ():
            yield from self._no_cycle(three)

    def _order_of(self, i: int, j: int) -> Iterator[Formula]:
        """Say who of two e-agents is before the other after a turn."""
        both, before = self._together(i, j, later=True), self._before(i, j, later=True)
        yield disj(both, negation(before))
        stay = self._stays(i), self._stays(j)
        yield implies(conj(both, *stay), iff(before, self._before(i, j)))
        yield implies(conj(both, stay[0], negation(stay[1])), before)
        yield implies(conj(both, negation(stay[0]), stay[1]), negation(before))

    def _no_cycle(self, cars: tuple[int, ...]) -> Iterator[Formula]:
        """Say that the order among three e-agents is one."""
        for i, j, k in permutations(cars):
            waiting = conj(self._together(i, j, later=True), self._together(j, k, later=True))
            chain = conj(self._before(i, j, later=True), self._before(j, k, later=True))
            yield implies(conj(waiting, chain), self._before(i, k, later=True))

    def _steps_of_ego(self) -> Iterator[Formula]:
        moves = [self._stays(EGO)]
        for v in self._nodes:
            moves.append(conj(self._at(EGO, v), self._among(EGO, self._exits(v), later=True)))
            clear = conj(*(negation(self._goes_to(j, v)) for j in self._cars[1:]))
            first = self._may_enter() if self.board.road_cells.nodes[v].crossing else conj()
            moves.append(conj(self._among(EGO, self._inbound(v)), clear, first, self._goes_to(EGO, v)))
        yield disj(*moves)
        for cell in range(self.board.road_cells.cells):
            others = (self._goes_to(j, cell) for j in self._cars[1:])
            yield implies(self._goes_to(EGO, cell), negation(disj(*others)))
        for i, j in self._pairs:
            if i == EGO:
                ahead = disj(negation(self._stays(j)), self._before(EGO, j))
                waiting = conj(self._together(EGO, j, later=True), self._stays(EGO), ahead)
                yield iff(self._before(EGO, j, later=True), waiting)

    def _may_enter(self) -> Formula:
        """Say that everybody who waits on at the ego's crossing is behind it."""
        if not self._pairs:
            return conj()
        return conj(
            *(
                disj(negation(conj(self._together(EGO, j), self._stays(j))), self._before(EGO, j))
                for j in self._cars[1:]
            )
        )

    def _debts(self) -> Iterator[Formula]:
        """Yield what the environment owes; none of it may be owed for ever."""
        assumed = self.board.assumption
        for i in self._cars[1:]:
            yield disj(*(self._owes_entry(i, v) for v in self._nodes if self._is_entered(v)))
            if assumed.leaves is not Leaving.NEVER:
                yield disj(*(conj(self._at(i, v), self._open(v), self._unmet_by_ego(v)) for v in self._nodes))
        for nodes in self.board.road_cells.goal_nodes if assumed.frees else ():
            yield conj(self._taken(nodes), negation(self._held_up(nodes)))

    def _is_entered(self, node: int) -> bool:
        return self.board.assumption.enters or not self.board.road_cells.nodes[node].crossing

    def _owes_entry(self, car: int, node: int) -> Formula:
        owed = [self._among(car, self._inbound(node)), self._clear(node, car), self._unmet_by_ego(node)]
        if self.board.road_cells.nodes[node].crossing:
            return conj(*owed, self._first(car))
        if self.board.assumption.arrives is Arriving.MOVES_UP:
            return conj(*owed, disj(self._free_exit(node), negation(self._among(EGO, self._exits(node)))))
        return conj(*owed, self._open(node))

    def _open(self, node: int) -> Formula:
        """Say that an exit is free, and where a weak E4 is assumed that no other e-agent passes by."""
        other = self.board.road_cells.opposite(node)
        if other < 0 or self.board.assumption.leaves is not Leaving.UNMET:
            return self._free_exit(node)
        return conj(self._free_exit(node), self._clear(other, EGO))

    def _taken(self, nodes: Sequence[int]) -> Formula:
        return disj(*(self._at(i, v) for i in self._cars[1:] for v in nodes))

    def _held_up(self, nodes: Sequence[int]) -> Formula:
        """Say that nobody in a goal has a free exit, and that the ego is near one of theirs."""
        stuck = [disj(negation(self._taken([v])), negation(self._free_exit(v))) for v in nodes]
        near = [conj(self._taken([v]), self._among(EGO, [*self._beside(v), *nodes])) for v in nodes]
        return conj(*stuck, disj(*near))

    def _beside(self, node: int) -> list[int]:
        """Return the exits of a node and the lanes beside them."""
        lanes = (other for lane in self.board.road_cells.nodes[node].exits for other in (lane, lane ^ 1))
        return [len(self._nodes) + lane for lane in lanes]


def _simple(parts: Iterable[Formula]) -> tuple[Formula, ...]:
    """Return parts without constants, and without those that are always true."""
    simplified = (simplify(part) for part in parts)
    return tuple(part for part in simplified if part.op is not Op.TRUE)
