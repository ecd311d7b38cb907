"""Writing formulas: SPIN's syntax, and conjunctions that would be too long to be made.

What `to_spin` and `to_ascii` return, `parse` reads back as the same formula; both leave out as many parentheses as both
readings allow.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final

from dubins_traffic.logic.formula import (
    Brackets,
    Formula,
    Op,
    Style,
    conj,
    implies,
    is_bare,
    joined_with_sign,
    prop,
    written,
)

SPIN: Final = Style({Op.F: "<>", Op.G: "[]", Op.R: "V"}, Brackets.MIXED_NEVER)


def to_spin(formula: Formula) -> str:
    """Return `formula` as SPIN writes it: ``[] (a -> <> b)``.

    SPIN ranks all boolean operators equally, so parentheses stand wherever two of them meet. Operators that SPIN
    lacks (past, bounds, W, M) keep their letters; `exports.spin` rewrites those it can.
    """
    return written(formula, SPIN)


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
        text if is_bare(_IMPLIES, place, top, style.brackets) else f"({text})"
        for place, (top, text) in enumerate(sides)
    ]
    return joined_with_sign(_IMPLIES, inner, style)


def _together(formulas: Sequence[Formula], style: Style) -> tuple[Formula, str]:
    """Return a formula with the same top as the conjunction of `formulas`, and the conjunction's text."""
    flat = [part for formula in formulas for part in (formula.args if formula.op is Op.AND else (formula,))]
    if len(flat) < 2:
        whole = conj(*flat)
        return whole, written(whole, style)
    texts = [written(part, style) for part in flat]
    inner = [
        text if is_bare(_AND, place, part, style.brackets) else f"({text})"
        for place, (part, text) in enumerate(zip(flat, texts, strict=True))
    ]
    return _AND, joined_with_sign(_AND, inner, style)
