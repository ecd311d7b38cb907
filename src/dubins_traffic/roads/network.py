"""Road networks: segments, straight or bent, between points of a plane, embedded by scale and rigid motion."""

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
from dubins_traffic.kernels.arrays import Floats, Ints
from dubins_traffic.roads.chains import sides
from dubins_traffic.roads.checks import check
from dubins_traffic.roads.embedding import Embedding, Point
from dubins_traffic.roads.formats import registry as formats
from dubins_traffic.roads.formats import rnd
from dubins_traffic.roads.formats.registry import MapFormat
from dubins_traffic.roads.formats.rnd import Corners, Segment
from dubins_traffic.roads.formats.rnd_json import write_json
from dubins_traffic.roads.formats.rnd_text import write_lines
from dubins_traffic.roads.routes import Routes, arms, shortest
from dubins_traffic.roads.surface import Surface


@dataclass(frozen=True)
class RoadNetwork(Embedding, Pictured):
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
        that radius, tangent to both sides (`roads.chain`). Empty where all are straight.

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

    def __repr__(self) -> str:
        return f"<RoadNetwork {self.summary}>"

    @property
    def summary(self) -> str:
        """The network in a few words: ``17 segments, 12 intersections on a 3 x 4 lattice``; metres where off it."""
        rows, columns = self.shape
        segments, points = len(self.segments), len(self.intersections)
        found = f"{count(segments, 'segment')}, {count(points, 'intersection')}"
        bent = sum(1 for own in self.corners if own)
        if self.on_lattice:
            place = f"on a {rows} x {columns} lattice"
        else:
            width, height = np.ptp(self.points, axis=0)
            place = f"on {width:.0f} x {height:.0f} m"
        return f"{found} {place}" + (f", {bent} bent" if bent else "")

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
        """Return the network of an RND document; errors name `file` and the field."""
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
        """Return the RND document: segments written out, whole numbers as integers; version 0 wherever that says it."""
        rows = [list(segment) for segment in self.segments]
        for row, own in zip(rows, self.corners, strict=False):
            row += [number for corner in own for number in corner]
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

    def write(
        self, path: str | Path, map_format: MapFormat | None = None, *, overwrite: bool = False
    ) -> None:
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
    def _arms(self) -> list[tuple[int, ...]]:
        return arms(self._sides, self.ends, len(self.intersections))

    @cached_property
    def _sides(self) -> list[Segment]:
        """The first and the last side (dx, dy) of each segment's polygon, in the lattice's frame."""
        return sides(self.segments, self.corners)

    def arms(self, v: int) -> tuple[int, ...]:
        """Return the lanes out of an intersection, counter-clockwise by bearing there from the lattice's x axis."""
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

    @cached_property
    def surface(self) -> Surface:
        """The segments and intersections in the world, with look-up by place."""
        return Surface(
            self.points, self.ends, self.tangents, self.lengths, None if self.is_straight else self.chains
        )

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


def _number(value: float) -> float | int:
    return int(value) if value.is_integer() else value
