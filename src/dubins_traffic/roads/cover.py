"""Which uniform cells segments touch, and which items share one, in NumPy."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Final, cast

import numpy as np

from dubins_traffic.kernels.arrays import Floats, Ints

PAIRS_AT_ONCE: Final = 1 << 21


def covered(start: Floats, end: Floats, pad: float, size: float) -> tuple[Ints, Ints, Ints]:
    """Return the cells that segments touch when grown by `pad`: a superset, as rows (item, column, row).

    Parameters
    ----------
    start, end : array (S, 2)
        Ends of the segments.
    pad : float
        Distance by which they are grown.
    size : float
        Side of a cell; cell (0, 0) begins in the origin.
    """
    rounding = 1e-9 * (size + float(np.abs(start).max(initial=0.0)))
    pad += rounding
    swap = start[:, 0] > end[:, 0]
    low = np.where(swap[:, None], end, start)
    high = np.where(swap[:, None], start, end)
    first = np.floor((low[:, 0] - pad) / size).astype(np.int64)
    last = np.floor((high[:, 0] + pad) / size).astype(np.int64)
    item, column = _spread(first, last)
    run = high[item, 0] - low[item, 0]
    upright = run <= rounding
    slope = np.divide(high[item, 1] - low[item, 1], run, out=np.zeros_like(run), where=~upright)
    left = np.clip(column * size - pad - low[item, 0], 0.0, run)
    right = np.clip((column + 1) * size + pad - low[item, 0], 0.0, run)
    y0 = low[item, 1] + slope * left
    y1 = cast(Floats, np.where(upright, high[item, 1], low[item, 1] + slope * right))
    bottom = np.floor((np.minimum(y0, y1) - pad) / size).astype(np.int64)
    top = np.floor((np.maximum(y0, y1) + pad) / size).astype(np.int64)
    strip, row = _spread(bottom, top)
    return item[strip], column[strip], row


def pairs(item: Ints, column: Ints, row: Ints) -> Iterator[tuple[Ints, Ints]]:
    """Yield the pairs of items that share a cell, in blocks; a pair may come more than once."""
    height = int(row.max(initial=0)) - int(row.min(initial=0)) + 1
    key = (column - column.min(initial=0)) * height + row
    order = np.lexsort((item, key))
    key, item = key[order], item[order]
    count = len(key)
    after = cast(Ints, np.searchsorted(key, key, side="right") - np.arange(count) - 1)
    total = cast(Ints, np.concatenate([[0], np.cumsum(after)]))
    begin = 0
    while begin < count:
        full = int(total[begin]) + PAIRS_AT_ONCE
        stop = int(np.searchsorted(total, full, side="right")) - 1
        stop = min(max(stop, begin + 1), count)
        near = np.repeat(np.arange(begin, stop), after[begin:stop])
        step = np.arange(len(near)) - np.repeat(total[begin:stop] - total[begin], after[begin:stop])
        yield item[near], item[near + 1 + step]
        begin = stop


def _spread(first: Ints, last: Ints) -> tuple[Ints, Ints]:
    """Return (k, value) for every k and every value in first[k]..last[k]."""
    count = last - first + 1
    k = np.repeat(np.arange(len(first)), count)
    begin = np.repeat(np.cumsum(count) - count, count)
    return k, first[k] + np.arange(len(k)) - begin
