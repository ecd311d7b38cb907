"""Rounds: closed routes along lanes through all goals, and ways to join them.

A route is a sequence of lanes, each a successor of the one before (`RoadNetwork.successors`: turning round only at
a dead end). It is as long as its lanes together, plus what its turns cost.
"""

from __future__ import annotations

import heapq
from collections import Counter
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import chain, pairwise
from math import inf
from typing import TYPE_CHECKING, TypeVar

import numpy as np

from dubins_traffic.kernels.arrays import Floats, Ints
from dubins_traffic.kernels.calls import bound
from dubins_traffic.routing.round_search import LaneTables, joined, metres_into, room, shortest_round

if TYPE_CHECKING:
    from dubins_traffic.roads.network import RoadNetwork

EXACT = 7
"""Up to this many goals the shortest round is found; of more goals the nearest is taken next."""

TOGETHER = 16
"""So many rounds are found on graphs that are made one: on each, the search looks at the lanes of all."""

MOST_KEPT, FEWEST_KEPT = 1 << 19, 8
"""About how many numbers are cached of the rounds found on a network, and the least number of rounds."""

TurnCost = Callable[[int, int], float]
T = TypeVar("T")


@dataclass(frozen=True, slots=True)
class Round:
    """A closed route: `lanes` in order, the first following the last; `arrivals` are the places in `lanes` of the
    lanes that end in a goal as it is reached, `length` is in metres.
    """

    lanes: tuple[int, ...]
    arrivals: tuple[int, ...]
    length: float


class LaneGraph:
    """The lanes of a network with their lengths, successors and costs of turning, metres.

    `turn_cost` (from lane, to lane) is asked once for each pair; without it turning is free.
    """

    def __init__(self, network: RoadNetwork, turn_cost: TurnCost | None = None) -> None:
        count, end = network.lanes, network.ends[:, ::-1].ravel()
        follows = [network.successors(lane) for lane in range(count)]
        length = np.repeat(network.lengths, 2)
        lane = np.repeat(np.arange(count), [len(lanes) for lanes in follows])
        other = np.fromiter(chain.from_iterable(follows), dtype=np.int64)
        turn: Floats | float = 0.0
        if turn_cost is not None:
            turn = np.array([turn_cost(*step) for step in zip(lane.tolist(), other.tolist(), strict=True)])
        cost = np.maximum(0.0, length[other] + turn)
        back, into = np.argsort(other, kind="stable"), np.argsort(end, kind="stable")
        self.tables = LaneTables(
            *(_offsets(lane, count), other, cost),
            *(_offsets(other, count), lane[back], cost[back]),
            *(_offsets(end, len(network.intersections)), into),
        )
        self.count = count
        self.length: tuple[float, ...] = tuple(length.tolist())
        self.end: tuple[int, ...] = tuple(end.tolist())
        self.rounds: dict[tuple[int, ...], Round | None] = {}
        self.stages: dict[Round, tuple[Ints, Floats]] = {}

    @cached_property
    def into(self) -> list[list[int]]:
        """The lanes that end in each intersection."""
        return _parts(self.tables.into.tolist(), self.tables.into_off)

    @cached_property
    def after(self) -> list[list[tuple[int, float]]]:
        """The lanes that may follow each lane, with what the step costs."""
        tables = self.tables
        return _parts(list(zip(tables.after.tolist(), tables.after_cost.tolist(), strict=True)), tables.after_off)

    @cached_property
    def before(self) -> list[list[tuple[int, float]]]:
        """The lanes that each lane may follow, with what the step costs."""
        tables = self.tables
        return _parts(list(zip(tables.before.tolist(), tables.before_cost.tolist(), strict=True)), tables.before_off)

    def metres_into(self, intersections: Iterable[int]) -> list[Floats]:
        """Return the metres from the end of each lane to each of some intersections, (L,); inf: there is no way."""
        far, work = np.empty(self.count), np.empty((2, self.count), dtype=np.int64)
        queue, waits = work
        find, rows = bound(metres_into), list[Floats]()
        for v in intersections:
            rows.append(np.empty(self.count))
            find(v, self.tables, rows[-1], far, queue, waits)
        return rows

    def distances(self, target: int, penalty: TurnCost | None = None) -> list[float]:
        """Return metres from the end of each lane to the end of the lane `target`, driving on from there."""
        metres = [inf] * self.count
        metres[target] = 0.0
        heap = [(0.0, target)]
        while heap:
            far, lane = heapq.heappop(heap)
            if far > metres[lane]:
                continue
            for other, cost in self.before[lane]:
                total = far + cost + (penalty(other, lane) if penalty is not None else 0.0)
                if total < metres[other]:
                    metres[other] = total
                    heapq.heappush(heap, (total, other))
        return metres

    def step(self, lane: int, distances: Sequence[float], penalty: TurnCost | None = None) -> tuple[int, float]:
        """Return the next lane toward the target of `distances`, and metres to it by way of that lane (or -1, inf).

        At the target itself this begins another way round to it.
        """
        best, least = -1, inf
        for other, cost in self.after[lane]:
            total = cost + distances[other] + (penalty(lane, other) if penalty is not None else 0.0)
            if total < least:
                best, least = other, total
        return best, least

    def route(self, lane: int, target: int, distances: Sequence[float], penalty: TurnCost | None = None) -> list[int]:
        """Return the lanes after `lane` up to `target`: at least one, so from `target` itself once round."""
        lanes: list[int] = []
        while lane >= 0 and (lane != target or not lanes):
            lane = self.step(lane, distances, penalty)[0]
            if lane >= 0:
                lanes.append(lane)
        return lanes


