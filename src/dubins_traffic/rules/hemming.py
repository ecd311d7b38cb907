"""Which cars are hemmed in while they overtake: near a car that has moved meanwhile (docs/rules.md#hemmed)."""

from __future__ import annotations

import numpy as np

from dubins_traffic.kernels.compile import jit, jit_rare
from dubins_traffic.rules.propositions import FLAG
from dubins_traffic.rules.tables import LabelTables


@jit_rare
def hem_in(b: int, tick: int, tables: LabelTables) -> None:
    """Flag the cars of trial b that are hemmed in, in a frame in which some car is left; `tables` (LabelTables).

    Norm: docs/rules.md#hemmed.
    """
    labels, row = tables.labels, tables.memory.car[b]
    cars: int = tables.state.count[b]
    for n in range(cars):
        if np.int64(labels.bits[b, n]) & FLAG.STILL == 0:
            row[n].stirred = tick
    for n in range(cars):
        bits = np.int64(labels.bits[b, n])
        if bits & FLAG.LEFT != 0 and bits & FLAG.OVERTAKING != 0 and _is_hemmed(b, n, tables):
            labels.bits[b, n] = bits | FLAG.HEMMED


@jit
def _is_hemmed(b: int, n: int, tables: LabelTables) -> bool:
    """Tell whether near car n there is a car that was not still in some frame since n became left."""
    state, row, rules = tables.state, tables.memory.car[b], tables.rules[b]
    since = row[n].left_since
    for other in range(state.count[b]):
        if other != n and row[other].stirred >= since:
            dx = state.x[b, other] - state.x[b, n]
            dy = state.y[b, other] - state.y[b, n]
            if dx * dx + dy * dy <= rules.hem2:
                return True
    return False
