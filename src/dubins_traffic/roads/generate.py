"""Random networks: planar, connected, with room for the rules; and grids from which roads are taken.

They are grown freely where that makes enough roads (`Sketch`), else woven from a grid; some roads may swerve.
"""

from __future__ import annotations

import heapq
from dataclasses import replace
from math import ceil, floor, isfinite, isqrt, pi, sqrt

import numpy as np

from dubins_traffic.errors import InputError
from dubins_traffic.kernels.angles import sincos
from dubins_traffic.kernels.arrays import Floats, Ints
from dubins_traffic.kernels.philox import Draws
from dubins_traffic.roads.chains import Corners
from dubins_traffic.roads.checks import LARGEST_DEGREE, meetings
from dubins_traffic.roads.clearance import (
    LEAST_RADIUS,
    ROUNDING,
    SEGMENT_SLACK,
    TIGHTEST,
    Clearances,
    clearance_faults,
    clearances,
    tight,
)
from dubins_traffic.roads.formats.rnd import extent
from dubins_traffic.roads.network import RoadNetwork

STREAM = 1
"""The stream of `Draws` from which networks come."""
MOST_INTERSECTIONS = 20_000
UNITS = 8
"""Lattice units in the shortest segment: bearings come in steps of a few degrees."""
GROWN_SHARE = 1.4
"""Freely grown networks have hardly more segments than this for each intersection."""
ATTEMPTS = 3
FARTHEST = 10.0
"""Largest shift of a random rigid motion along each axis, metres."""
Drawn = tuple[list[tuple[int, int]], list[tuple[int, int]]]
LONGEST = 1.8
"""Roads are at most this many times as long as they must be."""
GROWN = 1.5
"""And those of the tree at most this many times."""
TRIES = 16
"""An intersection at which so many roads did not fit grows no more (more where only few bearings do)."""
Point = tuple[int, int]
PITCH = 1.35
"""Distance of neighbours in the grid, in least lengths of a segment."""
SHIFT = 0.45
"""How far a point may be moved, in pitches."""
ROUNDS = 12
"""After so many rounds, points that are still in the way stay on the grid."""
OUTLINES = (4.0, 2.0, 1.0, 0.5)
"""How ragged an outline to try, from the most."""
Site = tuple[int, int]
ROOM = 3.0
"""Metres by which segments are longer where some are to bend, for w = 0.3 m."""
WIDEST = 2.0
"""Largest radius of an arc, in units of the least."""
STEEPEST = 1.0
"""Tangent of the largest angle at which a road leaves the straight way."""
FARTHEST_ASIDE = 4.0
"""How far a road swerves to the side at most, in units of w."""
SPARE = 1e-6
"""Metres that are straight beyond what has to be."""
FLATTER, SWERVES = 0.7, 8
"""A swerve that does not fit is made so much flatter, and that so often."""


def generate(
    intersections: int,
    segments: int,
    seed: int = 0,
    *,
    trial: int = 0,
    minimum_angle: float = pi / 3,
    w: float = 0.3,
    radius: float | None = None,
    reach: float = 0.177,
    slack: float = SEGMENT_SLACK,
    rigid_motion: bool = False,
    bent: float = 0.0,
) -> RoadNetwork:
    """Return the random network of a seed and trial; see `random_network`."""
    return random_network(
        Draws(seed, trial, STREAM),
        intersections,
        segments,
        minimum_angle=minimum_angle,
        w=w,
        radius=radius,
        reach=reach,
        slack=slack,
        rigid_motion=rigid_motion,
        bent=bent,
    )


