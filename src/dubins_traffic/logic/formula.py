"""Formulas of linear temporal logic with past and bounded operators, over named propositions.

Formulas are immutable and shared: equal formulas are one object, so `==` and `hash` cost nothing. Conjunctions and
disjunctions have any number of parts and never stand directly inside one of their own kind. A formula is printed in
letters: ``G (a -> F b)``.

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

What `to_spin` and `to_ascii` return, `parse` reads back as the same formula; both leave out as many parentheses as both
readings allow.
"""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from enum import Enum
from threading import Lock
from typing import Any, Final, TypeAlias
from weakref import WeakValueDictionary

from dubins_traffic.errors import InputError

MAX_DEPTH: Final = 100
"""Deepest nesting of operators in a formula."""
MAX_SIZE: Final = 20_000
"""Most operators and propositions in a formula written out."""

Bounds: TypeAlias = tuple[float, float]


class FormulaError(InputError):
    """A formula can't be read or used.

    Parameters
    ----------
    problem : str
        What is wrong.
    line, column : int, optional
        Where in the text, both from 1.
    file, field, value, expected
        As in `InputError`.
    """

    def __init__(self, problem: str, *, line: int | None = None, column: int | None = None, **context: Any) -> None:
        self.line = line
        self.column = column
        self.context = context
        place = "" if line is None else f"line {line}, column {column}: "
        super().__init__(place + problem, **context)

    def within(self, *, file: str | None = None, field: str | None = None) -> FormulaError:
        """Return the same error placed in `file` and below the field `field`."""
        placed = super().within(file=file, field=field)
        context: dict[str, Any] = self.context | {"file": placed.file, "field": placed.field}
        error = FormulaError(placed.problem, **context)
        error.line, error.column = self.line, self.column
        return error


class Op(Enum):
    """What stands at the top of a formula."""

    TRUE = "true"
    FALSE = "false"
    PROP = "prop"
    NOT = "!"
    AND = "&&"
    OR = "||"
    IMPLIES = "->"
    IFF = "<->"
    X = "X"
    F = "F"
    G = "G"
    U = "U"
    R = "R"
    W = "W"
    M = "M"
    Y = "Y"
    Z = "Z"
    O = "O"  # noqa: E741
    H = "H"
    S = "S"
    T = "T"


PAST: Final = frozenset({Op.Y, Op.Z, Op.O, Op.H, Op.S, Op.T})
FUTURE: Final = frozenset({Op.X, Op.F, Op.G, Op.U, Op.R, Op.W, Op.M})
BOUNDABLE: Final = frozenset({Op.F, Op.G, Op.U, Op.R})
RESERVED: Final = frozenset({op.value for op in PAST | FUTURE} | {"V", "true", "false"})
"""Words that can't be names of propositions."""

_NAME = re.compile(r"[A-Za-z_][A-Za-z0-9_]*\Z")


class Formula:
    """A formula; made by the functions of this module, never directly.

    Attributes
    ----------
    op : Op
        What stands at the top.
    args : tuple of Formula
        The parts.
    name : str
        The name of a proposition, else empty.
    bounds : (float, float) or None
        Seconds, for F, G, U and R.
    depth, size : int
        Levels of operators, and operators and propositions written out.
    """

    __slots__ = ("__weakref__", "args", "bounds", "depth", "name", "op", "size")

    op: Op
    args: tuple[Formula, ...]
    name: str
    bounds: Bounds | None
    depth: int
    size: int

    def __setattr__(self, name: str, value: object) -> None:
        raise AttributeError(f"formulas don't change: {name}")

    def __reduce__(self) -> tuple[Any, ...]:
        return make, (self.op, self.args, self.name, self.bounds)

    def __and__(self, other: Formula) -> Formula:
        return conj(self, other)

    def __or__(self, other: Formula) -> Formula:
        return disj(self, other)

    def __invert__(self) -> Formula:
        return negation(self)

    def __str__(self) -> str:
        return to_ascii(self)

    def __repr__(self) -> str:
        return f"<Formula {self}>"


_Key: TypeAlias = tuple[Op, tuple[Formula, ...], str, Bounds | None]
_known: WeakValueDictionary[_Key, Formula] = WeakValueDictionary()
_lock = Lock()


def make(op: Op, args: tuple[Formula, ...] = (), name: str = "", bounds: Bounds | None = None) -> Formula:
    """Return the one formula with these parts.

    Raises
    ------
    FormulaError
        If it is nested too deeply or too long, or if its bounds are no interval.
    """
    key = (op, args, name, bounds)
    with _lock:
        made = _known.get(key)
        if made is None:
            made = _known[key] = _new(op, args, name, bounds)
        return made


