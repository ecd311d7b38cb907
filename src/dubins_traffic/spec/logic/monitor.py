"""Monitors: formulas judged frame by frame over a batch of trials, by table look-up.

A formula is split into the parts of its conjunction (G distributes over it), and each part is monitored by a table of
its own; the verdict of the whole is the least one. A part is *true* as soon as every infinite continuation satisfies
it and *false* as soon as none does. So is the whole, as long as parts that share propositions don't contradict each
other on a continuation that suits each of them alone: then *false* comes when the first part is lost, possibly later
than the whole was. Parts without common propositions never do. *True* is as early as for the whole; a part that is
decided counts as decided in what is presumed of the whole. `split=False` monitors the formula in one piece.

Bounds of at most `UNROLL` ticks are counted in the states of a table, longer ones by clocks beside it, so tables
don't grow with the bounds. Where a clock doesn't do, requests go through a delay line (`delays`), or the bound is
counted if the table stays within its limits.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import lru_cache
from typing import TYPE_CHECKING, Any, Final

import numpy as np
import numpy.typing as npt

from dubins_traffic.kernels.arrays import Ints
from dubins_traffic.spec.logic.automaton import Automaton, automaton
from dubins_traffic.spec.logic.delays import Line, delayed, line
from dubins_traffic.spec.logic.formula import (
    FUTURE,
    PAST,
    Formula,
    FormulaError,
    Op,
    always,
    conj,
    implies,
    propositions,
    subformulas,
)
from dubins_traffic.spec.logic.obligations import MAX_PROPOSITIONS
from dubins_traffic.spec.logic.packing import Piece, packed_lines, packed_tables
from dubins_traffic.spec.logic.rewrite import renamed

if TYPE_CHECKING:
    from dubins_traffic.spec.logic.kernel import Lines, Tables

UNROLL: Final = 4
"""Longest bound, ticks, that is counted in states though a clock would do."""
LONGEST: Final = 400
"""Longest bound, ticks, that is counted in states where a clock does not do."""
MAX_PARTS: Final = 512
"""Most parts of one formula."""


def parts(formula: Formula) -> tuple[Formula, ...]:
    """Return formulas whose conjunction is equivalent to `formula`; what has no temporal operator stays together.

    Raises
    ------
    FormulaError
        If there are more than `MAX_PARTS`.
    """
    split = dict.fromkeys(_split(formula, True))
    plain = [part for part in split if not any(inner.op in FUTURE | PAST for inner in subformulas(part))]
    if plain and len(propositions(conj(*plain))) <= MAX_PROPOSITIONS:
        found = (conj(*plain), *(part for part in split if part not in plain))
    else:
        found = tuple(split)
    if len(found) > MAX_PARTS:
        raise FormulaError("too many parts", value=len(found), expected=f"at most {MAX_PARTS} conjuncts")
    return found


def _split(formula: Formula, positive: bool) -> list[Formula]:
    """Return the conjuncts of `formula` or of its negation."""
    if formula.op is Op.NOT:
        return _split(formula.args[0], not positive)
    if formula.op is (Op.AND if positive else Op.OR):
        return [part for arg in formula.args for part in _split(arg, positive)]
    if formula.op is Op.IMPLIES and not positive:
        return _split(formula.args[0], True) + _split(formula.args[1], False)
    if formula.op is Op.IMPLIES:
        conclusions = _split(formula.args[1], True)
        return (
            [formula] if len(conclusions) == 1 else [implies(formula.args[0], part) for part in conclusions]
        )
    if formula.op in (Op.G, Op.F) and (formula.op is Op.G) == positive:
        return [always(part, formula.bounds) for part in _split(formula.args[0], positive)]
    return [formula if positive else ~formula]


def compiled(formula: Formula, period: float, unroll: int = UNROLL) -> Automaton:
    """Return the table of one formula in one piece.

    Parameters
    ----------
    formula : Formula
        With at most `obligations.MAX_PROPOSITIONS` propositions.
    period : float
        Seconds between frames, > 0.
    unroll : int
        Bounds up to this many ticks are counted in states, longer ones by clocks.

    Raises
    ------
    FormulaError
        If it can't be monitored in this form, saying why.
    """
    names = propositions(formula)
    plain = {name: f"p{place:03d}" for place, name in enumerate(names)}
    try:
        found = _compiled(renamed(formula, plain), period, unroll)
    except FormulaError as error:
        raise FormulaError(f"{error.problem}, in {_short(formula)}", **error.context) from None
    return Automaton(names, found.letter, found.target, found.reset, found.verdict, found.clocks)


@lru_cache(maxsize=1024)
def _compiled(formula: Formula, period: float, unroll: int) -> Automaton:
    return automaton(formula, period, unroll)


def _short(formula: Formula, limit: int = 80) -> str:
    text = str(formula)
    return text if len(text) <= limit else text[: limit - 3] + "..."


class Monitors:
    """Judges formulas over a batch of trials, one compiled call a frame.

    Parameters
    ----------
    formulas : mapping of str to Formula
        By name.
    names : sequence of str
        The propositions, in the order of the input's columns.
    period : float
        Seconds between frames.
    split : bool
        Whether conjunctions are split (see above).

    Attributes
    ----------
    formulas : tuple of str
        The names of the formulas, in the order of the verdicts' columns.
    tables : int
        How many table look-ups a frame of one trial takes.
    lines : int
        How many delay lines there are.
    verdicts : (B, F) int64
        The verdicts after the last frame (`automaton.VERDICTS`); before the first, what holds of the empty word.

    Raises
    ------
    FormulaError
        If a formula uses a proposition that `names` lacks, or is too large to be monitored.
    """

    def __init__(
        self, formulas: Mapping[str, Formula], names: Sequence[str], period: float, *, split: bool = True
    ) -> None:
        if not period > 0.0:
            raise FormulaError("not a period", value=period, expected="seconds > 0")
        self.formulas = tuple(formulas)
        self._column = {name: column for column, name in enumerate(names)}
        self._pieces: list[Piece] = []
        self._delays: list[tuple[Line, int]] = []
        for number, (name, formula) in enumerate(formulas.items()):
            try:
                for part in parts(formula) if split else (formula,):
                    self._add(number, part, period)
            except FormulaError as error:
                raise error.within(field=name) from None
        self.tables = len(self._pieces)
        self.lines = len(self._delays)
        self._tables = packed_tables(self._pieces)
        self._lines = packed_lines(self._delays, self._column)
        self._kernel: tuple[Tables, Lines] | None = None
        self.reset(0)

    def _add(self, number: int, part: Formula, period: float) -> None:
        """Monitor a part: with clocks, else with a delay line, else by counting its bounds."""
        try:
            self._place(number, compiled(part, period))
            return
        except FormulaError as error:
            refused = error
        found = delayed(part, period)
        if found is not None:
            others, late = found
            for other in others:
                self._add(number, other, period)
            table = compiled(late.formula, period)
            self._delays.append((line(late.request, period), late.length))
            self._place(number, table, late.name, late.strong)
            return
        try:
            self._place(number, compiled(part, period, LONGEST))
        except FormulaError:
            raise refused from None

    def _place(self, number: int, table: Automaton, request: str = "", strong: bool = False) -> None:
        """Add a table; `request` is its proposition that comes out of the last delay line."""
        for name in table.names:
            if name != request and name not in self._column:
                raise FormulaError(
                    "unknown proposition", value=name, expected="one of the problem's propositions"
                )
        last = len(self._delays) - 1
        columns = tuple(
            len(self._column) + last if name == request else self._column[name] for name in table.names
        )
        self._pieces.append(Piece(number, table, columns, last if strong else -1))

    def reset(self, trials: int) -> None:
        """Begin anew with `trials` trials."""
        tables = self._tables
        self._state = np.zeros((trials, self.tables), dtype=np.int64)
        self._clocks = np.zeros((trials, len(tables["clock_length"])), dtype=np.int64)
        self._memory = np.zeros((trials, len(self._delays), 3), dtype=np.int64)
        self._rings = np.zeros((trials, sum(length for _, length in self._delays)), dtype=np.int64)
        self._frame = np.zeros((trials, len(self._column) + len(self._delays)), dtype=np.int64)
        first = np.full(len(self.formulas), 3, dtype=np.int64)
        np.minimum.at(first, tables["part_of"], tables["verdict"][tables["verdict_at"]])
        self.verdicts = np.tile(first, (trials, 1))

    def update(self, values: npt.NDArray[Any]) -> Ints:
        """Take one frame into account.

        Parameters
        ----------
        values : (B, P) array of int64 or bool
            The propositions, in the order of `names`.

        Returns
        -------
        (B, F) int64
            `verdicts`, updated in place.
        """
        from dubins_traffic.spec.logic.kernel import Lines, Tables, advance, delay

        width = len(self._column)
        if values.shape != (len(self._state), width):
            raise ValueError(f"values: shape {values.shape}, expected {(len(self._state), width)}")
        if self._kernel is None:
            self._kernel = Tables(**self._tables), Lines(**self._lines)
        tables, lines = self._kernel
        self._frame[:, :width] = values
        if self._delays:
            delay(self._frame, lines, self._memory, self._rings)
        advance(self._frame, tables, self._memory, self._state, self._clocks, self.verdicts)
        return self.verdicts
