"""Random networks woven from a grid: some of its sites, joined by roads, each moved as far as there is room.

A part of the grid has room for as many roads as a request may name (`most_segments`).
"""

from __future__ import annotations

from functools import lru_cache
from math import ceil, isqrt
from threading import get_ident
from typing import TYPE_CHECKING

import numpy as np

from dubins_traffic.kernels.arrays import Floats, Ints
from dubins_traffic.kernels.calls import bound
from dubins_traffic.kernels.compile import jit
from dubins_traffic.kernels.records import Rows, record, table
from dubins_traffic.kernels.stream import Stream, next_uniform, set_stream, shuffle
from dubins_traffic.kernels.tables import Tables
from dubins_traffic.roads.closeness import Frame, Hits, find_meetings, find_tight, frame, hits, put_arms
from dubins_traffic.roads.room import Clearances

if TYPE_CHECKING:
    from dubins_traffic.kernels.philox import Draws
    from dubins_traffic.roads.sketch import Drawn

PITCH = 1.35
"""Distance of neighbours in the grid, in least lengths of a segment."""
SHIFT = 0.45
"""How far a point may be moved, in pitches."""
ROUNDS = 12
"""After so many rounds, points that are still in the way stay on the grid."""
OUTLINES = (4.0, 2.0, 1.0, 0.5)
"""How ragged an outline to try, from the most."""
HALF_EVEN = 6755399441055744.0
"""1.5 * 2**52: a number to which it is added, and from which it is taken, is rounded to a whole one, half to even."""
AROUND = 8
"""The grid reaches so much farther than the densest outline."""
NEIGHBOURS = 64
"""So much that falls short there may be for each intersection."""


@record
class Loom:
    """What is to be woven, and how far it is."""

    intersections: int
    """How many are wanted."""
    segments: int
    """How many roads are wanted."""
    pitch: float
    """Distance of neighbours in the grid, lattice units."""
    half: int
    """The grid has the numbers from -half to half."""
    side: int
    """Side of the largest square of sites."""
    sites: int
    """Number of sites so far."""
    border: int
    """Number of sites in the border."""
    couples: int
    """Number of couples of neighbours."""
    rounds: int
    """After so many rounds, points that are still in the way stay on the grid."""


@record
class Site:
    """A site of the grid."""

    x: int
    """Its column in the grid."""
    y: int
    """Its row."""
    shift_x: float
    """How far its point is moved at most along x, lattice units."""
    shift_y: float
    """And along y."""
    scale: float
    """By what share of that it is moved."""
    is_bad: int
    """Whether it has a part in something that falls short."""


@record
class Edge:
    """A site in the border: that of the least `far`, then x, then y, is taken next."""

    far: float
    """How far it is from the middle, more or less."""
    x: int
    """Its column in the grid."""
    y: int
    """Its row."""


class Web(Tables):
    """A network under way.

    `number` (G,): the number of each site of the grid, -1 where none has been reached, -2 in the border; `couple`
    (K, 2): sites that are neighbours; `order`, `joins` (K,): scratch for these; `above` (N,): scratch for sites;
    `ragged` (4,): how ragged an outline to try, one after the other.
    """

    site: Rows[Site]
    edge: Rows[Edge]
    number: Ints
    couple: Ints
    order: Ints
    joins: Ints
    above: Ints
    ragged: Floats


def most_segments(count: int) -> int:
    """Return floor(2 N - 2 sqrt(N)), the most segments of a part of the grid with N points.

    Source: F. Harary, H. Harborth, "Extremal animals", Journal of Combinatorics, Information and System
    Sciences 1, 1976.
    """
    return 2 * count - isqrt(4 * count - 1) - 1


def woven(draws: Draws, count: int, roads: int, least: Clearances) -> Drawn:
    """Return `count` lattice points and `roads` roads between them, as pairs of their numbers.

    Parameters
    ----------
    draws : Draws
        Random numbers; they stand where it has left them.
    count, roads : int
        count - 1 <= roads <= floor(2 count - 2 sqrt(count)), what the densest outline has.
    least : Clearances
        In lattice units; its angle at most pi / 2.
    """
    weaver = _weaver(count, roads, get_ident())
    weaver.run(draws, least)
    node, bar = weaver.made.node, weaver.made.bar
    points = zip(node["x"].astype(np.int64).tolist(), node["y"].astype(np.int64).tolist(), strict=True)
    return list(points), list(zip(bar["a"].tolist(), bar["b"].tolist(), strict=True))


