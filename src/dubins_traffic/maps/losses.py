"""What was lost of a map when it became a network: by road, as a table, and as JSON."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from enum import StrEnum
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from dubins_traffic.display import count
from dubins_traffic.errors import InputError
from dubins_traffic.kernels.arrays import Floats
from dubins_traffic.maps.model import Road
from dubins_traffic.maps.polylines import dense, to_segments
from dubins_traffic.maps.settings import W


class Reason(StrEnum):
    """Reasons, as reports name them."""

    CLOSED = "not for cars"
    ONE_WAY = "one-way"
    PAIR = "two one-way roads beside each other"
    LANES = "more lanes than one in a direction"
    WIDTH = "lanes of another width"
    DEGREE = "more than four roads at a junction"
    JUNCTIONS = "junctions too near each other"
    ANGLE = "roads too near each other at a junction"
    CURVATURE = "bends too sharply, or too near a junction"
    LENGTH = "too short"
    CROSSING = "crosses another road, or lies too near it"
    APART = "not joined to the rest"


class Outcome(NamedTuple):
    """A road of the map, the lines of the network that stand for it, and why it is not as it was."""

    road: Road
    lines: tuple[Floats, ...]
    reasons: tuple[Reason, ...]


class Fate(NamedTuple):
    """What became of a road.

    Attributes
    ----------
    name : str
        Of the road in the file.
    fate : str
        ``kept``, ``altered`` or ``dropped``.
    reasons : tuple of Reason
        Why, the first being the main one.
    length, kept : float
        Metres of the road, and those of them that lie within the tolerance of the network.
    plain : bool
        Whether it has one lane in each direction, and is for cars.
    line : array (N, 2)
        Points along it, metres of the map.
    near : array (N,)
        Whether each point is within the tolerance of the network.
    """

    name: str
    fate: str
    reasons: tuple[Reason, ...]
    length: float
    kept: float
    plain: bool
    line: Floats
    near: npt.NDArray[np.bool_]


@dataclass(frozen=True, slots=True)
class Losses:
    """What became of the roads of a map.

    Parameters
    ----------
    fates : tuple of Fate
        One for each road of the map, in its order.
    tolerance : float
        Within which a road counts as kept, metres of the map.
    scale : float
        Metres of the network in one of the map.
    segments : int
        Segments of the network.
    w : float
        Half the width of the network's lanes, metres of it.
    network : tuple of array (N, 2)
        Lines of its segments, metres of the map.
    """

    fates: tuple[Fate, ...]
    tolerance: float
    scale: float
    segments: int
    w: float = W
    network: tuple[Floats, ...] = ()

    @property
    def plain_length(self) -> float:
        """Metres of roads with one lane in each direction."""
        return sum(fate.length for fate in self.fates if fate.plain)

    @property
    def length(self) -> float:
        """Metres of all roads."""
        return sum(fate.length for fate in self.fates)

    @property
    def kept_share(self) -> float:
        """Share of the length that the network keeps within the tolerance: of roads with one lane in each direction.

        Where a map has none of those, the share of all roads.
        """
        counted = [fate for fate in self.fates if fate.plain or not self.plain_length]
        return sum(fate.kept for fate in counted) / max(sum(fate.length for fate in counted), 1e-300)

    @property
    def is_whole(self) -> bool:
        """Whether nothing was dropped or altered."""
        return all(fate.fate == "kept" for fate in self.fates)

    def rows(self) -> list[tuple[str, str, int, float]]:
        """Return the table: fate, reason, number of roads, metres of them; the largest first in each fate."""
        sums: dict[tuple[str, str], tuple[int, float]] = {}
        for fate in self.fates:
            key = fate.fate, str(fate.reasons[0]) if fate.reasons else ""
            number, metres = sums.get(key, (0, 0.0))
            sums[key] = number + 1, metres + fate.length
        rows = [(*key, *value) for key, value in sums.items()]
        return sorted(rows, key=lambda row: (FATES.index(row[0]), -row[3], row[1]))

    def document(self) -> dict[str, Any]:
        """Return all of it as JSON holds it."""
        return {
            "scale": self.scale,
            "tolerance": self.tolerance,
            "segments": self.segments,
            "w": self.w,
            "one_plus_one": {
                "length": round(self.plain_length, 3),
                "kept_share": round(self.kept_share, 6) if self.plain_length else None,
            },
            "length": round(self.length, 3),
            "table": [
                {"fate": fate, "reason": reason, "roads": number, "length": round(metres, 3)}
                for fate, reason, number, metres in self.rows()
            ],
            "roads": [
                {
                    "name": fate.name,
                    "fate": fate.fate,
                    "reasons": [str(reason) for reason in fate.reasons],
                    "length": round(fate.length, 3),
                    "kept": round(fate.kept, 3),
                }
                for fate in self.fates
            ],
        }

    def lines(self) -> list[str]:
        """Return the report as lines of text."""
        plain = f"{self.plain_length:.0f} m with one lane in each direction"
        none = f"{self.length:.0f} m, none of them with one lane in each direction,"
        head = (
            f"{self.segments} segments of {len(self.fates)} roads, 1 m of the map is {self.scale:.6g} m; of "
            f"{plain if self.plain_length else none} {100.0 * self.kept_share:.1f} % kept within {self.tolerance:g} m"
        ) + ("" if self.w == W else f"; lanes of 2w, w = {self.w:.6g} m")
        rows = [("", "roads", "metres", "why"), *((a, str(n), f"{m:.0f}", b) for a, b, n, m in self.rows())]
        wide = [max(len(row[k]) for row in rows) for k in range(3)]
        table = [f"{row[0]:<{wide[0]}}  {row[1]:>{wide[1]}}  {row[2]:>{wide[2]}}  {row[3]}".rstrip() for row in rows]
        return [head, *table]


FATES = ("kept", "altered", "dropped")


class NothingHeldError(InputError):
    """Nothing of a map can be held; `losses` are those of all its roads."""

    def __init__(self, losses: Losses, file: str | None) -> None:
        self.losses = losses
        why = "; ".join(f"{reason} ({count(n, 'road')}, {metres:.0f} m)" for _, reason, n, metres in losses.rows())
        super().__init__(f"nothing of the map can be held: {why}", file=file, expected="roads that a network can hold")


def losses(outcomes: Sequence[Outcome], tolerance: float, scale: float, segments: int, w: float = W) -> Losses:
    """Return what became of roads."""
    fates = tuple(_fate(each, tolerance) for each in outcomes)
    lines = {id(line): line for each in outcomes for line in each.lines}
    return Losses(fates, tolerance, scale, segments, w, tuple(lines.values()))


def _fate(outcome: Outcome, tolerance: float) -> Fate:
    road = outcome.road
    line = dense(road.line, max(5.0 * tolerance, road.length / 5000.0))
    away = np.full(len(line), np.inf)
    for other in outcome.lines:
        away = np.minimum(away, to_segments(line, other))
    near = away <= tolerance
    reasons = outcome.reasons
    if outcome.lines and not near.all() and Reason.CURVATURE not in reasons:
        reasons = (*reasons, Reason.CURVATURE)
    name = "dropped" if not outcome.lines else "altered" if reasons else "kept"
    length = road.length
    return Fate(road.name, name, reasons, length, length * float(near.mean()), road.is_plain, line, near)
