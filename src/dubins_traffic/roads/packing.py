"""Road networks made into tables for kernels."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from dubins_traffic.kernels.arrays import Ints
from dubins_traffic.kernels.records import Rows, join
from dubins_traffic.roads.cells import with_cells
from dubins_traffic.roads.network import RoadNetwork
from dubins_traffic.roads.table import RoadTable, Segment


def pack_distinct(networks: Sequence[RoadNetwork], half_widths: Sequence[float]) -> tuple[RoadTable, Ints]:
    """Return the table of the distinct pairs of network and half width, and the number of each trial's pair in it."""
    numbered: dict[tuple[int, float], tuple[int, RoadNetwork]] = {}
    given: list[int] = []
    for network, width in zip(networks, half_widths, strict=True):
        number, _ = numbered.setdefault((id(network), width), (len(numbered), network))
        given.append(number)
    packed = pack([network for _, network in numbered.values()], [width for _, width in numbered])
    return packed, np.array(given, dtype=np.int64)


def pack(networks: Sequence[RoadNetwork], half_widths: Sequence[float]) -> RoadTable:
    """Return the table of at least one network, with the half width (2w, metres) of the roads of each."""
    if len(networks) == 1:
        return networks[0].table(half_widths[0])
    return with_cells(_joined([network.rows() for network in networks]), half_widths)


def _joined(tables: Sequence[RoadTable]) -> RoadTable:
    """Return several networks one after another, without widths and cells."""
    plain = {name: np.concatenate([getattr(table, name) for table in tables]) for name in ("ends", "arms", "degree")}
    return tables[0].replace(
        **plain,
        seg_off=_offsets([len(table.segment) for table in tables]),
        vert_off=_offsets([len(table.vertex) for table in tables]),
        segment=_joined_segments(tables),
        piece=join([table.piece for table in tables]),
        vertex=join([table.vertex for table in tables]),
    )


def _joined_segments(tables: Sequence[RoadTable]) -> Rows[Segment]:
    """Return the segments of several networks one after another, their pieces numbered so, too."""
    rows = join([table.segment for table in tables])
    before = _offsets([len(table.piece) for table in tables])[:-1]
    shift = np.repeat(before, [len(table.segment) for table in tables])
    bent = rows["piece"] >= 0
    rows["piece"] += np.where(bent, shift, 0)
    rows["last"] += np.where(bent, shift, 0)
    return rows


def _offsets(counts: Sequence[int] | Ints) -> Ints:
    return np.concatenate([[0], np.cumsum(counts)]).astype(np.int64)
