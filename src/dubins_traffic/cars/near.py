"""Which bodies may meet in a tick: pairs of one trial by distance, through uniform cells when there are many."""

from __future__ import annotations

from math import floor, sqrt

import numpy as np

from dubins_traffic.cars.state import State
from dubins_traffic.cars.tables import ObstacleTable
from dubins_traffic.kernels.arrays import Floats, Ints
from dubins_traffic.kernels.compile import jit, jit_inline, jit_look, jit_rare
from dubins_traffic.kernels.records import Grid, Rows, record, table
from dubins_traffic.kernels.tables import Tables

FEW = 24
"""Up to this many cars all pairs are compared, which is faster than cells."""
CELL = 4.0
"""Side of the cells in which neighbours are looked for among more cars, metres; larger distances count as this."""
REFRESH_TICKS = 8
"""Ticks after which the distances between cars are measured anew."""
MOST_TICKS = 1e6
"""Largest number of ticks that `ticks_within` returns."""


@record
class Pair:
    """Two bodies that may meet: car `one`, and `other`, a car or obstacle part -1 - p."""

    one: int
    other: int


@record
class Place:
    """The cell (`kx`, `ky`) that holds a car's centre."""

    kx: int
    ky: int


class Search(Tables):
    """Scratch of the search for pairs.

    `pair` (P,): the pairs found. The cars stand in a hash table of cells with H buckets, a power of two: `head` (H,) is
    the first car of each bucket, `link` (N,) the next car in the bucket of each, -1 for none, `cell` (N,) its cell.
    """

    pair: Rows[Pair]
    head: Ints
    link: Ints
    cell: Rows[Place]


def search_tables(cars: int, pairs: int) -> Search:
    """Return the scratch of a search among `cars` cars, with room for `pairs` pairs."""
    buckets = 64
    while buckets < 2 * cars:
        buckets *= 2
    return Search(
        table(Pair, pairs),
        np.zeros(buckets, dtype=np.int64),
        np.zeros(cars, dtype=np.int64),
        table(Place, cars),
    )


def widened_search(search: Search) -> Search:
    """Return scratch with room for four times as many pairs."""
    return search.replace(pair=table(Pair, 4 * len(search.pair)))


class Spacing(Tables):
    """How far apart the cars of a batch were in frame `since` (B,) of each trial.

    `apart` (B, N): lower bound on the distance from each car's centre to any other's, metres; `least` (B,): the least
    of these; `drift` (B,): metres that a car can move in a tick, 0 if unknown. `head` (B, H), `link` (B, N) and `cell`
    (B, N): the cars in a hash table of cells as in `Search`, with H = 0 for up to `FEW` cars or unknown motion; `near`
    (N,): scratch, the cars that `list_near` finds.
    """

    apart: Floats
    least: Floats
    since: Ints
    drift: Floats
    head: Ints
    link: Ints
    cell: Grid[Place]
    near: Ints


def spacing(trials: int, cars: int, drift: Floats) -> Spacing:
    """Return the spacing of `trials` x `cars`, which move up to `drift` (B,) metres a tick, before the first frame."""
    buckets = 0
    if cars > FEW:
        buckets = 1 << (2 * cars - 1).bit_length()
    return Spacing(
        np.zeros((trials, cars)),
        np.zeros(trials),
        np.full(trials, -REFRESH_TICKS, dtype=np.int64),
        drift,
        np.zeros((trials, buckets), dtype=np.int64),
        np.zeros((trials, cars), dtype=np.int64),
        table(Place, (trials, cars)),
        np.zeros(cars, dtype=np.int64),
    )


def unknown_spacing(trials: int, cars: int) -> Spacing:
    """Return the spacing of cars whose motion is unknown: any two may be close."""
    unknown = spacing(trials, cars, np.zeros(trials))
    return unknown.replace(head=np.zeros((trials, 0), dtype=np.int64))