def random_network(
    draws: Draws,
    intersections: int,
    segments: int,
    *,
    minimum_angle: float = pi / 3,
    w: float = 0.3,
    radius: float | None = None,
    reach: float = 0.177,
    slack: float = SEGMENT_SLACK,
    rigid_motion: bool = False,
    bent: float = 0.0,
) -> RoadNetwork:
    """Return a random planar, connected network that keeps the clearances of docs/rules.md#room.

    Parameters
    ----------
    draws : Draws
        Random numbers.
    intersections, segments : int
        N and M, with N - 1 <= M <= floor(2 N - 2 sqrt(N)).
    minimum_angle : float
        Least angle between two segments at an intersection, radians, in (0, pi]. Where the rules of the road
        need a larger one, that counts (61.3 degrees by default).
    w, radius, reach, slack : float
        Width w of cars, intersection radius R (default 1 m * w / 0.3), reach rho of bodies, and by how much a
        segment must be longer than 2 (R + rho); metres.
    rigid_motion : bool
        Whether the network is turned and moved at random.
    bent : float
        About which share of the segments bend, if there is room; all are longer if that is not 0.

    Raises
    ------
    InputError
        If the request makes no sense, or can't be placed; then it names the largest number that was.
    """
    radius = w / 0.3 if radius is None else radius
    _check_counts(intersections, segments)
    _check_sizes(minimum_angle, w, radius, reach, slack)
    metres = clearances(radius, reach, w, slack + (ROOM * w / 0.3 if bent > 0.0 else 0.0))
    unit = float(f"{metres.length / UNITS:.2g}")
    wider = sincos(minimum_angle)[0] + 2.0 * ROUNDING
    least = metres.in_units(unit)._replace(cosine=min(metres.cosine, wider))
    points, roads = _draw(draws, intersections, segments, least, minimum_angle)
    low_x, low_y = min(x for x, _ in points), min(y for _, y in points)
    moved = [(x - low_x, y - low_y) for x, y in points]
    rows = tuple(
        sorted((*moved[a], *moved[b]) if moved[a] < moved[b] else (*moved[b], *moved[a]) for a, b in roads)
    )
    made = RoadNetwork(rows, unit, _motion(draws, rigid_motion), extent(rows))
    if not bent > 0.0:
        return made
    return bend_some(made, draws, bent, w=w, radius=radius, reach=reach, slack=slack)


def thinned_grid(
    draws: Draws,
    rows: int,
    columns: int,
    removed: float,
    *,
    length: float = 3.0,
    rigid_motion: bool = False,
) -> RoadNetwork:
    """Return a grid without a share of its segments, drawn at random; it stays connected.

    Parameters
    ----------
    draws : Draws
        Random numbers.
    rows, columns : int
        Size of the grid.
    removed : float
        Share of the segments to take away, in [0, 1]; rounded down to a number of segments.
    length : float
        Length of the segments, metres.
    rigid_motion : bool
        Whether the network is turned and moved at random.

    Raises
    ------
    InputError
        If so many can't be taken away; it names the largest share that can.
    """
    if not (isfinite(removed) and 0.0 <= removed <= 1.0):
        raise InputError("not a share", field="removed", value=removed, expected="a number in [0, 1]")
    grid = RoadNetwork.grid(rows, columns, length)
    count = len(grid.segments)
    take = floor(removed * count + 1e-9)
    spare = count - (len(grid.intersections) - 1)
    if take > spare:
        expected = (
            f"at most {spare} of {count} segments ({floor(1e4 * spare / count) / 1e4:g}), to stay connected"
        )
        raise InputError("too many segments to remove", field="removed", value=removed, expected=expected)
    order = draws.shuffled(count)
    joins = spanning(len(grid.intersections), [(int(grid.ends[s, 0]), int(grid.ends[s, 1])) for s in order])
    loose = [s for s, joined in zip(order, joins, strict=True) if not joined]
    gone = set(loose[:take])
    kept = tuple(segment for s, segment in enumerate(grid.segments) if s not in gone)
    return RoadNetwork(kept, length, _motion(draws, rigid_motion), grid.shape)


