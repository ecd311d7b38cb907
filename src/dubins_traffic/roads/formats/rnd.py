"""Road network descriptions (RND), versions 0 and 2: the fields, checked. Every map format is read into them.

Their containers are map formats: JSON (`RndJson`) and plain text (`RndText`).

Source: the documentation of the 2016 benchmark. A point (x, y) of the integer lattice maps to
R(theta) (length x, length y) + (tx, ty), with `transform` = [tx, ty, theta]. In version 2 points
need not be whole, and a segment may go on with corners: [x0, y0, x1, y1, x, y, radius, x, y, radius, ...].
"""

from __future__ import annotations

import json
import math
import re
from collections.abc import Iterable, Mapping, Sequence
from numbers import Integral, Real
from typing import Any, NamedTuple, TypeGuard, cast

from dubins_traffic.errors import InputError
from dubins_traffic.roads.chains import Corners, Segment

LARGEST_POINT = 1_000_000
LARGEST_GRID = 100_000
LENGTHS = (1e-3, 1e6)
WORLD = 1e6
TURNS = 1e5
MOST_CORNERS = 10_000
"""Of one segment."""
DEEPEST = 100
"""Most levels of what stands under a key that version 0 does not know."""
VERSIONS = (0, 2)
FIELDS = ("version", "length", "transform", "shape", "segments")
_NUMBER = re.compile(r"[+-]?(\d+\.?\d*|\.\d+)([eE][+-]?\d+)?", re.ASCII)
_PLAIN_KEY = re.compile(r"[A-Za-z_][\w.-]*", re.ASCII)


class Description(NamedTuple):
    """The checked fields of a description; `extra` holds the keys that it does not know."""

    segments: tuple[Segment, ...]
    length: float
    transform: tuple[float, float, float]
    shape: tuple[int, int]
    extra: dict[str, Any]
    corners: tuple[Corners, ...] = ()


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
    if not is_integer(version) or version not in VERSIONS:
        raise InputError("unknown version of RND", field="version", value=version, expected="0 or 2")
    if "shape" not in document and "segments" not in document:
        raise InputError("neither segments nor shape", field="segments", expected="at least one of them")
    length = checked_length(document["length"])
    transform = checked_transform(document.get("transform", (0, 0, 0)))
    given = checked_shape(document["shape"]) if "shape" in document else None
    corners: tuple[Corners, ...] = ()
    if "segments" in document and version == 0:
        segments = checked_segments(document["segments"], lattice=True)
    elif "segments" in document:
        segments, corners = _bent(document["segments"])
    else:
        segments = grid_segments(*given) if given else ()
    shape = given if given is not None else extent(segments)
    extra = {key: value for key, value in document.items() if key not in FIELDS}
    return Description(segments, length, transform, shape, checked_extra(extra), corners)


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
    """Return the shape (rows, columns) of segments: (ymax - ymin + 1, xmax - xmin + 1), rounded down."""
    if not segments:
        raise InputError("no segments", field="segments", value=[], expected="at least one segment")
    xs = [x for a, _, b, _ in segments for x in (a, b)]
    ys = [y for _, a, _, b in segments for y in (a, b)]
    return math.floor(max(ys) - min(ys)) + 1, math.floor(max(xs) - min(xs)) + 1


def is_integer(value: object) -> TypeGuard[int]:
    """Whether `value` is a whole number (2.0 is one, True is not)."""
    if type(value) is int:
        return True
    if type(value) is float:
        return value.is_integer()
    if isinstance(value, bool) or not isinstance(value, Real):
        return False
    return isinstance(value, Integral) or (math.isfinite(value) and float(value).is_integer())


def is_finite(value: object) -> TypeGuard[float]:
    """Whether `value` is a number that a float64 holds and not NaN."""
    if type(value) is float:
        return math.isfinite(value)
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


def checked_segments(value: object, lattice: bool = False) -> tuple[Segment, ...]:
    """Return the segments [x0, y0, x1, y1], integers if `lattice`; how they lie to each other is not looked at."""
    rows = _rows(value)
    return tuple(_segment(row, s, lattice) for s, row in enumerate(rows))


def checked_corners(value: object, count: int) -> tuple[Corners, ...]:
    """Return the corners [x, y, radius] of each of `count` segments; none at all if no segment has any."""
    rows = _row(value)
    if rows is None or len(rows) not in (0, count):
        expected = f"corners [x, y, radius] for each of the {count} segments, or none"
        raise InputError("not a list", field="corners", value=value, expected=expected)
    corners = tuple(_corners(_row(entry), s, entry) for s, entry in enumerate(rows))
    return corners if any(corners) else ()


