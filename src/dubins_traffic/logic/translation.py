"""Rewriting for tools that know less: past operators become memory, bounded ones counts of ticks."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Final

from dubins_traffic.logic.formula import (
    PAST,
    Formula,
    FormulaError,
    Op,
    conj,
    disj,
    iff,
    implies,
    make,
    negation,
    prop,
    propositions,
)
from dubins_traffic.logic.rewrite import mapped, rebuilt
from dubins_traffic.logic.temporal import always, eventually, next_, release, ticks, until

MAX_NEXT: Final = 40
"""Most nested nexts by which a bound is written out."""


@dataclass(frozen=True)
class Memory:
    """A proposition that remembers what a past operator needs: its value at a position tells of those before.

    Attributes
    ----------
    name : str
        The proposition.
    first : bool
        Its value at position 0.
    update : Formula
        What it is at the next position, a formula without temporal operators over the present one.
    meaning : Formula
        The past operator for which it stands.
    """

    name: str
    first: bool
    update: Formula
    meaning: Formula

    @property
    def initially(self) -> Formula:
        """The constraint on position 0."""
        return prop(self.name) if self.first else negation(prop(self.name))

    @property
    def step(self) -> Formula:
        """The constraint on every step: next it is `update`."""
        return iff(next_(prop(self.name)), self.update)


class FreshNames:
    """Makes names of propositions that are not taken.

    Parameters
    ----------
    taken : iterable of str
        Names that there are.
    """

    def __init__(self, taken: Iterable[str]) -> None:
        self._taken = set(taken)
        self._last: dict[str, int] = {}

    def take(self, *names: str) -> None:
        """Take note of names that there are as well."""
        self._taken.update(names)

    def make(self, stem: str) -> str:
        """Return `stem` with the first number that makes it a new name, and take it."""
        count = self._last.get(stem, 0) + 1
        while f"{stem}_{count}" in self._taken:
            count += 1
        self._last[stem] = count
        self._taken.add(f"{stem}_{count}")
        return f"{stem}_{count}"


def without_past(formulas: Sequence[Formula]) -> tuple[tuple[Formula, ...], tuple[Memory, ...]]:
    """Return `formulas` with memory in place of past operators.

    Equal past operators share their memory. The formulas hold on an infinite word exactly if the new ones hold on
    the same word with the memory as it must be.

    Raises
    ------
    FormulaError
        If a past operator ranges over a future one.
    """
    names = FreshNames(name for formula in formulas for name in propositions(formula))
    memories: dict[Formula, Memory] = {}
    meanings: dict[Formula, Formula] = {}

    def change(part: Formula) -> Formula:
        if part.op not in PAST:
            return part
        _check_plain(part)
        memory = memories.get(part)
        if memory is None:
            name = names.make("past")
            memory = memories[part] = _memory(part, name, meanings)
            meanings[prop(name)] = memory.meaning
        return _now(part, prop(memory.name))

    changed = tuple(mapped(formula, change) for formula in formulas)
    return changed, tuple(memories.values())


def _check_plain(part: Formula) -> None:
    for arg in part.args:
        if any(inner.op not in (Op.AND, Op.OR, Op.NOT, Op.IMPLIES, Op.IFF) for inner in _operators(arg)):
            raise FormulaError(
                "a past operator ranges over a future one", value=str(part), expected="the past of the past"
            )


def _operators(formula: Formula) -> Iterable[Formula]:
    stack = [formula]
    while stack:
        part = stack.pop()
        if part.args:
            yield part
        stack.extend(part.args)


def _memory(part: Formula, name: str, meanings: dict[Formula, Formula]) -> Memory:
    kept = prop(name)
    update = part.args[0] if part.op in (Op.Y, Op.Z) else _now(part, kept)
    meaning = mapped(part, lambda inner: meanings.get(inner, inner))
    return Memory(name, part.op in (Op.Z, Op.H, Op.T), update, meaning)


def _now(part: Formula, kept: Formula) -> Formula:
    """Return the value of a past operator, given its memory."""
    if part.op in (Op.Y, Op.Z):
        return kept
    last = part.args[-1]
    if part.op is Op.O:
        return disj(last, kept)
    if part.op is Op.H:
        return conj(last, kept)
    if part.op is Op.S:
        return disj(last, conj(part.args[0], kept))
    return conj(last, disj(part.args[0], kept))


def in_ticks(formula: Formula, period: float) -> Formula:
    """Return `formula` with bounds in ticks, and only F and G bounded: a delay by a ticks is F[a, a]."""

    def change(part: Formula) -> Formula:
        if part.bounds is None:
            return part
        low, high = (ticks(bound, period) for bound in part.bounds)
        if part.op in (Op.F, Op.G):
            return make(part.op, part.args, bounds=(float(low), float(high)))
        left, right = part.args
        span = 0.0, float(high - low)
        if part.op is Op.U:
            inner = conj(until(left, right), eventually(right, span))
            return inner if low == 0 else conj(always(left, (0, low - 1)), eventually(inner, (low, low)))
        inner = disj(release(left, right), always(right, span))
        return inner if low == 0 else disj(eventually(left, (0, low - 1)), eventually(inner, (low, low)))

    return mapped(formula, change)


def written_out(formula: Formula) -> Formula:
    """Return a formula with bounds in ticks (`in_ticks`) written out with next.

    Raises
    ------
    FormulaError
        If that takes more than `MAX_NEXT` nested nexts.
    """

    def change(part: Formula) -> Formula:
        if part.bounds is None:
            return part
        low, high = (int(bound) for bound in part.bounds)
        if high > MAX_NEXT:
            raise FormulaError(
                f"a bound of {high} ticks is too long to be written out with next",
                value=str(part),
                expected=f"at most {MAX_NEXT} ticks: a longer period, or a format that counts",
            )
        (arg,) = part.args
        found = arg
        for _ in range(high - low):
            found = (disj if part.op is Op.F else conj)(arg, next_(found))
        for _ in range(low):
            found = next_(found)
        return found

    return mapped(formula, change)


def until_and_release_only(formula: Formula) -> Formula:
    """Return an equivalent formula without W and M."""

    def change(part: Formula) -> Formula:
        if part.op is Op.W:
            left, right = part.args
            return release(right, disj(left, right))
        if part.op is Op.M:
            left, right = part.args
            return until(right, conj(left, right))
        return part

    return mapped(formula, change)


def for_signals(formula: Formula) -> Formula:
    """Return an equivalent formula without R, W, M, T and <->, of the same robustness."""

    def change(part: Formula) -> Formula:
        op, args = part.op, part.args
        if op is Op.IFF:
            return conj(implies(*args), implies(args[1], args[0]))
        if op is Op.W:
            return disj(until(args[0], args[1]), always(args[0]))
        if op is Op.M:
            return until(args[1], conj(*args))
        if op in (Op.R, Op.T):
            dual = Op.U if op is Op.R else Op.S
            return negation(make(dual, (negation(args[0]), negation(args[1])), bounds=part.bounds))
        return rebuilt(part, args)

    return mapped(formula, change)
