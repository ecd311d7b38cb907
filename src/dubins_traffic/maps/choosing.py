"""Which roads of a map are to be held: those with one lane in each direction, and what joins them together."""

from __future__ import annotations

from collections.abc import Callable, Collection, Sequence
from heapq import heappop, heappush

from dubins_traffic.maps.junctions import Union
from dubins_traffic.maps.model import Road

TWO_WAY, ONE_WAY, CLOSED = 1.0, 2.0, 4.0
"""What a metre of a road costs that joins others, by its kind."""
WORTH = 2.0
"""Roads that join a group to others may cost this much for a metre of the group."""


class Chooser:
    """Chooses the roads of one map that are to be held, again and again as more of them are dropped.

    They are plain roads. Where a map has none, two-way roads are taken for these; where it has none of those either,
    all roads for cars, or all.
    """

    def __init__(self, roads: Sequence[Road]) -> None:
        self._roads = roads
        self._lengths = [road.length for road in roads]
        kinds: tuple[Callable[[Road], bool], ...] = (
            lambda road: road.is_plain,
            lambda road: bool(road.forward and road.backward and not road.closed),
            lambda road: not road.closed,
            lambda _: True,
        )
        of_kinds = ([k for k, road in enumerate(roads) if kind(road)] for kind in kinds)
        base = next(numbers for numbers in of_kinds if numbers)
        self._others = sorted(set(range(len(roads))) - set(base))
        self._groups: dict[int, list[int]] = {}
        self._group_of: dict[int, int] = {}
        self._weights: dict[int, float] = {}
        self._group(base)

    def chosen(self) -> list[int]:
        """Return the numbers of connected roads: the largest group of plain roads, and those that others join to it."""
        if not self._groups:
            return []
        first = max(self._groups, key=lambda g: (self._weights[g], -g))
        held = self._groups[first]
        if not self._others:
            return held
        groups = [self._groups[g] for g in sorted(self._groups) if g != first]
        return sorted({*held, *_Joining(self._roads, self._lengths, self._others, groups).to(held)})

    def drop(self, numbers: Collection[int]) -> None:
        """Leave roads out from now on; what is left of their groups may fall apart."""
        self._others = [k for k in self._others if k not in numbers]
        for g in {self._group_of[k] for k in numbers if k in self._group_of}:
            del self._weights[g]
            self._group([k for k in self._groups.pop(g) if k not in numbers])

    def _group(self, numbers: list[int]) -> None:
        """Note the connected groups of some roads, each under its least number."""
        for group in _groups(self._roads, numbers):
            self._groups[group[0]] = group
            self._weights[group[0]] = sum(self._lengths[k] for k in group)
            self._group_of |= dict.fromkeys(group, group[0])


def _groups(roads: Sequence[Road], numbers: list[int]) -> list[list[int]]:
    """Return the connected groups of roads."""
    union = Union[str]()
    for k in numbers:
        union.join((roads[k].first, roads[k].last))
    groups: dict[str, list[int]] = {}
    for k in numbers:
        groups.setdefault(union.root(roads[k].first), []).append(k)
    return list(groups.values())


class _Joining:
    """Finds the groups that are worth being joined to the roads that are held, the cheapest first (Dijkstra).

    What is known about costs is kept from one group to the next: junctions that become held cost nothing from then on.
    """

    def __init__(
        self, roads: Sequence[Road], lengths: Sequence[float], others: list[int], groups: list[list[int]]
    ) -> None:
        self._roads = roads
        self._lengths = lengths
        self._groups = groups
        self._worth = [WORTH * sum(lengths[k] for k in group) for group in groups]
        self._owner = {end: g for g, group in enumerate(groups) for end in self._ends(group)}
        self._links: dict[str, list[tuple[int, str]]] = {}
        for k in others:
            self._links.setdefault(roads[k].first, []).append((k, roads[k].last))
            self._links.setdefault(roads[k].last, []).append((k, roads[k].first))
        self._waiting: list[tuple[float, str]] = []
        self._cost: dict[str, float] = {}
        self._came: dict[str, tuple[int, str]] = {}

    def to(self, held: list[int]) -> list[int]:
        """Return the roads of the groups that are worth it, and those that join them to `held`."""
        path: list[int] = []
        self._hold(held)
        while (name := self._next()) is not None:
            group = self._groups[self._owner[name]]
            for end in self._ends(group):
                del self._owner[end]
            new = [*self._way(name), *group]
            self._hold(new)
            path += new
        return path

    def _ends(self, numbers: list[int]) -> set[str]:
        return {end for k in numbers for end in (self._roads[k].first, self._roads[k].last)}

    def _hold(self, numbers: list[int]) -> None:
        """Let roads be held: what ends at theirs costs nothing."""
        for name in self._ends(numbers):
            self._came.pop(name, None)
            self._cost[name] = 0.0
            heappush(self._waiting, (0.0, name))

    def _next(self) -> str | None:
        """Return a junction of the cheapest group that is worth it, None if there is none."""
        while self._waiting:
            far, name = heappop(self._waiting)
            if far > self._cost[name]:
                continue
            group = self._owner.get(name)
            if group is not None and far <= self._worth[group]:
                return name
            for k, to in self._links.get(name, []):
                new = far + self._lengths[k] * _price(self._roads[k])
                if new < self._cost.get(to, float("inf")):
                    self._cost[to] = new
                    self._came[to] = (k, name)
                    heappush(self._waiting, (new, to))
        return None

    def _way(self, name: str) -> list[int]:
        """Return the roads by which the search came to a junction."""
        path: list[int] = []
        while name in self._came:
            k, name = self._came[name]
            path.append(k)
        return path


def _price(road: Road) -> float:
    if road.closed:
        return CLOSED
    return TWO_WAY if road.forward and road.backward else ONE_WAY