def _draw(draws: Draws, count: int, roads: int, least: Clearances, minimum_angle: float) -> Drawn:
    """Return points and roads: freely grown if that makes enough roads, else woven from a grid."""
    grid = minimum_angle <= pi / 2
    largest = 0
    if not grid or roads <= ceil(GROWN_SHARE * count):
        for _ in range(ATTEMPTS):
            sketch = Sketch(least, minimum_angle)
            if sketch.grow(draws, count):
                sketch.connect(draws, roads)
                if len(sketch.roads) == roads:
                    return sketch.points, sketch.roads
            largest = max(largest, len(sketch.roads))
    if grid:
        return draw_from_grid(draws, count, roads, least)
    problem = f"can't be placed at angles of at least {180.0 * minimum_angle / pi:.6g} degrees"
    raise InputError(
        problem, field="segments", value=roads, expected=f"at most {largest}, the most that were placed"
    )


def _motion(draws: Draws, wanted: bool) -> tuple[float, float, float]:
    if not wanted:
        return 0.0, 0.0, 0.0
    return draws.uniform(-FARTHEST, FARTHEST), draws.uniform(-FARTHEST, FARTHEST), draws.uniform(-pi, pi)


def _check_counts(intersections: int, segments: int) -> None:
    if not 2 <= intersections <= MOST_INTERSECTIONS:
        expected = f"an integer in [2, {MOST_INTERSECTIONS}]"
        raise InputError(
            "not a number of intersections", field="intersections", value=intersections, expected=expected
        )
    low, high = intersections - 1, most_segments(intersections)
    if not low <= segments <= high:
        expected = f"an integer in [{low}, {high}] for {intersections} intersections"
        raise InputError("not a number of segments", field="segments", value=segments, expected=expected)


def _check_sizes(minimum_angle: float, w: float, radius: float, reach: float, slack: float) -> None:
    if not (isfinite(minimum_angle) and 0.0 < minimum_angle <= pi):
        expected = "radians in (0, pi]"
        raise InputError("not an angle", field="minimum_angle", value=minimum_angle, expected=expected)
    for name, value, least in (("w", w, 1e-3), ("reach", reach, 0.0), ("slack", slack, 0.0)):
        if not (isfinite(value) and least <= value <= 1e3):
            raise InputError("not a length", field=name, value=value, expected=f"metres in [{least:g}, 1000]")
    if not (isfinite(radius) and LEAST_RADIUS * w - 1e-9 <= radius <= 1e4):
        expected = f"metres in [{LEAST_RADIUS} w, 10000], w = {w:g}"
        raise InputError("not an intersection radius", field="radius", value=radius, expected=expected)


