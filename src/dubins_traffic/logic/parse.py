r"""The parser: SPIN's syntax and the usual ASCII forms, with the exact place of every error.

Loosest first: ``<->``, ``->``, ``||``, ``&&``, the binary temporal operators, then the unary operators, which bind
tightest. ``->`` and the binary temporal operators group to the right. SPIN itself ranks ``&&``, ``||``, ``->`` and
``<->`` equally and groups everything to the left: formulas that mix them without parentheses mean something else
there, so the printer always sets parentheses where the two readings differ.

=====================  =========================================
``!`` ``~``            not
``&&`` ``&`` ``/\``     and
``||`` ``|`` ``\/``     or
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
from dubins_traffic.logic.formula import (
    BOUNDABLE,
    FALSE,
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
_CONSTANTS: Final = {"true": TRUE, "1": TRUE, "false": FALSE, "0": FALSE}
_UNARY: Final = {op.value: op for op in (Op.NOT, Op.X, Op.F, Op.G, Op.Y, Op.Z, Op.O, Op.H)}
_RANKS: Final = {Op.IFF: 1, Op.IMPLIES: 2, Op.OR: 3, Op.AND: 4} | dict.fromkeys((Op.U, Op.R, Op.W, Op.M, Op.S, Op.T), 5)
_BINARY: Final = {op.value: op for op in _RANKS}
_TIGHTEST: Final = 6
_OPERAND: Final = "a proposition, true, false, '(' or a unary operator"


@dataclass(frozen=True, slots=True)
class _Token:
    kind: str
    text: str
    meaning: str
    start: int


@dataclass(frozen=True, slots=True)
class _Pending:
    """An operator that waits for its right part, or an opening parenthesis (without `op`)."""

    token: _Token
    op: Op | None
    rank: int
    bounds: Bounds | None = None


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
        raise FormulaError("too long", line=1, column=1, file=file, expected=f"at most {MAX_LENGTH} characters")
    return _Parser(text, file).whole()


def place_of(text: str, name: str) -> tuple[int, int]:
    """Return line and column, both from 1, at which a proposition first stands in the text of a formula.

    ValueError if it does not stand there.
    """
    match = re.search(rf"(?<![A-Za-z0-9_]){re.escape(name)}(?![A-Za-z0-9_])", text)
    if match is None:
        raise ValueError(f"no {name!r} in {text!r}")
    return _place(text, match.start())


class _Parser:
    """Reads one text by operator precedence, with stacks of its own in place of recursion."""

    def __init__(self, text: str, file: str | None) -> None:
        self._text = text
        self._file = file
        self._tokens = self._split()
        self._next = 0
        self._parts: list[Formula] = []
        self._pending: list[_Pending] = []

    def whole(self) -> Formula:
        while True:
            self._operand()
            while self._ahead().text == ")":
                self._close()
            if self._ahead().kind == "end":
                return self._finish()
            self._operator()

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

    def _operand(self) -> None:
        """Read unary operators and opening parentheses up to and with a proposition or constant."""
        while True:
            token = self._ahead()
            if token.text == "(":
                self._pending.append(_Pending(self._take(), None, 0))
            elif token.meaning in _UNARY:
                self._take()
                op = _UNARY[token.meaning]
                self._pending.append(_Pending(token, op, _TIGHTEST, self._bounds(op)))
            else:
                break
        constant = _CONSTANTS.get(token.text)
        if constant is None:
            if token.kind != "word" or token.text in RESERVED:
                self._unexpected(_OPERAND)
            constant = prop(token.text)
        self._take()
        self._parts.append(constant)

    def _operator(self) -> None:
        token = self._ahead()
        op = _BINARY.get(token.meaning)
        if op is None:
            self._unexpected(self._wanted())
        self._take()
        rank = _RANKS[op]
        while self._pending and (self._pending[-1].rank > rank or (self._pending[-1].rank == rank and op is Op.IFF)):
            self._reduce()
        self._pending.append(_Pending(token, op, rank, self._bounds(op)))

    def _close(self) -> None:
        while self._pending and self._pending[-1].op is not None:
            self._reduce()
        if not self._pending:
            self._unexpected("no more ')' than '('")
        self._pending.pop()
        self._take()

    def _finish(self) -> Formula:
        while self._pending:
            if self._pending[-1].op is None:
                self._unexpected(self._wanted())
            self._reduce()
        return self._parts.pop()

    def _wanted(self) -> str:
        """Say what may stand behind a part."""
        for pending in reversed(self._pending):
            if pending.op is None:
                line, column = _place(self._text, pending.token.start)
                return f"an operator or ')' for the '(' at line {line}, column {column}"
        return "an operator or the end"

    def _reduce(self) -> None:
        """Apply the last pending operator; all of a chain of && or of || at once."""
        last = self._pending.pop()
        right = self._parts.pop()
        if last.rank == _TIGHTEST:
            self._parts.append(self._built(last, (right,)))
            return
        parts = [right, self._parts.pop()]
        if last.op in (Op.AND, Op.OR):
            while self._pending and self._pending[-1].op is last.op:
                last = self._pending.pop()
                parts.append(self._parts.pop())
        self._parts.append(self._built(last, tuple(reversed(parts))))

    def _built(self, pending: _Pending, parts: tuple[Formula, ...]) -> Formula:
        op = pending.op or Op.AND
        if op is Op.AND or op is Op.OR:
            return self._placed(pending.token, lambda: conj(*parts) if op is Op.AND else disj(*parts))
        return self._placed(pending.token, lambda: make(op, parts, bounds=pending.bounds))

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
        return self._placed(opening, lambda: interval((low, high)))

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

    def _placed(self, token: _Token, build: Callable[[], T]) -> T:
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

    def _fail(self, problem: str, place: int, read: str | None, expected: str) -> NoReturn:
        line, column = _place(self._text, place)
        what = problem if read is None else f"{problem} '{read}'"
        raise FormulaError(what, line=line, column=column, file=self._file, expected=expected)


def _place(text: str, offset: int) -> tuple[int, int]:
    """Return line and column, both from 1, of a position in `text`."""
    before = text[:offset]
    return before.count("\n") + 1, offset - (before.rfind("\n") + 1) + 1
