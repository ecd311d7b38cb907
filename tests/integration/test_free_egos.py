"""Egos that are free programs under the shield (`experiments.free_egos`): clean, and the same alone as among many."""

from __future__ import annotations

from experiments.contract import PROVOKING
from experiments.free_egos import Free

from dubins_traffic.engine.batch import run_batch
from dubins_traffic.problem.configuration import Configuration
from dubins_traffic.problem.draw import draw
from dubins_traffic.runs.single import run_trial

NAME = "experiments.free_egos:Free"
SECONDS = 20.0


def test_what_they_do_follows_from_their_trial_and_they_break_nothing() -> None:
    own = Configuration.from_document(PROVOKING | {"duration": SECONDS, "number_trials": 4})
    together = run_batch(own, NAME, trials=4, seed=1).sheet.trials
    alone = [run_trial(draw(own, 1, number), Free(), sketch=False).score for number in range(4)]
    assert [one.driven for one in together] == [one.driven for one in alone]
    assert all(one.verdict is not None and one.verdict.clean for one in alone)
    assert len({one.driven.distance_m for one in alone}) == 4
