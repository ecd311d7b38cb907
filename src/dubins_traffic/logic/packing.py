"""Tables of monitors and delay lines, laid one after another for the kernels."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np

from dubins_traffic.kernels.arrays import Ints
from dubins_traffic.logic.automaton import Automaton
from dubins_traffic.logic.delays import Line


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
