"""Finds the shortest round through some goals, over all cyclic orders and all lanes into each goal (compiled)."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import accumulate, repeat
from typing import Any

import numpy as np

from dubins_traffic.kernels.arrays import INFINITE, Floats, Ints
from dubins_traffic.kernels.compile import jit
from dubins_traffic.kernels.tables import Tables

ARMS = 4
"""Most lanes that end in one intersection."""


class LaneTables(Tables):
    """The graph of lanes as arrays.

    What may follow lane a are ``after[after_off[a]]`` to ``after[after_off[a + 1] - 1]``, each with the metres
    `after_cost` that it takes; in the same way `before`, `before_cost`: what a lane may follow. `into`, by `into_off`:
    the lanes that end in an intersection.
    """

    after_off: Ints
    after: Ints
    after_cost: Floats
    before_off: Ints
    before: Ints
    before_cost: Floats
    into_off: Ints
    into: Ints


class Search(Tables):
    """Scratch of the search for rounds through n goals on L lanes.

    `far` (n, 4, L): metres from the end of each lane to the end of each lane into a goal; `leg` (n, n, 4, 4): metres
    from the lanes into one goal to those into another; `total`, `other` (4, 4) and `to_go` (n + 1, 4): what is reckoned
    with; `order`, `best` (n,): orders of the goals; `queue`, `waits` (L,); and what is found: `lane` (n L,), `arrival`
    (n,), and `row` (n,): the rows of `far`, taken as (4n, L), of the lanes that arrive.
    """

    far: Floats
    leg: Floats
    total: Floats
    other: Floats
    to_go: Floats
    order: Ints
    best: Ints
    queue: Ints
    waits: Ints
    lane: Ints
    arrival: Ints
    row: Ints


def joined(graphs: Sequence[LaneTables]) -> tuple[LaneTables, list[int], list[int]]:
    """Return several graphs as one, and the numbers in it of the first lane and the first intersection of each."""
    if len(graphs) == 1:
        return graphs[0], [0, len(graphs[0].into)], [0, len(graphs[0].into_off) - 1]
    lanes, places, steps = (
        [0, *accumulate(len(array) for array in arrays)]
        for arrays in zip(*((graph.into, graph.into_off[1:], graph.after) for graph in graphs), strict=True)
    )
    by = {
        "after_off": steps,
        "before_off": steps,
        "after": lanes,
        "before": lanes,
        "into_off": lanes,
        "into": lanes,
    }
    columns: dict[str, Any] = {}
    for name in LaneTables.field_names:
        parts = [getattr(graph, name) + first for graph, first in zip(graphs, by.get(name, repeat(0)), strict=False)]
        if name.endswith("_off"):
            parts[:-1] = [part[:-1] for part in parts[:-1]]
        columns[name] = np.concatenate(parts)
    return LaneTables(**columns), lanes, places


def room(goals: int, lanes: int) -> Search:
    """Return the scratch of a search."""
    return Search(
        far=np.zeros((goals, ARMS, lanes)),
        leg=np.full((goals, goals, ARMS, ARMS), np.inf),
        total=np.zeros((ARMS, ARMS)),
        other=np.zeros((ARMS, ARMS)),
        to_go=np.zeros((goals + 1, ARMS)),
        order=np.zeros(goals, dtype=np.int64),
        best=np.zeros(goals, dtype=np.int64),
        queue=np.zeros(lanes, dtype=np.int64),
        waits=np.zeros(lanes, dtype=np.int64),
        lane=np.zeros(goals * lanes, dtype=np.int64),
        arrival=np.zeros(goals, dtype=np.int64),
        row=np.zeros(goals, dtype=np.int64),
    )


@jit
def metres_to(target: Any, g: LaneTables, far: Floats, queue: Ints, waits: Ints) -> None:
    """Write the metres from the end of each lane to the end of `target` (a lane) into `far` (L,).

    `queue` (L,) and `waits` (L,) are scratch.
    """
    lanes = far.shape[0]
    for lane in range(lanes):
        far[lane] = INFINITE
        waits[lane] = 0
    far[target] = 0.0
    queue[0] = target
    first = 0
    count = 1
    while count > 0:
        lane = queue[first]
        first = first + 1 if first + 1 < lanes else 0
        count -= 1
        waits[lane] = 0
        for k in range(g.before_off[lane], g.before_off[lane + 1]):
            total = far[lane] + g.before_cost[k]
            other = g.before[k]
            if total < far[other]:
                far[other] = total
                if waits[other] == 0:
                    waits[other] = 1
                    place = first + count
                    queue[place if place < lanes else place - lanes] = other
                    count += 1


@jit
def metres_into(v: int, g: LaneTables, least: Floats, far: Floats, queue: Ints, waits: Ints) -> None:
    """Write the metres from the end of each lane to the intersection `v` (index) into `least` (L,); inf: no way.

    `far` (L,), `queue` (L,) and `waits` (L,) are scratch.
    """
    for lane in range(least.shape[0]):
        least[lane] = INFINITE
    for k in range(g.into_off[v], g.into_off[v + 1]):
        metres_to(g.into[k], g, far, queue, waits)
        for lane in range(least.shape[0]):
            least[lane] = min(least[lane], far[lane])


@jit
def shortest_round(goals: Ints, g: LaneTables, search: Search) -> tuple[int, float]:
    """Find the shortest round through the distinct intersections of `goals` (G,).

    Its lanes are in `search.lane`, the places in it of those that end in a goal as it is reached in `search.arrival`,
    and the rows of `search.far` with the ways to them in `search.row`.

    Returns
    -------
    lanes, metres
        How many lanes it has, 0 if there is no round, and how long it is.
    """
    count = goals.shape[0]
    _fill_legs(goals, g, search)
    for k in range(count):
        search.order[k] = k
    least = INFINITE
    more = True
    while more:
        arms = _chain(goals, g, search, search.order)
        for i in range(arms):
            if search.total[i, i] < least:
                least = search.total[i, i]
                for k in range(count):
                    search.best[k] = search.order[k]
        more = _next_order(search.order)
    if least == INFINITE:
        return 0, least
    return _trace(goals, g, search), least


@jit
def _arms(goals: Ints, g: LaneTables, k: Any) -> Any:
    return g.into_off[goals[k] + 1] - g.into_off[goals[k]]


@jit
def _fill_legs(goals: Ints, g: LaneTables, search: Search) -> None:
    count = goals.shape[0]
    for b in range(count):
        for j in range(_arms(goals, g, b)):
            far = search.far[b, j]
            metres_to(g.into[g.into_off[goals[b]] + j], g, far, search.queue, search.waits)
            for a in range(count):
                if a == b and count > 1:
                    continue
                for i in range(_arms(goals, g, a)):
                    _, search.leg[a, b, i, j] = _step(g.into[g.into_off[goals[a]] + i], g, far)


@jit
def _step(lane: Any, g: LaneTables, far: Floats) -> tuple[Any, Any]:
    """Return the next lane toward the target of `far`, and the metres to it by way of that lane (or -1, inf)."""
    best = -1
    least = INFINITE
    for k in range(g.after_off[lane], g.after_off[lane + 1]):
        total = g.after_cost[k] + far[g.after[k]]
        if total < least:
            best = g.after[k]
            least = total
    return best, least


@jit
def _chain(goals: Ints, g: LaneTables, search: Search, order: Ints) -> Any:
    """Write the metres once round, in an order, from each lane into its first goal to each into `search.total`."""
    count = goals.shape[0]
    head = _arms(goals, g, order[0])
    for i in range(head):
        for j in range(_arms(goals, g, order[1 % count])):
            search.total[i, j] = search.leg[order[0], order[1 % count], i, j]
    for k in range(1, count):
        a = order[k]
        b = order[(k + 1) % count]
        for i in range(head):
            for j in range(_arms(goals, g, b)):
                least = INFINITE
                for m in range(_arms(goals, g, a)):
                    least = min(least, search.total[i, m] + search.leg[a, b, m, j])
                search.other[i, j] = least
        for i in range(head):
            for j in range(_arms(goals, g, b)):
                search.total[i, j] = search.other[i, j]
    return head


@jit
def _next_order(order: Ints) -> bool:
    """Write the next order that begins with the same goal; return False after the last."""
    k = order.shape[0] - 2
    while k >= 1 and order[k] > order[k + 1]:
        k -= 1
    if k < 1:
        return False
    other = order.shape[0] - 1
    while order[other] < order[k]:
        other -= 1
    order[k], order[other] = order[other], order[k]
    low = k + 1
    high = order.shape[0] - 1
    while low < high:
        order[low], order[high] = order[high], order[low]
        low += 1
        high -= 1
    return True


@jit
def _trace(goals: Ints, g: LaneTables, search: Search) -> int:
    """Write the lanes of the best round of the best order, from its first goal to itself; return their number."""
    count = goals.shape[0]
    arms = _chain(goals, g, search, search.best)
    start = 0
    for i in range(arms):
        if search.total[i, i] < search.total[start, start]:
            start = i
    for i in range(arms):
        search.to_go[count, i] = 0.0 if i == start else INFINITE
    for k in range(count - 1, -1, -1):
        a = search.best[k]
        b = search.best[(k + 1) % count]
        for i in range(_arms(goals, g, a)):
            least = INFINITE
            for j in range(_arms(goals, g, b)):
                least = min(least, search.leg[a, b, i, j] + search.to_go[k + 1, j])
            search.to_go[k, i] = least
    done = 0
    at = start
    for k in range(count):
        a = search.best[k]
        b = search.best[(k + 1) % count]
        following = 0
        least = INFINITE
        for j in range(_arms(goals, g, b)):
            far = search.leg[a, b, at, j] + search.to_go[k + 1, j]
            if far < least:
                following = j
                least = far
        lane = g.into[g.into_off[goals[a]] + at]
        target = g.into[g.into_off[goals[b]] + following]
        begin = done
        while done == begin or lane != target:
            lane, _ = _step(lane, g, search.far[b, following])
            search.lane[done] = lane
            done += 1
        search.arrival[k] = done - 1
        search.row[k] = search.far.shape[1] * b + following
        at = following
    return done
