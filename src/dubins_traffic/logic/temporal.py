"""Making formulas with temporal operators, and their bounds.

========  =====================  =================================================================
letter    function               meaning at position t of an infinite word
========  =====================  =================================================================
``X``     `next_`                p holds at t + 1
``F``     `eventually`           p holds now or later; with bounds [a, b], within them
``G``     `always`               p holds from now on; with bounds [a, b], at all positions in them
``U``     `until`                q holds now or later (within the bounds), and p until then
``R, V``  `release`              not (not p U not q)
``W``     `weak_until`           p U q, or p for ever
``M``     `strong_release`       q U (p and q)
``Y``     `yesterday`            t > 0, and p held at t - 1
``Z``     `weak_yesterday`       t = 0, or p held at t - 1
``O``     `once`                 p holds now or held before
``H``     `historically`         p holds now and held always before
``S``     `since`                q holds now or held before, and p has held since
``T``     `trigger`              not (not p S not q)
========  =====================  =================================================================

Bounds are in seconds. At period T the bound d means ceil(d/T - 1e-9) ticks.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Final

from dubins_traffic.logic.formula import Bounds, Formula, FormulaError, Op, make

LONGEST_BOUND: Final = 1e9
"""Longest bound, seconds: some thirty years."""


def _unary(op: Op) -> Callable[[Formula], Formula]:
    def build(part: Formula) -> Formula:
        return make(op, (part,))

    build.__doc__ = f"Return {op.value} `part`."
    return build


def _binary(op: Op) -> Callable[[Formula, Formula], Formula]:
    def build(left: Formula, right: Formula) -> Formula:
        return make(op, (left, right))

    build.__doc__ = f"Return `left` {op.value} `right`."
    return build


next_ = _unary(Op.X)
yesterday = _unary(Op.Y)
weak_yesterday = _unary(Op.Z)
once = _unary(Op.O)
historically = _unary(Op.H)
weak_until = _binary(Op.W)
strong_release = _binary(Op.M)
since = _binary(Op.S)
trigger = _binary(Op.T)


def eventually(part: Formula, bounds: Bounds | None = None) -> Formula:
    """Return F `part`, within `bounds` (seconds) if given."""
    return make(Op.F, (part,), bounds=interval(bounds))


def always(part: Formula, bounds: Bounds | None = None) -> Formula:
    """Return G `part`, within `bounds` (seconds) if given."""
    return make(Op.G, (part,), bounds=interval(bounds))


def until(left: Formula, right: Formula, bounds: Bounds | None = None) -> Formula:
    """Return `left` U `right`, `right` within `bounds` (seconds) if given."""
    return make(Op.U, (left, right), bounds=interval(bounds))


def release(left: Formula, right: Formula, bounds: Bounds | None = None) -> Formula:
    """Return `left` R `right`, `right` asked for within `bounds` (seconds) only if given."""
    return make(Op.R, (left, right), bounds=interval(bounds))


def interval(bounds: Bounds | None) -> Bounds | None:
    """Return `bounds` as floats.

    Raises
    ------
    FormulaError
        If they are not 0 <= a <= b <= `LONGEST_BOUND`.
    """
    if bounds is None:
        return None
    low, high = float(bounds[0]), float(bounds[1])
    if not 0.0 <= low <= high <= LONGEST_BOUND:
        expected = f"[a, b] with 0 <= a <= b <= {LONGEST_BOUND:g}, seconds"
        raise FormulaError("not an interval", value=list(bounds), expected=expected)
    return low + 0.0, high + 0.0


def ticks(seconds: float, period: float) -> int:
    """Return how many ticks a duration takes: ceil(seconds / period - 1e-9)."""
    return max(0, math.ceil(seconds / period - 1e-9))
