"""The robustness of a user's own formula is negative exactly if its verdict is false."""

from __future__ import annotations

import tempfile
from dataclasses import replace
from functools import lru_cache
from pathlib import Path
from random import Random

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from dubins_traffic.logic.automaton import FALSE, TRUE
from dubins_traffic.logic.formula import Formula, FormulaError, propositions, to_spin
from dubins_traffic.logic.monitor import Monitors
from dubins_traffic.logic.robustness import outlook, robustness
from dubins_traffic.problem.configuration import load_config
from dubins_traffic.problem.draw import draw
from dubins_traffic.record.reader import Record, read, replay
from dubins_traffic.runs.single import run_trial
from dubins_traffic.scoring.formulas import FormulaVerdict, FormulaVerdicts
from tests.formulas import drawn
from tests.minute import a_minute

NAMES = ("a", "b", "c")


def formula_of(seed: int, names: tuple[str, ...] = NAMES) -> Formula:
    return drawn(Random(seed), 3, names, past=True, bounds=True, longest=4)


@settings(max_examples=300, deadline=None, derandomize=True)
@given(st.integers(0, 1 << 32), st.integers(1, 12))
def test_what_every_continuation_breaks_is_false_and_what_none_breaks_is_true(seed: int, count: int) -> None:
    formula, dice = formula_of(seed), np.random.default_rng(seed)
    values = dice.normal(size=(len(NAMES), count))
    signals = dict(zip(NAMES, values, strict=True))
    least, most = outlook(formula, signals, 1.0)
    value = robustness(formula, signals, 1.0)
    assert (least <= value).all()
    assert (value <= most).all()
    try:
        monitors = Monitors({"own": formula}, NAMES, 1.0, split=False)
    except FormulaError:
        return
    monitors.reset(1)
    for frame in values.T:
        verdict = int(monitors.update((frame > 0.0)[None, :])[0, 0])
    assert most[0] >= 0.0 or verdict == FALSE
    assert least[0] <= 0.0 or verdict == TRUE
    assert verdict != FALSE or "own" in monitors.breakable
    more = dice.normal(size=(len(NAMES), 9))
    longer = {name: np.append(signals[name], row) for name, row in zip(NAMES, more, strict=True)}
    narrower = outlook(formula, longer, 1.0)
    assert least[0] <= narrower[0][0]
    assert narrower[1][0] <= most[0]


@lru_cache
def record(controller: str) -> Record:
    """Return a trial of some seconds among cars that wander."""
    document = {
        **a_minute("junction").to_document(),
        "e-agents": [{"type": "wander", "name": "car", "count": 3}],
        "duration": 6.0,
    }
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "one.mcap"
        run_trial(draw(load_config(document), 4, 1), controller, record=path)
        return read(path)


def judged(formula: str, own: Record) -> FormulaVerdict:
    problem = replace(own.instance.problem, formulas={"own": formula})
    sink = FormulaVerdicts()
    replay(replace(own, instance=replace(own.instance, problem=problem)), [sink])
    return sink.result()[0]


WORDS = (
    "collision_ego", "on_road_ego", "left_ego", "still_ego", "stopped_ego", "entered_ego", "in_crossing_ego",
    "clear_ego", "ego_t_1_1", "cross_ego_1_1", "clear_ego_1_1", "free_1_1", "stands_car0",
    "approach_ego_1_1", "enter_car1_1_1",
)  # fmt: skip


@settings(max_examples=40, deadline=None, derandomize=True)
@given(st.integers(0, 1 << 32), st.sampled_from(["simple", "lanes"]), st.data())
def test_on_trials_the_sign_is_that_of_the_verdict(seed: int, controller: str, data: st.DataObject) -> None:
    names = tuple(data.draw(st.lists(st.sampled_from(WORDS), min_size=2, max_size=3, unique=True)))
    formula = formula_of(seed, names)
    if not propositions(formula):
        return
    found = judged(to_spin(formula), record(controller))
    assert (found.verdict == "false") == (found.robustness is not None and found.robustness < 0.0)


def test_margins_are_lengths_and_times_that_can_be_worked_out() -> None:
    own = record("lanes")
    frames, problem = own.frames, own.instance.problem
    x, y = problem.network.points[problem.network.vertex((1, 1))].tolist()
    apart = np.sqrt((frames.x[:, 0] - x) ** 2 + (frames.y[:, 0] - y) ** 2)
    least = float((apart - problem.intersection_radius).min())
    assert judged("[] !ego_t_1_1", own).robustness == (least if least > 0.0 else min(least, -1e-9))
    body = problem.car.body.reach
    gaps = np.sqrt((frames.x[:, 1:] - frames.x[:, :1]) ** 2 + (frames.y[:, 1:] - frames.y[:, :1]) ** 2) - 2 * body
    found = judged("[] !collision_ego", own)
    assert found.robustness is not None
    assert found.verdict == "false" or abs(found.robustness - float(gaps.min())) < 1e-9
    assert judged("[]<> ego_t_1_1", own).robustness is None
