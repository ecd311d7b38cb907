"""Is it a network? Planar, connected, at most four roads a point; for straight roads on the lattice exact, in integers.

Every fault is an InputError that names the segment: ``segments[3]``. Chains of lines and arcs are compared piece
by piece.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from math import sqrt

import numpy as np

from dubins_traffic.errors import InputError
from dubins_traffic.kernels.arrays import Ints
from dubins_traffic.roads.chains import ChainPiece, Corners, Point, Segment, chain, pieces
from dubins_traffic.roads.closeness import finder
from dubins_traffic.roads.cover import covered, pairs
from dubins_traffic.roads.formats.rnd import extent
from dubins_traffic.roads.room import LARGEST_DEGREE

NEAR = 1e-7
"""Share of the extent of two pieces within which points are one."""


def check(segments: Sequence[Segment], shape: tuple[int, int], corners: Sequence[Corners] = ()) -> None:
    """Raise InputError unless the segments, with their `corners`, form a network of this shape."""
    measured = extent(segments)
    _check_each(segments)
    if not corners and all(isinstance(number, int) for segment in segments for number in segment):
        _check_planar(np.array(segments, dtype=np.int64))
    else:
        _check_apart(segments, corners)
    _check_connected(segments)
    if tuple(shape) != measured:
        raise InputError(
            "shape differs from that of the segments",
            field="shape",
            value=list(shape),
            expected=f"{list(measured)}, that is [ymax - ymin + 1, xmax - xmin + 1]",
        )


def _check_each(segments: Sequence[Segment]) -> None:
    """Refuse segments without length, given twice, or the fifth at a point."""
    seen: dict[Segment, int] = {}
    degree: dict[tuple[float, float], int] = {}
    for s, (x0, y0, x1, y1) in enumerate(segments):
        a, b = (x0, y0), (x1, y1)
        if a == b:
            raise _fault(segments, s, "zero length", "two different ends")
        twin = seen.setdefault((*min(a, b), *max(a, b)), s)
        if twin != s:
            raise _fault(segments, s, f"the same road as segments[{twin}]", "every road once")
        for point in (a, b):
            degree[point] = degree.get(point, 0) + 1
            if degree[point] > LARGEST_DEGREE:
                problem = f"a fifth road at the intersection {list(point)}"
                raise _fault(segments, s, problem, f"at most {LARGEST_DEGREE} roads at a point")


def meetings(segment: Ints) -> Ints:
    """Return the pairs (K, 2) of segments (S, 4) that meet elsewhere than at a common end; the lower number first."""
    search = finder(0, len(segment), 0)
    search.put_bars(segment[:, :2].astype(np.float64), segment[:, 2:].astype(np.float64))
    met = search.meetings()[:, 2:]
    return met[np.lexsort((met[:, 1], met[:, 0]))]


def _check_planar(segment: Ints) -> None:
    """Refuse segments that meet elsewhere than at common ends."""
    met = meetings(segment)
    if len(met):
        earlier, later = min(met.tolist(), key=lambda pair: (pair[1], pair[0]))
        rows = [(int(a), int(b), int(c), int(d)) for a, b, c, d in segment]
        problem = f"{_how(segment[earlier], segment[later])} segments[{earlier}]"
        raise _fault(rows, later, problem, "roads that meet at common ends only")


def _check_apart(segments: Sequence[Segment], corners: Sequence[Corners]) -> None:
    """Refuse chains of lines and arcs that meet elsewhere than at common ends, and that meet themselves."""
    pair = first_crossing(segments, corners)
    if pair is not None:
        earlier, later = pair
        problem = "crosses itself" if earlier == later else f"meets segments[{earlier}]"
        raise _fault(segments, later, problem, "roads that meet at common ends only")


def _how(p: Ints, q: Ints) -> str:
    """Return how the segment q meets p."""
    a0, a1 = (_side(p, q[k : k + 2]) for k in (0, 2))
    b0, b1 = (_side(q, p[k : k + 2]) for k in (0, 2))
    if a0 == a1 == 0:
        return "overlaps"
    if 0 in (a0, a1):
        return "ends in the middle of"
    return "passes through an end of" if 0 in (b0, b1) else "crosses"


def _side(p: Ints, point: Ints) -> int:
    """Return a number that is 0 for a point in line with the segment p."""
    (x0, y0, x1, y1), (x, y) = p.tolist(), point.tolist()
    return (x1 - x0) * (y - y0) - (y1 - y0) * (x - x0)


def _check_connected(segments: Sequence[Segment]) -> None:
    """Refuse segments that can't be reached from the first."""
    roads: dict[tuple[float, float], list[tuple[float, float]]] = {}
    for x0, y0, x1, y1 in segments:
        roads.setdefault((x0, y0), []).append((x1, y1))
        roads.setdefault((x1, y1), []).append((x0, y0))
    begin = (segments[0][0], segments[0][1])
    reached = {begin}
    waiting = [begin]
    while waiting:
        for point in roads[waiting.pop()]:
            if point not in reached:
                reached.add(point)
                waiting.append(point)
    for s, (x0, y0, _, _) in enumerate(segments):
        if (x0, y0) not in reached:
            raise _fault(segments, s, "disconnected from segments[0]", "one connected network")


