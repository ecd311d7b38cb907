"""Which bodies touch each other, and the workspace of `cars.motion`."""

from __future__ import annotations

import numpy as np

from dubins_traffic.cars.near import Search, search_tables, widened_search
from dubins_traffic.cars.state import State
from dubins_traffic.cars.tables import CarTable, ObstacleTable, box_at, box_of
from dubins_traffic.kernels.arrays import Floats, Ints
from dubins_traffic.kernels.boxes import NEVER, separation
from dubins_traffic.kernels.compile import jit, jit_rare
from dubins_traffic.kernels.records import Rows, record, table
from dubins_traffic.kernels.tables import Tables

PARTED = 0.01
"""Two bodies that touched count as touching until they are this far apart, metres."""
PARTNERS = 12
"""Most bodies that `Workspace.partner` can hold for a car."""
VACANT = -(2**62)
"""In `Workspace.partner`: no body."""


@record
class Meeting:
    """A contact in trial `b`: of `car` with `other`, a car or obstacle -1 - k, `time` seconds into the tick.

    (`px`, `py`) is its point, m, and (`nx`, `ny`) its normal, a unit vector from `car` to `other`. `closing` and
    `other_closing` are the speeds of the two bodies' points there toward each other, m/s; `moved` and `other_moved`
    tell whether each body moved in the tick, 0 or 1.
    """

    b: int
    car: int
    other: int
    time: float
    px: float
    py: float
    nx: float
    ny: float
    closing: float
    other_closing: float
    moved: int
    other_moved: int


class Workspace(Tables):
    """What `step` needs beside the state, allocated once.

    `partner` (B, N, PARTNERS): the bodies that a car has touched and is still close to, in the row of the car with the
    lower index, obstacle k as -1 - k, VACANT for none. `touching` (B,): number of such pairs. `search`: candidate pairs
    of one trial (P,); `when` (P,): their instants of contact, s. `until` (N,): when each car was fixed, s. `contact`
    (C,): the contacts, of which `found` (1,) are filled.
    """

    partner: Ints
    touching: Ints
    search: Search
    when: Floats
    until: Floats
    contact: Rows[Meeting]
    found: Ints

    def meetings(self) -> list[Meeting]:
        """Return the contacts found."""
        return [self.contact[k] for k in range(int(self.found[0]))]


def workspace(trials: int, cars: int) -> Workspace:
    """Return the workspace of a batch of `trials` x `cars`."""
    pairs = max(64, 8 * cars)
    return Workspace(
        partner=np.full((trials, cars, PARTNERS), VACANT, dtype=np.int64),
        touching=np.zeros(trials, dtype=np.int64),
        search=search_tables(cars, pairs),
        when=np.zeros(pairs),
        until=np.zeros(cars),
        contact=table(Meeting, max(1024, 2 * cars)),
        found=np.zeros(1, dtype=np.int64),
    )


@jit_rare
def forget_parted(state: State, cars: CarTable, obstacles: ObstacleTable, work: Workspace, b: int) -> None:
    """Forget the touching pairs of trial b whose bodies are PARTED or more apart by now."""
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
    own = box_at(b, i, state, cars)
    if other >= 0:
        best, _, _, _, _ = separation(own, box_at(b, other, state, cars))
        return best
    best = NEVER
    for k in range(obstacles.off[b], obstacles.off[b + 1]):
        part_k = obstacles.parts[k]
        if part_k.owner == -1 - other:
            distance, _, _, _, _ = separation(own, box_of(part_k))
            best = min(best, distance)
    return best


def enlarged(work: Workspace) -> Workspace:
    """Return the workspace with more room for pairs."""
    search = widened_search(work.search)
    return work.replace(search=search, when=np.zeros(len(search.pair)))