def lane_graph(network: RoadNetwork) -> LaneGraph:
    """Return the graph of a network's lanes in which turning is free; made once for each network."""
    graph = network.known.get(LaneGraph)
    if not isinstance(graph, LaneGraph):
        graph = network.known[LaneGraph] = LaneGraph(network)
    return graph


def _offsets(owner: Ints, count: int) -> Ints:
    off = np.zeros(count + 1, dtype=np.int64)
    np.cumsum(np.bincount(owner, minlength=count), out=off[1:])
    return off


def _parts(flat: list[T], off: Ints) -> list[list[T]]:
    return [flat[begin:end] for begin, end in pairwise(off.tolist())]


def find_round(graph: LaneGraph, goals: Sequence[int]) -> Round | None:
    """Return a short round through the intersections `goals` (numbers; duplicates count once).

    Up to `EXACT` goals it is the shortest there is: for every cyclic order of the goals and every choice of the
    lane by which each is reached. With more goals, each time the nearest one not yet visited is taken. None without
    goals or if no round reaches them all.
    """
    distinct = tuple(dict.fromkeys(goals))
    if not distinct:
        return None
    if distinct not in graph.rounds:
        find_rounds([(graph, distinct)])
    return graph.rounds[distinct]


def find_rounds(many: Iterable[tuple[LaneGraph, Sequence[int]]]) -> None:
    """Find the rounds through many lists of goals, in less time than one after another, for `find_round`."""
    wanted: dict[int, dict[tuple[LaneGraph, tuple[int, ...]], None]] = {}
    for graph, goals in many:
        distinct = tuple(dict.fromkeys(goals))
        if distinct and distinct not in graph.rounds:
            wanted.setdefault(len(distinct), {})[graph, distinct] = None
    for graph, count in Counter([graph for group in wanted.values() for graph, _ in group]).items():
        if len(graph.rounds) + count > max(FEWEST_KEPT, MOST_KEPT // graph.count):
            graph.rounds.clear()
            graph.stages.clear()
    for number, group in wanted.items():
        pairs = list(group)
        if number <= EXACT:
            for k in range(0, len(pairs), TOGETHER):
                _find_shortest(number, pairs[k : k + TOGETHER])
        else:
            for graph, goals in pairs:
                graph.rounds[goals] = _nearest_first(graph, goals)


def free_round(graph: LaneGraph, goals: Sequence[int]) -> Round | None:
    """Return the round through `goals` in free flow; with a single goal, to the nearest other intersection and back.

    Only another disc makes the next visit of a goal one (docs/rules.md#visit), and turning round in a disc is free.
    Through several goals it is what `find_round` finds.
    """
    distinct = tuple(dict.fromkeys(goals))
    if len(distinct) != 1:
        return find_round(graph, goals)
    back = min(graph.into[distinct[0]], key=lambda lane: (graph.length[lane], lane), default=-1)
    return None if back < 0 else Round((back ^ 1, back), (1,), 2.0 * graph.length[back])


def _find_shortest(number: int, wanted: Sequence[tuple[LaneGraph, tuple[int, ...]]]) -> None:
    """Find the shortest round through each of some lists of so many goals, and the ways to them."""
    graphs = dict.fromkeys([graph for graph, _ in wanted])
    whole, lanes, places = joined([graph.tables for graph in graphs])
    first = dict(zip(graphs, zip(lanes, places, strict=True), strict=False))
    search_room, sought, search = room(number, lanes[-1]), np.zeros(number, dtype=np.int64), bound(shortest_round)
    far = search_room.far.reshape(-1, lanes[-1])
    for graph, goals in wanted:
        lane, place = first[graph]
        sought[:] = goals
        sought += place
        count, length = search(sought, whole, search_room)
        if not count:
            graph.rounds[goals] = None
            continue
        tour = Round(tuple((search_room.lane[:count] - lane).tolist()), tuple(search_room.arrival.tolist()), length)
        distance = far[search_room.row, lane : lane + graph.count] + np.array(graph.length)
        graph.rounds[goals] = tour
        graph.stages[tour] = np.array(goals, dtype=np.int64)[search_room.row // search_room.far.shape[1]], distance


def _nearest_first(graph: LaneGraph, goals: tuple[int, ...]) -> Round | None:
    first = graph.into[goals[0]][0]
    lanes: list[int] = []
    arrivals: list[int] = []
    length, lane = 0.0, first
    missing = set(goals[1:])
    while missing:
        leg, far = _search(graph, lane, lambda other: graph.end[other] in missing)
        if not leg:
            return None
        lanes += leg
        length += far
        lane = leg[-1]
        arrivals.append(len(lanes) - 1)
        missing.discard(graph.end[lane])
    leg, far = _search(graph, lane, lambda other: other == first)
    lanes += leg
    arrivals.append(len(lanes) - 1)
    return Round(tuple(lanes), tuple(arrivals), length + far) if leg else None


def _search(graph: LaneGraph, lane: int, wanted: Callable[[int], bool]) -> tuple[list[int], float]:
    """Return the shortest route from the end of `lane` to the end of a wanted lane, and its metres."""
    metres: dict[int, float] = {}
    came: dict[int, int] = {}
    heap = [(cost, other, -1) for other, cost in graph.after[lane]]
    heapq.heapify(heap)
    while heap:
        far, at, source = heapq.heappop(heap)
        if at in metres:
            continue
        metres[at] = far
        came[at] = source
        if wanted(at):
            leg = [at]
            while came[leg[-1]] >= 0:
                leg.append(came[leg[-1]])
            return leg[::-1], far
        for other, cost in graph.after[at]:
            if other not in metres:
                heapq.heappush(heap, (far + cost, other, at))
    return [], inf
