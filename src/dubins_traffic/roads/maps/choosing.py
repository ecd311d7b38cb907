"""Which roads of a map are to be held: those with one lane in each direction, and what joins them together."""

from __future__ import annotations

from collections.abc import Callable, Collection, Sequence
from heapq import heappop, heappush

from dubins_traffic.roads.maps.model import Road

TWO_WAY, ONE_WAY, CLOSED = 1.0, 2.0, 4.0
"""What a metre of a road costs that joins others, by its kind."""
WORTH = 2.0
"""Roads that join a group to others may cost this much for a metre of the group."""


def chosen(roads: Sequence[Road], dropped: Collection[int]) -> list[int]:
    """Return the numbers of connected roads: the largest group of plain roads, and groups that others join to it.

    Where no road is plain, two-way roads are taken for it, and where there are none, all roads.
    """
    left = [k for k in range(len(roads)) if k not in dropped]
    base = _base(roads, left)
    groups = _groups(roads, base)
    if not groups:
        return []
    weights = [sum(roads[k].length for k in group) for group in groups]
    held = [*groups.pop(weights.index(max(weights)))]
    others = [k for k in left if k not in set(base)]
    while groups:
        link = _cheapest(roads, others, held, groups)
        if link is None:
            break
        group, path = link
        held += [*path, *groups.pop(group)]
    return sorted(set(held))


def _base(roads: Sequence[Road], left: list[int]) -> list[int]:
    kinds: tuple[Callable[[Road], bool], ...] = (
        lambda road: road.is_plain,
        lambda road: bool(road.forward and road.backward and not road.closed),
        lambda road: not road.closed,
    )
    for kind in kinds:
        found = [k for k in left if kind(roads[k])]
        if any(kind(road) for road in roads):
            return found
    return left


def _groups(roads: Sequence[Road], numbers: list[int]) -> list[list[int]]:
    """Return the connected groups of roads."""
    parent: dict[str, str] = {}

    def root(name: str) -> str:
        while parent.setdefault(name, name) != name:
            parent[name] = parent[parent[name]]
            name = parent[name]
        return name

    for k in numbers:
        parent[root(roads[k].first)] = root(roads[k].last)
    found: dict[str, list[int]] = {}
    for k in numbers:
        found.setdefault(root(roads[k].first), []).append(k)
    return list(found.values())


def _cheapest(
    roads: Sequence[Road], others: list[int], held: list[int], groups: list[list[int]]
) -> tuple[int, list[int]] | None:
    """Return the cheapest group to join that is worth it, and the roads that join it; None if none is."""
    owner = {
        end: g for g, group in enumerate(groups) for k in group for end in (roads[k].first, roads[k].last)
    }
    links: dict[str, list[tuple[int, str]]] = {}
    for k in others:
        links.setdefault(roads[k].first, []).append((k, roads[k].last))
        links.setdefault(roads[k].last, []).append((k, roads[k].first))
    begin = {end for k in held for end in (roads[k].first, roads[k].last)}
    waiting: list[tuple[float, str]] = [(0.0, name) for name in sorted(begin)]
    cost = dict.fromkeys(begin, 0.0)
    came: dict[str, tuple[int, str]] = {}
    while waiting:
        far, name = heappop(waiting)
        if far > cost[name]:
            continue
        group = owner.get(name)
        if group is not None and far <= WORTH * sum(roads[k].length for k in groups[group]):
            return group, _way(came, name)
        for k, to in links.get(name, []):
            new = far + roads[k].length * _price(roads[k])
            if new < cost.get(to, float("inf")):
                cost[to] = new
                came[to] = (k, name)
                heappush(waiting, (new, to))
    return None


def _price(road: Road) -> float:
    if road.closed:
        return CLOSED
    return TWO_WAY if road.forward and road.backward else ONE_WAY


def _way(came: dict[str, tuple[int, str]], name: str) -> list[int]:
    path: list[int] = []
    while name in came:
        k, name = came[name]
        path.append(k)
    return path
