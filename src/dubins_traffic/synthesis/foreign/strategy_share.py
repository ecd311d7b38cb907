"""The metric `strategy_share`: how many of the ego's decisions a strategy of another tool made."""

from __future__ import annotations

from collections.abc import Mapping

from dubins_traffic.cars.state import Frames
from dubins_traffic.problem.instance import Instance
from dubins_traffic.record.sink import BY_STRATEGY, DECIDED, Ending
from dubins_traffic.scoring.metric import Column, Value


class StrategyShare:
    """Share of the decisions before intersections that a strategy of another tool made, and not the rules.

    A decision is due whenever the position of the game has changed while the ego is at the end of a lane
    (docs/foreign-strategies.md).
    """

    columns = (
        Column(
            "strategy_share",
            "decided by the strategy",
            "share",
            1,
            meaning="share of the decisions before intersections that the strategy made; null without any",
            short="by strategy",
        ),
    )

    def begin(self, instance: Instance) -> None:  # noqa: ARG002  # what is counted does not depend on it
        """Start counting."""
        self._made = self._due = 0

    def frames(self, frames: Frames) -> None:
        """Take the events of a block."""
        told = [event.detail for event in frames.events if event.kind == DECIDED]
        self._due += len(told)
        self._made += told.count(BY_STRATEGY)

    def end(self, ending: Ending) -> None:
        """Nothing is left to do."""

    def result(self) -> Mapping[str, Value]:
        """Return the share, None where no decision was due."""
        return {"strategy_share": self._made / self._due if self._due else None}
