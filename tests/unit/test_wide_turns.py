"""Dubins cars whose turning radius is that of a car beside its lane: who drives them, and on which roads."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from dubins_traffic.engine.batch import run_batch
from dubins_traffic.errors import InputError
from dubins_traffic.problem.configuration import Configuration, load_config
from dubins_traffic.problem.draw import draw
from dubins_traffic.protocols import End
from dubins_traffic.record.reader import read
from dubins_traffic.runs.single import run_trial
from dubins_traffic.scoring.score import score
from tests.property.test_batch import plain

SEED = 9
SUBURB = "suburb"


def suburb(**parts: Any) -> Configuration:
    """Return the shipped configuration with some parts changed."""
    document = load_config(SUBURB).to_document()
    bounds = parts.pop("bounds", {})
    document["car"]["bounds"].update(bounds)
    whole = {**document, **parts}
    return load_config({name: value for name, value in whole.items() if value is not None})


MANY = [{"type": "lawful", "name": "car", "count": 7}, {"type": "nemesis", "name": "nemesis"}]
REAL: dict[str, Any] = {
    "network": {"grid": {"rows": 3, "columns": 4, "length": 27}},
    "intersection_radius": 7.6,
    "sensing_radius": 30.0,
    "car": {
        "w": 1.75,
        "body": {"rectangle": {"length": 3.6, "width": 1.63}},
        "bounds": {"speed": 8.0, "yaw_rate": 2.0, "turning_radius": 3.8},
    },
    "rules": {"exit_time": 10.0},
    "e-agents": [{"type": "lawful", "name": "car", "count": 5}],
}  # fmt: skip
"""In metres as large as a car is."""

STAR = {"version": 0, "length": 6, "transform": [0, 0, 0], "shape": [3, 3],
        "segments": [[0, 1, 1, 1], [1, 1, 2, 1], [1, 0, 1, 1], [1, 1, 1, 2]]}  # fmt: skip


@pytest.mark.parametrize("parts", [{}, {"e-agents": MANY}, REAL], ids=["suburb", "crowded", "real"])
def test_rules_and_lawful_drive_clean_at_car_scale(parts: dict[str, Any]) -> None:
    found = run_batch(suburb(**parts), "rules", trials=60, seed=SEED).outcomes
    verdicts = [outcome.score.verdict for outcome in found]
    assert all(verdict is not None and verdict.clean for verdict in verdicts)
    assert not any(verdict is None or verdict.assumption_broken for verdict in verdicts)
    assert sum(outcome.score.verdict.rounds > 0 for outcome in found if outcome.score.verdict) > 35


@pytest.mark.parametrize("controller", ["rules", "rules+shield", "lanes+shield"])
def test_alone_in_a_batch_and_from_its_record_a_trial_is_the_same(controller: str, tmp_path: Path) -> None:
    made = suburb(duration=15)
    (outcome,) = run_batch(made, controller, trials=1, seed=SEED).outcomes
    alone = run_trial(draw(made, SEED, 0), controller, record=tmp_path / "a.mcap")
    assert alone.ending.end is End.DURATION
    assert plain(outcome.score) == plain(alone.score) == plain(score(read(tmp_path / "a.mcap")))
    assert alone.score.verdict is not None
    assert alone.score.verdict.clean


@pytest.mark.parametrize("controller", ["simple", "lanes"])
def test_other_controllers_drive_on_arcs(controller: str, tmp_path: Path) -> None:
    made = draw(suburb(**{"e-agents": []}), SEED, 0)
    result = run_trial(made, controller, record=tmp_path / "a.mcap")
    frames = read(tmp_path / "a.mcap").frames
    assert result.score.driven.distance_m > 15.0
    radius = made.problem.car.bounds.turning_radius
    assert (np.abs(frames.command_yaw_rate) <= np.abs(frames.command_speed) / radius + 1e-12).all()


@pytest.mark.parametrize(
    ("parts", "words"),
    [
        ({"intersection_radius": 1.2}, r"car\.bounds\.turning_radius: the turn from segments\[\d+\] to .* too tight"),
        ({"bounds": {"turning_radius": 0.75}}, r"too tight for a turning radius of 0.75 m: got 0.74; .* 0.7875"),
        (
            {"network": None, "rnd": STAR},
            r"segments\[\d+\]: a car with a turning radius of 0.65 m can't turn round in the dead end at \[",
        ),
        ({"obstacles": [{"disc": {"x": 2.0, "y": 0.3, "radius": 0.1}}]}, "obstacles: .* passes no obstacles"),
        ({"bounds": {"speed_min": 0.1}}, r"car\.bounds\.speed_min: .*it can't stop"),
    ],
)  # fmt: skip
def test_roads_that_are_too_tight_are_refused_with_the_place(parts: dict[str, Any], words: str) -> None:
    with pytest.raises(InputError, match=words):
        run_trial(draw(suburb(**parts), SEED, 0), "lanes")
    ending = run_trial(draw(suburb(**{**parts, "e-agents": []}), SEED, 0), "rules").ending
    assert ending.end is End.CONTROLLER_FAULT


@pytest.mark.parametrize("controller", ["simple", "lanes"])
def test_cars_that_never_stop_drive_where_no_rules_are_asked_for(controller: str, tmp_path: Path) -> None:
    agents = [{"type": "wander", "name": "one"}, {"type": "loop", "name": "two"}]
    made = suburb(**{"rules": False, "e-agents": agents, "bounds": {"speed_min": 0.3}, "end_on_collision": True})
    ending = run_trial(draw(made, SEED, 1), controller, record=tmp_path / "a.mcap").ending
    frames = read(tmp_path / "a.mcap").frames
    assert ending.ticks > 60
    assert (frames.speed[1:-1] >= 0.3).all()
