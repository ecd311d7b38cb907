"""Margins are negative exactly if the referee finds the rule broken, in trials of all kinds."""

from __future__ import annotations

from itertools import chain

import numpy as np
import pytest

from dubins_traffic.engine.batch import outcomes, run_batch
from dubins_traffic.runs.single import run_trial
from dubins_traffic.scoring.margins import ENTERED, LIVENESS, MARGINS, margins_of
from tests.property.test_batch import SEED, configuration
from tests.property.test_choices import trials


@pytest.mark.parametrize("controller", ["rules", "lanes", "simple"])
def test_a_margin_is_negative_exactly_if_its_rule_is_broken(controller: str) -> None:
    hostile = [
        {"type": "lawful", "name": "a", "count": 2, "parameters": {"rolls": 0.4, "left": 0.3, "blocks": 0.3}},
        {"type": "wander", "name": "b", "count": 2},
    ]
    drawn_from = configuration(**{"e-agents": hostile, "duration_bounds": [30, 30]})
    among = run_batch(drawn_from, controller, trials=30, seed=SEED).outcomes
    scores = [one.score for one in chain(outcomes(trials(30, 0.4, 30), controller), among)]
    found = margins_of(scores)
    assert found.shape == (len(scores), len(MARGINS))
    assert found.dtype == np.float64
    entries = 0
    for score, row in zip(scores, found.tolist(), strict=True):
        assert score.verdict is not None
        broken = {own.rule for own in score.verdict.violations if own.car == "ego"}
        assert {rule for rule, value in zip(MARGINS[:-1], row, strict=False) if value < 0.0} == broken
        for rule in ENTERED:
            value = score.verdict.robustness[rule]
            assert value is None or (value < 0.0) == (rule in broken)
            entries += value is not None
        missed = not score.verdict.recurrent or (score.verdict.longest_gap_s or 0.0) > (
            score.verdict.gap_limit_s or np.inf
        )
        assert (row[MARGINS.index(LIVENESS)] < 0.0) == missed
    assert entries > 20


def test_alone_and_in_a_batch_margins_are_the_same() -> None:
    own = list(trials(4, 0.5, 20))
    for one in outcomes(own, "lanes"):
        alone = run_trial(own[one.instance.trial], "lanes").score
        assert np.array_equal(margins_of([alone]), margins_of([one.score]))
