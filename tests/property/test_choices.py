"""E-agents of the kind `chosen`: a table without choices is the law, and with any choices they keep E1 to E3."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np

from dubins_traffic.agents.choices import (
    drawn,
    empty,
    with_choices,
)
from dubins_traffic.engine.batch import outcomes
from dubins_traffic.problem.draw import draw
from dubins_traffic.problem.instance import Instance
from dubins_traffic.record.reader import read
from dubins_traffic.runs.single import run_trial
from dubins_traffic.scoring.score import score
from tests.property.test_batch import SEED, configuration, plain

LEGS = 12
CARS = 4


def trials(count: int, share: float, seconds: int = 60) -> Iterator[Instance]:
    """Yield instances in which random tables drive all e-agents."""
    own = [{"type": "chosen", "name": "a", "count": CARS}]
    networks: tuple[dict[str, Any], ...] = (
        {"grid": {"rows": 3, "columns": 3, "length": 4.0}},
        {"random": {"intersections": 8, "segments": 10}},
        {"grid": {"rows": 2, "columns": 3, "length": 3.0}},
    )
    drawn_from = [
        configuration(**{"network": network, "e-agents": own, "duration_bounds": [seconds, seconds]})
        for network in networks
    ]
    for trial in range(count):
        dice = np.random.default_rng(trial)
        instance = draw(drawn_from[trial % len(networks)], SEED, trial)
        yield with_choices(instance, {n: drawn(dice, LEGS, share) for n in range(1, 1 + CARS)})


def test_a_table_in_which_nothing_is_chosen_is_the_law(tmp_path: Path) -> None:
    drawn_from = configuration(**{"e-agents": [{"type": "lawful", "name": "a", "count": 3}]})
    lawful = draw(drawn_from, SEED, 0)
    nothing = with_choices(lawful, {n: empty(5) for n in (1, 2, 3)})
    assert [agent.kind for agent in nothing.e_agents] == ["chosen"] * 3
    assert nothing.e_agents[0].parameters["choices"] == []
    for name, instance in (("lawful", lawful), ("chosen", nothing)):
        run_trial(instance, "rules", record=tmp_path / f"{name}.mcap")
    one, other = (read(tmp_path / f"{name}.mcap").frames for name in ("lawful", "chosen"))
    assert all((getattr(one, name) == getattr(other, name)).all() for name in ("x", "y", "c", "s", "bits"))


def test_alone_in_a_batch_and_from_its_record_it_does_the_same(tmp_path: Path) -> None:
    own = list(trials(6, 0.6, seconds=12))
    for outcome in outcomes(own, "rules"):
        record = tmp_path / f"{outcome.instance.trial}.mcap"
        alone = run_trial(own[outcome.instance.trial], "rules", record=record)
        assert plain(outcome.score) == plain(alone.score) == plain(score(read(record)))
        assert read(record).instance.e_agents == outcome.instance.e_agents


def test_whatever_is_chosen_e1_to_e3_are_kept() -> None:
    found: Counter[str] = Counter()
    for outcome in outcomes(trials(400, 0.4), "rules"):
        verdict = outcome.score.verdict
        assert verdict is not None
        found.update(own.rule for own in verdict.violations if own.car != "ego")
    assert found.keys() <= {"E4"}
    assert found["E4"] <= 4