def _fault(segments: Sequence[Segment], s: int, problem: str, expected: str) -> InputError:
    return InputError(problem, field=f"segments[{s}]", value=list(segments[s]), expected=expected)


def first_crossing(segments: Sequence[Segment], corners: Sequence[Corners]) -> tuple[int, int] | None:
    """Return the first pair of segments (earlier, later) that meet, or twice one that meets itself; None if none does.

    Raises
    ------
    InputError
        If the arcs of a segment do not fit: it names segment and corner.
    """
    bent = pieces(segments, corners)
    chains = [bend or chain(row[:2], (), row[2:]) for bend, row in zip(bent, segments, strict=True)]
    owner = [s for s, chain in enumerate(chains) for _ in chain]
    rows = [piece for chain in chains for piece in chain]
    shared = [frozenset(((row[0], row[1]), (row[2], row[3]))) for row in segments]
    crossings: list[tuple[int, int]] = []
    for i, j in _candidates(rows):
        s, other = owner[i], owner[j]
        if s == other and _follow(rows[i : j + 1]):
            continue
        common = shared[s] & shared[other] if s != other else frozenset[Point]()
        if _pieces_meet(rows[i], rows[j], common):
            crossings.append((min(s, other), max(s, other)))
    return min(crossings, key=lambda pair: (pair[1], pair[0]), default=None)


def _follow(row: Sequence[ChainPiece]) -> bool:
    """Whether the last of some pieces of a chain begins where the first one ends, but for what rounding may leave."""
    between = sum(piece.length for piece in row[1:-1])
    return between <= 4.0 * NEAR * (row[0].length + row[-1].length)


def _candidates(rows: Sequence[ChainPiece]) -> Iterator[tuple[int, int]]:
    """Yield the pairs of pieces that are near each other, each once."""
    boxes = [_box(piece) for piece in rows]
    spans = np.array([(x0, y0, x1, y1) for x0, y0, x1, y1 in boxes])
    size = float((spans[:, 2:] - spans[:, :2]).max(axis=1).mean())
    chords = np.array([(p.x, p.y, p.end_x, p.end_y) for p in rows])
    bulge = max((_bulge(piece) for piece in rows), default=0.0)
    item, column, row = covered(chords[:, :2], chords[:, 2:], bulge + NEAR * size, size)
    seen: set[tuple[int, int]] = set()
    for first, second in pairs(item, column, row):
        low, high = np.minimum(first, second), np.maximum(first, second)
        apart = low < high
        low, high = low[apart], high[apart]
        slack = NEAR * size
        over = (spans[low, :2] <= spans[high, 2:] + slack) & (spans[high, :2] <= spans[low, 2:] + slack)
        near = over.all(axis=1)
        seen.update(zip(low[near].tolist(), high[near].tolist(), strict=True))
    yield from sorted(seen)


