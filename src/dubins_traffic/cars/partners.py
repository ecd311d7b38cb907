"""Who touches whom, and the room in which `cars.motion` works."""

from __future__ import annotations

import numpy as np

from dubins_traffic.cars.state import State
from dubins_traffic.cars.tables import CarTable, ObstacleTable
from dubins_traffic.kernels.arrays import Floats, Ints
from dubins_traffic.kernels.boxes import NEVER, separation
from dubins_traffic.kernels.compile import jit
from dubins_traffic.kernels.tables import Tables

PARTED = 0.01
"""Two bodies that touched count as touching until they are this far apart, metres."""
PARTNERS = 12
VACANT = -(2**62)
CONTACT_FIELDS = 12


class Workspace(Tables):
    """What `step` needs beside the state, allocated once.

    `partner` (B, N, PARTNERS): whom a car touches since their contact, VACANT where nobody; held by the lower
    index, obstacle k as -1 - k. `touching` (B,): number of such pairs. `pair` (P, 2) and `when` (P,): candidate
    pairs of one trial and their instants of contact. `until` (N,): when each car was fixed. `head`, `link` and
    `cell`: buckets of the neighbour search. `contact` (C, CONTACT_FIELDS): trial, car, other, time in the tick,
    point, normal, closing speeds, moved flags. `found` (1,): number of contacts.
    """

    partner: Ints
    touching: Ints
    pair: Ints
    when: Floats
    until: Floats
    head: Ints
    link: Ints
    cell: Ints
    contact: Floats
    found: Ints


def workspace(trials: int, cars: int) -> Workspace:
    """Return a workspace for a batch of `trials` x `cars`."""
    buckets = 64
    while buckets < 2 * cars:
        buckets *= 2
    pairs = max(64, 8 * cars)
    return Workspace(
        partner=np.full((trials, cars, PARTNERS), VACANT, dtype=np.int64),
        touching=np.zeros(trials, dtype=np.int64),
        pair=np.zeros((pairs, 2), dtype=np.int64),
        when=np.zeros(pairs),
        until=np.zeros(cars),
        head=np.zeros(buckets, dtype=np.int64),
        link=np.zeros(cars, dtype=np.int64),
        cell=np.zeros((cars, 2), dtype=np.int64),
        contact=np.zeros((max(1024, 2 * cars), CONTACT_FIELDS)),
        found=np.zeros(1, dtype=np.int64),
    )


@jit
def part(state: State, cars: CarTable, obstacles: ObstacleTable, work: Workspace, b: int) -> None:
    """Forget the pairs of trial b that are PARTED or more apart."""
    for i in range(state.count[b]):
        for k in range(PARTNERS):
            other = work.partner[b, i, k]
            if other == VACANT:
                continue
            if _gap(state, cars, obstacles, b, i, other) >= PARTED:
                work.partner[b, i, k] = VACANT
                work.touching[b] -= 1


@jit
def _gap(state: State, cars: CarTable, obstacles: ObstacleTable, b: int, i: int, other: int) -> float:
    """Return the gap, metres, between car i and `other`, a car or obstacle -1 - k."""
    a, h, r = cars.half_length[b], cars.half_width[b], cars.rounding[b]
    x, y, c, s = state.x[b, i], state.y[b, i], state.c[b, i], state.s[b, i]
    if other >= 0:
        best, _, _, _, _ = separation(
            x, y, c, s, a, h, r,
            state.x[b, other], state.y[b, other], state.c[b, other], state.s[b, other], a, h, r,
        )  # fmt: skip
        return best
    best = NEVER
    for k in range(obstacles.off[b], obstacles.off[b + 1]):
        if obstacles.owner[k] == -1 - other:
            p = obstacles.part[k]
            distance, _, _, _, _ = separation(x, y, c, s, a, h, r, p[0], p[1], p[2], p[3], p[4], p[5], p[6])
            best = min(best, distance)
    return best
