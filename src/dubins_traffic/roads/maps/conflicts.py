"""Roads that lie too near each other or to a junction of others, found on points of their lines."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence

import numpy as np

from dubins_traffic.kernels.arrays import Floats
from dubins_traffic.roads.maps.model import Junction
from dubins_traffic.roads.maps.polylines import along, dense, to_segments
from dubins_traffic.roads.maps.reasons import Reason
from dubins_traffic.roads.maps.settings import Room
from dubins_traffic.roads.maps.strands import Strand

_RUN = 256
"""Points of a line that are compared with others at once."""


def conflicts(
    strands: Sequence[Strand],
    lines: Sequence[Floats],
    junctions: Mapping[str, Junction],
    room: Room,
) -> dict[int, Reason]:
    """Return the strands that must go, so that no two are too near each other: the shorter of each such pair.

    Parameters
    ----------
    strands, lines
        Strands and the lines that are to stand for them, metres of the map.
    junctions : mapping
        All junctions by name.
    room : Room
        What the network must keep, metres of the map.
    """
    drops = {s: Reason.CROSSING for s, line in enumerate(lines) if on_itself(line, room)}
    for s, other in _near(lines, max(room.aside, room.roads)):
        if s in drops or other in drops:
            continue
        if _too_near(strands[s], strands[other], (lines[s], lines[other]), junctions, room):
            short = s if strands[s].length < strands[other].length else other
            drops[short] = Reason.CROSSING
    return drops


def _near(lines: Sequence[Floats], margin: float) -> Iterator[tuple[int, int]]:
    """Yield pairs of lines whose boxes are near each other."""
    low = np.array([line.min(axis=0) for line in lines]) - 0.5 * margin
    high = np.array([line.max(axis=0) for line in lines]) + 0.5 * margin
    for s in range(len(lines)):
        meets = ((low[s + 1 :] <= high[s]) & (high[s + 1 :] >= low[s])).all(axis=1)
        yield from ((s, s + 1 + int(k)) for k in np.flatnonzero(meets))


def _too_near(
    one: Strand,
    other: Strand,
    lines: tuple[Floats, Floats],
    junctions: Mapping[str, Junction],
    room: Room,
) -> bool:
    common = {one.first, one.last} & {other.first, other.last}
    for strand, line in ((one, lines[1]), (other, lines[0])):
        loose = [name for name in (strand.first, strand.last) if name not in common]
        places = np.array([junctions[name][:2] for name in loose]).reshape(-1, 2)
        if len(places) and float(to_segments(places, line).min()) < room.aside:
            return True
    points = dense(lines[0], 0.25 * room.roads)
    for name in common:
        away = points - np.array(junctions[name][:2])
        points = points[(away * away).sum(axis=1) > room.straight**2]
    return bool(len(points)) and float(to_segments(points, lines[1]).min()) < room.roads


def on_itself(line: Floats, room: Room) -> bool:
    """Tell whether a line comes too near itself: nearer than two roads may be, farther along than a half turn."""
    points = dense(line, 0.3 * room.roads)
    where = along(points)
    runs = [slice(k, k + _RUN) for k in range(0, len(points), _RUN)]
    low = np.array([points[run].min(axis=0) for run in runs]) - room.roads
    high = np.array([points[run].max(axis=0) for run in runs])
    for k, run in enumerate(runs):
        meets = ((low[k:] <= high[k]) & (low[k] <= high[k:])).all(axis=1)
        for other in np.flatnonzero(meets).tolist():
            rest = runs[k + other]
            step = points[run][:, None, :] - points[rest][None]
            near = (step * step).sum(axis=2) < room.roads * room.roads
            if (near & (np.abs(where[run][:, None] - where[rest][None]) > room.half_turn)).any():
                return True
    return False
