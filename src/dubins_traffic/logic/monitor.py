"""Monitors: formulas judged frame by frame over a batch of trials, by table look-up.

A formula is split into the parts of its conjunction (G distributes over it). Parts that share propositions are put
together again where their table stays small (`TOGETHER`), and each group is monitored by a table of its own; the
verdict of the whole is the least one. A group is *true* as soon as every infinite continuation satisfies it and *false*
as soon as none does, and so is the whole, since groups without common propositions can't contradict each other.

Where parts that share propositions stay apart they may contradict each other on every continuation though each could
be met alone. Then *false* comes when the first part is lost, possibly later than the whole was (`Monitors.late`).
*True* is as early as ever; a part that is decided counts as decided in what is presumed of the whole.

Bounds of at most `UNROLL` ticks are counted in the states of a table, longer ones by clocks beside it, so tables
don't grow with the bounds. Where a clock doesn't do, requests go through a delay line (`delays`), or the bound is
counted if the table stays within its limits.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from functools import lru_cache
from typing import TYPE_CHECKING, Any, Final, NamedTuple

import numpy as np
import numpy.typing as npt

from dubins_traffic.kernels.arrays import Ints
from dubins_traffic.kernels.records import table
from dubins_traffic.logic.automaton import FALSE, Automaton, Limits, automaton
from dubins_traffic.logic.delays import Line, Requests, delayed, line
from dubins_traffic.logic.formula import (
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
from dubins_traffic.logic.obligations import MAX_PROPOSITIONS
from dubins_traffic.logic.rewrite import renamed

if TYPE_CHECKING:
    from dubins_traffic.logic.kernel import Lines, Tables


class Piece(NamedTuple):
    """A table that monitors a part of a formula.

    Attributes
    ----------
    formula : int
        The number of the formula.
    table : Automaton
        The table.
    columns : tuple of int
        Which column of the input each of its propositions is.
    watch : int
        The delay line whose waiting requests speak against the formula, or -1.
    """

    formula: int
    table: Automaton
    columns: tuple[int, ...]
    watch: int


def packed_tables(pieces: Sequence[Piece]) -> dict[str, Ints]:
    """Return the fields of `kernel.Tables`; tables that several parts share stand once."""
    shared: dict[int, tuple[int, int, int]] = {}
    kept: list[Automaton] = []
    places: list[tuple[int, int, int]] = []
    sizes = (0, 0, 0)
    for piece in pieces:
        table = piece.table
        place = shared.get(id(table.target))
        if place is None:
            place = shared[id(table.target)] = sizes
            kept.append(table)
            sizes = (
                sizes[0] + table.letter.size,
                sizes[1] + table.target.size,
                sizes[2] + table.verdict.size,
            )
        places.append(place)
    clocks = [len(piece.table.clocks) for piece in pieces]
    return _as_ints(
        {
            "names_off": np.cumsum([0] + [len(piece.columns) for piece in pieces]),
            "names": [column for piece in pieces for column in piece.columns],
            "letter_at": [place[0] for place in places],
            "cell_at": [place[1] for place in places],
            "verdict_at": [place[2] for place in places],
            "letters": [piece.table.target.shape[1] for piece in pieces],
            "clock_count": clocks,
            "clock_off": np.cumsum([0, *clocks])[:-1],
            "part_of": [piece.formula for piece in pieces],
            "watch": [piece.watch for piece in pieces],
            "letter": _joined([table.letter for table in kept]),
            "target": _joined([table.target for table in kept]),
            "reset": _joined([table.reset for table in kept]),
            "verdict": _joined([table.verdict for table in kept]),
            "clock_length": _joined([piece.table.clocks for piece in pieces]),
        }
    )


def packed_lines(lines: Sequence[tuple[Line, int]], column: Mapping[str, int]) -> dict[str, Ints]:
    """Return the fields of `kernel.Lines`, given each line and its length in ticks."""
    return _as_ints(
        {
            "names_off": np.cumsum([0] + [len(line.names) for line, _ in lines]),
            "names": [column[name] for line, _ in lines for name in line.names],
            "letter_at": np.cumsum([0] + [line.letter.size for line, _ in lines])[:-1],
            "cell_at": np.cumsum([0] + [line.target.size for line, _ in lines])[:-1],
            "letters": [line.target.shape[1] for line, _ in lines],
            "ring_off": np.cumsum([0] + [length for _, length in lines]),
            "letter": _joined([line.letter for line, _ in lines]),
            "target": _joined([line.target for line, _ in lines]),
            "value": _joined([line.value for line, _ in lines]),
        }
    )


def _as_ints(fields: Mapping[str, Any]) -> dict[str, Ints]:
    return {name: np.ascontiguousarray(value, dtype=np.int64) for name, value in fields.items()}


def _joined(arrays: Sequence[Ints]) -> Ints:
    return np.concatenate([array.reshape(-1) for array in arrays]) if arrays else np.zeros(0, dtype=np.int64)


UNROLL: Final = 4
"""Longest bound, ticks, that is counted in states though a clock would do."""
LONGEST: Final = 400
"""Longest bound, ticks, that is counted in states where a clock does not do."""
MAX_PARTS: Final = 512
"""Most parts of one formula."""
LONGEST_DELAY: Final = 1_000_000
"""Most ticks that a bound may begin later, where requests wait in a delay line."""
TOGETHER: Final = Limits(states=256, cells=4_096, sought=1_000, choices=8_192)
"""How large a table may grow in which several parts are put together."""


def parts(formula: Formula) -> tuple[Formula, ...]:
    """Return formulas whose conjunction is equivalent to `formula`; what has no temporal operator stays together.

    FormulaError if there are more than `MAX_PARTS`.
    """
    split = dict.fromkeys(_split(formula, True))
    plain = [part for part in split if not any(inner.op in FUTURE | PAST for inner in subformulas(part))]
    if plain and len(propositions(conj(*plain))) <= MAX_PROPOSITIONS:
        conjuncts = (conj(*plain), *(part for part in split if part not in plain))
    else:
        conjuncts = tuple(split)
    if len(conjuncts) > MAX_PARTS:
        raise FormulaError("too many parts", value=len(conjuncts), expected=f"at most {MAX_PARTS} conjuncts")
    return conjuncts


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
        return [formula] if len(conclusions) == 1 else [implies(formula.args[0], part) for part in conclusions]
    if formula.op in (Op.G, Op.F) and (formula.op is Op.G) == positive:
        return [always(part, formula.bounds) for part in _split(formula.args[0], positive)]
    return [formula if positive else ~formula]


def groups(split: Sequence[Formula]) -> list[list[Formula]]:
    """Return the parts in groups; parts of two groups have no proposition in common."""
    joined: list[tuple[set[str], list[Formula]]] = []
    for part in split:
        names, members = set(propositions(part)), [part]
        apart: list[tuple[set[str], list[Formula]]] = []
        for other, others in joined:
            if names & other:
                names, members = names | other, others + members
            else:
                apart.append((other, others))
        joined = [*apart, (names, members)]
    return [members for _, members in joined]


def together(group: Sequence[Formula], period: float) -> Automaton | None:
    """Return one table for all parts of a group, exact in every verdict; None if it would be too large."""
    formula = conj(*group)
    names = propositions(formula)
    if len(names) > MAX_PROPOSITIONS:
        return None
    joint = _together(renamed(formula, _plain(names)), period)
    return None if joint is None else replace(joint, names=names)


@lru_cache(maxsize=1024)
def _together(formula: Formula, period: float) -> Automaton | None:
    for unroll in (UNROLL, LONGEST):
        try:
            return automaton(formula, period, unroll, TOGETHER)
        except FormulaError:
            continue
    return None


def _plain(names: Sequence[str]) -> dict[str, str]:
    """Return a name for each proposition by its place, the same for all formulas of one shape."""
    return {name: f"p{place:03d}" for place, name in enumerate(names)}


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
    try:
        made = _compiled(renamed(formula, _plain(names)), period, unroll)
    except FormulaError as error:
        raise FormulaError(f"{error.problem}, in {_short(formula)}", **error.context) from None
    return replace(made, names=names)


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
    split : bool, optional
        Whether all parts of conjunctions stay apart (true), or none (false); if not given, as above.

    Attributes
    ----------
    formulas : tuple of str
        The names of the formulas, in the order of the verdicts' columns.
    late : frozenset of str
        The formulas for which *false* may come later than it could.
    breakable : frozenset of str
        The formulas that can become *false* at all: what can always still come is never broken.
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
        self,
        formulas: Mapping[str, Formula],
        names: Sequence[str],
        period: float,
        *,
        split: bool | None = None,
    ) -> None:
        if not period > 0.0:
            raise FormulaError("not a period", value=period, expected="seconds > 0")
        self.formulas = tuple(formulas)
        self._column = {name: column for column, name in enumerate(names)}
        self._pieces: list[Piece] = []
        self._delays: list[tuple[Line, int]] = []
        late: set[str] = set()
        for number, (name, formula) in enumerate(formulas.items()):
            try:
                if not self._take(number, formula, period, split):
                    late.add(name)
            except FormulaError as error:
                raise error.within(field=name) from None
        self.late = frozenset(late)
        self.breakable = frozenset(
            self.formulas[piece.formula] for piece in self._pieces if (piece.table.verdict == FALSE).any()
        )
        self.tables = len(self._pieces)
        self.lines = len(self._delays)
        self._tables = packed_tables(self._pieces)
        self._lines = packed_lines(self._delays, self._column)
        self._kernel: tuple[Tables, Lines, Callable[..., None], Callable[..., None]] | None = None
        self.reset(0)

    def _take(self, number: int, formula: Formula, period: float, split: bool | None) -> bool:
        """Monitor a formula; say whether *false* comes as early as it can."""
        lines = len(self._delays)
        if split is False:
            self._add(number, formula, period)
            return len(self._delays) == lines
        early = True
        for group in groups(parts(formula)):
            table = together(group, period) if len(group) > 1 and split is None else None
            if table is not None:
                self._place(number, table)
                continue
            early = early and len(group) == 1
            for part in group:
                self._add(number, part, period)
        return early and len(self._delays) == lines

    def _add(self, number: int, part: Formula, period: float) -> None:
        """Monitor a part: with clocks, else with a delay line, else by counting its bounds."""
        try:
            self._place(number, compiled(part, period))
            return
        except FormulaError as error:
            refused = error
        split_off = delayed(part, period)
        if split_off is not None:
            others, late = split_off
            if late.length > LONGEST_DELAY:
                raise FormulaError(
                    "begins too late", value=late.length, expected=f"at most {LONGEST_DELAY} ticks from now"
                )
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
                raise FormulaError("unknown proposition", value=name, expected="one of the problem's propositions")
        last = len(self._delays) - 1
        columns = tuple(len(self._column) + last if name == request else self._column[name] for name in table.names)
        self._pieces.append(Piece(number, table, columns, last if strong else -1))

    def reset(self, trials: int) -> None:
        """Begin anew with `trials` trials."""
        tables = self._tables
        self._state = np.zeros((trials, self.tables), dtype=np.int64)
        self._clocks = np.zeros((trials, len(tables["clock_length"])), dtype=np.int64)
        self._memory = table(Requests, (trials, len(self._delays)))
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
        from dubins_traffic.kernels.calls import bound
        from dubins_traffic.logic.kernel import Lines, Tables, advance, delay

        width = len(self._column)
        if values.shape != (len(self._state), width):
            raise ValueError(f"values: shape {values.shape}, expected {(len(self._state), width)}")
        if self._kernel is None:
            self._kernel = Tables(**self._tables), Lines(**self._lines), bound(advance), bound(delay)
        tables, lines, step, wait = self._kernel
        self._frame[:, :width] = values
        if self._delays:
            wait(self._frame, lines, self._memory, self._rings)
        step(self._frame, tables, self._memory, self._state, self._clocks, self.verdicts)
        return self.verdicts
