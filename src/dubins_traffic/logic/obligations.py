"""Formulas as obligations: what must hold from a position on, and what is left of it after one letter.

An obligation is a number in a table of nodes. Stepping over a letter turns it into a disjunction of *moves*: sets
of obligations for the next position (a tableau, as in Gerth, Peled, Vardi and Wolper, 1995). Negations are pushed to
the literals, a strong next stays apart from a weak one, so the same table serves infinite words (where both are the
same) and finite ones (where the last position satisfies weak nexts only).

Bounds up to `unroll` ticks are counted in the obligations; longer ones are left to *clocks* outside: the obligation
then says only that its clock is running.

Past operators must not range over future ones; each keeps one bit of memory. Parts without any temporal operator are
*tests*; letters are the feasible outcomes of all tests.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Final, NamedTuple, TypeAlias

import numpy as np
import numpy.typing as npt

from dubins_traffic.logic.formula import (
    FUTURE,
    PAST,
    Formula,
    FormulaError,
    Op,
    conj,
    disj,
    propositions,
    subformulas,
    ticks,
)
from dubins_traffic.logic.rewrite import DUAL

MAX_LETTERS: Final = 256
"""Most outcomes of the tests of one monitor."""


class Letter(NamedTuple):
    """What is known at a position: outcomes of tests, values of past operators, clocks that have run out."""

    tests: tuple[bool, ...]
    past: tuple[bool, ...]
    expired: int


def timed_parts(formula: Formula) -> frozenset[Formula]:
    """Return the parts of a formula in which a temporal operator stands.

    FormulaError if a past operator ranges over a future one.
    """
    timed: set[Formula] = set()
    future: set[Formula] = set()
    for part in subformulas(formula):
        if part.op in FUTURE or any(arg in future for arg in part.args):
            future.add(part)
            if part.op in PAST:
                raise FormulaError(
                    "a past operator ranges over a future one",
                    value=str(part),
                    expected="the past of the past",
                )
        if part.op in PAST or part in future or any(arg in timed for arg in part.args):
            timed.add(part)
    return frozenset(timed)


def letters_of(names: Sequence[str], tests: Sequence[Formula]) -> tuple[npt.NDArray[np.int64], list[tuple[bool, ...]]]:
    """Return the letter of each valuation of the propositions `names`, and the outcomes of `tests` for each letter.

    Bit number i of a valuation is the value of proposition number i.

    FormulaError if there are more than `MAX_LETTERS` letters.
    """
    count = 1 << len(names)
    numbers = np.arange(count)
    known = {name: (numbers >> place & 1).astype(bool) for place, name in enumerate(names)}
    if not tests:
        return np.zeros(count, dtype=np.int64), [()]
    rows = np.stack([valued(test, known, count) for test in tests], axis=1)
    distinct, letter = np.unique(rows, axis=0, return_inverse=True)
    if len(distinct) > MAX_LETTERS:
        raise FormulaError(
            "too many combinations of conditions in one part",
            value=len(distinct),
            expected=f"at most {MAX_LETTERS}",
        )
    return letter.reshape(-1).astype(np.int64), [tuple(map(bool, row)) for row in distinct.tolist()]


def valued(formula: Formula, known: Mapping[str, npt.NDArray[np.bool_]], count: int) -> npt.NDArray[np.bool_]:
    """Return the values of a formula without temporal operators under `count` valuations."""
    if formula.op is Op.PROP:
        return known[formula.name]
    if formula.op in (Op.TRUE, Op.FALSE):
        return np.full(count, formula.op is Op.TRUE)
    values = [valued(arg, known, count) for arg in formula.args]
    if formula.op is Op.NOT:
        return ~values[0]
    if formula.op is Op.IMPLIES:
        return ~values[0] | values[1]
    if formula.op is Op.IFF:
        return values[0] == values[1]
    join = np.logical_and if formula.op is Op.AND else np.logical_or
    return np.asarray(join.reduce(values), dtype=np.bool_)


MAX_PROPOSITIONS: Final = 12
"""Most propositions in one monitor."""

Atom: TypeAlias = int
"""An obligation for the next position: four times its number, plus 1 if it asks that there be a next position, plus
2 if it is an until that has been put off."""
Moves: TypeAlias = frozenset[frozenset[Atom]]
"""A disjunction of conjunctions, none of which implies another."""

NOTHING: Final[Moves] = frozenset()
DONE: Final[Moves] = frozenset([frozenset()])


class Node(NamedTuple):
    """One obligation.

    `kind` is ``true``, ``false``, ``test`` and ``past`` (`first`: its number; `strong`: its sign), ``and``, ``or``
    (`parts`), ``next`` (`parts`, `length` ticks, `strong`), ``until`` and ``release`` (`parts`, `length` ticks or -1,
    `clock` or -1, `running` 0: not yet, 1: since this tick, 2: since earlier).
    """

    kind: str
    parts: tuple[int, ...] = ()
    first: int = 0
    strong: bool = True
    length: int = -1
    clock: int = -1
    running: int = 0


@dataclass
class Table:
    """The obligations of one formula.

    Attributes
    ----------
    names : tuple of str
        The propositions.
    tests : list of Formula
        The parts without temporal operators.
    past : list of Formula
        The past operators, parts before wholes.
    clocks : list of int
        The length of each clock, ticks.
    root : int
        The whole formula.
    """

    period: float
    unroll: int
    names: tuple[str, ...] = ()
    tests: list[Formula] = field(default_factory=list[Formula])
    past: list[Formula] = field(default_factory=list[Formula])
    clocks: list[int] = field(default_factory=list[int])
    root: int = 0
    nodes: list[Node] = field(default_factory=list[Node])

    def __post_init__(self) -> None:
        self._number: dict[Node, int] = {}
        self._test_number: dict[Formula, int] = {}
        self._past_number: dict[Formula, int] = {}
        self._clock_number: dict[tuple[tuple[int, ...], int], int] = {}
        self._built: dict[tuple[Formula, bool], int] = {}
        self._dual: dict[int, int] = {}
        self.false = self.node(Node("false"))
        self.true = self.node(Node("true"))

    def node(self, node: Node) -> int:
        """Return the number of `node`."""
        number = self._number.get(node)
        if number is None:
            number = self._number[node] = len(self.nodes)
            self.nodes.append(node)
        return number

    def add(self, formula: Formula) -> None:
        """Make `formula` the root.

        Raises
        ------
        FormulaError
            If a past operator ranges over a future one, or if there are too many propositions.
        """
        self._prepare(formula)
        self.root = self._build(formula, True)

    def observe(self, formula: Formula) -> None:
        """Make `outcome` and `letter` ready for a formula without future operators.

        FormulaError if there are too many propositions.
        """
        self._prepare(formula)
        self._register(formula)
        if formula not in self._timed:
            self._test(formula, True)

    def _prepare(self, formula: Formula) -> None:
        self.names = propositions(formula)
        if len(self.names) > MAX_PROPOSITIONS:
            raise FormulaError(
                "too many propositions in one part",
                value=len(self.names),
                expected=f"at most {MAX_PROPOSITIONS} in each part of the conjunction",
            )
        self._timed = timed_parts(formula)

    def dual(self, number: int) -> int:
        """Return the negation of an obligation."""
        dual = self._dual.get(number)
        if dual is not None:
            return dual
        node = self.nodes[number]
        other = {"true": "false", "and": "or", "until": "release"}
        other |= {value: key for key, value in other.items()}
        parts = tuple(self.dual(part) for part in node.parts)
        strong = node.strong if node.kind in ("and", "or", "until", "release", "true", "false") else not node.strong
        changed = node._replace(kind=other.get(node.kind, node.kind), parts=parts, strong=strong)
        if node.kind in ("and", "or"):
            changed = changed._replace(parts=tuple(sorted(parts)))
        dual = self.node(changed)
        self._dual[number], self._dual[dual] = dual, number
        return dual

    def _build(self, formula: Formula, positive: bool) -> int:
        """Return the obligation that `formula`, or its negation, holds."""
        key = formula, positive
        number = self._built.get(key)
        if number is None:
            number = self._built[key] = self._new(formula, positive)
        return number

    def _new(self, formula: Formula, positive: bool) -> int:
        op, args = formula.op, formula.args
        if formula not in self._timed:
            return self._test(formula, positive)
        if op is Op.NOT:
            return self._build(args[0], not positive)
        if op in PAST:
            return self.node(Node("past", first=self._past(formula), strong=positive))
        if op is Op.IMPLIES:
            return self._join(not positive, [self._build(args[0], not positive), self._build(args[1], positive)])
        if op is Op.IFF:
            a, b = args
            return self._join(
                False,
                [
                    self._join(True, [self._build(a, True), self._build(b, positive)]),
                    self._join(True, [self._build(a, False), self._build(b, not positive)]),
                ],
            )
        if op in (Op.AND, Op.OR):
            return self._junction(formula, positive)
        return self._temporal(formula, positive)

    def _junction(self, formula: Formula, positive: bool) -> int:
        plain = [arg for arg in formula.args if arg not in self._timed]
        join = conj if formula.op is Op.AND else disj
        parts = [self._build(arg, positive) for arg in formula.args if arg in self._timed]
        if plain:
            parts.append(self._test(join(*plain), positive))
        return self._join((formula.op is Op.AND) == positive, parts)

    def _join(self, both: bool, parts: list[int]) -> int:
        kind = "and" if both else "or"
        neutral, absorbing = (self.true, self.false) if both else (self.false, self.true)
        flat: set[int] = set()
        for part in parts:
            flat.update(self.nodes[part].parts if self.nodes[part].kind == kind else (part,))
        flat.discard(neutral)
        if absorbing in flat:
            return absorbing
        if len(flat) == 1:
            return flat.pop()
        return self.node(Node(kind, tuple(sorted(flat)))) if flat else neutral

    def _test(self, formula: Formula, positive: bool) -> int:
        while formula.op is Op.NOT:
            formula, positive = formula.args[0], not positive
        if formula.op in (Op.TRUE, Op.FALSE):
            return self.true if (formula.op is Op.TRUE) == positive else self.false
        number = self._test_number.setdefault(formula, len(self.tests))
        if number == len(self.tests):
            self.tests.append(formula)
        return self.node(Node("test", first=number, strong=positive))

    def _past(self, formula: Formula) -> int:
        self._register(formula)
        return self._past_number[formula]

    def _register(self, formula: Formula) -> None:
        """Number the past operators in `formula`, parts before wholes, and the tests that they ask for."""
        for part in subformulas(formula):
            if part in self._timed:
                for arg in part.args:
                    if arg not in self._timed:
                        self._test(arg, True)
            if part.op in PAST and part not in self._past_number:
                self._past_number[part] = len(self.past)
                self.past.append(part)

    def _temporal(self, formula: Formula, positive: bool) -> int:
        op = formula.op if positive else DUAL[formula.op]
        args = [self._build(arg, positive) for arg in formula.args]
        if op is Op.X:
            return self._later(args[0], 1, positive)
        if op in (Op.F, Op.G):
            args.insert(0, self.true if op is Op.F else self.false)
            op = Op.U if op is Op.F else Op.R
        left, right = args
        if op is Op.W:
            return self._fixpoint("release", right, self._join(False, [left, right]), None)
        if op is Op.M:
            return self._fixpoint("until", right, self._join(True, [left, right]), None)
        kind = "until" if op is Op.U else "release"
        if formula.bounds is None:
            return self._fixpoint(kind, left, right, None)
        low, high = (ticks(bound, self.period) for bound in formula.bounds)
        inner = self._fixpoint(kind, left, right, high - low)
        if low == 0:
            return inner
        waiting = self._fixpoint("release" if kind == "until" else "until", *self._wait(kind, left), low - 1)
        return self._join(kind == "until", [waiting, self._later(inner, low, kind == "until")])

    def _wait(self, kind: str, left: int) -> tuple[int, int]:
        return (self.false if kind == "until" else self.true), left

    def _later(self, part: int, count: int, strong: bool) -> int:
        if count == 0:
            return part
        if count > self.unroll:
            clock = self._clock((part, int(strong)), count)
            return self.node(Node("next", (part,), strong=strong, clock=clock))
        return self.node(Node("next", (part,), strong=strong, length=count))

    def _fixpoint(self, kind: str, left: int, right: int, count: int | None) -> int:
        if count == 0 or right in (self.true, self.false):
            return right
        if left == (self.false if kind == "until" else self.true):
            return right
        if count is None:
            return self.node(Node(kind, (left, right)))
        if count > self.unroll:
            return self.node(Node(kind, (left, right), clock=self._clock((left, right), count)))
        return self.node(Node(kind, (left, right), length=count))

    def _clock(self, owner: tuple[int, ...], count: int) -> int:
        number = self._clock_number.setdefault((owner, count), len(self.clocks))
        if number == len(self.clocks):
            self.clocks.append(count)
        return number

    def outcome(self, formula: Formula, letter_tests: tuple[bool, ...], past: Sequence[bool]) -> bool:
        """Return the value of a formula without future operators, given tests and past operators."""
        if formula.op in (Op.TRUE, Op.FALSE):
            return formula.op is Op.TRUE
        if formula.op is Op.NOT:
            return not self.outcome(formula.args[0], letter_tests, past)
        if formula in self._test_number:
            return letter_tests[self._test_number[formula]]
        if formula in self._past_number:
            return past[self._past_number[formula]]
        values = [self.outcome(arg, letter_tests, past) for arg in formula.args]
        if formula.op is Op.AND:
            return all(values)
        if formula.op is Op.OR:
            return any(values)
        return (not values[0] or values[1]) if formula.op is Op.IMPLIES else values[0] == values[1]

    def remembered(self) -> tuple[bool, ...]:
        """Return the memory of the past operators before the first position."""
        return tuple(part.op in (Op.Z, Op.H, Op.T) for part in self.past)

    def letter(
        self, tests: tuple[bool, ...], memory: tuple[bool, ...], expired: int = 0
    ) -> tuple[Letter, tuple[bool, ...]]:
        """Return what is known at a position, and the memory after it."""
        past: list[bool] = []
        after: list[bool] = []
        for part, before in zip(self.past, memory, strict=True):
            if part.op in (Op.Y, Op.Z):
                past.append(before)
                after.append(False)
                continue
            *left, right = (self.outcome(arg, tests, past) for arg in part.args)
            kept = before and (not left or left[0]) if part.op in (Op.O, Op.S) else before or any(left)
            past.append(right or kept if part.op in (Op.O, Op.S) else right and kept)
            after.append(past[-1])
        for place, part in enumerate(self.past):
            if part.op in (Op.Y, Op.Z):
                after[place] = self.outcome(part.args[0], tests, past)
        return Letter(tests, tuple(past), expired), tuple(after)

    def letters(self) -> tuple[npt.NDArray[np.int64], list[tuple[bool, ...]]]:
        """Return the letter of each valuation of the propositions, and the outcomes of the tests of each letter.

        Bit number i of a valuation is the value of proposition number i.
        """
        return letters_of(self.names, self.tests)