class Sketch:
    """Roads between points of the integer lattice that keep the clearances.

    Parameters
    ----------
    least : Clearances
        In lattice units.
    minimum_angle : float
        Least angle between two roads at an intersection, radians: says how often to try.
    """

    def __init__(self, least: Clearances, minimum_angle: float) -> None:
        self.points: list[Point] = []
        self.roads: list[tuple[int, int]] = []
        self._least = least
        self._longest = LONGEST * least.length
        self._cosine = least.cosine - ROUNDING
        self._tries = ceil(TRIES * pi / max(pi - minimum_angle, 0.02))
        self._arms: list[list[int]] = []
        self._near_points: dict[Point, list[int]] = {}
        self._near_roads: dict[Point, list[tuple[int, int]]] = {}

    def grow(self, draws: Draws, count: int) -> bool:
        """Draw a tree of `count` intersections; False if it did not find the room."""
        self._add_point((0, 0))
        reach = floor(GROWN * self._least.length)
        around = range(-reach, reach + 1)
        offsets = [
            (x, y) for x in around for y in around if self._fair(x, y) and x * x + y * y <= reach * reach
        ]
        failures = [0]
        active = [0]
        while len(self.points) < count and active:
            u = draws.uniform()
            k = int(u * u * len(active))
            a = active[k]
            dx, dy = offsets[draws.below(len(offsets))]
            q = (self.points[a][0] + dx, self.points[a][1] + dy)
            if self._fits(a, q, None):
                b = self._add_point(q)
                self._add_road(a, b)
                active.append(b)
                failures.append(0)
            else:
                failures[a] += 1
                if failures[a] >= self._tries:
                    del active[k]
        return len(self.points) == count

    def connect(self, draws: Draws, roads: int) -> None:
        """Add roads between the points, in random order, until there are `roads` or no other fits."""
        couples = [
            (a, b)
            for a, p in enumerate(self.points)
            for b in self._points_around(p)
            if a < b and self._fair(self.points[b][0] - p[0], self.points[b][1] - p[1])
        ]
        couples.sort()
        for k in draws.shuffled(len(couples)):
            if len(self.roads) >= roads:
                break
            a, b = couples[k]
            if b not in self._arms[a] and self._fits(a, self.points[b], b):
                self._add_road(a, b)

    def _fair(self, dx: int, dy: int) -> bool:
        return self._least.length <= sqrt(dx * dx + dy * dy) <= self._longest

    def _fits(self, a: int, q: Point, b: int | None) -> bool:
        """Whether a road from intersection a to the point q (intersection b, or a new one) fits in."""
        p = self.points[a]
        if not self._turns(a, q) or (b is not None and not self._turns(b, p)):
            return False
        middle = ((p[0] + q[0]) // 2, (p[1] + q[1]) // 2)
        for v in self._points_around(middle):
            r = self.points[v]
            if v not in (a, b) and _distance(r, p, q) < self._least.aside:
                return False
            if b is None and _distance(r, q, q) < self._least.apart:
                return False
        for c, d in self._roads_around(middle):
            r, t = self.points[c], self.points[d]
            if b is None and _distance(q, r, t) < self._least.aside:
                return False
            if not {a, b} & {c, d} and _cross(p, q, r, t):
                return False
        return True

    def _turns(self, v: int, q: Point) -> bool:
        """Whether intersection v may have another road, toward q."""
        x, y = self.points[v]
        dx, dy = q[0] - x, q[1] - y
        if len(self._arms[v]) >= LARGEST_DEGREE:
            return False
        for other in self._arms[v]:
            ex, ey = self.points[other][0] - x, self.points[other][1] - y
            if dx * ex + dy * ey > self._cosine * sqrt((dx * dx + dy * dy) * (ex * ex + ey * ey)):
                return False
        return True

    def _add_point(self, point: Point) -> int:
        self.points.append(point)
        self._arms.append([])
        self._near_points.setdefault(self._cell(point), []).append(len(self.points) - 1)
        return len(self.points) - 1

    def _add_road(self, a: int, b: int) -> None:
        (x0, y0), (x1, y1) = self.points[a], self.points[b]
        self.roads.append((a, b))
        self._arms[a].append(b)
        self._arms[b].append(a)
        self._near_roads.setdefault(self._cell(((x0 + x1) // 2, (y0 + y1) // 2)), []).append((a, b))

    def _cell(self, point: Point) -> Point:
        side = self._longest + 2.0
        return floor(point[0] / side), floor(point[1] / side)

    def _points_around(self, point: Point) -> list[int]:
        x, y = self._cell(point)
        cells = [(i, j) for i in (x - 1, x, x + 1) for j in (y - 1, y, y + 1)]
        return [v for cell in cells for v in self._near_points.get(cell, ())]

    def _roads_around(self, point: Point) -> list[tuple[int, int]]:
        x, y = self._cell(point)
        cells = [(i, j) for i in (x - 1, x, x + 1) for j in (y - 1, y, y + 1)]
        return [road for cell in cells for road in self._near_roads.get(cell, ())]


def _distance(r: Point, p: Point, q: Point) -> float:
    """Return the distance from r to the segment from p to q."""
    dx, dy, rx, ry = q[0] - p[0], q[1] - p[1], r[0] - p[0], r[1] - p[1]
    square = dx * dx + dy * dy
    along = min(max((rx * dx + ry * dy) / square, 0.0), 1.0) if square else 0.0
    rx, ry = rx - along * dx, ry - along * dy
    return sqrt(rx * rx + ry * ry)


def _cross(p: Point, q: Point, r: Point, t: Point) -> bool:
    """Whether the segments pq and rt meet."""
    return _side(p, q, r) * _side(p, q, t) <= 0 and _side(r, t, p) * _side(r, t, q) <= 0


def _side(p: Point, q: Point, r: Point) -> int:
    turn = (q[0] - p[0]) * (r[1] - p[1]) - (q[1] - p[1]) * (r[0] - p[0])
    return (turn > 0) - (turn < 0)


def draw_from_grid(
    draws: Draws, count: int, roads: int, least: Clearances
) -> tuple[list[Site], list[tuple[int, int]]]:
    """Return `count` lattice points and `roads` roads between them, as pairs of their numbers.

    Parameters
    ----------
    draws : Draws
        Random numbers.
    count, roads : int
        count - 1 <= roads <= floor(2 count - 2 sqrt(count)), what the densest outline has.
    least : Clearances
        In lattice units; its angle at most pi / 2.
    """
    sites, couples = _outline(draws, count, roads)
    ends = np.array(_choose(draws, count, couples, roads), dtype=np.int64)
    pitch = ceil(PITCH * max(least.length, least.apart, least.aside))
    grid = pitch * np.array(sites, dtype=np.float64)
    shift = np.array([[draws.uniform(-1.0, 1.0) for _ in range(2)] for _ in range(count)]) * SHIFT * pitch
    scale = np.ones(count)
    points = grid
    for k in range(count + ROUNDS + 1):
        points = grid + np.rint(scale[:, None] * shift)
        bad = _in_the_way(points, ends, least)
        if not bad.any():
            break
        scale[bad] = scale[bad] * 0.75 if k < ROUNDS else 0.0
    return [(int(x), int(y)) for x, y in points], [(int(a), int(b)) for a, b in ends]


def most_segments(count: int) -> int:
    """Return floor(2 N - 2 sqrt(N)), the most segments of a part of the grid with N points.

    Source: F. Harary, H. Harborth, "Extremal animals", Journal of Combinatorics, Information and System
    Sciences 1, 1976.
    """
    return 2 * count - isqrt(4 * count - 1) - 1


def spanning(count: int, couples: list[tuple[int, int]]) -> list[bool]:
    """Return which of the couples, taken in order, join two parts that were not joined before."""
    above = list(range(count))

    def root(v: int) -> int:
        while above[v] != v:
            above[v] = above[above[v]]
            v = above[v]
        return v

    joins: list[bool] = []
    for a, b in couples:
        p, q = root(a), root(b)
        joins.append(p != q)
        above[p] = q
    return joins


def _outline(draws: Draws, count: int, roads: int) -> tuple[list[Site], list[tuple[int, int]]]:
    """Return sites of the grid and its couples of neighbours, of the most ragged outline that has enough."""
    couples: list[tuple[int, int]] = []
    for ragged in OUTLINES:
        sites = _ragged(draws, count, ragged)
        couples = _neighbours(sites)
        if len(couples) >= roads:
            return sites, couples
    sites = _dense(count)
    return sites, _neighbours(sites)


def _ragged(draws: Draws, count: int, ragged: float) -> list[Site]:
    """Return sites taken one after another from the border, mostly the nearest to the middle."""
    sites: list[Site] = []
    seen = {(0, 0)}
    border: list[tuple[float, Site]] = [(0.0, (0, 0))]
    while len(sites) < count:
        _, (x, y) = heapq.heappop(border)
        sites.append((x, y))
        for near in ((x + 1, y), (x, y + 1), (x - 1, y), (x, y - 1)):
            if near not in seen:
                seen.add(near)
                far = max(abs(near[0]), abs(near[1]))
                heapq.heappush(border, (far + ragged * draws.uniform(), near))
    return sites


def _dense(count: int) -> list[Site]:
    """Return the square, then the sites of a further column, then of a row."""
    side = isqrt(count)
    sites = [(x, y) for x in range(side) for y in range(side)]
    sites += [(side, y) for y in range(side)] + [(x, side) for x in range(side + 1)]
    return sites[:count]


def _neighbours(sites: list[Site]) -> list[tuple[int, int]]:
    number = {site: v for v, site in enumerate(sites)}
    couples: list[tuple[int, int]] = []
    for v, (x, y) in enumerate(sites):
        couples += [(v, number[near]) for near in ((x + 1, y), (x, y + 1)) if near in number]
    return couples


def _choose(draws: Draws, count: int, couples: list[tuple[int, int]], roads: int) -> list[tuple[int, int]]:
    """Return a random tree of the couples and as many others as are asked for."""
    order = [couples[k] for k in draws.shuffled(len(couples))]
    joins = spanning(count, order)
    tree = [couple for couple, joined in zip(order, joins, strict=True) if joined]
    others = [couple for couple, joined in zip(order, joins, strict=True) if not joined]
    return tree + others[: roads - len(tree)]


def _in_the_way(points: Floats, ends: Ints, least: Clearances) -> np.ndarray[tuple[int], np.dtype[np.bool_]]:
    """Return which points have a part in something that is too close, too sharp or crosses."""
    bad = np.zeros(len(points), dtype=np.bool_)
    found = tight(points, ends, least)
    bad[ends[found.short].ravel()] = True
    bad[found.close.ravel()] = True
    bad[found.beside[:, 0]] = True
    bad[ends[found.beside[:, 1]].ravel()] = True
    segment = np.concatenate([points[ends[:, 0]], points[ends[:, 1]]], axis=1).astype(np.int64)
    bad[ends[meetings(segment).ravel()].ravel()] = True
    bad[ends[found.sharp[:, 1:].ravel()].ravel()] = True
    return bad


def bend_some(
    network: RoadNetwork, draws: Draws, share: float, *, w: float, radius: float, reach: float, slack: float
) -> RoadNetwork:
    """Return a straight network in which about a `share` of the segments swerve: those that have the room.

    Parameters
    ----------
    network, draws, share
        The network, random numbers, and a share in [0, 1].
    w, radius, reach, slack
        As of `roads.generate.random_network`, metres.
    """
    straight = radius + reach + slack + SPARE
    corners: list[Corners] = []
    for s in range(len(network.segments)):
        picked = draws.uniform() < share
        bend = draws.uniform(TIGHTEST * w, WIDEST * TIGHTEST * w)
        slope = draws.uniform(0.4, STEEPEST) * (1.0 if draws.uniform() < 0.5 else -1.0)
        corners.append(_swerve(network, s, bend, slope, straight, FARTHEST_ASIDE * w) if picked else ())
    while any(corners):
        try:
            bent = replace(network, corners=tuple(corners))
        except InputError as error:
            faults = [error]
        else:
            faults = clearance_faults(bent, radius, reach, w, slack)
            if not faults:
                return bent
        named = {int(fault.field[len("segments[") : -1]) for fault in faults if fault.field}
        if not any(corners[s] for s in named):
            break
        corners = [() if s in named else own for s, own in enumerate(corners)]
    return network


def _swerve(
    network: RoadNetwork, s: int, bend: float, slope: float, straight: float, farthest: float
) -> Corners:
    """Return the corners with which segment s swerves to the side in its middle; none if it is too short."""
    x0, y0, x1, y1 = network.segments[s]
    length = float(network.lengths[s])
    for _ in range(SWERVES):
        steep = abs(slope)
        lean = sqrt(1.0 + steep * steep)
        quarter = (lean - 1.0) / steep
        run = min(0.5 * length - straight - bend * quarter, farthest / steep)
        if run * lean >= bend * (quarter + steep) + SPARE:
            break
        slope *= FLATTER
    else:
        return ()
    begin, aside = (0.5 * length - run) / length, run * slope / length
    dx, dy = x1 - x0, y1 - y0
    radius = bend / network.length
    return (
        (x0 + begin * dx, y0 + begin * dy, radius),
        (x0 + 0.5 * dx - aside * dy, y0 + 0.5 * dy + aside * dx, radius),
        (x1 - begin * dx, y1 - begin * dy, radius),
    )
