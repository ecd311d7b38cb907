"""Writing formulas: SPIN's syntax and the usual ASCII forms, with as few parentheses as both readings allow.

What these functions return, `parse` reads back as the same formula.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Final

from dubins_traffic.spec.logic.formula import Formula, Op, subformulas

_JUNCTIONS: Final = (Op.AND, Op.OR, Op.IMPLIES, Op.IFF)
_SPIN: Final = {Op.F: "<>", Op.G: "[]", Op.R: "V"}
_ASCII: Final = {Op.AND: "&", Op.OR: "|"}


def to_spin(formula: Formula) -> str:
    """Return `formula` as SPIN writes it: ``[] (a -> <> b)``.

    SPIN ranks all boolean operators equally, so parentheses stand wherever two of them meet.
    Operators that SPIN lacks (past, bounds, W, M) keep their letters; `spin_form` rewrites those it can.
    """
    return written(formula, _SPIN, mixed=False)


def to_ascii(formula: Formula) -> str:
    """Return `formula` in letters: ``G (a -> F b)``."""
    return written(formula, _ASCII, mixed=True)


def number(value: float) -> str:
    """Return a number of seconds as short as it reads back exactly, never in exponents if that is short."""
    return str(int(value)) if value.is_integer() and value < 1e15 else repr(value)


def written(formula: Formula, signs: Mapping[Op, str], *, mixed: bool) -> str:
    """Return `formula` with the operators spelled as in `signs`, else by their letters.

    Parameters
    ----------
    mixed : bool
        Whether `&` inside `|`, and both inside `->`, may do without parentheses.
    """
    done: dict[Formula, str] = {}
    for part in subformulas(formula):
        inner = [
            done[arg] if _bare(part, place, arg, mixed) else f"({done[arg]})"
            for place, arg in enumerate(part.args)
        ]
        done[part] = _one(part, inner, signs)
    return done[formula]


def _one(part: Formula, inner: list[str], signs: Mapping[Op, str]) -> str:
    if part.op is Op.PROP:
        return part.name
    sign = signs.get(part.op, part.op.value)
    if part.bounds is not None:
        sign += f"[{number(part.bounds[0])},{number(part.bounds[1])}]"
    if not inner:
        return sign
    if part.op is Op.NOT:
        return sign + inner[0]
    if len(inner) == 1:
        return f"{sign} {inner[0]}"
    return f" {sign} ".join(inner)


def _bare(whole: Formula, place: int, part: Formula, mixed: bool) -> bool:
    """Say whether `part` needs no parentheses as the part number `place` of `whole`."""
    if len(part.args) < 2:
        return True
    if whole.op not in _JUNCTIONS:
        return False
    if part.op not in _JUNCTIONS:
        return True
    if not mixed:
        return False
    if whole.op is Op.IMPLIES and part.op is Op.IMPLIES:
        return place == 1
    if whole.op is Op.IFF and part.op is Op.IFF:
        return place == 0
    return _JUNCTIONS.index(part.op) < _JUNCTIONS.index(whole.op)
