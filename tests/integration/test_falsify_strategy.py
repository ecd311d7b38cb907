"""Strategies of users' own: another package's sampler finds planted faults, and what goes wrong has a name."""

from __future__ import annotations

import json
import math
import sys
from pathlib import Path
from typing import Any

import pytest

import dubins_traffic as dt
from dubins_traffic.cli.main import main
from dubins_traffic.falsification import plugged
from dubins_traffic.falsification.search import Search
from dubins_traffic.problem.configuration import Configuration
from tests import tools
from tests.mutants import MUTANTS

EXAMPLES = Path(__file__).parents[2] / "examples" / "falsify"
WORLD: dict[str, Any] = {
    "version": 1, "problem_domain": "dubins_traffic", "network": {"grid": {"rows": 2, "columns": 3, "length": 4.0}},
    "e-agents": [{"type": "lawful", "name": "car", "count": 3}], "number_goals_bounds": [2, 3], "rules": True,
}  # fmt: skip
HALTON = """
from scipy.stats.qmc import Halton

class Points:
    def begin(self, space):
        self.halton, self.told = Halton(space.size, seed=space.seed), 0

    def propose(self, history):
        assert len(history) == self.told
        return self.halton.random(48)

    def tell(self, results):
        assert len(results) == 48
        self.told += 48
"""


def bytes_of(folder: Path) -> dict[str, bytes]:
    return {str(path.relative_to(folder)): path.read_bytes() for path in sorted(folder.rglob("*.json"))}


def own(tmp_path: Path, text: str) -> str:
    (tmp_path / "points.py").write_text(text)
    return f"{tmp_path / 'points.py'}:Points"


def searched(spec: str, folder: Path, trials: int = 144, **more: Any) -> Any:
    return dt.falsify(
        Configuration.from_document(WORLD), MUTANTS["clear_early"].kind, folder, trials=trials, seed=2,
        strategy=spec, duration=30.0, **more,
    )  # fmt: skip


def test_a_sampler_of_scipy_finds_a_planted_fault_also_after_a_pause(tmp_path: Path) -> None:
    spec = own(tmp_path, HALTON)
    found = searched(spec, tmp_path / "whole")
    assert found.trials == 144
    assert {name[:7] for name in found.cases} == {"3.clear"}

    def stop(search: Search) -> None:
        if search.counts.trials == 80:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        searched(spec, tmp_path / "halves", progress=stop, most=16)
    assert json.loads((tmp_path / "halves" / "search.json").read_text())["trials"] == 80
    again = searched(spec, tmp_path / "halves", resume=True, most=16)
    assert again.violated == found.violated > 0
    assert again.cases.keys() == found.cases.keys()
    assert bytes_of(tmp_path / "halves" / "cases") == bytes_of(tmp_path / "whole" / "cases")


def test_a_search_is_not_resumed_with_a_strategy_that_proposes_something_else(tmp_path: Path) -> None:
    spec = own(tmp_path, HALTON)
    searched(spec, tmp_path / "found", 48)
    own(tmp_path, HALTON.replace("seed=space.seed", "seed=space.seed + 1"))
    with pytest.raises(dt.InputError, match="does not propose again what it did"):
        searched(spec, tmp_path / "found", 96, resume=True)


def test_the_strategy_ends_the_search_by_proposing_nothing_more(tmp_path: Path) -> None:
    text = HALTON.replace("return self", "return [] if history else self")
    assert searched(own(tmp_path, text), tmp_path / "found").trials == 48


@pytest.mark.parametrize(
    ("answer", "told"),
    [
        ("[[2.0] * self.size]", r"proposes no point: got 2\.0; expected \d+ numbers from 0 to 1"),
        ("[[float('nan')] * self.size]", r"proposes no point: got nan; expected \d+ numbers from 0 to 1"),
        ("[[0.5] * 3]", r"proposes no point: got '3 numbers'; expected \d+ numbers"),
        ("[['half'] * self.size]", "proposes no point"),
        ("1 / 0", "propose raised ZeroDivisionError"),
        ("0", "propose raised TypeError"),
        ("exit()", "propose raised SystemExit"),
        ("threading.Event().wait()", r"propose has not ended after 0\.3 s"),
    ],
)
def test_what_is_wrong_with_a_proposal_is_named_and_what_was_found_is_kept(
    answer: str, told: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    text = HALTON.replace("self.halton, ", "self.size = space.size; self.halton, ")
    spec = own(tmp_path, f"import threading{text.replace('return self', f'return {answer} if history else self')}")
    monkeypatch.setattr(plugged, "WAIT", 0.3 if "Event" in answer else 60.0)
    with pytest.raises(dt.InputError, match=told) as raised:
        searched(spec, tmp_path / "found")
    assert raised.value.file == "--strategy"
    report = json.loads((tmp_path / "found" / "search.json").read_text())
    assert report["trials"] == 48
    assert report["cases"]


@pytest.mark.parametrize(
    ("name", "told"),
    [
        ("gradient", "expected one of uniform, evolution, cma, module:Class or path/to/file.py:Class"),
        ("nowhere.py:Points", "no such file: nowhere.py"),
        ("points.py:Other", "no class Other in points.py"),
        ("points.py:Half", "Half is not a strategy: it lacks the method tell"),
    ],
)
@pytest.mark.path
def test_a_class_that_is_not_there_or_is_no_strategy_is_refused(
    name: str, told: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    own(tmp_path, HALTON + "\n\nclass Half:\n    begin = propose = print\n")
    assert main(["falsify", "junction", "--trials", "32", "--strategy", name]) == 2
    assert told in capsys.readouterr().err


def test_where_nothing_can_be_chosen_a_strategy_is_refused(tmp_path: Path) -> None:
    alone = WORLD | {"e-agents": [], "ego": {"start": [1.5, -0.3, 0.0]}}
    with pytest.raises(dt.InputError, match="there is nothing to choose"):
        dt.falsify(Configuration.from_document(alone), "simple", tmp_path / "found", strategy=own(tmp_path, HALTON))


def test_margins_tell_the_strategy_how_near_a_trial_came(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    text = f"""{HALTON}
def note(results):
    with open('margins', 'a') as file:
        print([own.margin for own in results], end=',', file=file)
"""
    found = searched(
        own(tmp_path, text.replace("self.told += 48", "self.told += 48; note(results)")), tmp_path / "found",
        rules=["3.clear"],
    )  # fmt: skip
    told = Path("margins").read_text().replace("inf", "Infinity").replace("None", "null")
    margins = [margin for margins in json.loads(f"[{told[:-1]}]") for margin in margins]
    assert len(margins) == 144
    assert sum(margin is not None and margin < 0.0 for margin in margins) == found.violated > 0
    assert any(margin is not None and 0.0 < margin < math.inf for margin in margins)


@pytest.mark.tools
def test_dual_annealing_of_psy_taliro_finds_a_planted_fault(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    environment = Path(tools.interpreter_with("psytaliro")).parents[1]
    packages = next(environment.glob("lib/python*/site-packages"))
    monkeypatch.setattr(sys, "path", [*sys.path, str(packages)])
    found = searched(f"{EXAMPLES / 'psy_taliro.py'}:DualAnnealing", tmp_path / "found", 48)
    assert found.trials == 48
    assert {name[:7] for name in found.cases} == {"3.clear"}
