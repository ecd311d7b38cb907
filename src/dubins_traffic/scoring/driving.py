"""The metrics of the ego's driving: distance, standing, time off the road, departures from its lane, clearance."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from dubins_traffic.scoring.metric import Column, ScoreColumn

if TYPE_CHECKING:
    from dubins_traffic.scoring.counts import TrialCounts


@dataclass(frozen=True, slots=True)
class Driven:
    """Driving in numbers; shares are of the ticks of the trial, 0 if it has none.

    Attributes
    ----------
    distance_m : float
        Sum of the distances between the centres at consecutive frames.
    standing_share : float
        Share of the ticks in which the centre moved at less than the still speed of docs/rules.md#time, 0.05 m/s.
    off_road_s, off_road_share : float
        Ticks that end in a frame at which the ego is not on the road (docs/rules.md#on-road).
    lane_departures : int
        Frames at which the ego's body begins to reach over the centre line (docs/rules.md#left rises) and any other car
        moved, at the still speed or faster, in the tick that ends there. Frame 0 ends no tick.
    """

    distance_m: float
    standing_share: float
    off_road_s: float
    off_road_share: float
    lane_departures: int


def driven_of(counts: TrialCounts, rate: float, ticks: int) -> Driven:
    """Return these metrics of a trial of `ticks` ticks at `rate` Hz from its counts."""
    most = max(1, ticks)
    return Driven(
        counts.distance,
        counts.standing / most,
        counts.off_road / rate,
        counts.off_road / most,
        counts.departures,
    )


COLUMNS = (
    ScoreColumn(Column("distance_m", "distance", "m"), lambda score: score.driven.distance_m),
    ScoreColumn(Column("standing_share", "standing", "share", -1), lambda score: score.driven.standing_share),
    ScoreColumn(Column("off_road_s", "off the road", "s", -1), lambda score: score.driven.off_road_s),
    ScoreColumn(Column("off_road_share", "off the road", "share", -1), lambda score: score.driven.off_road_share),
    ScoreColumn(
        Column("lane_departures", "lane departures", "", -1, "int32"),
        lambda score: score.driven.lane_departures,
    ),
    ScoreColumn(Column("min_clearance_m", "least clearance", "m", 1), lambda score: score.min_clearance_m),
)