def _new(op: Op, args: tuple[Formula, ...], name: str, bounds: Bounds | None) -> Formula:
    depth = 1 + max((part.depth for part in args), default=0)
    size = 1 + sum(part.size for part in args)
    if depth > MAX_DEPTH:
        raise FormulaError("nested too deeply", expected=f"at most {MAX_DEPTH} levels of operators")
    if size > MAX_SIZE:
        raise FormulaError("too long", expected=f"at most {MAX_SIZE} operators and propositions")
    formula = object.__new__(Formula)
    values = {"op": op, "args": args, "name": name, "bounds": bounds, "depth": depth, "size": size}
    for attribute, value in values.items():
        object.__setattr__(formula, attribute, value)
    return formula


TRUE: Final = make(Op.TRUE)
FALSE: Final = make(Op.FALSE)


def prop(name: str) -> Formula:
    """Return the proposition `name`: letters, digits and underscores, no digit first, not a reserved word."""
    if not _NAME.match(name) or name in RESERVED:
        raise FormulaError("not a name of a proposition", value=name, expected="a word that is not reserved")
    return make(Op.PROP, name=name)


def negation(part: Formula) -> Formula:
    """Return the negation of `part`."""
    return make(Op.NOT, (part,))


def conj(*parts: Formula) -> Formula:
    """Return the conjunction of `parts`; of none, true."""
    return _joined(Op.AND, TRUE, parts)


def disj(*parts: Formula) -> Formula:
    """Return the disjunction of `parts`; of none, false."""
    return _joined(Op.OR, FALSE, parts)


def _joined(op: Op, empty: Formula, parts: tuple[Formula, ...]) -> Formula:
    flat = tuple(inner for part in parts for inner in (part.args if part.op is op else (part,)))
    if len(flat) < 2:
        return flat[0] if flat else empty
    return make(op, flat)


def implies(left: Formula, right: Formula) -> Formula:
    """Return `left` -> `right`."""
    return make(Op.IMPLIES, (left, right))


def iff(left: Formula, right: Formula) -> Formula:
    """Return `left` <-> `right`."""
    return make(Op.IFF, (left, right))


def subformulas(formula: Formula) -> Iterator[Formula]:
    """Yield each distinct subformula once, parts before wholes."""
    seen: set[Formula] = set()
    stack = [(formula, False)]
    while stack:
        item, opened = stack.pop()
        if opened:
            yield item
        elif item not in seen:
            seen.add(item)
            stack.append((item, True))
            stack.extend((part, False) for part in reversed(item.args))


def propositions(formula: Formula) -> tuple[str, ...]:
    """Return the names of the propositions in `formula`, sorted."""
    return tuple(sorted(part.name for part in subformulas(formula) if part.op is Op.PROP))


JUNCTIONS: Final = (Op.AND, Op.OR, Op.IMPLIES, Op.IFF)


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


ASCII: Final = Style({Op.AND: "&", Op.OR: "|"})


def to_ascii(formula: Formula) -> str:
    """Return `formula` in letters: ``G (a -> F b)``."""
    return written(formula, ASCII)


def written(formula: Formula, style: Style) -> str:
    """Return `formula` spelled in a style."""
    done: dict[Formula, str] = {}
    for part in subformulas(formula):
        inner = [
            done[arg] if is_bare(part, place, arg, style.brackets) else f"({done[arg]})"
            for place, arg in enumerate(part.args)
        ]
        done[part] = joined_with_sign(part, inner, style)
    return done[formula]


def joined_with_sign(part: Formula, inner: Sequence[str], style: Style) -> str:
    """Return `part` spelled in a style, given its parts' texts with their brackets."""
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


def is_bare(whole: Formula, place: int, part: Formula, brackets: Brackets) -> bool:
    """Say whether `part` needs no parentheses as the part number `place` of `whole`."""
    if brackets is Brackets.ALL:
        return not part.args
    if len(part.args) < 2:
        return True
    if whole.op not in JUNCTIONS:
        return False
    if part.op not in JUNCTIONS:
        return True
    if brackets is Brackets.MIXED_NEVER:
        return False
    if whole.op is Op.IMPLIES and part.op is Op.IMPLIES:
        return place == 1
    if whole.op is Op.IFF and part.op is Op.IFF:
        return place == 0
    return JUNCTIONS.index(part.op) < JUNCTIONS.index(whole.op)


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
    """Return `bounds` as floats; FormulaError if they are not 0 <= a <= b <= `LONGEST_BOUND`."""
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
