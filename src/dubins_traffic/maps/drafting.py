"""From the chosen roads of a map to fitted strands, or to the strands that can't be held, each with the reason."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from math import atan2, cos, pi, sin

import numpy as np

from dubins_traffic.kernels.arrays import Floats
from dubins_traffic.maps.fitting import Aim, Fit, Limits, fit, line_of
from dubins_traffic.maps.losses import Reason
from dubins_traffic.maps.model import Junction, RoadMap
from dubins_traffic.maps.polylines import along, dense, to_segments
from dubins_traffic.maps.settings import ImportSettings, Room
from dubins_traffic.maps.strands import Contraction, Strand, cut, strands_of
from dubins_traffic.roads.room import LARGEST_DEGREE

Drops = dict[int, Reason]
"""Strands, by their number, that can't be held, and why."""
_RUN = 256
"""Points of a line that are compared with others at once."""
MOST_TURNED = 0.5
"""An arm may be turned by at most this, radians."""
_ROUNDS = 400


@dataclass(slots=True)
class Draft:
    """Strands between junctions, with their fits; `gone` are the roads that had to go, with the reason."""

    strands: list[Strand]
    junctions: dict[str, Junction]
    fits: list[Fit] = field(default_factory=list[Fit])
    gone: dict[int, Reason] = field(default_factory=dict[int, Reason])

    def drop(self, drops: Mapping[int, Reason]) -> bool:
        """Note the roads of strands as gone; tell whether there were any."""
        for s, reason in drops.items():
            self.gone |= dict.fromkeys(self.strands[s].roads, reason)
        return bool(drops)

    def ends(self) -> dict[str, list[tuple[int, bool]]]:
        """Return which strands meet at each junction, and whether each begins there."""
        by_place: dict[str, list[tuple[int, bool]]] = {}
        for s, strand in enumerate(self.strands):
            by_place.setdefault(strand.first, []).append((s, True))
            by_place.setdefault(strand.last, []).append((s, False))
        return by_place


class Drafter:
    """Makes drafts of one map; fits are kept between them."""

    def __init__(self, road_map: RoadMap, settings: ImportSettings, scale: float) -> None:
        self._map = road_map
        self._settings = settings
        self._scale = scale
        self._limits: Limits = settings.limits(scale)
        self._kept: dict[object, Fit | None] = {}

    def draft(self, numbers: Iterable[int]) -> Draft:
        """Return the draft of some roads, with fits if none had to go."""
        roads = self._map.roads
        draft = Draft(strands_of(roads, numbers, self._map.junctions), dict(self._map.junctions))
        if draft.drop(self._contract(draft)):
            return draft
        before = {number for strand in draft.strands for number in strand.roads}
        draft.strands, added = cut(draft.strands, 1.2 * self._limits.straight)
        draft.junctions |= added
        after = {number for strand in draft.strands for number in strand.roads}
        draft.gone |= dict.fromkeys(before - after, Reason.LENGTH)
        if draft.gone or draft.drop(self._crowded(draft)):
            return draft
        if draft.drop(self._fit(draft, {})):
            return draft
        aims, sharp = self._aims(draft)
        if draft.drop(sharp) or draft.drop(self._fit(draft, aims)):
            return draft
        lines = [self._line(draft, s) for s in range(len(draft.strands))]
        draft.drop(conflicts(draft.strands, lines, draft.junctions, self._settings.room(self._scale)))
        return draft

    def _contract(self, draft: Draft) -> Drops:
        """Draw the ends of strands that are too short together; return those with which that can't be done."""
        contraction = Contraction(draft.strands, draft.junctions, 2.0 * self._limits.straight)
        draft.strands = contraction.strands
        return dict.fromkeys(contraction.stuck, Reason.LENGTH)

    def _crowded(self, draft: Draft) -> Drops:
        """Return the fifth roads of junctions, and roads at junctions that are too near each other."""
        ends = draft.ends()
        drops: Drops = {}
        for ends_there in ends.values():
            spare = sorted((draft.strands[s].length, s) for s, _ in ends_there)[
                : max(0, len(ends_there) - LARGEST_DEGREE)
            ]
            drops |= {s: Reason.DEGREE for _, s in spare}
        if drops:
            return drops
        names = list(ends)
        places = np.array([draft.junctions[name][:2] for name in names])
        apart = self._settings.room(self._scale).apart
        for k in range(len(names) - 1):
            step = places[k + 1 :] - places[k]
            for other in np.flatnonzero((step * step).sum(axis=1) < apart * apart).tolist():
                near = ends[names[k]], ends[names[k + 1 + other]]
                few = min(near, key=lambda pair: sum(draft.strands[s].length for s, _ in pair))
                drops[min(few, key=lambda end: draft.strands[end[0]].length)[0]] = Reason.JUNCTIONS
        return drops

    def _fit(self, draft: Draft, aims: dict[tuple[int, bool], tuple[float, float]]) -> Drops:
        """Fit all strands, in given directions at some ends; return those that can't be fitted."""
        drops: Drops = {}
        fits: list[Fit] = []
        for s, strand in enumerate(draft.strands):
            aim: tuple[Aim, Aim] = aims.get((s, True)), aims.get((s, False))
            key = strand.line.tobytes(), aim
            if key not in self._kept:
                self._kept[key] = fit(strand.line, self._limits, aim)
            fitted = self._kept[key]
            if fitted is None:
                drops[s] = Reason.ANGLE if aims and any(aim) else Reason.CURVATURE
            else:
                fits.append(fitted)
        draft.fits = fits
        return drops

    def _aims(self, draft: Draft) -> tuple[dict[tuple[int, bool], tuple[float, float]], Drops]:
        """Return the directions of arms that must be turned, and the roads that are too near another all the same."""
        aims: dict[tuple[int, bool], tuple[float, float]] = {}
        drops: Drops = {}
        for ends in draft.ends().values():
            bearings = [_bearing(draft, s, begins) for s, begins in ends]
            wanted = spread(bearings, self._settings.least_angle)
            if wanted is None:
                drops[_least_of_sharpest(draft, ends, bearings)] = Reason.ANGLE
                continue
            for end, bearing, old in zip(ends, wanted, bearings, strict=True):
                if abs(bearing - old) > 1e-9:
                    aims[end] = (cos(bearing), sin(bearing))
        return aims, drops

    def _line(self, draft: Draft, s: int) -> Floats:
        strand = draft.strands[s]
        return line_of(strand.line[0], draft.fits[s], strand.line[-1], self._limits)