def _bent(value: object) -> tuple[tuple[Segment, ...], tuple[Corners, ...]]:
    """Return the segments of version 2, and their corners."""
    rows: list[list[Any]] = []
    for s, entry in enumerate(_rows(value)):
        row = _row(entry)
        if row is None or len(row) < 4 or (len(row) - 4) % 3:
            expected = "[x0, y0, x1, y1] and three numbers x, y, radius for each corner"
            raise InputError("not a segment", field=f"segments[{s}]", value=entry, expected=expected)
        rows.append(row)
    segments = checked_segments([row[:4] for row in rows])
    corners = [[row[k : k + 3] for k in range(4, len(row), 3)] for row in rows]
    return segments, checked_corners(corners, len(segments))


def _rows(value: object) -> list[Any]:
    rows = _row(value)
    if rows is None:
        expected = "a list of segments [x0, y0, x1, y1]"
        raise InputError("not a list", field="segments", value=value, expected=expected)
    return rows


def _segment(entry: Any, s: int, lattice: bool) -> Segment:
    row = _row(entry)
    if row is None or len(row) != 4:
        expected = "four integers [x0, y0, x1, y1]" if lattice else "four numbers [x0, y0, x1, y1]"
        raise InputError("not a segment", field=f"segments[{s}]", value=entry, expected=expected)
    kind = "an integer" if lattice else "a number"
    for k, number in enumerate(row):
        right = is_integer(number) if lattice else is_finite(number)
        if not right or abs(number) > LARGEST_POINT:
            expected = f"{kind} in [-{LARGEST_POINT}, {LARGEST_POINT}]"
            problem = "not a lattice coordinate" if lattice else "not a coordinate"
            raise InputError(problem, field=f"segments[{s}][{k}]", value=number, expected=expected)
    return _plain(row[0]), _plain(row[1]), _plain(row[2]), _plain(row[3])


def _corners(row: list[Any] | None, s: int, entry: Any) -> Corners:
    triples = None if row is None else [_row(corner) for corner in row]
    if triples is None or len(triples) > MOST_CORNERS:
        expected = f"at most {MOST_CORNERS} corners [x, y, radius]"
        raise InputError("not corners", field=f"segments[{s}]", value=entry, expected=expected)
    corners: list[tuple[float, float, float]] = []
    for k, triple in enumerate(triples):
        right = triple is not None and len(triple) == 3 and all(is_finite(number) for number in triple)
        if triple is None or not right or max(abs(number) for number in triple) > LARGEST_POINT or triple[2] <= 0:
            expected = f"[x, y, radius], a radius above 0, numbers up to {LARGEST_POINT}"
            raise InputError(f"corner {k}: not a corner", field=f"segments[{s}]", value=triple, expected=expected)
        corners.append((_plain(triple[0]), _plain(triple[1]), _plain(triple[2])))
    return tuple(corners)


def _plain(number: Any) -> float:
    """Return a number as an integer where it is whole."""
    return int(number) if is_integer(number) else float(number)


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


class RndJson:
    """Road network descriptions in JSON."""

    name = "rnd-json"
    suffixes = (".json",)
    description = "RND version 0 in JSON"

    def sniff(self, text: str) -> bool:
        """Tell whether a text is an object with segments or the shape of a grid, and not a document around one."""
        is_network = text.lstrip()[:1] == "{" and ('"segments"' in text or '"shape"' in text)
        return is_network and '"rnd"' not in text and '"problem_domain"' not in text

    def read(self, text: str, file: str | None = None) -> Mapping[str, Any]:
        """Return the document in a text."""
        return parse_json(text, file)

    def write(self, document: Mapping[str, Any]) -> str:
        """Return the text of a document."""
        return write_json(document)


