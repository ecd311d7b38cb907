"""Cars that stand, and drive on when `rules` passes them: it breaks nothing, and is back as soon as they let it."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import pytest

from dubins_traffic.cars.state import EGO, Labels, State
from dubins_traffic.controllers.rules import Rules
from dubins_traffic.kernels.arrays import Floats
from dubins_traffic.problem.instance import Instance
from dubins_traffic.rules.propositions import FLAG
from dubins_traffic.scoring.score import Score, Scorer
from dubins_traffic.simulators.embedded import Embedded
from dubins_traffic.trial.trial import Trial, run
from tests.property.test_shield_return import FASTEST, PERIOD, START, Sides, along, standing
from tests.unit.test_law import W, broken, on_grid

Chooses = Callable[[int, float, State], float]
"""A car's speed, by its number and for how long the ego has been left, seconds."""
BOX = {"body": {"rectangle": {"length": 0.4, "width": 0.25}}}


class Standing:
    """Drives all e-agents straight on: each stands until the ego is left for the first time, then a function says."""

    def __init__(self, chooses: Chooses) -> None:
        self._chooses = chooses
        self._since = -1

    def reset(self, instances: Sequence[Instance], state: State) -> None:
        """Nothing of the batch matters."""

    def decide(self, tick: int, state: State, labels: Labels, commands: Floats) -> None:
        """Write the commands."""
        if self._since < 0 and int(labels.bits[0, EGO]) & FLAG.LEFT:
            self._since = tick
        for n in range(1, state.x.shape[1]):
            speed = self._chooses(n, (tick - self._since) * PERIOD, state) if self._since >= 0 else 0.0
            commands[0, n] = min(max(speed, -FASTEST), FASTEST), 0.0


def keeps_beside(_n: int, seconds: float, state: State) -> float:
    """Be beside the ego and a little ahead of it, as far as it goes; enter the crossing after a while, as one may."""
    ahead = along(state, EGO) + 0.1 - along(state, 1)
    return min(max(ahead / PERIOD, -0.02), FASTEST) if seconds < 9.0 else FASTEST


def moves_up(n: int, _seconds: float, state: State) -> float:
    """Stand, and move up once beside the ego, to where it would return."""
    beside = along(state, EGO) > along(state, n)
    return (3.4 - along(state, n)) / PERIOD if beside or along(state, n) > 3.01 else 0.0


def opposed(instance: Instance, chooses: Chooses) -> tuple[Score, list[int]]:
    """Return the score of `rules` against these cars, and for how many ticks it was left each time."""
    scorer, sides = Scorer(), Sides()
    with Trial(instance, simulator=Embedded(), agents=[Standing(chooses)], sinks=[scorer, sides]) as trial:
        run(trial, Rules())
    return scorer.result(), sides.spans


@pytest.mark.parametrize("body", [{}, {"car": BOX}], ids=["disc", "rectangle"])
@pytest.mark.parametrize(("chooses", "least", "most"), [(keeps_beside, 10.0, 18.0), (moves_up, 2.0, 6.0)])
def test_who_is_passed_may_drive_on(body: dict[str, object], chooses: Chooses, least: float, most: float) -> None:
    score, spans = opposed(on_grid([standing(3.0, -W)], 17.0, START, **body), chooses)
    assert broken(score, "ego") == broken(score, "other") == set()
    assert least < max(spans) * PERIOD < most
