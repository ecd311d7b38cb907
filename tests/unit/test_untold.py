"""Verdicts on trials of a world outside, whose poses are known to a tolerance only (docs/rules.md#told)."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import dubins_traffic as dt
from dubins_traffic.problem.parts import Disturbances
from dubins_traffic.runs.single import run_trial
from dubins_traffic.runs.sources import load_record
from dubins_traffic.scoring.verdict import Ruling

NOISE = 0.002


@pytest.fixture(scope="module")
def driven(tmp_path_factory: pytest.TempPathFactory) -> dt.Record:
    """Return a trial of cars that reckon with noise."""
    disturbed = Disturbances(position_noise=NOISE, cars="all")
    instance = replace(dt.draw(dt.load_config("town"), 7, 1), disturbances=disturbed, duration=60.0)
    file = tmp_path_factory.mktemp("driven") / "trial.mcap"
    assert run_trial(instance, "rules", record=file, sketch=False).score.verdict
    return load_record(file)


def tracked(record: dt.Record, noise: float, declared: float | None = None) -> dt.Score:
    """Return the score of a record as a tracker would have seen it, with poses off by `noise` on each axis at most."""
    dice = np.random.default_rng(2)
    frames = record.frames
    off = noise * dice.uniform(-1.0, 1.0, (2, *frames.x.shape))
    frames = replace(frames, x=frames.x + off[0], y=frames.y + off[1])
    bound = noise if declared is None else declared
    described = Disturbances(position_noise=bound / 3.0, cars="all")
    instance = replace(record.instance, simulator="ros1-world", disturbances=described)
    return dt.score(replace(record, instance=instance, frames=frames, blocks=(frames,)))


def test_a_simulated_trial_has_no_tolerance(driven: dt.Record) -> None:
    verdict = dt.score(driven).verdict
    assert verdict is not None
    assert verdict.tolerance is None
    assert "tolerance" not in verdict.to_json()
    assert not verdict.own_violations


def test_who_reckons_with_the_noise_is_judged_as_if_there_were_none(driven: dt.Record) -> None:
    exact, seen = dt.score(driven), tracked(driven, NOISE)
    assert seen.verdict is not None
    assert exact.verdict is not None
    assert seen.verdict.verdict is exact.verdict.verdict
    assert seen.verdict.own_violations == ()
    assert seen.verdict.tolerance == pytest.approx(np.sqrt(2.0) * NOISE)
    assert seen.verdict.to_json()["tolerance"] == seen.verdict.tolerance
    assert (seen.rounds, seen.counted_rounds) == (exact.rounds, exact.counted_rounds)


def test_what_depends_on_the_noise_is_untold_and_counts_nothing(driven: dt.Record) -> None:
    """Cars stop a few centimetres before the line: within 6 cm it can't be told that they did."""
    score = tracked(driven, 0.0, 0.06)
    assert score.verdict is not None
    assert score.verdict.verdict is Ruling.UNTOLD
    assert score.outcome == "untold"
    assert not score.verdict.clean
    assert score.verdict.cut
    assert (score.counted_rounds, score.rounds_before_breach) == (0, 0.0)


def test_noise_that_nobody_declares_breaks_rules(driven: dt.Record) -> None:
    """As in a simulated trial: a body that noise moves to and fro over a disc's edge, or off its lane."""
    score = tracked(driven, 0.03, 0.0)
    assert score.verdict is not None
    assert score.verdict.own_violations


def test_who_never_stops_is_told_so(tmp_path: Path) -> None:
    instance = replace(dt.draw(dt.load_config("town"), 7, 1), duration=30.0)
    run_trial(instance, "simple", record=tmp_path / "simple.mcap", sketch=False)
    score = tracked(load_record(tmp_path / "simple.mcap"), 0.005)
    assert score.verdict is not None
    assert score.verdict.verdict is Ruling.VIOLATED
    assert score.verdict.tolerance is not None