def _bearing(draft: Draft, s: int, begins: bool) -> float:
    line, corners = draft.strands[s].line, draft.fits[s].corners
    here, there = (line[0], line[-1]) if begins else (line[-1], line[0])
    x, y = corners[0 if begins else -1][:2] if corners else there
    return atan2(y - here[1], x - here[0])


def _least_of_sharpest(draft: Draft, ends: list[tuple[int, bool]], bearings: list[float]) -> int:
    """Return the shorter of the two strands that make the sharpest angle."""
    pairs = [(i, j) for i in range(len(ends)) for j in range(i)]
    i, j = max(pairs, key=lambda pair: cos(bearings[pair[0]] - bearings[pair[1]]))
    return min(ends[i][0], ends[j][0], key=lambda s: draft.strands[s].length)


def conflicts(
    strands: Sequence[Strand], lines: Sequence[Floats], junctions: Mapping[str, Junction], room: Room
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
    one: Strand, other: Strand, lines: tuple[Floats, Floats], junctions: Mapping[str, Junction], room: Room
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


def spread(bearings: list[float], least: float) -> list[float] | None:
    """Return bearings that are at least `least` radians apart, near the given ones; None if none are near enough.

    Two neighbours that are too near are turned away from each other by the same amount, again and again.

    Parameters
    ----------
    bearings : list of float
        Of the arms, radians, in any order.
    least : float
        Least angle between two of them.
    """
    if len(bearings) * least > 2.0 * pi:
        return None
    order = sorted(range(len(bearings)), key=lambda k: bearings[k] % (2.0 * pi))
    now = [bearings[k] % (2.0 * pi) for k in order]
    for _ in range(_ROUNDS):
        worst = 0.0
        for k in range(len(now)):
            following = (k + 1) % len(now)
            gap = now[following] - now[k] + (2.0 * pi if following <= k else 0.0)
            lack = least - gap
            if lack > 0.0 and following != k:
                now[k] -= 0.5 * lack
                now[following] += 0.5 * lack
                worst = max(worst, lack)
        if worst < 1e-6:
            break
    else:
        return None
    made = list(bearings)
    for k, bearing in zip(order, now, strict=True):
        change = (bearing - bearings[k] + pi) % (2.0 * pi) - pi
        if abs(change) > MOST_TURNED:
            return None
        made[k] = bearings[k] + change
    return made
