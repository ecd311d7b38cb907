"""Is it a network? Planar, connected, at most four roads a point; for straight roads on the lattice exact, in integers.

Every fault is an InputError that names the segment: ``segments[3]``.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from dubins_traffic.errors import InputError
from dubins_traffic.kernels.arrays import Ints
from dubins_traffic.roads.cells import covered, pairs
from dubins_traffic.roads.crossings import first_crossing
from dubins_traffic.roads.formats.rnd import Corners, Segment, extent
from dubins_traffic.roads.room import LARGEST_DEGREE

OFF_LATTICE = 0.37
"""Moves the borders of cells off the lattice, so that roads along it lie in few cells."""


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
    start, end = segment[:, :2].astype(np.float64), segment[:, 2:].astype(np.float64)
    size = max(1.0, float(np.abs(end - start).max(axis=1).mean()))
    found: list[Ints] = []
    for i, j in pairs(*covered(start + OFF_LATTICE, end + OFF_LATTICE, 0.0, size)):
        bad = (i != j) & _meet(segment[i], segment[j])
        found.append(np.stack([np.minimum(i, j), np.maximum(i, j)], axis=-1)[bad])
    return np.unique(np.concatenate(found), axis=0) if found else np.empty((0, 2), dtype=np.int64)


def _check_planar(segment: Ints) -> None:
    """Refuse segments that meet elsewhere than at common ends."""
    found = meetings(segment)
    if len(found):
        earlier, later = min(found.tolist(), key=lambda pair: (pair[1], pair[0]))
        rows = [(int(a), int(b), int(c), int(d)) for a, b, c, d in segment]
        problem = f"{_how(segment[earlier], segment[later])} segments[{earlier}]"
        raise _fault(rows, later, problem, "roads that meet at common ends only")


def _check_apart(segments: Sequence[Segment], corners: Sequence[Corners]) -> None:
    """Refuse chains of lines and arcs that meet elsewhere than at common ends, and that meet themselves."""
    found = first_crossing(segments, corners)
    if found is not None:
        earlier, later = found
        problem = "crosses itself" if earlier == later else f"meets segments[{earlier}]"
        raise _fault(segments, later, problem, "roads that meet at common ends only")


def _cross(ax: Ints, ay: Ints, bx: Ints, by: Ints) -> Ints:
    return ax * by - ay * bx


def _sides(p: Ints, q: Ints) -> tuple[Ints, Ints]:
    """Return on which side of each segment of p (N, 4) the ends of those of q lie: signs."""
    dx, dy = p[:, 2] - p[:, 0], p[:, 3] - p[:, 1]
    first = np.sign(_cross(dx, dy, q[:, 0] - p[:, 0], q[:, 1] - p[:, 1]))
    second = np.sign(_cross(dx, dy, q[:, 2] - p[:, 0], q[:, 3] - p[:, 1]))
    return first, second


def _meet(p: Ints, q: Ints) -> np.ndarray[tuple[int], np.dtype[np.bool_]]:
    """Whether segments p and q (N, 4) share a point other than one common end."""
    p0, p1, q0, q1 = p[:, :2], p[:, 2:], q[:, :2], q[:, 2:]
    a0, a1 = _sides(p, q)
    b0, b1 = _sides(q, p)
    aligned = (a0 == 0) & (a1 == 0)
    low = np.maximum(np.minimum(p0, p1), np.minimum(q0, q1))
    high = np.minimum(np.maximum(p0, p1), np.maximum(q0, q1))
    boxes = (low <= high).all(axis=1)
    inside = (low < high).any(axis=1)
    common = np.zeros(len(p), dtype=np.bool_)
    for one in (p0, p1):
        for other in (q0, q1):
            common |= (one == other).all(axis=1)
    apart = (a0 * a1 <= 0) & (b0 * b1 <= 0) & boxes
    return np.where(common, aligned & boxes & inside, apart)


def _how(p: Ints, q: Ints) -> str:
    a0, a1 = (int(side[0]) for side in _sides(p[None], q[None]))
    b0, b1 = (int(side[0]) for side in _sides(q[None], p[None]))
    if a0 == a1 == 0:
        return "overlaps"
    if 0 in (a0, a1):
        return "ends in the middle of"
    return "passes through an end of" if 0 in (b0, b1) else "crosses"


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
