"""What a search can be asked for beside the rules: goals that are not visited, formulas of one's own."""

from __future__ import annotations

import json
import os
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

import dubins_traffic as dt
from dubins_traffic.cli.main import main
from dubins_traffic.errors import InputError
from dubins_traffic.falsification import search, strategies, trying
from dubins_traffic.falsification.archive import files
from dubins_traffic.falsification.case import judge
from dubins_traffic.falsification.contract import limit_of
from dubins_traffic.falsification.regress import regress
from dubins_traffic.falsification.search import falsify
from dubins_traffic.falsification.trying import Tried
from dubins_traffic.problem.configuration import Configuration
from tests.minute import a_minute

SOON = "[] (stopped_a -> <>[0,9.7] !stopped_a)"
"""A car does not wait at its line for as long as the law allows it: seldom otherwise by chance."""


MOST = 500
"""Trials of a search."""
SEEDS = range(6 if os.environ.get("DUBINS_TRAFFIC_ESTIMATES") == "full" else 3)
"""Of the searches that are compared; `make test-all` takes all."""


class Standing:
    """Stands."""

    def start(self, problem: dt.Problem) -> None:
        """Nothing is to be learnt."""

    def act(self, observation: dt.Observation) -> tuple[float, float]:
        """Stand."""
        del observation
        return 0.0, 0.0


def meeting() -> Configuration:
    """Return a crossing to which two cars come that keep the law, and an ego out of their way."""
    roads = [[0, 1, 1, 1], [1, 1, 2, 1], [1, 0, 1, 1], [1, 1, 1, 2], [2, 1, 3, 1]]
    document: dict[str, Any] = {
        "version": 1, "problem_domain": "dubins_traffic", "rules": True, "goals": [], "duration": 13.0,
        "rnd": {"version": 0, "length": 3, "transform": [0, 0, 0], "shape": [3, 4], "segments": roads},
        "e-agents": [
            {"type": "lawful", "name": "a", "start": [1.3, 2.7, 0.0]},
            {"type": "lawful", "name": "b", "start": [4.7, 3.3, 3.14159265]},
        ],
        "ego": {"start": [8.0, 2.7, 0.0]},
    }  # fmt: skip
    return Configuration.from_document(document)


def impatient(duration: float) -> Configuration:
    """Return the junction with goals that are to be visited every two free-flow rounds."""
    document = a_minute("junction").to_document()
    rules = {"gap_rounds": 1.0}
    return Configuration.from_document({**document, "rules": rules, "goals": [[0, 1], [2, 1]], "duration": duration})


def test_a_goal_that_is_not_visited_is_found_and_the_case_ends_where_it_was_overdue(tmp_path: Path) -> None:
    found = dt.falsify(impatient(60.0), "lanes", tmp_path / "found", rules=["1.goal"], trials=24, seed=1, duration=None)
    assert found.violated
    assert {case.story.rule for case in found.cases.values()} == {"1.goal"}
    for case in found.cases.values():
        judged = judge(case.instance, lambda: load("lanes"), "lanes")
        verdict, breach = judged.score.verdict, judged.breach("1.goal")
        assert verdict is not None
        assert breach is not None
        assert not verdict.assumption_broken
        assert verdict.longest_gap_s is not None
        limit = limit_of(case.instance.problem)
        assert limit is not None
        assert verdict.longest_gap_s > limit >= verdict.longest_gap_s - 1.5 / judged.record.frames.rate
        assert breach.tick == case.story.tick == case.instance.ticks
        assert "had not visited the goal" in case.story.sentence
    outcomes = regress(tmp_path / "found", "lanes")
    assert all(own.broken == ("1.goal",) or "1.goal" in own.broken for own in outcomes)
    assert not any(own.passed for own in outcomes)


def load(name: str) -> dt.Controller:
    from dubins_traffic.controllers.registry import load as loaded

    return loaded(name)


def test_what_no_trial_can_break_is_refused(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    arguments = ["falsify", "junction", "--trials", "4", "-o", str(tmp_path / "a")]
    assert main([*arguments, "--rule", "1.goal"]) == 2
    assert (
        "--duration: no gap between visits can be over its limit in trials so short: got 15" in capsys.readouterr().err
    )
    assert main([*arguments, "--formula", "[]<> ego_t_1_1"]) == 2
    assert "--formula: no trial of any length can break it" in capsys.readouterr().err
    assert main([*arguments, "--rule", "1.goals"]) == 2
    assert "1.goal" in capsys.readouterr().err
    assert not (tmp_path / "a").exists()


def trials_until_found(folder: Path, seed: int, most: int) -> int:
    """Return after how many trials of a search the formula is broken."""

    class FoundError(Exception):
        """It is."""

    counts: list[int] = []

    def look(own: search.Search) -> None:
        counts[:] = [own.counts.trials]
        if own.counts.violated:
            raise FoundError

    try:
        falsify(meeting(), Standing, folder, formula=SOON, trials=most, seed=seed, duration=None, progress=look)
    except FoundError:
        return counts[0]
    return most + 1


def test_by_how_much_a_formula_holds_guides_a_search(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """With the robustness it takes fewer trials than with nothing but whether the formula was broken.

    Few trials are drawn anew: what these find, they find with and without it.
    """
    monkeypatch.setattr(search, "GENERATION", 16)
    monkeypatch.setattr(strategies, "FRESH", 0.1)
    measured = trying.tried_of

    def blind(*given: object) -> Tried:
        found = measured(*given)  # pyright: ignore[reportArgumentType]
        signs = {name: 1.0 if value > 0.0 else -1.0 for name, value in found.margins.items()}
        return replace(found, margins=signs)

    guided = [trials_until_found(tmp_path / f"guided-{seed}", seed, MOST) for seed in SEEDS]
    monkeypatch.setattr(trying, "tried_of", blind)
    blinded = [trials_until_found(tmp_path / f"blind-{seed}", seed, MOST) for seed in SEEDS]
    assert sorted(guided)[-2] <= MOST
    assert sum(guided) < 0.8 * sum(blinded), (guided, blinded)


def test_a_case_of_a_formula_is_told_again_by_regress(tmp_path: Path) -> None:
    folder = tmp_path / "found"
    dt.falsify("junction", "simple", folder, trials=8, duration=6.0, formula="[] !left_ego")
    assert list(files(folder))
    outcomes = regress(folder, "simple")
    assert all("formula asked" in own.broken for own in outcomes)
    assert not any(own.passed for own in outcomes)
    assert json.loads((folder / "search.json").read_text())["settings"]["targets"] == ["formula asked"]


def test_a_formula_that_can_not_be_read_is_refused(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="unknown proposition"):
        dt.falsify("junction", "lanes", tmp_path / "a", trials=4, formula="[] !lefd_ego")


@pytest.mark.parametrize("form", [(), ("--json",)])
def test_an_empty_cell_is_a_warning(form: tuple[str, ...], tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """In two seconds nobody turns left at the crossing: nothing is known of it, which is said in every form."""
    arguments = ["--controller", "lanes", "--rule", "3.clear", "--trials", "2", "--duration", "2"]
    assert main(["falsify", "junction", *arguments, "-o", str(tmp_path / "found"), *form]) == 0
    told = capsys.readouterr()
    rows = json.loads((tmp_path / "found" / "search.json").read_text())["coverage"]
    empty = [row for row in rows if not row["tested"] and not row["broken"]]
    assert {row["manoeuvre"] for row in empty} >= {"left", "right", "straight"}
    assert f"{len(empty)} of {len(rows)} cells were never put to the test" in told.err
    assert form or told.out.count("never") == len(empty)
