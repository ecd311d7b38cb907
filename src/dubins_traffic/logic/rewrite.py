"""Rewriting: normal forms, simplification, and formulas for tools that know less: no past, no bounds, no release."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Final

from dubins_traffic.logic.formula import (
    FALSE,
    PAST,
    TRUE,
    Formula,
    FormulaError,
    Op,
    always,
    conj,
    disj,
    eventually,
    iff,
    implies,
    make,
    negation,
    next_,
    prop,
    propositions,
    release,
    subformulas,
    ticks,
    until,
)

DUAL: Final = {
    Op.AND: Op.OR,
    Op.X: Op.X,
    Op.F: Op.G,
    Op.U: Op.R,
    Op.W: Op.M,
    Op.Y: Op.Z,
    Op.O: Op.H,
    Op.S: Op.T,
}
DUAL.update({second: first for first, second in tuple(DUAL.items())})


def rebuilt(formula: Formula, args: tuple[Formula, ...]) -> Formula:
    """Return `formula` with other parts; conjunctions and disjunctions stay flat."""
    if formula.op is Op.AND:
        return conj(*args)
    if formula.op is Op.OR:
        return disj(*args)
    return make(formula.op, args, formula.name, formula.bounds)


def mapped(formula: Formula, change: Callable[[Formula], Formula]) -> Formula:
    """Return `formula` with `change` applied to every subformula, parts first."""
    done: dict[Formula, Formula] = {}
    for part in subformulas(formula):
        done[part] = change(rebuilt(part, tuple(done[arg] for arg in part.args)))
    return done[formula]


def renamed(formula: Formula, names: Mapping[str, str]) -> Formula:
    """Return `formula` with propositions renamed; names that `names` lacks stay."""
    return mapped(
        formula,
        lambda part: make(Op.PROP, name=names.get(part.name, part.name)) if part.op is Op.PROP else part,
    )


def nnf(formula: Formula) -> Formula:
    """Return an equivalent formula with negations at propositions only, without -> and <->.

    ``<->`` may double the length of its parts at every level.
    """
    forms: dict[tuple[Formula, bool], Formula] = {}
    for part in subformulas(formula):
        forms[part, True] = _pushed(part, True, forms)
        forms[part, False] = _pushed(part, False, forms)
    return forms[formula, True]


def _pushed(part: Formula, positive: bool, forms: Mapping[tuple[Formula, bool], Formula]) -> Formula:
    if part.op in (Op.TRUE, Op.FALSE):
        return TRUE if (part.op is Op.TRUE) == positive else FALSE
    if part.op is Op.PROP:
        return part if positive else negation(part)
    if part.op is Op.NOT:
        return forms[part.args[0], not positive]
    if part.op is Op.IMPLIES:
        join = disj if positive else conj
        return join(forms[part.args[0], not positive], forms[part.args[1], positive])
    if part.op is Op.IFF:
        a, b = part.args
        return disj(conj(forms[a, True], forms[b, positive]), conj(forms[a, False], forms[b, not positive]))
    args = tuple(forms[arg, positive] for arg in part.args)
    if positive:
        return rebuilt(part, args)
    dual = DUAL[part.op]
    if dual is Op.AND:
        return conj(*args)
    if dual is Op.OR:
        return disj(*args)
    return make(dual, args, bounds=part.bounds)


def simplify(formula: Formula) -> Formula:
    """Return a formula that holds on the same infinite words and is not longer.

    Constants are folded, repeated and opposite parts of conjunctions and disjunctions removed, and operators that
    are idempotent applied once.
    """
    return mapped(formula, _simple)


def _simple(part: Formula) -> Formula:
    op, args = part.op, part.args
    if op in (Op.AND, Op.OR):
        return _simple_junction(part)
    if op is Op.NOT:
        return _opposite(args[0])
    if op is Op.IMPLIES:
        return _simple_implication(args[0], args[1])
    if op is Op.IFF:
        return _simple_equivalence(args[0], args[1])
    if len(args) == 1:
        return _simple_unary(part)
    if len(args) == 2:
        return _simple_binary(part)
    return part


def _opposite(part: Formula) -> Formula:
    if part.op is Op.NOT:
        return part.args[0]
    if part.op in (Op.TRUE, Op.FALSE):
        return FALSE if part is TRUE else TRUE
    return negation(part)


def _simple_junction(part: Formula) -> Formula:
    neutral, absorbing = (TRUE, FALSE) if part.op is Op.AND else (FALSE, TRUE)
    kept = [arg for arg in dict.fromkeys(part.args) if arg is not neutral]
    present = set(kept)
    if absorbing in present or any(arg.op is Op.NOT and arg.args[0] in present for arg in kept):
        return absorbing
    return conj(*kept) if part.op is Op.AND else disj(*kept)


def _simple_implication(left: Formula, right: Formula) -> Formula:
    if left is FALSE or right is TRUE or left is right:
        return TRUE
    if left is TRUE:
        return right
    if right is FALSE:
        return _opposite(left)
    return make(Op.IMPLIES, (left, right))


def _simple_equivalence(left: Formula, right: Formula) -> Formula:
    if left is right:
        return TRUE
    for one, other in ((left, right), (right, left)):
        if one is TRUE:
            return other
        if one is FALSE:
            return _opposite(other)
    return make(Op.IFF, (left, right))


def _simple_unary(part: Formula) -> Formula:
    (arg,) = part.args
    if arg in (TRUE, FALSE):
        kept = (part.op is Op.Y and arg is TRUE) or (part.op is Op.Z and arg is FALSE)
        return part if kept else arg
    if part.bounds == (0.0, 0.0):
        return arg
    if part.op in (Op.F, Op.G, Op.O, Op.H) and arg.op is part.op and part.bounds is None and arg.bounds is None:
        return arg
    return part


def _simple_binary(part: Formula) -> Formula:
    op, (left, right) = part.op, part.args
    if part.bounds == (0.0, 0.0):
        return right
    if part.bounds is not None and part.bounds[0] > 0.0:
        return part
    if right in _FIXED_BY_RIGHT.get(op, ()):
        return right
    if part.bounds is not None:
        return part
    if left is right:
        return right
    if left in (TRUE, FALSE):
        return _constant_left(op, left is TRUE, right)
    return part


_FIXED_BY_RIGHT: Final = {
    Op.U: (TRUE, FALSE),
    Op.R: (TRUE, FALSE),
    Op.S: (TRUE, FALSE),
    Op.T: (TRUE, FALSE),
    Op.W: (TRUE,),
    Op.M: (FALSE,),
}
_UNARY_FORM: Final = {
    (Op.U, True): Op.F,
    (Op.S, True): Op.O,
    (Op.R, False): Op.G,
    (Op.W, True): None,
    (Op.M, False): None,
    (Op.T, False): Op.H,
}
"""Operator that is left when the left part is true or false; None: the constant itself; absent: the right part."""


def _constant_left(op: Op, left: bool, right: Formula) -> Formula:
    form = _UNARY_FORM.get((op, left), op)
    if form is None:
        return TRUE if left else FALSE
    return right if form is op else _simple_unary(make(form, (right,)))


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

    FormulaError if a past operator ranges over a future one.
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

    FormulaError if that takes more than `MAX_NEXT` nested nexts.
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
        changed = arg
        for _ in range(high - low):
            changed = (disj if part.op is Op.F else conj)(arg, next_(changed))
        for _ in range(low):
            changed = next_(changed)
        return changed

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
