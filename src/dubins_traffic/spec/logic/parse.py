"""The parser: SPIN's syntax and the usual ASCII forms, with the exact place of every error.

Loosest first: ``<->``, ``->``, ``||``, ``&&``, the binary temporal operators, then the unary operators, which bind
tightest. ``->`` and the binary temporal operators group to the right. SPIN itself ranks ``&&``, ``||``, ``->`` and
``<->`` equally and groups everything to the left: formulas that mix them without parentheses mean something else
there, so the printer always sets parentheses where the two readings differ.

=====================  =========================================
``!`` ``~``            not
``&&`` ``&`` ``/\\``    and
``||`` ``|`` ``\\/``    or
``->`` ``=>``          implies
``<->`` ``<=>``        is equivalent to
``[]`` ``<>``          ``G``, ``F``
``true`` ``1``         true
``false`` ``0``        false
=====================  =========================================

F, G, U, R and V may be followed by bounds in seconds: ``F[0,10] p``, ``<>[0,0.5] p``, ``p U[1,2 s] q``. Line breaks
are spaces.
"""

from __future__ import annotations

import re
from collections.abc import Callable
from dataclasses import dataclass
from typing import Final, NoReturn, TypeVar

from dubins_traffic.errors import InputError
from dubins_traffic.spec.logic.formula import (
    BOUNDABLE,
    FALSE,
    MAX_DEPTH,
    RESERVED,
    TRUE,
    Bounds,
    Formula,
    FormulaError,
    Op,
    conj,
    disj,
    interval,
    make,
    negation,
    prop,
)

T = TypeVar("T")

MAX_LENGTH: Final = 200_000
"""Most characters in the text of a formula."""

_TOKEN = re.compile(
    r"(?P<space>\s+)"
    r"|(?P<number>\d+(?:\.\d*)?(?:[eE][+-]?\d+)?|\.\d+(?:[eE][+-]?\d+)?)(?![A-Za-z0-9_.])"
    r"|(?P<word>[A-Za-z_][A-Za-z0-9_]*)"
    r"|(?P<sign><->|<=>|\[\]|<>|->|=>|&&|\|\||/\\|\\/|[!~&|()\[\],])"
)
_SPELLINGS: Final = {
    "~": "!",
    "&": "&&",
    "/\\": "&&",
    "|": "||",
    "\\/": "||",
    "=>": "->",
    "<=>": "<->",
    "[]": "G",
    "<>": "F",
    "V": "R",
}
_UNARY: Final = {op.value: op for op in (Op.X, Op.F, Op.G, Op.Y, Op.Z, Op.O, Op.H)}
_BINARY: Final = {op.value: op for op in (Op.U, Op.R, Op.W, Op.M, Op.S, Op.T)}
_RANKS: Final = {"<->": 1, "->": 2, "||": 3, "&&": 4} | dict.fromkeys(_BINARY, 5)
_TO_THE_RIGHT: Final = frozenset({"->", *_BINARY})
_OPERAND: Final = "a proposition, true, false, '(' or a unary operator"


@dataclass(frozen=True, slots=True)
class _Token:
    kind: str
    text: str
    meaning: str
    start: int


def parse(text: str, *, file: str | None = None) -> Formula:
    """Return the formula that `text` says.

    Parameters
    ----------
    text : str
        The formula.
    file : str, optional
        Where it stands, for messages.

    Raises
    ------
    FormulaError
        With the line and column (from 1) at which `text` stops being a formula, and what could stand there; or if
        it is too long or nested too deeply.
    """
    if len(text) > MAX_LENGTH:
        raise FormulaError(
            "too long", line=1, column=1, file=file, expected=f"at most {MAX_LENGTH} characters"
        )
    return _Parser(text, file).whole()