class Weaver:
    """Weaves networks of `count` intersections and `roads` roads."""

    def __init__(self, count: int, roads: int) -> None:
        self._loom, self._stream = table(Loom, 1)[0], table(Stream, 1)[0]
        self._loom.intersections, self._loom.segments = count, roads
        self._loom.half, self._loom.side = isqrt(count) + AROUND, isqrt(count)
        self._loom.rounds = ROUNDS
        most = most_segments(count)
        self._web = Web(
            site=table(Site, count), edge=table(Edge, 4 * count + 1),
            number=np.zeros((2 * self._loom.half + 1) ** 2, dtype=np.int64),
            couple=np.zeros((most, 2), dtype=np.int64), order=np.zeros(most, dtype=np.int64),
            joins=np.zeros(most, dtype=np.int64), above=np.zeros(count, dtype=np.int64), ragged=np.array(OUTLINES),
        )  # fmt: skip
        self.made = frame(count, roads, 2 * roads)
        self._hits = hits(NEIGHBOURS * count)
        self._weave = bound(weave)

    def run(self, draws: Draws, least: Clearances) -> None:
        """Weave a network, `made`; the arguments are as of `woven`."""
        self._loom.pitch = float(ceil(PITCH * max(least.length, least.apart, least.aside)))
        set_stream(self._stream, draws)
        self._weave(self._loom, self._web, self.made, least, self._hits, self._stream)
        draws.go_to(self._stream.drawn)


@lru_cache(maxsize=16)
def _weaver(count: int, roads: int, _thread: int) -> Weaver:
    """Return what weaves such networks in a thread: its tables are made once."""
    return Weaver(count, roads)


@jit
def weave(loom: Loom, web: Web, made: Frame, least: Clearances, hits: Hits, stream: Stream) -> None:
    """Draw a network: its intersections and segments in `made`."""
    _outline(loom, web, stream)
    _choose(loom, web, made, stream)
    for v in range(loom.intersections):
        site = web.site[v]
        site.shift_x = (-1.0 + 2.0 * next_uniform(stream)) * SHIFT * loom.pitch
        site.shift_y = (-1.0 + 2.0 * next_uniform(stream)) * SHIFT * loom.pitch
        site.scale = 1.0
    for k in range(loom.intersections + loom.rounds + 1):
        _move(loom, web, made)
        hits.filled[0] = 0
        put_arms(made)
        find_tight(made, least, hits)
        find_meetings(made, hits)
        if hits.filled[0] == 0:
            break
        _mark(web, made, hits)
        for v in range(loom.intersections):
            site = web.site[v]
            if site.is_bad != 0:
                site.scale = site.scale * 0.75 if k < loom.rounds else 0.0


@jit
def _outline(loom: Loom, web: Web, stream: Stream) -> None:
    """Take sites of the grid and find its couples of neighbours, of the most ragged outline that has enough."""
    for k in range(web.ragged.shape[0]):
        _ragged(loom, web, web.ragged[k], stream)
        _neighbours(loom, web)
        if loom.couples >= loom.segments:
            return
    _dense(loom, web)
    _neighbours(loom, web)


@jit
def _place(loom: Loom, x: int, y: int) -> int:
    """Return where in `Web.number` a site stands."""
    return (y + loom.half) * (2 * loom.half + 1) + x + loom.half


@jit
def _clear(loom: Loom, web: Web) -> None:
    for k in range(web.number.shape[0]):
        web.number[k] = -1
    loom.sites = 0
    loom.border = 0


@jit
def _take(loom: Loom, web: Web, x: int, y: int) -> None:
    """Take a site, if there are not enough."""
    if loom.sites < loom.intersections:
        site = web.site[loom.sites]
        site.x = x
        site.y = y
        web.number[_place(loom, x, y)] = loom.sites
        loom.sites += 1


@jit
def _ragged(loom: Loom, web: Web, ragged: float, stream: Stream) -> None:
    """Take sites one after another from the border, mostly the nearest to the middle."""
    _clear(loom, web)
    _push(loom, web, 0.0, 0, 0)
    while loom.sites < loom.intersections:
        edge = web.edge[0]
        x = edge.x
        y = edge.y
        _drop(loom, web)
        _take(loom, web, x, y)
        for k in range(4):
            i = x + (1 if k == 0 else 0) - (1 if k == 2 else 0)
            j = y + (1 if k == 1 else 0) - (1 if k == 3 else 0)
            if web.number[_place(loom, i, j)] == -1:
                _push(loom, web, max(abs(i), abs(j)) + ragged * next_uniform(stream), i, j)


@jit
def _dense(loom: Loom, web: Web) -> None:
    """Take the square, then the sites of a further column, then of a row."""
    _clear(loom, web)
    side = loom.side
    for x in range(side):
        for y in range(side):
            _take(loom, web, x, y)
    for y in range(side):
        _take(loom, web, side, y)
    for x in range(side + 1):
        _take(loom, web, x, side)


@jit
def _before(edge: Edge, far: float, x: int, y: int) -> bool:
    """Return whether a site in the border is taken before another."""
    if edge.far != far:
        return edge.far < far
    return edge.x < x or (edge.x == x and edge.y < y)


