"""Road networks made into tables for kernels."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import numpy.typing as npt

from dubins_traffic.errors import InputError
from dubins_traffic.kernels.arrays import Ints
from dubins_traffic.kernels.records import Rows, join
from dubins_traffic.roads.network import RoadNetwork
from dubins_traffic.roads.table import CellGrid, RoadTable, Segment

_NUMBERED = frozenset(
    {"seg_off", "segment", "piece", "vert_off", "vertex", "grid", "seg_start", "vert_start"}
)
"""What is not just put one after another where several networks are."""


def pack_distinct(networks: Sequence[RoadNetwork], half_widths: Sequence[float]) -> tuple[RoadTable, Ints]:
    """Return the table of the distinct pairs of network and half width, and the number of each trial's pair in it."""
    numbers: dict[tuple[int, float], int] = {}
    for network, width in zip(networks, half_widths, strict=True):
        numbers.setdefault((id(network), width), len(numbers))
    given = [numbers[id(network), width] for network, width in zip(networks, half_widths, strict=True)]
    first = [given.index(number) for number in range(len(numbers))]
    packed = pack([networks[k] for k in first], [half_widths[k] for k in first])
    return packed, np.array(given, dtype=np.int64)


def pack(networks: Sequence[RoadNetwork], half_widths: Sequence[float]) -> RoadTable:
    """Return the table of some networks with the half widths (2w, metres) of their roads.

    Raises
    ------
    InputError
        If there is no network, or not one half width for each.
    """
    if not networks or len(networks) != len(half_widths):
        expected = "one half width for each of at least one network"
        raise InputError("can't pack networks", value=(len(networks), len(half_widths)), expected=expected)
    tables = [network.table(width) for network, width in zip(networks, half_widths, strict=True)]
    if len(tables) == 1:
        return tables[0]
    plain = {
        name: np.concatenate([getattr(own, name) for own in tables])
        for name in RoadTable.field_names
        if name not in _NUMBERED
    }
    return RoadTable(
        **plain,
        seg_off=_offsets([len(own.segment) for own in tables]),
        vert_off=_offsets([len(own.vertex) for own in tables]),
        segment=_joined_segments(tables),
        piece=join([own.piece for own in tables]),
        vertex=join([own.vertex for own in tables]),
        grid=_grids([own.grid for own in tables]),
        seg_start=_starts([own.seg_start for own in tables]),
        vert_start=_starts([own.vert_start for own in tables]),
    )


def _joined_segments(tables: Sequence[RoadTable]) -> Rows[Segment]:
    """Return the segments of several networks one after another, their pieces numbered so, too."""
    rows = join([own.segment for own in tables])
    before = _offsets([len(own.piece) for own in tables])[:-1]
    shift = np.repeat(before, [len(own.segment) for own in tables])
    bent = rows["piece"] >= 0
    rows["piece"] += np.where(bent, shift, 0)
    rows["last"] += np.where(bent, shift, 0)
    return rows


def _grids(grids: Sequence[Rows[CellGrid]]) -> Rows[CellGrid]:
    """Return the cells of several networks, numbered one after another."""
    rows = join(grids)
    rows["first"] = _offsets(rows["nx"] * rows["ny"])[:-1]
    rows["pave_first"] = _offsets(rows["pave_nx"] * rows["pave_ny"])[:-1]
    return rows


def _offsets(counts: Sequence[int] | Ints) -> Ints:
    return np.concatenate([[0], np.cumsum(counts)]).astype(np.int64)


def _starts(starts: Sequence[npt.NDArray[np.int64]]) -> Ints:
    shift = _offsets([int(start[-1]) for start in starts])
    rows = [start[:-1] + shift[k] for k, start in enumerate(starts)]
    return np.concatenate([*rows, shift[-1:]]).astype(np.int64)
