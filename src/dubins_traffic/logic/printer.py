"""Writing formulas: SPIN's syntax and the usual ASCII forms, with as few parentheses as both readings allow.

What `to_spin` and `to_ascii` return, `parse` reads back as the same formula.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from enum import Enum
from typing import Final

from dubins_traffic.logic.formula import Bounds, Formula, Op, conj, implies, prop, subformulas

_JUNCTIONS: Final = (Op.AND, Op.OR, Op.IMPLIES, Op.IFF)


class Brackets(Enum):
    """Which parentheses are left out."""

    RANKED = "ranked"
    """Those that the ranks of ``&``, ``|``, ``->`` and ``<->`` make needless."""
    MIXED_NEVER = "mixed never"
    """As SPIN needs it: none around parts of ``&``, ``|``, ``->`` and ``<->`` that are none of these themselves."""
    ALL = "all"
    """None: every operator has its own."""


def number(value: float) -> str:
    """Return a number of seconds as short as it reads back exactly."""
    return str(int(value)) if value.is_integer() and value < 1e15 else repr(value)


def _in_brackets(bounds: Bounds) -> str:
    return f"[{number(bounds[0])},{number(bounds[1])}]"


@dataclass(frozen=True)
class Style:
    """How formulas are spelled.

    Attributes
    ----------
    signs : mapping of Op to str
        Operators and constants that are not spelled as their values.
    brackets : Brackets
        Which parentheses are left out.
    bounds : callable
        Spells the bounds behind an operator.
    name : callable
        Spells a proposition.
    tight : bool
        Whether the sign of the negation stands right before its part.
    """

    signs: Mapping[Op, str]
    brackets: Brackets = Brackets.RANKED
    bounds: Callable[[Bounds], str] = _in_brackets
    name: Callable[[str], str] = str
    tight: bool = True


SPIN: Final = Style({Op.F: "<>", Op.G: "[]", Op.R: "V"}, Brackets.MIXED_NEVER)
ASCII: Final = Style({Op.AND: "&", Op.OR: "|"})


def to_spin(formula: Formula) -> str:
    """Return `formula` as SPIN writes it: ``[] (a -> <> b)``.

    SPIN ranks all boolean operators equally, so parentheses stand wherever two of them meet. Operators that SPIN
    lacks (past, bounds, W, M) keep their letters; `exports.spin` rewrites those it can.
    """
    return written(formula, SPIN)


def to_ascii(formula: Formula) -> str:
    """Return `formula` in letters: ``G (a -> F b)``."""
    return written(formula, ASCII)


def written(formula: Formula, style: Style) -> str:
    """Return `formula` spelled in a style."""
    done: dict[Formula, str] = {}
    for part in subformulas(formula):
        inner = [
            done[arg] if _bare(part, place, arg, style.brackets) else f"({done[arg]})"
            for place, arg in enumerate(part.args)
        ]
        done[part] = _one(part, inner, style)
    return done[formula]


_AND: Final = conj(prop("p"), prop("q"))
_IMPLIES: Final = implies(prop("p"), prop("q"))
"""Stand for formulas that would be too long to be made; only what is at their top matters."""


def written_together(formulas: Sequence[Formula], style: Style) -> str:
    """Return the conjunction of `formulas` spelled in a style.

    It is not made: it may have more parts than a formula can have.
    """
    return _together(formulas, style)[1]


def written_implication(left: Sequence[Formula], right: Sequence[Formula], style: Style) -> str:
    """Return that the conjunction of `left` implies that of `right`, in a style; only the latter if `left` is empty."""
    sides = [_together(formulas, style) for formulas in (left, right)]
    if not left:
        return sides[1][1]
    inner = [
        text if _bare(_IMPLIES, place, top, style.brackets) else f"({text})"
        for place, (top, text) in enumerate(sides)
    ]
    return _one(_IMPLIES, inner, style)


def _together(formulas: Sequence[Formula], style: Style) -> tuple[Formula, str]:
    """Return a formula with the same top as the conjunction of `formulas`, and the conjunction's text."""
    flat = [part for formula in formulas for part in (formula.args if formula.op is Op.AND else (formula,))]
    if len(flat) < 2:
        whole = conj(*flat)
        return whole, written(whole, style)
    texts = [written(part, style) for part in flat]
    inner = [
        text if _bare(_AND, place, part, style.brackets) else f"({text})"
        for place, (part, text) in enumerate(zip(flat, texts, strict=True))
    ]
    return _AND, _one(_AND, inner, style)


def _one(part: Formula, inner: list[str], style: Style) -> str:
    if part.op is Op.PROP:
        return style.name(part.name)
    sign = style.signs.get(part.op, part.op.value)
    if part.bounds is not None:
        sign += style.bounds(part.bounds)
    if not inner:
        return sign
    if part.op is Op.NOT and style.tight:
        return sign + inner[0]
    if len(inner) == 1:
        return f"{sign} {inner[0]}"
    return f" {sign} ".join(inner)


def _bare(whole: Formula, place: int, part: Formula, brackets: Brackets) -> bool:
    """Say whether `part` needs no parentheses as the part number `place` of `whole`."""
    if brackets is Brackets.ALL:
        return not part.args
    if len(part.args) < 2:
        return True
    if whole.op not in _JUNCTIONS:
        return False
    if part.op not in _JUNCTIONS:
        return True
    if brackets is Brackets.MIXED_NEVER:
        return False
    if whole.op is Op.IMPLIES and part.op is Op.IMPLIES:
        return place == 1
    if whole.op is Op.IFF and part.op is Op.IFF:
        return place == 0
    return _JUNCTIONS.index(part.op) < _JUNCTIONS.index(whole.op)
