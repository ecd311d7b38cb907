"""Monitors: formulas judged frame by frame over a batch of trials, by table look-up.

A formula is split into the parts of its conjunction (G distributes over it), and each part is monitored by a table of
its own; the verdict of the whole is the least one. A part is *true* as soon as every infinite continuation satisfies
it and *false* as soon as none does. So is the whole, as long as parts that share propositions don't contradict each
other on a continuation that suits each of them alone: then *false* comes when the first part is lost, possibly later
than the whole was. Parts without common propositions never do. *True* is as early as for the whole; a part that is
decided counts as decided in what is presumed of the whole. `split=False` monitors the formula in one piece.

Bounds of at most `UNROLL` ticks are counted in the states of a table, longer ones by clocks beside it, so tables
don't grow with the bounds. Where a clock doesn't do, the bound is counted if the table stays within its limits.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import lru_cache
from typing import TYPE_CHECKING, Any, Final

import numpy as np
import numpy.typing as npt

from dubins_traffic.kernels.arrays import Ints
from dubins_traffic.spec.logic.automaton import Automaton, automaton
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
from dubins_traffic.spec.logic.rewrite import renamed

if TYPE_CHECKING:
    from dubins_traffic.spec.logic.kernel import Tables

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


def compiled(formula: Formula, period: float) -> Automaton:
    """Return the table of one formula in one piece.

    Parameters
    ----------
    formula : Formula
        With at most `obligations.MAX_PROPOSITIONS` propositions.
    period : float
        Seconds between frames, > 0.

    Raises
    ------
    FormulaError
        If it is too large to be monitored, saying what is too large.
    """
    names = propositions(formula)
    plain = {name: f"p{place:03d}" for place, name in enumerate(names)}
    try:
        found = _compiled(renamed(formula, plain), period)
    except FormulaError as error:
        raise FormulaError(f"{error.problem}, in {_short(formula)}", **error.context) from None
    return Automaton(names, found.letter, found.target, found.reset, found.verdict, found.clocks)


@lru_cache(maxsize=1024)
def _compiled(formula: Formula, period: float) -> Automaton:
    try:
        return automaton(formula, period, UNROLL)
    except FormulaError as first:
        try:
            return automaton(formula, period, LONGEST)
        except FormulaError:
            raise first from None


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
        self._width = len(names)
        pieces: list[tuple[int, Automaton]] = []
        for number, (name, formula) in enumerate(formulas.items()):
            try:
                pieces += [
                    (number, compiled(part, period)) for part in (parts(formula) if split else (formula,))
                ]
                _known(formula, names)
            except FormulaError as error:
                raise error.within(field=name) from None
        self._tables = _packed(pieces, {name: column for column, name in enumerate(names)})
        self._kernel_tables: Tables | None = None
        self.tables = len(pieces)
        self.reset(0)

    def reset(self, trials: int) -> None:
        """Begin anew with `trials` trials."""
        tables = self._tables
        self._state = np.zeros((trials, self.tables), dtype=np.int64)
        self._clocks = np.zeros((trials, len(tables["clock_length"])), dtype=np.int64)
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
        from dubins_traffic.spec.logic.kernel import Tables, advance

        if self._kernel_tables is None:
            self._kernel_tables = Tables(**self._tables)
        if values.shape != (len(self._state), self._width):
            raise ValueError(f"values: shape {values.shape}, expected {(len(self._state), self._width)}")
        frame = np.ascontiguousarray(values, dtype=np.int64)
        advance(frame, self._kernel_tables, self._state, self._clocks, self.verdicts)
        return self.verdicts


def _known(formula: Formula, names: Sequence[str]) -> None:
    for name in propositions(formula):
        if name not in names:
            raise FormulaError(
                "unknown proposition", value=name, expected="one of the problem's propositions"
            )


def _packed(pieces: Sequence[tuple[int, Automaton]], column: Mapping[str, int]) -> dict[str, Ints]:
    """Return the fields of `kernel.Tables`; tables that several parts share stand once."""
    shared: dict[int, tuple[int, int, int]] = {}
    letter: list[Ints] = []
    target: list[Ints] = []
    reset: list[Ints] = []
    verdict: list[Ints] = []
    places: list[tuple[int, int, int]] = []
    sizes = [0, 0, 0]
    for _, piece in pieces:
        place = shared.get(id(piece.target))
        if place is None:
            place = shared[id(piece.target)] = (sizes[0], sizes[1], sizes[2])
            for held, array in ((letter, piece.letter), (target, piece.target), (reset, piece.reset)):
                held.append(array.reshape(-1))
            verdict.append(piece.verdict)
            sizes = [
                sizes[0] + piece.letter.size,
                sizes[1] + piece.target.size,
                sizes[2] + piece.verdict.size,
            ]
        places.append(place)
    clocks = [len(piece.clocks) for _, piece in pieces]
    fields: dict[str, Any] = {
        "names_off": np.cumsum([0] + [len(piece.names) for _, piece in pieces]),
        "names": [column[name] for _, piece in pieces for name in piece.names],
        "letter_at": [place[0] for place in places],
        "cell_at": [place[1] for place in places],
        "verdict_at": [place[2] for place in places],
        "letters": [piece.target.shape[1] for _, piece in pieces],
        "clock_count": clocks,
        "clock_off": np.cumsum([0, *clocks])[:-1],
        "part_of": [number for number, _ in pieces],
        "letter": _joined(letter),
        "target": _joined(target),
        "reset": _joined(reset),
        "verdict": _joined(verdict),
        "clock_length": _joined([piece.clocks for _, piece in pieces]),
    }
    return {name: np.ascontiguousarray(value, dtype=np.int64) for name, value in fields.items()}


def _joined(arrays: Sequence[Ints]) -> Ints:
    return np.concatenate(arrays) if arrays else np.zeros(0, dtype=np.int64)