@jit_inline
def spacing_loss(spacing: Spacing, b: int, tick: int) -> float:
    """Return by how much two cars of trial b may have closed in since `apart` was measured, up to `tick`, metres."""
    return 2.0 * (tick - spacing.since[b]) * spacing.drift[b]


@jit_inline
def ticks_within(distance: float, spacing: Spacing, b: int) -> int:
    """Return how many ticks, at least 1, any car of trial b needs to drive `distance` (m); 1 if that is unknown."""
    if distance <= spacing.drift[b] or spacing.drift[b] <= 0.0:
        return 1
    return int(min(distance / spacing.drift[b], MOST_TICKS))


@jit_inline
def refresh_spacing(state: State, b: int, tick: int, spacing: Spacing) -> None:
    """Measure how far apart the cars of trial b are in frame `tick`, if that was `REFRESH_TICKS` ago or more."""
    if not _is_known(b, tick, spacing):
        _measure_spacing(state, b, tick, spacing)


@jit_look
def _is_known(b: int, tick: int, spacing: Spacing) -> bool:
    """Tell whether the spacing of trial b was measured less than `REFRESH_TICKS` ago."""
    return tick - spacing.since[b] < REFRESH_TICKS


@jit_inline
def _distance2(state: State, b: int, i: int, j: int) -> float:
    """Return the squared distance between the centres of two cars, square metres."""
    dx = state.x[b, j] - state.x[b, i]
    dy = state.y[b, j] - state.y[b, i]
    return dx * dx + dy * dy


@jit_inline
def _bucket(kx: int, ky: int, size: int) -> int:
    return (kx * 73856093 ^ ky * 19349663) & (size - 1)


@jit_inline
def _first_in_cell(n: int, kx: int, ky: int, link: Ints, cell: Rows[Place]) -> int:
    """Return the first car of cell (kx, ky) among car n and those after it in its bucket; -1 if there is none."""
    while n >= 0 and not (cell[n].kx == kx and cell[n].ky == ky):
        n = link[n]
    return n


@jit_inline
def _enter_cell(n: int, kx: int, ky: int, head: Ints, link: Ints, cell: Rows[Place]) -> None:
    """Put car n into the bucket of cell (kx, ky)."""
    cell[n].kx = kx
    cell[n].ky = ky
    here = _bucket(kx, ky, head.shape[0])
    link[n] = head[here]
    head[here] = n


@jit
def _measure_spacing(state: State, b: int, tick: int, spacing: Spacing) -> None:
    n = state.count[b]
    apart = spacing.apart[b]
    spacing.since[b] = tick
    for i in range(n):
        apart[i] = CELL * CELL if spacing.head.shape[1] > 0 else 1e300
    if spacing.head.shape[1] > 0:
        _nearest_in_cells(state, b, apart, spacing.head[b], spacing.link[b], spacing.cell[b])
    else:
        for i in range(1, n):
            for j in range(i):
                d2 = _distance2(state, b, i, j)
                apart[i] = min(apart[i], d2)
                apart[j] = min(apart[j], d2)
    least = CELL
    for i in range(n):
        apart[i] = sqrt(apart[i])
        least = min(least, apart[i])
    spacing.least[b] = least


@jit_rare
def _nearest_in_cells(state: State, b: int, apart: Floats, head: Ints, link: Ints, cell: Rows[Place]) -> None:
    """Lower `apart` (N,) to the squared distance to the nearest car in the neighbouring cells; fill the hash table."""
    size = head.shape[0]
    for k in range(size):
        head[k] = -1
    for j in range(state.count[b]):
        kx = floor(float(state.x[b, j] / CELL))
        ky = floor(float(state.y[b, j] / CELL))
        for mx in range(kx - 1, kx + 2):
            for my in range(ky - 1, ky + 2):
                i = _first_in_cell(head[_bucket(mx, my, size)], mx, my, link, cell)
                while i >= 0:
                    d2 = _distance2(state, b, i, j)
                    apart[i] = min(apart[i], d2)
                    apart[j] = min(apart[j], d2)
                    i = _first_in_cell(link[i], mx, my, link, cell)
        _enter_cell(j, kx, ky, head, link, cell)


