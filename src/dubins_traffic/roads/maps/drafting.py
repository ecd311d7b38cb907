"""From the chosen roads of a map to fitted strands, or to the strands that can't be held, each with the reason."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from math import atan2, cos, sin

import numpy as np

from dubins_traffic.kernels.arrays import Floats
from dubins_traffic.roads.maps.arms import spread
from dubins_traffic.roads.maps.conflicts import conflicts
from dubins_traffic.roads.maps.contracting import Contraction
from dubins_traffic.roads.maps.fitting import Aim, Fit, Limits, fit, line_of
from dubins_traffic.roads.maps.model import Junction, RoadMap
from dubins_traffic.roads.maps.reasons import Reason
from dubins_traffic.roads.maps.settings import ImportSettings
from dubins_traffic.roads.maps.strands import Strand, cut, strands_of
from dubins_traffic.roads.room import LARGEST_DEGREE

Drops = dict[int, Reason]
"""Strands, by their number, that can't be held, and why."""


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
        found: dict[str, list[tuple[int, bool]]] = {}
        for s, strand in enumerate(self.strands):
            found.setdefault(strand.first, []).append((s, True))
            found.setdefault(strand.last, []).append((s, False))
        return found


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
        found = Contraction(draft.strands, draft.junctions, 2.0 * self._limits.straight)
        draft.strands = found.strands
        return dict.fromkeys(found.stuck, Reason.LENGTH)

    def _crowded(self, draft: Draft) -> Drops:
        """Return the fifth roads of junctions, and roads at junctions that are too near each other."""
        ends = draft.ends()
        drops: Drops = {}
        for own in ends.values():
            spare = sorted((draft.strands[s].length, s) for s, _ in own)[: max(0, len(own) - LARGEST_DEGREE)]
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
                few = min(near, key=lambda own: sum(draft.strands[s].length for s, _ in own))
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
            found = self._kept[key]
            if found is None:
                drops[s] = Reason.ANGLE if aims and any(aim) else Reason.CURVATURE
            else:
                fits.append(found)
        draft.fits = fits
        return drops

    def _aims(self, draft: Draft) -> tuple[dict[tuple[int, bool], tuple[float, float]], Drops]:
        """Return the directions of arms that must be turned, and the roads that are too near another all the same."""
        aims: dict[tuple[int, bool], tuple[float, float]] = {}
        drops: Drops = {}
        for own in draft.ends().values():
            bearings = [_bearing(draft, s, begins) for s, begins in own]
            wanted = spread(bearings, self._settings.least_angle)
            if wanted is None:
                drops[_least_of_sharpest(draft, own, bearings)] = Reason.ANGLE
                continue
            for end, bearing, old in zip(own, wanted, bearings, strict=True):
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


def _least_of_sharpest(draft: Draft, own: list[tuple[int, bool]], bearings: list[float]) -> int:
    """Return the shorter of the two strands that make the sharpest angle."""
    pairs = [(i, j) for i in range(len(own)) for j in range(i)]
    i, j = max(pairs, key=lambda pair: cos(bearings[pair[0]] - bearings[pair[1]]))
    return min(own[i][0], own[j][0], key=lambda s: draft.strands[s].length)
