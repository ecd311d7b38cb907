"""Uniform cells in which kernels find what is near, however far a network reaches: chains of items, hashed by cell."""

from __future__ import annotations

from dubins_traffic.kernels.compile import jit
from dubins_traffic.kernels.records import Rows, record, table


@record
class Bucket:
    """The items of all cells with one hash."""

    first: int = -1
    """Number of the first item, which names the next; -1 if there is none."""


def buckets(items: int) -> Rows[Bucket]:
    """Return empty buckets for so many items."""
    return table(Bucket, 1 << max(items, 8).bit_length())


@jit
def bucket_of(buckets: Rows[Bucket], column: int, row: int) -> int:
    """Return the number of the bucket that holds what is in a cell, its `column` (number) and `row` (number)."""
    return (column * 73_856_093 ^ row * 19_349_663) & (buckets.shape[0] - 1)


@jit
def empty(buckets: Rows[Bucket]) -> None:
    """Take all items out of the buckets."""
    for k in range(buckets.shape[0]):
        buckets[k].first = -1
