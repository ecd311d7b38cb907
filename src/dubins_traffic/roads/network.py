"""Road networks: segments, straight or bent, between points of a plane, embedded by scale and rigid motion.

`Routes` are the shortest ways along their lanes.
"""

from __future__ import annotations

import heapq
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, fields
from functools import cached_property, cmp_to_key
from math import inf
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from dubins_traffic import files
from dubins_traffic.display import Pictured, count
from dubins_traffic.errors import InputError
from dubins_traffic.kernels.angles import sincos
from dubins_traffic.kernels.arrays import Floats, Ints
from dubins_traffic.kernels.records import Rows, table
from dubins_traffic.roads.cells import with_cells
from dubins_traffic.roads.chains import Bars, Chains, Corners, Runs, Segment, sides, turned
from dubins_traffic.roads.checks import check
from dubins_traffic.roads.formats import registry as formats
from dubins_traffic.roads.formats import rnd
from dubins_traffic.roads.formats.registry import MapFormat
from dubins_traffic.roads.formats.rnd import write_json, write_lines
from dubins_traffic.roads.lookup import coordinates, nearest
from dubins_traffic.roads.room import LARGEST_DEGREE
from dubins_traffic.roads.table import CellGrid, Piece, RoadTable, Vertex
from dubins_traffic.roads.table import Segment as SegmentRow

Point = tuple[float, float]
Line = tuple[Point, Point]


@dataclass(frozen=True, slots=True)
class Routes:
    """Shortest routes to one intersection.

    Attributes
    ----------
    next_lane : array (L,) of int64
        The lane to take at the end of each lane; -1 where the lane ends in the intersection.
    distance : array (L,) of float64
        Metres from the start of each lane to the intersection; inf where no route leads there.
    """

    next_lane: Ints
    distance: Floats

    def follow(self, lane: int) -> list[int]:
        """Return the lanes from `lane` to the intersection, both included; empty if no route leads there."""
        if not self.distance[lane] < inf:
            return []
        path = [lane]
        while self.next_lane[path[-1]] >= 0:
            path.append(int(self.next_lane[path[-1]]))
        return path


def arms(sides: Sequence[Segment], ends: Ints, count: int) -> tuple[tuple[int, ...], ...]:
    """Return the lanes out of each of `count` intersections, counter-clockwise by bearing from the lattice's x axis.

    `sides` are the vectors (dx, dy, dx, dy) along each segment where it begins and where it ends.
    """
    out: list[list[tuple[float, float, int]]] = [[] for _ in range(count)]
    for s, (ax, ay, bx, by) in enumerate(sides):
        out[int(ends[s, 0])].append((ax, ay, 2 * s))
        out[int(ends[s, 1])].append((-bx, -by, 2 * s + 1))
    return tuple([tuple([lane for _, _, lane in sorted(lanes, key=cmp_to_key(_turn))]) for lanes in out])


def _turn(p: tuple[float, float, int], q: tuple[float, float, int]) -> int:
    """Compare two directions by bearing in [0, 2 pi), exactly on the lattice."""
    lower_p = p[1] < 0 or (p[1] == 0 and p[0] < 0)
    lower_q = q[1] < 0 or (q[1] == 0 and q[0] < 0)
    if lower_p != lower_q:
        return 1 if lower_p else -1
    cross = p[0] * q[1] - p[1] * q[0]
    return -1 if cross > 0 else 1


def shortest(target: int, lane_end: Sequence[int], lengths: Sequence[float], before: Sequence[Sequence[int]]) -> Routes:
    """Return the shortest routes to the intersection `target` (Dijkstra, backwards over lanes).

    Parameters
    ----------
    target : int
        Number of the intersection.
    lane_end, lengths : sequences (L,)
        Intersection in which each lane ends, and its metres.
    before : sequence (L,) of sequences
        The lanes that may be left for each lane. Of equally short routes the lane of lowest number is taken.
    """
    count = len(lane_end)
    distance = [inf] * count
    follow = [-1] * count
    heap: list[tuple[float, int]] = []
    for lane in range(count):
        if lane_end[lane] == target:
            distance[lane] = lengths[lane]
            heap.append((lengths[lane], lane))
    heapq.heapify(heap)
    while heap:
        gone, lane = heapq.heappop(heap)
        if gone > distance[lane]:
            continue
        for previous in before[lane]:
            length = gone + lengths[previous]
            closer = length < distance[previous]
            if closer or (length == distance[previous] and lane < follow[previous]):
                follow[previous] = lane
            if closer:
                distance[previous] = length
                heapq.heappush(heap, (length, previous))
    return Routes(np.array(follow, dtype=np.int64), np.array(distance, dtype=np.float64))


