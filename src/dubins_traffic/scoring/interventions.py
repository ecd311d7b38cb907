"""The metric `interventions`: the number of ticks in which a shield has stepped in."""

from __future__ import annotations

from dubins_traffic.cars.state import Frames
from dubins_traffic.problem.instance import Instance
from dubins_traffic.record.sink import SHIELD, Ending
from dubins_traffic.scoring.metric import Column, ScoreColumn


class Interventions:
    """Counts the ticks in which a shield has changed the ego's command (docs/shield.md)."""

    def begin(self, instance: Instance) -> None:  # noqa: ARG002  # what is counted does not depend on it
        """Start counting."""
        self._count = 0

    def frames(self, frames: Frames) -> None:
        """Take the events of a block."""
        self._count += sum(event.kind == SHIELD for event in frames.events)

    def end(self, ending: Ending) -> None:
        """Nothing is left to do."""

    def result(self) -> int:
        """Return the number of ticks."""
        return self._count


COLUMNS = (
    ScoreColumn(
        Column("interventions", "interventions of a shield", "ticks", -1, "int32", rare=True),
        lambda score: score.interventions,
    ),
)