@jit
def list_near(state: State, b: int, tick: int, x: float, y: float, far: float, spacing: Spacing) -> int:
    """List in `spacing.near` all cars of trial b that may be within `far` (m) of a point; return how many."""
    size = spacing.head.shape[1]
    count = 0
    if size == 0 or far + (tick - spacing.since[b]) * spacing.drift[b] > CELL:
        for n in range(state.count[b]):
            spacing.near[n] = n
        return int(state.count[b])
    kx = floor(float(x / CELL))
    ky = floor(float(y / CELL))
    for mx in range(kx - 1, kx + 2):
        for my in range(ky - 1, ky + 2):
            n = _first_in_cell(spacing.head[b, _bucket(mx, my, size)], mx, my, spacing.link[b], spacing.cell[b])
            while n >= 0:
                spacing.near[count] = n
                count += 1
                n = _first_in_cell(spacing.link[b, n], mx, my, spacing.link[b], spacing.cell[b])
    return count


@jit_rare
def candidates(b: int, distance: float, margin: float, state: State, obstacles: ObstacleTable, search: Search) -> int:
    """List the pairs of trial b that may meet in `Search.pair` and return how many there are.

    They are cars i < j whose centres are nearer than `distance` (m), and (i, -1 - p) for each obstacle part p of which
    the centre of i is nearer than its reach plus `margin` (m). Pairs beyond the length of `Search.pair` are counted but
    not written.
    """
    if state.count[b] <= FEW:
        count = _all_pairs(state, b, distance, search.pair)
    else:
        count = _cell_pairs(state, b, distance, search)
    for p in range(obstacles.off[b], obstacles.off[b + 1]):
        part = obstacles.parts[p]
        far = part.reach + margin
        for i in range(state.count[b]):
            dx = state.x[b, i] - part.x
            dy = state.y[b, i] - part.y
            if dx * dx + dy * dy < far * far:
                _keep_pair(count, i, -1 - p, search.pair)
                count += 1
    return count


@jit_inline
def _keep_pair(place: int, i: int, j: int, pair: Rows[Pair]) -> None:
    """Write pair number `place`, if there is room for it."""
    if place < pair.shape[0]:
        pair[place].one = i
        pair[place].other = j


@jit
def _all_pairs(state: State, b: int, distance: float, pair: Rows[Pair]) -> int:
    n = state.count[b]
    x = state.x[b]
    y = state.y[b]
    limit = distance * distance
    near = 0
    for i in range(n - 1):
        xi = x[i]
        yi = y[i]
        for j in range(i + 1, n):
            dx = x[j] - xi
            dy = y[j] - yi
            near += 1 if dx * dx + dy * dy < limit else 0
    if near == 0:
        return 0
    count = 0
    for i in range(n - 1):
        for j in range(i + 1, n):
            dx = x[j] - x[i]
            dy = y[j] - y[i]
            if dx * dx + dy * dy < limit:
                _keep_pair(count, i, j, pair)
                count += 1
    return count


@jit
def _cell_pairs(state: State, b: int, distance: float, search: Search) -> int:
    head, link, cell = search.head, search.link, search.cell
    n = state.count[b]
    size = head.shape[0]
    scale = 1.0 / distance
    for k in range(size):
        head[k] = -1
    count = 0
    limit = distance * distance
    for j in range(n):
        kx = floor(float(state.x[b, j] * scale))
        ky = floor(float(state.y[b, j] * scale))
        for mx in range(kx - 1, kx + 2):
            for my in range(ky - 1, ky + 2):
                i = _first_in_cell(head[_bucket(mx, my, size)], mx, my, link, cell)
                while i >= 0:
                    if _distance2(state, b, i, j) < limit:
                        _keep_pair(count, i, j, search.pair)
                        count += 1
                    i = _first_in_cell(link[i], mx, my, link, cell)
        _enter_cell(j, kx, ky, head, link, cell)
    return count