@dataclass(frozen=True)
class RoadNetwork(Pictured):
    """A planar, connected network of roads; at most four meet at an intersection.

    Parameters
    ----------
    segments : sequence of (x0, y0, x1, y1)
        Ends of the roads: points of the integer lattice, or others.
    length : float
        Metres of a lattice unit.
    transform : (float, float, float)
        Rigid motion tx, ty (metres), theta (radians): a point (x, y) of the lattice lies in the world at
        R(theta) (length x, length y) + (tx, ty).
    shape : (int, int)
        Rows and columns of the lattice that the segments span.
    extra : mapping
        Keys of the document that are not ours, kept.
    corners : sequence of sequences of (x, y, radius)
        The corners of each segment between its ends, in the lattice's frame and unit; each is rounded by an arc of
        that radius, tangent to both sides (`roads.chains`). Empty where all are straight.

    Raises
    ------
    InputError
        If it is no network: roads that cross or overlap, a fifth road at a point, zero length, not connected, arcs
        that do not fit.

    Notes
    -----
    Lane 2s runs along segment s from its first to its second end, lane 2s + 1 back. Intersections are numbered
    in the order of their lattice points, x first. Arrays can't be written to.
    """

    segments: tuple[Segment, ...]
    length: float
    transform: tuple[float, float, float]
    shape: tuple[int, int]
    extra: Mapping[str, Any] = field(default_factory=dict[str, Any], hash=False)
    corners: tuple[Corners, ...] = ()

    def __post_init__(self) -> None:
        plain = {
            "segments": rnd.checked_segments(self.segments),
            "length": rnd.checked_length(self.length),
            "transform": rnd.checked_transform(self.transform),
            "shape": rnd.checked_shape(self.shape),
            "extra": rnd.checked_extra(self.extra),
            "corners": rnd.checked_corners(self.corners, len(self.segments)),
        }
        for name, value in plain.items():
            object.__setattr__(self, name, value)
        check(self.segments, self.shape, self.corners)
        reach = max(max(abs(number) for number in segment) for segment in self.segments)
        if self.length * reach > rnd.WORLD:
            raise InputError(
                "too large a network",
                field="length",
                value=self.length,
                expected=f"at most {rnd.WORLD:g} metres",
            )

    @classmethod
    def unchecked(
        cls, segments: tuple[Segment, ...], length: float, transform: tuple[float, float, float]
    ) -> RoadNetwork:
        """Return the network of straight `segments` that are known to form one: nothing is looked at."""
        made, shape = object.__new__(cls), rnd.extent(segments)
        plain = {"segments": segments, "length": length, "transform": transform, "shape": shape}
        vars(made).update(plain, extra={}, corners=())
        return made

    def __repr__(self) -> str:
        return f"<RoadNetwork {self.summary}>"

    @property
    def summary(self) -> str:
        """The network in a few words: ``17 segments, 12 intersections on a 3 x 4 lattice``; metres where off it."""
        rows, columns = self.shape
        segments, points = len(self.segments), len(self.intersections)
        size = f"{count(segments, 'segment')}, {count(points, 'intersection')}"
        bent = sum(1 for bends in self.corners if bends)
        if self.on_lattice:
            place = f"on a {rows} x {columns} lattice"
        else:
            width, height = np.ptp(self.points, axis=0)
            place = f"on {width:.0f} x {height:.0f} m"
        return f"{size} {place}" + (f", {bent} bent" if bent else "")

    def __deepcopy__(self, memo: object) -> RoadNetwork:
        """Return this very network, which never changes."""
        return self

    def __getstate__(self) -> dict[str, Any]:
        """Leave behind, when pickled, what can be worked out again."""
        return {field.name: getattr(self, field.name) for field in fields(self)}

    @classmethod
    def grid(
        cls,
        rows: int,
        columns: int,
        length: float = 3.0,
        transform: tuple[float, float, float] = (0.0, 0.0, 0.0),
    ) -> RoadNetwork:
        """Return the complete grid of rows x columns intersections, segments in the order of 2016."""
        shape = rnd.checked_shape((rows, columns))
        return cls(rnd.grid_segments(*shape), length, transform, shape)

    @classmethod
    def from_document(cls, document: Mapping[str, Any], file: str | None = None) -> RoadNetwork:
        """Return the network of an RND document; errors name `file` and the field."""
        try:
            return cls(**rnd.fields(document)._asdict())
        except InputError as error:
            raise error.within(file=file) from None

    @classmethod
    def from_text(cls, text: str, file: str | None = None, map_format: MapFormat | None = None) -> RoadNetwork:
        """Return the network in a text, of the format `map_format`, else by its content; `known` has the losses."""
        form = map_format or formats.of_text(text)
        document, losses = formats.document(form, text, file)
        network = cls.from_document(document, file)
        network.known[formats.LOSSES] = losses
        return network

    @classmethod
    def read(cls, path: str | Path, map_format: MapFormat | None = None) -> RoadNetwork:
        """Return the network in a file, as `from_text`; ``-`` is standard input."""
        return cls.from_text(files.read_text(path), str(path), map_format)

    def to_document(self) -> dict[str, Any]:
        """Return the RND document: segments written out, whole numbers as integers; version 0 wherever that says it."""
        rows = [list(segment) for segment in self.segments]
        for row, bends in zip(rows, self.corners, strict=False):
            row += [number for corner in bends for number in corner]
        return {
            "version": 0 if self.is_straight and self.on_lattice else 2,
            "length": _number(self.length),
            "transform": [_number(entry) for entry in self.transform],
            "shape": list(self.shape),
            "segments": rows,
            **self.extra,
        }

    def to_json(self) -> str:
        """Return the RND document as JSON text."""
        return write_json(self.to_document())

    def to_text(self) -> str:
        """Return the RND document as plain text."""
        return write_lines(self.to_document())

    def write(self, path: str | Path, map_format: MapFormat | None = None, *, overwrite: bool = False) -> None:
        """Write a file, whole or not at all, in the format of its suffix; what is no file gets plain text of RND.

        `map_format` is asked before the registered ones. A path is refused as `files.require_output` says.
        """
        known = files.packed(*formats.suffixes(map_format))
        files.require_output(path, "a road network", known, overwrite=overwrite)
        form = formats.of_suffix(path, map_format)
        files.write_text(path, self.to_text() if form is None else form.write(self.to_document()))

    @property
    def size(self) -> tuple[int, int]:
        """Rows and columns, as `shape`."""
        return self.shape

    @cached_property
    def on_lattice(self) -> bool:
        """Whether all intersections are points of the integer lattice."""
        return all(isinstance(number, int) for segment in self.segments for number in segment)

    @cached_property
    def is_grid(self) -> bool:
        """Whether every segment joins two neighbours of the lattice, so that the network is a grid or part of one."""
        neighbours = all(abs(x1 - x0) + abs(y1 - y0) == 1 for x0, y0, x1, y1 in self.segments)
        return neighbours and self.is_straight and self.on_lattice

    def vertex(self, point: Point) -> int:
        """Return the number of the intersection at a lattice point; InputError if there is none."""
        x, y = point
        number = self._numbers.get((x, y))
        if number is None:
            expected = "the lattice point [x, y] of an intersection"
            raise InputError("not an intersection of the network", value=list(point), expected=expected)
        return number

    def vertices(self, points: Sequence[Point]) -> tuple[int, ...]:
        """Return the numbers of the intersections at lattice points; InputError if there is none at one of them."""
        numbers = self._numbers
        try:
            return tuple([numbers[point] for point in points])
        except KeyError:
            return tuple([self.vertex(point) for point in points])

    @property
    def lanes(self) -> int:
        """Number of lanes: two a segment."""
        return 2 * len(self.segments)

    @cached_property
    def _arms(self) -> tuple[tuple[int, ...], ...]:
        return arms(sides(self.segments, self.corners), self.ends, len(self.intersections))

    def arms(self, v: int) -> tuple[int, ...]:
        """Return the lanes out of an intersection, counter-clockwise by bearing there from the lattice's x axis."""
        return self._arms[v]

    def successors(self, lane: int) -> tuple[int, ...]:
        """Return the lanes that may be taken at the end of `lane`; turning round only at a dead end."""
        return self._successors[lane]

    @cached_property
    def _successors(self) -> tuple[tuple[int, ...], ...]:
        out = [self._arms[v] for v in self.ends[:, ::-1].ravel().tolist()]
        return tuple([tuple([o for o in lanes if o != k ^ 1]) or (k ^ 1,) for k, lanes in enumerate(out)])

    @cached_property
    def _lane_graph(self) -> tuple[list[int], list[float], list[list[int]]]:
        before: list[list[int]] = [[] for _ in range(self.lanes)]
        for lane in range(self.lanes):
            for following in self.successors(lane):
                before[following].append(lane)
        ends = [self.lane_ends(lane)[1] for lane in range(self.lanes)]
        return ends, np.repeat(self.lengths, 2).tolist(), before

    @cached_property
    def known(self) -> dict[object, object]:
        """Tables that other rooms have computed for this network and keep with it, each under a key of its own."""
        return {}

    @cached_property
    def _routes(self) -> dict[int, Routes]:
        return {}

    def routes_to(self, v: int) -> Routes:
        """Return the shortest routes along lanes to an intersection, from every lane (kept for next time)."""
        routes = self._routes.get(v)
        if routes is None:
            routes = self._routes[v] = shortest(v, *self._lane_graph)
        return routes

    def table(self, half_width: float) -> RoadTable:
        """Return the network as kernels read it, its roads `half_width` metres to either side (kept for next time)."""
        known = self._tables.get(half_width)
        if known is None:
            known = self._tables[half_width] = with_cells(self.rows(), [half_width])
        return known

    @cached_property
    def _tables(self) -> dict[float, RoadTable]:
        return {}

    def rows(self) -> RoadTable:
        """Return the network as kernels read it, but for the width of its roads and cells."""
        none = np.zeros(0, dtype=np.int64)
        return RoadTable(
            half_width=np.zeros(1),
            seg_off=np.array([0, len(self.segments)]),
            segment=self._segment_rows(),
            piece=table(Piece, 0) if self.is_straight else self._piece_rows(),
            ends=self.ends.copy(),
            vert_off=np.array([0, len(self.points)]),
            vertex=self._vertex_rows(),
            arms=np.array([lanes + (-1,) * (LARGEST_DEGREE - len(lanes)) for lanes in self._arms]),
            degree=self.degrees.copy(),
            grid=table(CellGrid, 1),
            **dict.fromkeys(("seg_start", "seg_item", "vert_start", "vert_item", "pave"), none),
        )

    def _segment_rows(self) -> Rows[SegmentRow]:
        rows = table(SegmentRow, len(self.segments))
        rows["x"], rows["y"] = self.points[self.ends[:, 0]].T
        rows["tx"], rows["ty"] = self.tangents.T
        rows["length"] = self.lengths
        rows["end_x"], rows["end_y"] = self.points[self.ends[:, 1]].T
        rows["first"], rows["second"] = self.ends.T
        rows["end_tx"], rows["end_ty"] = self.end_tangents.T
        rows["piece"] = rows["last"] = -1
        if not self.is_straight:
            first = self.chains.first
            rows["piece"] = np.where(self.bent, first[:-1], -1)
            rows["last"] = np.where(self.bent, first[1:] - 1, -1)
        return rows

    def _piece_rows(self) -> Rows[Piece]:
        chains = self.chains
        rows = table(Piece, len(chains.owner))
        rows["x"], rows["y"] = chains.start.T
        rows["tx"], rows["ty"] = chains.tangent.T
        rows["end_x"], rows["end_y"] = chains.end.T
        rows["end_tx"], rows["end_ty"] = chains.end_tangent.T
        rows["cx"], rows["cy"] = chains.centre.T
        rows["length"], rows["base"], rows["radius"] = chains.length, chains.base, chains.radius
        rows["rest"], rows["side"] = chains.rest, chains.side
        return rows

    def _vertex_rows(self) -> Rows[Vertex]:
        rows = table(Vertex, len(self.points))
        rows["x"], rows["y"] = self.points.T
        return rows

    def nearest_segment(self, points: npt.ArrayLike) -> tuple[Ints, Floats]:
        """Return number of and distance to the nearest segment of points (..., 2); ties: the lower number."""
        number, square = nearest(self.table(0.0), points)
        return number, np.sqrt(square)

    def nearest_intersection(self, points: npt.ArrayLike) -> tuple[Ints, Floats]:
        """Return number of and distance to the nearest intersection of points (..., 2); ties: the lower number."""
        number, square = nearest(self.table(0.0), points, vertices=True)
        return number, np.sqrt(square)

    def on_road(self, points: npt.ArrayLike, half_width: float) -> npt.NDArray[np.bool_]:
        """Whether points (..., 2) lie within `half_width` metres of a segment (its ends capped by discs)."""
        return nearest(self.table(0.0), points)[1] <= half_width * half_width

    def lane_coordinates(self, lane: int, points: npt.ArrayLike) -> tuple[Floats, Floats]:
        """Return (s, l) of points (..., 2): metres along a lane from its start, and left of the centre line."""
        return coordinates(self.table(0.0), lane, points)

    def bars(self, sagitta: float) -> Bars:
        """Return straight bars that stand for the segments: chains leave them by at most `sagitta` metres."""
        start, end = self.points[self.ends[:, 0]], self.points[self.ends[:, 1]]
        if self.is_straight:
            return Bars(np.arange(len(start)), start, end)
        return self.chains.bars(start, end, sagitta)

    @property
    def is_straight(self) -> bool:
        """Whether no segment bends."""
        return not self.corners

    @cached_property
    def chains(self) -> Chains:
        """The pieces of the segments that bend."""
        return Chains(self.segments, self.corners, self.length, self.transform)

    @cached_property
    def intersections(self) -> tuple[Point, ...]:
        """Points of the lattice's frame where roads end, sorted by x, then y."""
        points = {(x0, y0) for x0, y0, _, _ in self.segments} | {(x1, y1) for _, _, x1, y1 in self.segments}
        return tuple(sorted(points))

    @cached_property
    def _numbers(self) -> dict[Point, int]:
        return {point: v for v, point in enumerate(self.intersections)}

    @cached_property
    def points(self) -> Floats:
        """World coordinates of the intersections, (V, 2), metres."""
        return _fixed(self.to_world(np.array(self.intersections, dtype=np.float64)))

    @cached_property
    def ends(self) -> Ints:
        """Numbers of the intersections at both ends of each segment, (S, 2)."""
        return _fixed(np.array(self._end_pairs, dtype=np.int64))

    @cached_property
    def _end_pairs(self) -> tuple[tuple[int, int], ...]:
        return tuple([(self._numbers[x0, y0], self._numbers[x1, y1]) for x0, y0, x1, y1 in self.segments])

    @cached_property
    def _steps(self) -> Floats:
        """Lattice vectors from the first to the second end of each segment, (S, 2)."""
        segment = np.array(self.segments, dtype=np.float64)
        return segment[:, 2:] - segment[:, :2]

    @cached_property
    def lengths(self) -> Floats:
        """Lengths of the segments, (S,), metres; a rigid motion does not change a bit of them."""
        dx, dy = self._steps.T
        straight = self.length * np.sqrt(dx * dx + dy * dy)
        return _fixed(straight if self.is_straight else np.where(self.bent, self.chains.lengths, straight))

    @cached_property
    def bent(self) -> npt.NDArray[np.bool_]:
        """Whether each segment bends, (S,)."""
        return _fixed(np.array([bool(bends) for bends in self.corners] or [False] * len(self.segments)))

    @cached_property
    def tangents(self) -> Floats:
        """Unit vectors along the segments at their first ends, (S, 2)."""
        directions = self._directions
        if not self.is_straight:
            directions[self.bent] = self.chains.tangent[self.chains.first[:-1][self.bent]]
        return _fixed(directions)

    @cached_property
    def end_tangents(self) -> Floats:
        """Unit vectors along the segments at their second ends, (S, 2): equal to `tangents` unless they bend."""
        if self.is_straight:
            return self.tangents
        directions = self._directions
        directions[self.bent] = self.chains.end_tangent[self.chains.first[1:][self.bent] - 1]
        return _fixed(directions)

    @property
    def _directions(self) -> Floats:
        """Unit vectors from the first to the second end of each segment, (S, 2)."""
        dx, dy = self._steps.T
        norm = np.sqrt(dx * dx + dy * dy)
        return turned(np.stack([dx / norm, dy / norm], axis=-1), *sincos(self.transform[2]))

    @cached_property
    def runs(self) -> Runs:
        """The longest straight run of each segment."""
        straight = Runs(self.points[self.ends[:, 0]], self.points[self.ends[:, 1]], self.tangents, self.lengths)
        return straight if self.is_straight else self.chains.runs(straight)

    @cached_property
    def degrees(self) -> Ints:
        """Number of roads at each intersection, (V,)."""
        degrees = np.bincount(self.ends.ravel(), minlength=len(self.intersections)).astype(np.int64)
        degrees.flags.writeable = False
        return degrees

    def lane_ends(self, lane: int) -> tuple[int, int]:
        """Return the intersections in which a lane begins and ends."""
        first, second = self._end_pairs[lane >> 1]
        return (second, first) if lane & 1 else (first, second)

    def to_world(self, points: npt.ArrayLike) -> Floats:
        """Map lattice points (..., 2) to the world."""
        tx, ty, theta = self.transform
        return turned(self.length * np.asarray(points, dtype=np.float64), *sincos(theta)) + np.array([tx, ty])

    def to_lattice(self, points: npt.ArrayLike) -> Floats:
        """Map world points (..., 2) to the lattice, where they need not be whole."""
        tx, ty, theta = self.transform
        c, s = sincos(theta)
        return turned(np.asarray(points, dtype=np.float64) - np.array([tx, ty]), c, -s) / self.length

    def lane_places(self, lane: int, along: Floats) -> tuple[Floats, Floats]:
        """Return points (N, 2) so many metres along the middle of a lane's road, and unit vectors (N, 2) along it."""
        s, back = lane >> 1, bool(lane & 1)
        if self.bent[s]:
            point, way = self.chains.places(s, self.lengths[s] - along if back else along)
            return point, -way if back else way
        way = -self.tangents[s] if back else self.tangents[s]
        start = self.points[self.ends[s, 1 if back else 0]]
        return start + along[:, None] * way, np.broadcast_to(way, (len(along), 2))

    def lane_line(self, lane: int, offset: float) -> Line:
        """Return the ends of the line parallel to a lane, `offset` m left of the centre line (the right lane: -w)."""
        first, last = self.lane_curve(lane, offset)[[0, -1]].tolist()
        return (first[0], first[1]), (last[0], last[1])

    def lane_curve(self, lane: int, offset: float, sagitta: float = 0.01) -> Floats:
        """Return the corners (K, 2) of a line parallel to a lane, `offset` metres left of the centre line.

        On arcs it leaves the parallel by about `sagitta` metres at most; that of a straight lane has its two ends.
        """
        s = lane >> 1
        left = -offset if lane & 1 else offset
        if self.bent[s]:
            line, way = self.chains.places(s, self.chains.marks(s, sagitta))
        else:
            line, way = self.points[self.ends[s]], self.tangents[[s, s]]
        drawn = np.stack([line[:, 0] - left * way[:, 1], line[:, 1] + left * way[:, 0]], axis=-1)
        return drawn[::-1] if lane & 1 else drawn


def _fixed(array: npt.NDArray[Any]) -> Any:
    array.flags.writeable = False
    return array


def _number(value: float) -> float | int:
    return int(value) if value.is_integer() else value