def parse_json(text: str, file: str | None = None) -> dict[str, Any]:
    """Return the JSON object in `text`; keys given twice, NaN and infinities are refused."""

    def unique(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
        document: dict[str, Any] = {}
        for key, value in pairs:
            if key in document:
                raise InputError("key given twice", file=file, field=key)
            document[key] = value
        return document

    def constant(name: str) -> Any:
        raise InputError("not a JSON number", file=file, value=name, expected="a finite number")

    try:
        value = json.loads(text, object_pairs_hook=unique, parse_constant=constant)
    except json.JSONDecodeError as error:
        where = f"line {error.lineno}, column {error.colno}"
        raise InputError(f"not JSON ({error.msg}, {where})", file=file) from None
    except RecursionError:
        raise InputError("nested too deeply", file=file) from None
    except ValueError as error:
        raise InputError(f"not JSON ({error})", file=file) from None
    if not isinstance(value, dict):
        raise InputError("not a JSON object", file=file, value=value, expected="an object {...}")
    return cast("dict[str, Any]", value)


def write_json(document: Mapping[str, Any]) -> str:
    """Return the JSON text of a description, one line a key and eight segments a line."""
    lines: list[str] = []
    for key, value in document.items():
        text = json.dumps(value, allow_nan=False) if key != "segments" else _segment_lines(value)
        lines.append(f"  {json.dumps(key)}: {text}")
    return "{\n" + ",\n".join(lines) + "\n}\n"


def _segment_lines(segments: Sequence[Sequence[int]]) -> str:
    rows = [json.dumps(list(segment), allow_nan=False) for segment in segments]
    lines = [", ".join(rows[k : k + 8]) for k in range(0, len(rows), 8)]
    return "[\n    " + ",\n    ".join(lines) + "\n  ]"


class RndText:
    """Road network descriptions in plain text."""

    name = "rnd-text"
    suffixes = (".rnd", ".txt")
    description = "RND version 0 in plain text"

    def sniff(self, text: str) -> bool:
        """Tell whether a text begins with a field of version 0; `may_be` also lets other keys stand first."""
        return may_be(text) and _first(text).partition(":")[0].strip() in FIELDS

    def read(self, text: str, file: str | None = None) -> Mapping[str, Any]:
        """Return the fields in plain text.

        Raises
        ------
        InputError
            If a line is none, or a key stands twice. The fields themselves are not looked at.
        """
        document: dict[str, Any] = {}
        segments: list[list[Any]] | None = None
        for number, full in enumerate(re.split(r"\r\n|\r|\n", text), start=1):
            line = full.split("#", 1)[0].strip()
            if not line:
                continue
            if segments is not None:
                segments.append([_number(token) for token in line.split()])
                continue
            key, value = _entry(line, number, file)
            if key in document:
                raise InputError(f"key given twice (line {number})", file=file, field=key)
            if key == "segments":
                if value:
                    raise InputError(f"not a line break (line {number})", file=file, field=key, value=value)
                document[key] = segments = []
            elif key in FIELDS:
                row = [_number(token) for token in value.split()]
                document[key] = row[0] if key in {"version", "length"} and len(row) == 1 else row
            else:
                document[key] = _value(value)
        return document

    def write(self, document: Mapping[str, Any]) -> str:
        """Return the text of a document."""
        return write_lines(document)


def may_be(text: str) -> bool:
    """Tell whether a text looks like plain text of RND, whatever its first key: lines ``key: value``, and a field."""
    bare = _first(text)
    if bare[:1] in ("", "{", "[", '"') or ":" not in bare:
        return False
    return any(line.partition(":")[0].strip() in FIELDS for line in text.splitlines() if ":" in line)


def _first(text: str) -> str:
    """Return the first line that says something, without its remark."""
    bare = (line.split("#", 1)[0].strip() for line in text.splitlines())
    return next((line for line in bare if line), "")


def write_lines(document: Mapping[str, Any]) -> str:
    """Return the plain text of a description, `segments` last."""
    lines: list[str] = []
    for key, value in document.items():
        if key == "segments":
            continue
        if key in FIELDS:
            row = cast("list[Any]", value) if isinstance(value, list) else [value]
            lines.append(f"{key}: {' '.join(_json(number) for number in row)}")
        else:
            name = key if _PLAIN_KEY.fullmatch(key) else _escaped(key, "#:")
            raw = isinstance(value, str) and _value(value) == value and value == " ".join(value.split())
            plain = raw and value and "#" not in value and value.isascii()
            lines.append(f"{name}: {value if plain else _escaped(value, '#')}")
    lines.append("segments:")
    lines += [" ".join(_json(number) for number in segment) for segment in document["segments"]]
    return "\n".join(lines) + "\n"


def _entry(line: str, number: int, file: str | None) -> tuple[str, str]:
    key, colon, value = line.partition(":")
    key = key.strip()
    if not colon or not key:
        raise InputError(f"not a line of RND text (line {number})", file=file, value=line, expected="key: values")
    if key.startswith('"'):
        decoded = _value(key)
        key = decoded if isinstance(decoded, str) else key
    return key, value.strip()


def _number(token: str) -> Any:
    if not _NUMBER.fullmatch(token) or len(token) > 400:
        return token
    return float(token) if any(mark in token for mark in ".eE") else int(token)


def _value(text: str) -> Any:
    """Return the value of an unknown key in plain text: JSON if it is that, else the text itself."""
    try:
        value = json.loads(text, parse_constant=str)
        json.dumps(value, allow_nan=False)
    except (ValueError, RecursionError):
        return text
    return value


def _json(value: Any) -> str:
    return json.dumps(value, allow_nan=False)


def _escaped(value: Any, marks: str) -> str:
    """Return JSON in which the `marks` stand in strings as escapes."""
    text = _json(value)
    if not any(mark in text for mark in marks):
        return text
    if isinstance(value, str):
        for mark in marks:
            text = text.replace(mark, f"\\u{ord(mark):04x}")
        return text
    return text.replace("#", "\\u0023")
