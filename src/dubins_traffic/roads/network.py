"""Road networks: straight segments between points of an integer lattice, embedded by scale and rigid motion."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, fields
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from dubins_traffic import files
from dubins_traffic.display import Pictured, count
from dubins_traffic.errors import InputError
from dubins_traffic.kernels.angles import sincos
from dubins_traffic.kernels.arrays import Floats, Ints
from dubins_traffic.roads.checks import check
from dubins_traffic.roads.formats import registry as formats
from dubins_traffic.roads.formats import rnd
from dubins_traffic.roads.formats.registry import MapFormat
from dubins_traffic.roads.formats.rnd import Segment
from dubins_traffic.roads.formats.rnd_json import write_json
from dubins_traffic.roads.formats.rnd_text import write_lines
from dubins_traffic.roads.routes import Routes, arms, shortest
from dubins_traffic.roads.surface import Surface

Line = tuple[tuple[float, float], tuple[float, float]]


@dataclass(frozen=True)
class RoadNetwork(Pictured):
    """A planar, connected network of straight roads; at most four meet at an intersection.

    Parameters
    ----------
    segments : sequence of (x0, y0, x1, y1)
        Ends of the roads, points of the integer lattice.
    length : float
        Metres of a lattice unit.
    transform : (float, float, float)
        Rigid motion tx, ty (metres), theta (radians): a point (x, y) of the lattice lies in the world at
        R(theta) (length x, length y) + (tx, ty).
    shape : (int, int)
        Rows and columns of the lattice that the segments span.
    extra : mapping
        Keys of the document that are not ours, kept.

    Raises
    ------
    InputError
        If it is no network: roads that cross or overlap, a fifth road at a point, zero length, not connected.

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

    def __post_init__(self) -> None:
        plain = {
            "segments": rnd.checked_segments(self.segments),
            "length": rnd.checked_length(self.length),
            "transform": rnd.checked_transform(self.transform),
            "shape": rnd.checked_shape(self.shape),
            "extra": rnd.checked_extra(self.extra),
        }
        for name, value in plain.items():
            object.__setattr__(self, name, value)
        check(self.segments, self.shape)
        reach = max(max(abs(number) for number in segment) for segment in self.segments)
        if self.length * reach > rnd.WORLD:
            raise InputError(
                "too large a network",
                field="length",
                value=self.length,
                expected=f"at most {rnd.WORLD:g} metres",
            )

    def __repr__(self) -> str:
        return f"<RoadNetwork {self.summary}>"

    @property
    def summary(self) -> str:
        """The network in a few words: ``17 segments, 12 intersections on a 3 x 4 lattice``."""
        rows, columns = self.shape
        segments, points = len(self.segments), len(self.intersections)
        found = f"{count(segments, 'segment')}, {count(points, 'intersection')}"
        return f"{found} on a {rows} x {columns} lattice"

    def __deepcopy__(self, memo: object) -> RoadNetwork:
        """Return this very network, which never changes."""
        return self

    def __getstate__(self) -> dict[str, Any]:
        """Leave behind, when pickled, what can be worked out again."""
        return {own.name: getattr(self, own.name) for own in fields(self)}

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
        """Return the network of an RND document, version 0; errors name `file` and the field."""
        try:
            return cls(**rnd.fields(document)._asdict())
        except InputError as error:
            raise error.within(file=file) from None

    @classmethod
    def from_text(
        cls, text: str, file: str | None = None, map_format: MapFormat | None = None
    ) -> RoadNetwork:
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
        """Return the RND document, version 0: segments written out, whole numbers as integers."""
        return {
            "version": 0,
            "length": _number(self.length),
            "transform": [_number(entry) for entry in self.transform],
            "shape": list(self.shape),
            "segments": [list(segment) for segment in self.segments],
            **self.extra,
        }

    def to_json(self) -> str:
        """Return the RND document as JSON text."""
        return write_json(self.to_document())

    def to_text(self) -> str:
        """Return the RND document as plain text."""
        return write_lines(self.to_document())

    def write(self, path: str | Path, map_format: MapFormat | None = None) -> None:
        """Write a file, whole or not at all, in the format of its suffix; of one that is none's, plain text of RND.

        `map_format` is asked before the registered ones.
        """
        form = formats.of_suffix(path, map_format)
        files.write_text(path, self.to_text() if form is None else form.write(self.to_document()))

    @property
    def size(self) -> tuple[int, int]:
        """Rows and columns, as `shape`."""
        return self.shape

    @cached_property
    def is_grid(self) -> bool:
        """Whether every segment joins two neighbours of the lattice, so that the network is a grid or part of one."""
        return all(abs(x1 - x0) + abs(y1 - y0) == 1 for x0, y0, x1, y1 in self.segments)

    @cached_property
    def intersections(self) -> tuple[tuple[int, int], ...]:
        """Lattice points where roads end, sorted by x, then y."""
        points = {(x0, y0) for x0, y0, _, _ in self.segments} | {(x1, y1) for _, _, x1, y1 in self.segments}
        return tuple(sorted(points))

    @cached_property
    def _numbers(self) -> dict[tuple[int, int], int]:
        return {point: v for v, point in enumerate(self.intersections)}

    def vertex(self, point: tuple[int, int]) -> int:
        """Return the number of the intersection at a lattice point; InputError if there is none."""
        x, y = point
        number = self._numbers.get((x, y))
        if number is None:
            expected = "the lattice point [x, y] of an intersection"
            raise InputError("not an intersection of the network", value=list(point), expected=expected)
        return number

    def vertices(self, points: Sequence[tuple[int, int]]) -> tuple[int, ...]:
        """Return the numbers of the intersections at lattice points; InputError if there is none at one of them."""
        numbers = self._numbers
        try:
            return tuple([numbers[point] for point in points])
        except KeyError:
            return tuple([self.vertex(point) for point in points])

    @cached_property
    def points(self) -> Floats:
        """World coordinates of the intersections, (V, 2), metres."""
        return _fixed(self.to_world(np.array(self.intersections, dtype=np.float64)))

    @cached_property
    def ends(self) -> Ints:
        """Numbers of the intersections at both ends of each segment, (S, 2)."""
        rows = [(self._numbers[x0, y0], self._numbers[x1, y1]) for x0, y0, x1, y1 in self.segments]
        ends = np.array(rows, dtype=np.int64)
        ends.flags.writeable = False
        return ends

    @cached_property
    def _steps(self) -> Floats:
        """Lattice vectors from the first to the second end of each segment, (S, 2)."""
        segment = np.array(self.segments, dtype=np.float64)
        return segment[:, 2:] - segment[:, :2]

    @cached_property
    def lengths(self) -> Floats:
        """Lengths of the segments, (S,), metres; a rigid motion does not change a bit of them."""
        dx, dy = self._steps.T
        return _fixed(self.length * np.sqrt(dx * dx + dy * dy))

    @cached_property
    def tangents(self) -> Floats:
        """Unit vectors along the segments, from the first end, (S, 2)."""
        dx, dy = self._steps.T
        norm = np.sqrt(dx * dx + dy * dy)
        return _fixed(_turned(np.stack([dx / norm, dy / norm], axis=-1), *sincos(self.transform[2])))

    @cached_property
    def degrees(self) -> Ints:
        """Number of roads at each intersection, (V,)."""
        degrees = np.bincount(self.ends.ravel(), minlength=len(self.intersections)).astype(np.int64)
        degrees.flags.writeable = False
        return degrees

    @property
    def lanes(self) -> int:
        """Number of lanes: two a segment."""
        return 2 * len(self.segments)

    def lane_ends(self, lane: int) -> tuple[int, int]:
        """Return the intersections in which a lane begins and ends."""
        first, second = self.ends[lane >> 1].tolist()
        return (second, first) if lane & 1 else (first, second)

    @cached_property
    def _arms(self) -> list[tuple[int, ...]]:
        return arms(self.segments, self.ends, len(self.intersections))

    def arms(self, v: int) -> tuple[int, ...]:
        """Return the lanes out of an intersection, counter-clockwise by bearing from the lattice's x axis."""
        return self._arms[v]

    def successors(self, lane: int) -> tuple[int, ...]:
        """Return the lanes that may be taken at the end of `lane`; turning round only at a dead end."""
        out = self._arms[self.lane_ends(lane)[1]]
        back = lane ^ 1
        return tuple(other for other in out if other != back) or (back,)

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

    def to_world(self, points: npt.ArrayLike) -> Floats:
        """Map lattice points (..., 2) to the world."""
        tx, ty, theta = self.transform
        turned = _turned(self.length * np.asarray(points, dtype=np.float64), *sincos(theta))
        return turned + np.array([tx, ty])

    def to_lattice(self, points: npt.ArrayLike) -> Floats:
        """Map world points (..., 2) to the lattice, where they need not be whole."""
        tx, ty, theta = self.transform
        c, s = sincos(theta)
        return _turned(np.asarray(points, dtype=np.float64) - np.array([tx, ty]), c, -s) / self.length

    @cached_property
    def surface(self) -> Surface:
        """The segments and intersections in the world, with look-up by place."""
        return Surface(self.points, self.ends, self.tangents, self.lengths)

    def nearest_segment(self, points: npt.ArrayLike) -> tuple[Ints, Floats]:
        """Return number of and distance to the nearest segment of points (..., 2); ties: the lower number."""
        return self.surface.nearest_segment(points)

    def nearest_intersection(self, points: npt.ArrayLike) -> tuple[Ints, Floats]:
        """Return number of and distance to the nearest intersection of points (..., 2); ties: the lower number."""
        return self.surface.nearest_vertex(points)

    def on_road(self, points: npt.ArrayLike, half_width: float) -> npt.NDArray[np.bool_]:
        """Whether points (..., 2) lie within `half_width` metres of a segment (its ends capped by discs)."""
        return self.surface.on_road(points, half_width)

    def lane_coordinates(self, lane: int, points: npt.ArrayLike) -> tuple[Floats, Floats]:
        """Return (s, l) of points (..., 2): metres along a lane from its start, and left of the centre line."""
        return self.surface.lane_coordinates(lane, points)

    def lane_line(self, lane: int, offset: float) -> Line:
        """Return the line parallel to a lane, `offset` metres left of the centre line: the right lane's is -w."""
        start, end = self.lane_ends(lane)
        tx, ty = self.tangents[lane >> 1].tolist()
        left = -offset if lane & 1 else offset
        (x0, y0), (x1, y1) = self.points[start].tolist(), self.points[end].tolist()
        return (x0 - left * ty, y0 + left * tx), (x1 - left * ty, y1 + left * tx)


def _turned(vectors: Floats, c: float, s: float) -> Floats:
    x, y = vectors[..., 0], vectors[..., 1]
    return np.stack([c * x - s * y, s * x + c * y], axis=-1)


def _fixed(array: Floats) -> Floats:
    array.flags.writeable = False
    return array


def _number(value: float) -> float | int:
    return int(value) if value.is_integer() else value