@jit
def _set(edge: Edge, far: float, x: int, y: int) -> None:
    edge.far = far
    edge.x = x
    edge.y = y


@jit
def _push(loom: Loom, web: Web, far: float, x: int, y: int) -> None:
    """Put a site into the border, a heap."""
    k = loom.border
    loom.border = k + 1
    while k > 0:
        above = web.edge[(k - 1) >> 1]
        if _before(above, far, x, y):
            break
        _set(web.edge[k], above.far, above.x, above.y)
        k = (k - 1) >> 1
    _set(web.edge[k], far, x, y)
    web.number[_place(loom, x, y)] = -2


@jit
def _drop(loom: Loom, web: Web) -> None:
    """Take the first site out of the border."""
    loom.border -= 1
    last = web.edge[loom.border]
    k = 0
    while 2 * k + 1 < loom.border:
        below = 2 * k + 1
        one = web.edge[below]
        if below + 1 < loom.border and not _before(
            one, web.edge[below + 1].far, web.edge[below + 1].x, web.edge[below + 1].y
        ):
            below += 1
            one = web.edge[below]
        if not _before(one, last.far, last.x, last.y):
            break
        _set(web.edge[k], one.far, one.x, one.y)
        k = below
    _set(web.edge[k], last.far, last.x, last.y)


@jit
def _neighbours(loom: Loom, web: Web) -> None:
    """Find the couples of sites beside one another."""
    loom.couples = 0
    for v in range(loom.intersections):
        site = web.site[v]
        for k in range(2):
            other = web.number[_place(loom, site.x + 1 - k, site.y + k)]
            if other >= 0:
                web.couple[loom.couples, 0] = v
                web.couple[loom.couples, 1] = other
                loom.couples += 1


@jit
def span(couple: Ints, order: Ints, above: Ints, joins: Ints) -> int:
    """Tell which couples, taken in order, join two parts that were not joined before; return how many do.

    Parameters
    ----------
    couple : (K, 2) int64
        Numbers of what they join, each below V.
    order : (M,) int64
        Numbers of the couples, in order.
    above : (V,) int64
        Scratch.
    joins : (M,) int64
        Set to whether each in that order does, 0 or 1.
    """
    count = 0
    for v in range(above.shape[0]):
        above[v] = v
    for k in range(order.shape[0]):
        p = _root(above, couple[order[k], 0])
        q = _root(above, couple[order[k], 1])
        joins[k] = 1 if p != q else 0
        count += joins[k]
        above[p] = q
    return count


@jit
def _root(above: Ints, v: int) -> int:
    while above[v] != v:
        above[v] = above[above[v]]
        v = above[v]
    return v


@jit
def _choose(loom: Loom, web: Web, made: Frame, stream: Stream) -> None:
    """Make roads of a random tree of the couples and of as many others as are asked for."""
    count = loom.couples
    shuffle(stream, web.order, count)
    spare = loom.segments - span(web.couple, web.order[:count], web.above, web.joins)
    s = 0
    for is_tree in range(1, -1, -1):
        for k in range(count):
            if web.joins[k] == is_tree and (is_tree == 1 or spare > 0):
                bar = made.bar[s]
                bar.a = web.couple[web.order[k], 0]
                bar.b = web.couple[web.order[k], 1]
                bar.owner = s
                s += 1
                spare -= 1 - is_tree


@jit
def _move(loom: Loom, web: Web, made: Frame) -> None:
    """Move all points as far as they may be moved."""
    for v in range(loom.intersections):
        site, node = web.site[v], made.node[v]
        node.x = loom.pitch * site.x + ((site.scale * site.shift_x + HALF_EVEN) - HALF_EVEN)
        node.y = loom.pitch * site.y + ((site.scale * site.shift_y + HALF_EVEN) - HALF_EVEN)
    for s in range(made.bar.shape[0]):
        bar = made.bar[s]
        one, other = made.node[bar.a], made.node[bar.b]
        bar.x0 = one.x
        bar.y0 = one.y
        bar.x1 = other.x
        bar.y1 = other.y


@jit
def _mark(web: Web, made: Frame, hits: Hits) -> None:
    """Mark the sites that have a part in something that falls short."""
    for v in range(web.site.shape[0]):
        web.site[v].is_bad = 0
    for k in range(min(hits.filled[0], hits.row.shape[0])):
        hit = hits.row[k]
        _mark_one(web, hit.vertex)
        _mark_one(web, hit.other_vertex)
        for s in (hit.segment, hit.other_segment):
            if s >= 0:
                _mark_one(web, made.bar[s].a)
                _mark_one(web, made.bar[s].b)


@jit
def _mark_one(web: Web, v: int) -> None:
    if v >= 0:
        web.site[v].is_bad = 1
