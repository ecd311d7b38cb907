"""The game of cells once more, as one would write it in a textbook: labelled cars, sets, and the nested fixpoint.

Nothing of `dubins_traffic.synthesis` is used, so that it can be compared with it. A state is (cells, orders, renewed):
the cell of each car, the ego's first; who waits at each crossing, in order; which e-agents have given up their place in
this wait.
A cell is ("node", point), ("node", point, from) for one direction of a bend that is no crossing, or ("lane", from, to).
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import cached_property
from itertools import combinations, permutations, product
from typing import Any

import numpy as np

Point = tuple[int, int]
State = tuple[Any, ...]


@dataclass(frozen=True)
class Reference:
    """A game: roads as pairs of points, goals, number of e-agents, and what is assumed (`synthesis.Assumption`)."""

    roads: tuple[tuple[Point, Point], ...]
    goals: tuple[Point, ...]
    others: int
    order: str = "kept"
    forfeits: str = "never"
    enters: bool = True
    leaves: str = "owed"
    arrives: str = "owed"
    frees: bool = True
    order_degree: int = 1

    @cached_property
    def _neighbours(self) -> dict[Point, list[Point]]:
        ends = [end for road in self.roads for end in (road, road[::-1])]
        return {point: sorted({b for a, b in ends if a == point}) for point, _ in ends}

    @cached_property
    def _nodes(self) -> dict[State, State]:
        """The cell into which each lane leads."""
        found: dict[State, State] = {}
        for before, point in [end for road in self.roads for end in (road, road[::-1])]:
            bend = not self.crossing(point) and len(self._neighbours[point]) == 2
            found["lane", before, point] = ("node", point, before) if bend else ("node", point)
        return found

    @cached_property
    def _exits(self) -> dict[State, list[State]]:
        return {
            node: [
                ("lane", node[1], point) for point in self._neighbours[node[1]] if len(node) == 2 or point != node[2]
            ]
            for node in self._nodes.values()
        }

    def crossing(self, point: Point) -> bool:
        return len(self._neighbours[point]) >= self.order_degree

    def node(self, lane: State) -> State:
        """Return the cell into which a lane leads."""
        return self._nodes[lane]

    def exits(self, node: State) -> list[State]:
        return self._exits[node]

    def cells(self) -> list[State]:
        lanes = [("lane", a, b) for a, b in self.roads] + [("lane", b, a) for a, b in self.roads]
        return lanes + sorted({self.node(lane) for lane in lanes})

    def states(self) -> Iterator[State]:
        for cells in permutations(self.cells(), self.others + 1):
            waiting: dict[Point, list[int]] = {}
            for car, cell in enumerate(cells):
                if cell[0] == "lane" and self.crossing(cell[2]):
                    waiting.setdefault(cell[2], []).append(car)
            for orders in product(*(self._orders(cars) for cars in waiting.values())):
                lined = dict(zip(waiting, orders, strict=True))
                queued = [car for order in orders for car in order if car]
                renewals = queued if self.forfeits == "once" and self.order != "none" else []
                for count in range(len(renewals) + 1):
                    for renewed in combinations(sorted(renewals), count):
                        yield cells, _frozen(lined), renewed

    def _orders(self, cars: list[int]) -> list[tuple[int, ...]]:
        must = [car for car in cars if car == 0 or self.arrives != "never"]
        may = [car for car in cars if car not in must]
        found: list[tuple[int, ...]] = []
        for count in range(len(may) + 1):
            for some in combinations(may, count):
                group = sorted((*must, *some))
                found += permutations(group) if self.order != "none" else [tuple(group)]
        return found

    def first(self, state: State, car: int) -> bool:
        """Say whether a car is in a lane, at its end, and nobody is before it."""
        cells, orders, _ = state
        if cells[car][0] != "lane":
            return False
        point = cells[car][2]
        if not self.crossing(point):
            return True
        order = dict(orders).get(point, ())
        return order[:1] == (car,) if self.order != "none" else car in order

    def clear(self, state: State, car: int) -> bool:
        return self.node(state[0][car]) not in state[0]

    def may_enter(self, state: State, car: int) -> bool:
        if state[0][car][0] != "lane" or not self.clear(state, car):
            return False
        return (car > 0 and self.order != "kept") or self.first(state, car)

    def turns(self, state: State) -> Iterator[State]:
        """Yield what the environment may make of a state; all e-agents move at once."""
        cells, _, _ = state
        options: list[list[tuple[str, State]]] = []
        for car in range(1, self.others + 1):
            own = [("stay", cells[car])]
            if cells[car][0] == "node":
                own += [("go", lane) for lane in self.exits(cells[car])]
            if self.may_enter(state, car):
                own.append(("go", self.node(cells[car])))
            own += [("renew", cells[car])] if self._may_renew(state, car) else []
            options.append(own)
        for chosen in product(*options):
            moved = (cells[0], *(cell for _, cell in chosen))
            if len(set(moved)) == len(moved):
                yield from self._after(state, chosen, moved)

    def _may_renew(self, state: State, car: int) -> bool:
        cells, orders, renewed = state
        if cells[car][0] != "lane" or not self.crossing(cells[car][2]):
            return False
        if car not in dict(orders).get(cells[car][2], ()):
            return True
        may = self.forfeits == "always" or (self.forfeits == "once" and car not in renewed)
        return self.order != "none" and may

    def _after(self, state: State, chosen: Any, moved: State) -> Iterator[State]:
        cells, orders, renewed = state
        lines = {point: list(order) for point, order in orders}
        new: dict[Point, list[int]] = {}
        again = set(renewed)
        for car, (what, cell) in enumerate(chosen, 1):
            if what == "stay":
                continue
            if cells[car][0] == "lane":
                point = cells[car][2]
                if what == "renew" and self.forfeits == "once" and car in lines.get(point, []):
                    again.add(car)
                if car in lines.get(point, []):
                    lines[point].remove(car)
                if what == "renew":
                    new.setdefault(point, []).append(car)
                else:
                    again.discard(car)
            elif self.crossing(cell[2]) and self.arrives != "never":
                new.setdefault(cell[2], []).append(car)
        for arrivals in product(*(permutations(cars) for cars in new.values())):
            lined = {point: list(order) for point, order in lines.items()}
            for point, cars in zip(new, arrivals, strict=True):
                lined.setdefault(point, []).extend(cars)
            yield moved, self._lines(lined), tuple(sorted(again))

    def _lines(self, lined: dict[Point, list[int]]) -> Any:
        return _frozen({p: sorted(o) if self.order == "none" else o for p, o in lined.items()})

    def answers(self, state: State) -> Iterator[State]:
        """Yield what the ego may make of a state."""
        yield state
        cells, orders, renewed = state
        lined = {point: list(order) for point, order in orders}
        own = cells[0]
        if own[0] == "lane":
            if not (self.first(state, 0) and self.clear(state, 0)):
                return
            if 0 in lined.get(own[2], []):
                lined[own[2]].remove(0)
            yield (self.node(own), *cells[1:]), self._lines(lined), renewed
            return
        for lane in self.exits(own):
            if lane not in cells:
                after = {point: list(order) for point, order in lined.items()}
                if self.crossing(lane[2]):
                    after.setdefault(lane[2], []).append(0)
                yield (lane, *cells[1:]), self._lines(after), renewed

    def owed(self, state: State) -> list[bool]:
        """Return what the environment owes: two debts a car, one a goal."""
        cells, _, _ = state
        found: list[bool] = []
        for car in range(1, self.others + 1):
            lane = cells[car][0] == "lane"
            found.append(lane and self.must_enter(state, car))
            found.append(not lane and self.must_leave(state, car))
        return found + [self.frees and self.must_free(state, goal) for goal in self.goals]

    def closed(self, state: State, node: State) -> bool:
        """Say whether every way out of a node is taken, but for one that may be the way back, which is none."""
        exits = self.exits(node)
        spare = 1 if len(exits) > 1 and not self.crossing(node[1]) else 0
        return sum(lane not in state[0] for lane in exits) <= spare

    def met_by_ego(self, state: State, node: State) -> bool:
        """Say whether the ego is at the intersection of a node."""
        own = state[0][0]
        return own[0] == "node" and own[1] == node[1]

    def met_by_others(self, state: State, node: State) -> bool:
        """Say whether an e-agent is in the same bend, on its way in the other direction."""
        return any(cell[:2] == node[:2] and cell != node for cell in state[0][1:])

    def must_enter(self, state: State, car: int) -> bool:
        """E3 at crossings, E5 before bends and dead ends."""
        node = self.node(state[0][car])
        if not (self.first(state, car) and self.clear(state, car)):
            return False
        if self.crossing(node[1]):
            return self.enters
        if self.arrives == "never" or self.met_by_ego(state, node):
            return False
        if self.arrives == "moves_up":
            return not (self.closed(state, node) and state[0][0] in self.exits(node))
        passing = self.leaves == "unmet" and self.met_by_others(state, node)
        return not self.closed(state, node) and not passing

    def must_leave(self, state: State, car: int) -> bool:
        """E4."""
        node = state[0][car]
        if self.leaves == "never" or self.closed(state, node):
            return False
        if len(node) == 3 and self.met_by_ego(state, node):
            return False
        return not (self.leaves == "unmet" and self.met_by_others(state, node))

    def must_free(self, state: State, goal: Point) -> bool:
        """E6."""
        own, *others = state[0]
        nodes = {cell for cell in others if cell[0] == "node" and cell[1] == goal}
        exits = [lane for node in nodes for lane in self.exits(node)]
        near = exits + [("lane", after, before) for _, before, after in exits]
        held_up = all(self.closed(state, node) for node in nodes)
        return bool(nodes) and not (held_up and (own in near or self.met_by_ego(state, ("node", goal))))


def _frozen(lined: dict[Point, Any]) -> Any:
    return tuple(sorted((point, tuple(order)) for point, order in lined.items() if order))


class Arrays:
    """The states and moves of a game, numbered."""

    def __init__(self, game: Reference) -> None:
        self.states = list(game.states())
        number = {state: k for k, state in enumerate(self.states)}
        self.to_at, self.to = _rows([[number[s] for s in game.turns(state)] for state in self.states])
        self.ego_at, self.ego_to = _rows([[number[s] for s in game.answers(state)] for state in self.states])
        self.owed = np.array([game.owed(state) for state in self.states], dtype=bool).T
        self.goals = [self._at(lambda point, goal=goal: point == goal) for goal in dict.fromkeys(game.goals)]
        if len(self.goals) == 1:
            self.goals.append(self._at(lambda point: point != game.goals[0]))

    def _at(self, wanted: Callable[[Point], bool]) -> Any:
        """Return in which states the ego is at an intersection that is wanted."""
        egos = [state[0][0] for state in self.states]
        return np.array([own[0] == "node" and wanted(own[1]) for own in egos])

    def cpre(self, safe: Any) -> Any:
        """Return from where the ego gets into `safe` in one turn of both."""
        ready = np.logical_or.reduceat(safe[self.ego_to], self.ego_at)
        return np.logical_and.reduceat(ready[self.to], self.to_at)

    def winning(self) -> Any:
        """Return where the ego wins: equation 2 of Piterman, Pnueli and Sa'ar (VMCAI 2006), evaluated as it stands."""
        z = np.ones(len(self.states), dtype=bool)
        while True:
            before = z
            for goal in self.goals:
                z = self._towards(goal & self.cpre(z))
            if (z == before).all():
                return z

    def _towards(self, start: Any) -> Any:
        y = np.zeros_like(start)
        while True:
            step = start | self.cpre(y)
            after = step.copy()
            for owed in self.owed:
                x = np.ones_like(start)
                while True:
                    smaller = step | (owed & self.cpre(x))
                    if (smaller == x).all():
                        break
                    x = smaller
                after |= x
            if (after == y).all():
                return y
            y = after


def _rows(rows: list[list[int]]) -> tuple[Any, Any]:
    sizes = [len(row) for row in rows]
    at = np.concatenate([[0], np.cumsum(sizes)[:-1]]).astype(np.int64)
    return at, np.array([entry for row in rows for entry in row], dtype=np.int64)