def _bulge(piece: ChainPiece) -> float:
    """Return how far an arc leaves its chord."""
    if piece.side == 0.0:
        return 0.0
    cosine = sqrt(max(0.5 + 0.5 * (piece.tx * piece.end_tx + piece.ty * piece.end_ty), 0.0))
    return piece.radius * (1.0 - cosine)


def _box(piece: ChainPiece) -> tuple[float, float, float, float]:
    """Return a box about a piece."""
    grown = _bulge(piece)
    return (
        min(piece.x, piece.end_x) - grown,
        min(piece.y, piece.end_y) - grown,
        max(piece.x, piece.end_x) + grown,
        max(piece.y, piece.end_y) + grown,
    )


def _pieces_meet(p: ChainPiece, q: ChainPiece, common: frozenset[Point]) -> bool:
    """Whether two pieces share a point other than the `common` ends of their segments."""
    near = NEAR * (p.length + q.length)
    ends = [(p.x, p.y), (p.end_x, p.end_y), (q.x, q.y), (q.end_x, q.end_y)]
    for x, y in [*ends, *_intersections(p, q)]:
        if not (_covers(p, x, y, near) and _covers(q, x, y, near)):
            continue
        if all(max(abs(x - cx), abs(y - cy)) > 4.0 * near for cx, cy in common):
            return True
    return False


def _intersections(p: ChainPiece, q: ChainPiece) -> list[Point]:
    """Return the points in which the lines or circles of two pieces cross; none where they are parallel or apart."""
    if p.side != 0.0 and q.side != 0.0:
        return _of_circles(p, q)
    if p.side != 0.0:
        p, q = q, p
    if q.side != 0.0:
        return _of_circle(p.x, p.y, p.tx, p.ty, q)
    cross = p.tx * q.ty - p.ty * q.tx
    if abs(cross) < NEAR:
        return []
    along = ((q.x - p.x) * q.ty - (q.y - p.y) * q.tx) / cross
    return [(p.x + along * p.tx, p.y + along * p.ty)]


def _of_circle(x: float, y: float, tx: float, ty: float, arc: ChainPiece) -> list[Point]:
    """Return where the line through (x, y) with direction (tx, ty) crosses the circle of an arc."""
    along = (arc.cx - x) * tx + (arc.cy - y) * ty
    off = tx * (arc.cy - y) - ty * (arc.cx - x)
    square = arc.radius * arc.radius - off * off
    if square < 0.0:
        return []
    half = sqrt(square)
    return [(x + s * tx, y + s * ty) for s in (along - half, along + half)]


def _of_circles(p: ChainPiece, q: ChainPiece) -> list[Point]:
    dx, dy = q.cx - p.cx, q.cy - p.cy
    apart = sqrt(dx * dx + dy * dy)
    if apart <= NEAR * (p.radius + q.radius):
        return []
    along = 0.5 * (apart + (p.radius - q.radius) * (p.radius + q.radius) / apart)
    x, y = p.cx + along * dx / apart, p.cy + along * dy / apart
    return _of_circle(x, y, -dy / apart, dx / apart, p)


def _covers(piece: ChainPiece, x: float, y: float, near: float) -> bool:
    """Whether a point lies on a piece, its ends included."""
    if piece.side == 0.0:
        rx, ry = x - piece.x, y - piece.y
        along, aside = rx * piece.tx + ry * piece.ty, piece.tx * ry - piece.ty * rx
        return -near <= along <= piece.length + near and abs(aside) <= near
    ox, oy = x - piece.cx, y - piece.cy
    on = abs(sqrt(ox * ox + oy * oy) - piece.radius) <= near
    return on and ox * piece.tx + oy * piece.ty >= -near and ox * piece.end_tx + oy * piece.end_ty <= near