class _Parser:
    """Reads one text by operator precedence; parts of one rank are collected in a loop, not by recursion."""

    def __init__(self, text: str, file: str | None) -> None:
        self._text = text
        self._file = file
        self._tokens = self._split()
        self._next = 0

    def whole(self) -> Formula:
        formula = self._expression(1, 0)
        if self._ahead().kind != "end":
            self._unexpected("an operator or the end" if self._ahead().text != ")" else "no more ')' than '('")
        return formula

    def _split(self) -> list[_Token]:
        tokens: list[_Token] = []
        place = 0
        while place < len(self._text):
            match = _TOKEN.match(self._text, place)
            if match is None:
                self._fail("unknown character", place, self._text[place], "an operator or a proposition")
            kind = match.lastgroup or ""
            text = match.group()
            if kind != "space":
                tokens.append(_Token(kind, text, _SPELLINGS.get(text, text), place))
            place = match.end()
        tokens.append(_Token("end", "", "end", len(self._text.rstrip())))
        return tokens

    def _ahead(self) -> _Token:
        return self._tokens[self._next]

    def _take(self) -> _Token:
        token = self._tokens[self._next]
        self._next += 1
        return token

    def _expression(self, rank: int, depth: int) -> Formula:
        """Read operands joined by operators of at least `rank`."""
        if depth > MAX_DEPTH:
            self._fail("nested too deeply", self._ahead().start, None, f"at most {MAX_DEPTH} levels")
        left = self._operand(depth)
        while True:
            token = self._ahead()
            found = _RANKS.get(token.meaning, 0) if token.kind in ("sign", "word") else 0
            if found < rank or found == 0:
                return left
            left = self._joined(left, token, found, depth)

    def _joined(self, left: Formula, token: _Token, rank: int, depth: int) -> Formula:
        sign = token.meaning
        if sign in ("&&", "||"):
            parts = [left]
            while self._ahead().meaning == sign:
                self._take()
                parts.append(self._expression(rank + 1, depth + 1))
            return self._built(token, lambda: conj(*parts) if sign == "&&" else disj(*parts))
        self._take()
        bounds = self._bounds(_BINARY.get(sign))
        right = self._expression(rank if sign in _TO_THE_RIGHT else rank + 1, depth + 1)
        op = _BINARY.get(sign) or Op(sign)
        return self._built(token, lambda: make(op, (left, right), bounds=bounds))

    def _operand(self, depth: int) -> Formula:
        """Read unary operators and what they apply to."""
        prefix: list[tuple[_Token, Op, Bounds | None]] = []
        while self._ahead().meaning == "!" or self._ahead().meaning in _UNARY:
            token = self._take()
            op = Op.NOT if token.meaning == "!" else _UNARY[token.meaning]
            prefix.append((token, op, self._bounds(op)))
        formula = self._atom(depth)
        for token, op, bounds in reversed(prefix):
            formula = self._apply(token, op, formula, bounds)
        return formula

    def _apply(self, token: _Token, op: Op, part: Formula, bounds: Bounds | None) -> Formula:
        return self._built(
            token, lambda: negation(part) if op is Op.NOT else make(op, (part,), bounds=bounds)
        )

    def _atom(self, depth: int) -> Formula:
        token = self._ahead()
        if token.text in ("true", "1"):
            self._take()
            return TRUE
        if token.text in ("false", "0"):
            self._take()
            return FALSE
        if token.kind == "word" and token.text not in RESERVED:
            self._take()
            return prop(token.text)
        if token.text == "(":
            return self._parenthesised(depth)
        self._unexpected(_OPERAND)

    def _parenthesised(self, depth: int) -> Formula:
        opening = self._take()
        inner = self._expression(1, depth + 1)
        if self._ahead().text != ")":
            line, column = _place(self._text, opening.start)
            self._unexpected(f"an operator or ')' for the '(' at line {line}, column {column}")
        self._take()
        return inner

    def _bounds(self, op: Op | None) -> Bounds | None:
        opening = self._ahead()
        if opening.text != "[":
            return None
        if op not in BOUNDABLE:
            self._unexpected("no bounds here: only F, G, U and R have them")
        self._take()
        low = self._duration()
        self._demand(",")
        high = self._duration()
        self._demand("]")
        return self._built(opening, lambda: interval((low, high)))

    def _duration(self) -> float:
        if self._ahead().kind != "number":
            self._unexpected("a number of seconds")
        value = float(self._take().text)
        if self._ahead().text == "s":
            self._take()
        return value

    def _demand(self, text: str) -> None:
        if self._ahead().text != text:
            self._unexpected(f"'{text}'")
        self._take()

    def _built(self, token: _Token, build: Callable[[], T]) -> T:
        """Return what `build` makes; its errors get the place of `token`."""
        try:
            return build()
        except InputError as error:
            context = error.context if isinstance(error, FormulaError) else {}
            line, column = _place(self._text, token.start)
            merged = context | {"file": self._file}
            raise FormulaError(error.problem, line=line, column=column, **merged) from None

    def _unexpected(self, expected: str) -> NoReturn:
        token = self._ahead()
        if token.kind == "end":
            self._fail("ends too early", token.start, None, expected)
        self._fail("unexpected", token.start, token.text, expected)

    def _fail(self, problem: str, place: int, found: str | None, expected: str) -> NoReturn:
        line, column = _place(self._text, place)
        what = problem if found is None else f"{problem} '{found}'"
        raise FormulaError(what, line=line, column=column, file=self._file, expected=expected)


def _place(text: str, offset: int) -> tuple[int, int]:
    """Return line and column, both from 1, of a position in `text`."""
    before = text[:offset]
    return before.count("\n") + 1, offset - (before.rfind("\n") + 1) + 1
