"""The metrics of the ego's driving: distance, standing, time off the road, departures from its lane."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from dubins_traffic.cars.state import EGO, Frames
from dubins_traffic.problem.instance import Instance
from dubins_traffic.record.sink import Ending
from dubins_traffic.rules.parameters import RuleParameters
from dubins_traffic.rules.propositions import FLAG
from dubins_traffic.scoring.metric import Column, ScoreColumn


@dataclass(frozen=True, slots=True)
class Driven:
    """What `Driving` counts; shares are of the ticks of the trial, 0 if it has none.

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


class Driving:
    """Sums these metrics over the ticks of a trial."""

    def begin(self, instance: Instance) -> None:
        """Start counting."""
        self._rate = instance.problem.rate
        self._still = RuleParameters.from_mapping(instance.problem.rules).still_speed / self._rate
        self._last: Frames | None = None
        self._ticks = 0
        self._distance = 0.0
        self._standing = 0
        self._off_road = 0
        self._departures = 0

    def frames(self, frames: Frames) -> None:
        """Take a block of frames."""
        if not len(frames):
            return
        before = self._last
        x, y, bits = frames.x, frames.y, frames.bits[:, EGO]
        if before is not None:
            x, y = np.vstack([before.x[-1:], x]), np.vstack([before.y[-1:], y])
            bits = np.concatenate([before.bits[-1:, EGO], bits])
        self._last = frames
        dx, dy = np.diff(x, axis=0), np.diff(y, axis=0)
        moved = np.sqrt(dx * dx + dy * dy)
        moves = moved >= self._still
        left = (bits & FLAG.LEFT) != 0
        self._ticks += len(moved)
        self._distance = float(np.cumsum(np.concatenate([[self._distance], moved[:, EGO]]))[-1])
        self._standing += int(np.count_nonzero(~moves[:, EGO]))
        self._off_road += int(np.count_nonzero((bits[1:] & FLAG.ON_ROAD) == 0))
        self._departures += int(np.count_nonzero(left[1:] & ~left[:-1] & moves[:, 1:].any(axis=1)))

    def end(self, ending: Ending) -> None:
        """Nothing is left to do."""

    def result(self) -> Driven:
        """Return the sums up to the last frame."""
        ticks = max(1, self._ticks)
        return Driven(
            self._distance,
            self._standing / ticks,
            self._off_road / self._rate,
            self._off_road / ticks,
            self._departures,
        )


COLUMNS = (
    ScoreColumn(Column("distance_m", "distance", "m"), lambda score: score.driven.distance_m),
    ScoreColumn(Column("standing_share", "standing", "share", -1), lambda score: score.driven.standing_share),
    ScoreColumn(Column("off_road_s", "off the road", "s", -1), lambda score: score.driven.off_road_s),
    ScoreColumn(
        Column("off_road_share", "off the road", "share", -1), lambda score: score.driven.off_road_share
    ),
    ScoreColumn(
        Column("lane_departures", "lane departures", "", -1, "int32"),
        lambda score: score.driven.lane_departures,
    ),
)
