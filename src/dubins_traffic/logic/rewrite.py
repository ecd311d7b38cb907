"""Rewriting: negation normal form, simplification, and forms that other tools understand."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Final

from dubins_traffic.logic.formula import (
    FALSE,
    TRUE,
    Formula,
    Op,
    conj,
    disj,
    make,
    negation,
    subformulas,
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
        return disj(
            conj(forms[a, True], forms[b, positive]),
            conj(forms[a, False], forms[b, not positive]),
        )
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
    if (
        part.op in (Op.F, Op.G, Op.O, Op.H)
        and arg.op is part.op
        and part.bounds is None
        and arg.bounds is None
    ):
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
