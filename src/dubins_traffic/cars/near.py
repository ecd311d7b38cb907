"""Which bodies may meet in a tick: pairs of one trial by distance, through uniform cells when there are many."""

from __future__ import annotations

from math import floor

from dubins_traffic.cars.state import State
from dubins_traffic.cars.tables import ObstacleTable
from dubins_traffic.kernels.arrays import Ints
from dubins_traffic.kernels.compile import jit

FEW = 24
"""Up to this many cars all pairs are looked at, which is faster."""


@jit
def candidates(
    state: State,
    b: int,
    distance: float,
    obstacles: ObstacleTable,
    margin: float,
    pair: Ints,
    head: Ints,
    link: Ints,
    cell: Ints,
) -> int:
    """Write the pairs of trial b that may meet into `pair` (P, 2) and return how many there are.

    Cars i < j whose centres are nearer than `distance`, and (i, -1 - p) for obstacle part p whose reach plus
    `margin` holds the centre of i. If more than P, the surplus is counted but not written.
    """
    if state.count[b] <= FEW:
        found = _all_pairs(state, b, distance, pair)
    else:
        found = _cell_pairs(state, b, distance, pair, head, link, cell)
    first = obstacles.off[b]
    last = obstacles.off[b + 1]
    for p in range(first, last):
        row = obstacles.part[p]
        far = row[7] + margin
        for i in range(state.count[b]):
            dx = state.x[b, i] - row[0]
            dy = state.y[b, i] - row[1]
            if dx * dx + dy * dy < far * far:
                if found < pair.shape[0]:
                    pair[found, 0] = i
                    pair[found, 1] = -1 - p
                found += 1
    return found


@jit
def _all_pairs(state: State, b: int, distance: float, pair: Ints) -> int:
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
    found = 0
    for i in range(n - 1):
        for j in range(i + 1, n):
            dx = x[j] - x[i]
            dy = y[j] - y[i]
            if dx * dx + dy * dy < limit:
                if found < pair.shape[0]:
                    pair[found, 0] = i
                    pair[found, 1] = j
                found += 1
    return found


@jit
def _bucket(kx: int, ky: int, size: int) -> int:
    return (kx * 73856093 ^ ky * 19349663) & (size - 1)


@jit
def _cell_pairs(state: State, b: int, distance: float, pair: Ints, head: Ints, link: Ints, cell: Ints) -> int:
    n = state.count[b]
    size = head.shape[0]
    scale = 1.0 / distance
    for k in range(size):
        head[k] = -1
    found = 0
    limit = distance * distance
    for j in range(n):
        kx = floor(float(state.x[b, j] * scale))
        ky = floor(float(state.y[b, j] * scale))
        for mx in range(kx - 1, kx + 2):
            for my in range(ky - 1, ky + 2):
                i = head[_bucket(mx, my, size)]
                while i >= 0:
                    if cell[i, 0] == mx and cell[i, 1] == my:
                        dx = state.x[b, j] - state.x[b, i]
                        dy = state.y[b, j] - state.y[b, i]
                        if dx * dx + dy * dy < limit:
                            if found < pair.shape[0]:
                                pair[found, 0] = i
                                pair[found, 1] = j
                            found += 1
                    i = link[i]
        cell[j, 0] = kx
        cell[j, 1] = ky
        here = _bucket(kx, ky, size)
        link[j] = head[here]
        head[here] = j
    return found
