"""The order of arrival at a crossing as a finite model: the referee's `keep_order`, run in each of its states.

At each of two to four arms a car may stop at any tick, as often as it likes. Who is first at a clear crossing enters at
any tick, or does not and forfeits its place; who is in the crossing leaves it at any tick, or does not. Only
differences of tickets up to the `group_ticks` matter, and times up to `forfeit_ticks`: longer ones are cut, so there
are finitely many states. Where four cars yield to each other the least index decides, so cars have their indices in all
orders.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from itertools import chain, combinations, permutations
from types import SimpleNamespace
from typing import Any, Final, NamedTuple

import numpy as np
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import connected_components

from dubins_traffic.rules import queue
from proofs.claims import RefutedError
from proofs.terms import replaced

GROUP, FORFEIT = 1, 2
"""`group_ticks` and `forfeit_ticks` of the model: with more there are more states, and the same comparisons."""
ARMS: Final = ((1, 0), (0, 1), (-1, 0), (0, -1))
"""Directions of the arms, counter-clockwise."""


class Waiting(NamedTuple):
    """A car that has stopped at an arm, with its ticket, and since when it is first at a clear crossing, -1: not."""

    arm: int
    ticket: int
    first_since: int


class Crossing(NamedTuple):
    """A frame: who waits, in the order of their indices, whether a car is in the crossing, and the tick."""

    waiting: tuple[Waiting, ...]
    taken: bool
    tick: int


def judged(crossing: Crossing) -> tuple[Crossing, list[int]]:
    """Return a frame as `keep_order` leaves it, and the places of those that wait."""
    waiting = crossing.waiting
    rows: Any = [SimpleNamespace(**car._asdict(), forfeits=0, rank=-1, in_group=0) for car in waiting]
    if rows:
        lanes: Any = [car.arm for car in waiting]
        members: Any = list(range(len(rows)))
        terms: Any = SimpleNamespace(net=0, group_ticks=GROUP, forfeit_ticks=FORFEIT)
        roads: Any = None
        line = queue.Queue(rows, lanes, members, len(rows))
        queue.keep_order(roads, terms, line, not crossing.taken, crossing.tick)
    kept = tuple(Waiting(row.arm, row.ticket, row.first_since) for row in rows)
    return crossing._replace(waiting=kept), [row.rank for row in rows]


def cut(crossing: Crossing) -> Crossing:
    """Return the frame with gaps between tickets, and to the present tick, cut at what makes no difference."""
    moved: dict[int, int] = {}
    last = None
    for ticket in sorted({car.ticket for car in crossing.waiting} | {crossing.tick}):
        moved[ticket] = 0 if last is None else moved[last] + min(ticket - last, GROUP + 1)
        last = ticket
    tick = moved[crossing.tick]
    waiting = tuple(
        Waiting(
            car.arm,
            moved[car.ticket],
            -1 if car.first_since < 0 else tick - (crossing.tick - car.first_since),
        )
        for car in crossing.waiting
    )
    return Crossing(waiting, crossing.taken, tick)


def following(crossing: Crossing, ranks: Sequence[int], order: Sequence[int]) -> Iterator[Crossing]:
    """Yield the frames that may come next, not judged yet; `order` has the arms by the indices of their cars."""
    tick = crossing.tick + 1
    goes = [(crossing.waiting, crossing.taken)]
    if crossing.taken:
        goes.append((crossing.waiting, False))
    elif crossing.waiting:
        first = ranks.index(0)
        goes.append((crossing.waiting[:first] + crossing.waiting[first + 1 :], True))
    for waiting, taken in goes:
        free = [arm for arm in order if arm not in {car.arm for car in waiting}]
        for come in chain.from_iterable(combinations(free, count) for count in range(len(free) + 1)):
            cars = (*waiting, *(Waiting(arm, tick, -1) for arm in come))
            yield Crossing(tuple(sorted(cars, key=lambda car: order.index(car.arm))), taken, tick)


def check_order(crossing: Crossing, ranks: Sequence[int]) -> None:
    """Refute a frame in which not just one car is first, or one is before another that had stopped before its group."""
    if sorted(ranks) != list(range(len(ranks))):
        raise RefutedError(f"the places are {list(ranks)}: {crossing}")
    for one, rank in zip(crossing.waiting, ranks, strict=True):
        for other, its in zip(crossing.waiting, ranks, strict=True):
            if other.ticket > one.ticket + GROUP and its < rank:
                raise RefutedError(f"{other} is before {one}, which stopped earlier: {crossing}")


def explored(order: Sequence[int]) -> int:
    """Check the model with cars whose indices are as in `order` (arms); return how many states it has."""
    number: dict[Crossing, int] = {}
    places: list[list[int]] = []
    steps: list[tuple[int, int]] = []
    todo: list[Crossing] = []

    def met(frame: Crossing) -> int:
        after, ranks = judged(frame)
        state = cut(after)
        if state not in number:
            check_order(after, ranks)
            number[state] = len(number)
            places.append(ranks)
            todo.append(state)
        return number[state]

    met(Crossing((), False, 0))
    while todo:
        state = todo.pop()
        here = number[state]
        steps += [(here, met(frame)) for frame in following(state, places[here], order)]
    for arm in order:
        check_waiting(arm, list(number), places, steps)
    return len(number)


def check_waiting(
    arm: int, states: Sequence[Crossing], places: Sequence[Sequence[int]], steps: Sequence[tuple[int, int]]
) -> None:
    """Refute a model in which a car waits at an arm for ever, never first, though the crossing is clear at times."""
    waits = np.array([
        any(car.arm == arm and rank > 0 for car, rank in zip(state.waiting, ranks, strict=True))
        for state, ranks in zip(states, places, strict=True)
    ])  # fmt: skip
    kept = np.array([(a, b) for a, b in steps if waits[a] and waits[b]], dtype=np.int64).reshape(-1, 2)
    size = len(states)
    graph = coo_matrix((np.ones(len(kept)), (kept[:, 0], kept[:, 1])), shape=(size, size))
    _, part = connected_components(graph, connection="strong")
    again = {int(part[a]) for a, b in kept.tolist() if part[a] == part[b]}
    for state, own in zip(states, part.tolist(), strict=True):
        if own in again and not state.taken:
            raise RefutedError(f"a car waits at arm {arm} for ever, and is never first: {state}")


def orders() -> Iterator[tuple[int, ...]]:
    """Yield the arms of crossings by the indices of their cars; of those that are alike but for a turn, one."""
    for count in (2, 3, 4):
        seen: set[tuple[int, ...]] = set()
        for order in permutations(range(len(ARMS)), count):
            turned = {tuple((arm + turn) % len(ARMS) for arm in order) for turn in range(len(ARMS))}
            if not turned & seen:
                seen.add(order)
                yield order


def order_of_arrival() -> int:
    """Prove that just one is first, that nobody comes before an earlier group, and that nobody waits for ever."""
    with replaced(queue, {"lane_end_direction": lambda _roads, _net, lane: ARMS[lane]}):
        return sum(explored(order) for order in orders())
