"""Who touches whom, and the room in which `cars.motion` works."""

from __future__ import annotations

import numpy as np

from dubins_traffic.cars.near import Search, search_room, widened
from dubins_traffic.cars.state import State
from dubins_traffic.cars.tables import CarTable, ObstacleTable, box_at, box_of
from dubins_traffic.kernels.arrays import Floats, Ints
from dubins_traffic.kernels.boxes import NEVER, separation
from dubins_traffic.kernels.compile import jit
from dubins_traffic.kernels.records import Rows, record, table
from dubins_traffic.kernels.tables import Tables

PARTED = 0.01
"""Two bodies that touched count as touching until they are this far apart, metres."""
PARTNERS = 12
VACANT = -(2**62)


@record
class Meeting:
    """A contact: of trial `b`, a car and another or obstacle -1 - k, `time` seconds after the tick's beginning.

    Its point (`px`, `py`), m, and normal (`nx`, `ny`), a unit vector from `car` to `other`; the speeds at which the two
    bodies close there, m/s; and whether each had moved in the tick, 0 or 1.
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

    `partner` (B, N, PARTNERS): whom a car touches since their contact, VACANT where nobody; held by the lower
    index, obstacle k as -1 - k. `touching` (B,): number of such pairs. `search`: candidate pairs of one trial (P,);
    `when` (P,): their instants of contact. `until` (N,): when each car was fixed. `contact` (C,). `found` (1,): number
    of contacts.
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
    """Return a workspace for a batch of `trials` x `cars`."""
    pairs = max(64, 8 * cars)
    return Workspace(
        partner=np.full((trials, cars, PARTNERS), VACANT, dtype=np.int64),
        touching=np.zeros(trials, dtype=np.int64),
        search=search_room(cars, pairs),
        when=np.zeros(pairs),
        until=np.zeros(cars),
        contact=table(Meeting, max(1024, 2 * cars)),
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
    search = widened(work.search)
    return work.replace(search=search, when=np.zeros(len(search.pair)))
