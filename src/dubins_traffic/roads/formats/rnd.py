"""Road network descriptions (RND), version 0: the fields, checked. Every map format is read into them.

Their containers are map formats of their own: `rnd_json` and `rnd_text`.

Source: the documentation of the 2016 benchmark. A point (x, y) of the integer lattice maps to
R(theta) (length x, length y) + (tx, ty), with `transform` = [tx, ty, theta].
"""

from __future__ import annotations

import json
import math
from collections.abc import Iterable, Mapping, Sequence
from numbers import Integral, Real
from typing import Any, NamedTuple, TypeGuard, cast

from dubins_traffic.errors import InputError

Segment = tuple[int, int, int, int]

LARGEST_POINT = 1_000_000
LARGEST_GRID = 100_000
LENGTHS = (1e-3, 1e6)
WORLD = 1e6
TURNS = 1e5
DEEPEST = 100
"""Most levels of what stands under a key that version 0 does not know."""
FIELDS = ("version", "length", "transform", "shape", "segments")


class Description(NamedTuple):
    """The checked fields of a description; `extra` holds the keys that version 0 does not know."""

    segments: tuple[Segment, ...]
    length: float
    transform: tuple[float, float, float]
    shape: tuple[int, int]
    extra: dict[str, Any]


def fields(document: object) -> Description:
    """Check the fields of a description.

    Without `segments` the `shape` stands for the complete grid; without `shape` it is that of the segments.

    Raises
    ------
    InputError
        Naming the field and, for a segment, its place: ``segments[3]``.
    """
    if not isinstance(document, Mapping):
        raise InputError("not a road network", value=document, expected="an object with segments or shape")
    document = cast("Mapping[str, Any]", document)
    for name in ("version", "length"):
        if name not in document:
            raise InputError("missing", field=name, expected="0" if name == "version" else "a number > 0")
    version = document["version"]
    if not is_integer(version) or version != 0:
        raise InputError("unknown version of RND", field="version", value=version, expected="0")
    if "shape" not in document and "segments" not in document:
        raise InputError("neither segments nor shape", field="segments", expected="at least one of them")
    length = checked_length(document["length"])
    transform = checked_transform(document.get("transform", (0, 0, 0)))
    given = checked_shape(document["shape"]) if "shape" in document else None
    if "segments" in document:
        segments = checked_segments(document["segments"])
    else:
        segments = grid_segments(*given) if given else ()
    shape = given if given is not None else extent(segments)
    extra = {key: value for key, value in document.items() if key not in FIELDS}
    return Description(segments, length, transform, shape, checked_extra(extra))


def grid_segments(rows: int, columns: int) -> tuple[Segment, ...]:
    """Return the segments of the complete grid in the order of 2016."""
    if not 2 <= rows * columns <= LARGEST_GRID:
        expected = f"between 2 and {LARGEST_GRID} intersections"
        raise InputError("not the shape of a grid", field="shape", value=[rows, columns], expected=expected)
    segments: list[Segment] = []
    for x in range(columns - 1):
        for y in range(rows - 1):
            segments += [(x, y, x + 1, y), (x, y, x, y + 1)]
    segments += [(x, rows - 1, x + 1, rows - 1) for x in range(columns - 1)]
    segments += [(columns - 1, y, columns - 1, y + 1) for y in range(rows - 1)]
    return tuple(segments)


def extent(segments: Sequence[Segment]) -> tuple[int, int]:
    """Return the shape (rows, columns) of segments: (ymax - ymin + 1, xmax - xmin + 1)."""
    if not segments:
        raise InputError("no segments", field="segments", value=[], expected="at least one segment")
    xs = [x for a, _, b, _ in segments for x in (a, b)]
    ys = [y for _, a, _, b in segments for y in (a, b)]
    return max(ys) - min(ys) + 1, max(xs) - min(xs) + 1


def is_integer(value: object) -> TypeGuard[int]:
    """Whether `value` is a whole number (2.0 is one, True is not)."""
    if type(value) is int:
        return True
    if isinstance(value, bool) or not isinstance(value, Real):
        return False
    return isinstance(value, Integral) or (math.isfinite(value) and float(value).is_integer())


def is_finite(value: object) -> TypeGuard[float]:
    """Whether `value` is a number that a float64 holds and not NaN."""
    if isinstance(value, bool) or not isinstance(value, Real):
        return False
    try:
        return math.isfinite(float(value))
    except OverflowError:
        return False


def checked_length(value: object) -> float:
    """Return the length of a lattice unit in metres."""
    low, high = LENGTHS
    if not is_finite(value) or not low <= float(value) <= high:
        expected = f"a number of metres in [{low:g}, {high:g}]"
        raise InputError("not a length", field="length", value=value, expected=expected)
    return float(value)


def checked_transform(value: object) -> tuple[float, float, float]:
    """Return the rigid motion (tx, ty, theta)."""
    row = _row(value)
    if row is None or len(row) != 3:
        raise InputError("not a transform", field="transform", value=value, expected="[x, y, theta]")
    for k, (entry, bound) in enumerate(zip(row, (WORLD, WORLD, TURNS), strict=True)):
        if not is_finite(entry) or abs(entry) > bound:
            expected = f"a number in [{-bound:g}, {bound:g}]"
            raise InputError("not a transform", field=f"transform[{k}]", value=entry, expected=expected)
    return float(row[0]), float(row[1]), float(row[2])


def checked_shape(value: object) -> tuple[int, int]:
    """Return the shape (rows, columns)."""
    row = _row(value)
    if row is None or len(row) != 2:
        raise InputError("not a shape", field="shape", value=value, expected="[rows, columns]")
    for k, entry in enumerate(row):
        if not is_integer(entry) or not 1 <= entry <= 2 * LARGEST_POINT + 1:
            raise InputError("not a shape", field=f"shape[{k}]", value=entry, expected="an integer >= 1")
    rows, columns = int(row[0]), int(row[1])
    return rows, columns


def checked_segments(value: object) -> tuple[Segment, ...]:
    """Return the segments as integers [x0, y0, x1, y1]; how they lie to each other is not looked at."""
    rows = _row(value)
    if rows is None:
        expected = "a list of segments [x0, y0, x1, y1]"
        raise InputError("not a list", field="segments", value=value, expected=expected)
    segments: list[Segment] = []
    for s, entry in enumerate(rows):
        row = _row(entry)
        if row is None or len(row) != 4:
            expected = "four integers [x0, y0, x1, y1]"
            raise InputError("not a segment", field=f"segments[{s}]", value=entry, expected=expected)
        for k, number in enumerate(row):
            if not is_integer(number) or abs(number) > LARGEST_POINT:
                expected = f"an integer in [-{LARGEST_POINT}, {LARGEST_POINT}]"
                field = f"segments[{s}][{k}]"
                raise InputError("not a lattice coordinate", field=field, value=number, expected=expected)
        segments.append((int(row[0]), int(row[1]), int(row[2]), int(row[3])))
    return tuple(segments)


def checked_extra(extra: Mapping[Any, Any]) -> dict[str, Any]:
    """Return the unknown keys, if JSON can hold them in texts of Unicode, not nested too deep."""
    for key, value in extra.items():
        if not isinstance(key, str):
            raise InputError("not a key", value=key, expected="a string")
        try:
            json.dumps({key: value}, allow_nan=False, ensure_ascii=False).encode()
        except (TypeError, ValueError, RecursionError):
            raise InputError("not a JSON value", field=key, value=value) from None
        if _is_deep(value):
            raise InputError("nested too deep", field=key, expected=f"at most {DEEPEST} levels")
    return dict(extra)


def _is_deep(value: Any, levels: int = DEEPEST) -> bool:
    """Whether a JSON value has more than so many levels."""
    if isinstance(value, dict):
        return _is_deep(list(cast("dict[str, Any]", value).values()), levels)
    if not isinstance(value, list | tuple):
        return levels < 0
    return levels < 0 or any(_is_deep(item, levels - 1) for item in cast("list[Any]", value))


def _row(value: object) -> list[Any] | None:
    if isinstance(value, str | bytes | Mapping) or not hasattr(value, "__iter__"):
        return None
    return list(cast("Iterable[Any]", value))
