"""The lane keeper: counted rounds in `junction`, more rounds before a breach than `lanes`, a tutorial in 60 lines."""

from __future__ import annotations

import ast
import json
import os
import re
import subprocess
import sys
from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pytest

import dubins_traffic as dt
from dubins_traffic.campaign.report.statistics import estimate
from tests.integration.test_readme import FILE_NAME, ROOT, runnable

KEEPER = f"{ROOT / 'examples' / 'lane_keeper.py'}:LaneKeeper"
STABILITY = (ROOT / "docs" / "stability.md").read_text(encoding="utf-8")
TUTORIAL = (ROOT / "docs" / "tutorials" / "lane-keeper.md").read_text(encoding="utf-8")
TRIALS = 40
FEW = 3
MOST_LINES = 60
"""Of code that a user writes in the tutorial, blank lines left out."""


def public_names() -> set[str]:
    """Return the names that stay within a major version, as the page on stability says: what the package exports."""
    row = re.search(r"^\| \*\*API\*\* \| (.*) \|$", STABILITY, re.MULTILINE)
    assert row
    assert row[1].startswith("Names that `dubins_traffic` exports")
    assert "Everything else is internal" in row[1]
    exported = [getattr(dt, name) for name in dt.__all__]
    return {*dt.__all__, *(name for own in exported if isinstance(own, type) for name in dir(own))}


def internal_names(files: Sequence[str]) -> set[str]:
    """Return what files use of the package that the page on stability does not call public.

    A name after a dot counts unless a file defines it, or a module of Python's own or another of the files has it.
    """
    trees = [ast.parse(code) for code in files]
    nodes = [node for tree in trees for node in ast.walk(tree)]
    brought = {node.module or "" for node in nodes if isinstance(node, ast.ImportFrom)}
    brought |= {alias.name for node in nodes if isinstance(node, ast.Import) for alias in node.names}
    own = {node.name for node in nodes if isinstance(node, ast.FunctionDef | ast.ClassDef)}
    own |= {node.attr for node in nodes if isinstance(node, ast.Attribute) and isinstance(node.ctx, ast.Store)}
    used = {node.attr for node in nodes if isinstance(node, ast.Attribute) and isinstance(node.ctx, ast.Load)}
    inner = {name for name in brought if name.partition(".")[0] == "dubins_traffic" and name != "dubins_traffic"}
    return inner | (used - own - public_names()) | {name for name in used if name.startswith("_")}


def test_a_name_that_is_not_public_is_found() -> None:
    assert internal_names(["import dubins_traffic.rules\n"]) == {"dubins_traffic.rules"}
    assert internal_names(["import dubins_traffic as dt\ndt.kernels.boxes\n"]) == {"kernels", "boxes"}
    assert internal_names(["def f(o):\n    return o.propositions.stopped, o._hidden\n"]) == {"_hidden"}


def scores(configuration: str, controller: str, trials: int) -> tuple[dt.Score, ...]:
    plan = dt.plan(configuration, controller, trials=trials)
    return plan.conclude(dt.run_trials(plan.jobs)).trials


@pytest.mark.parametrize(
    "trials", [pytest.param(FEW, marks=pytest.mark.path), pytest.param(TRIALS, marks=pytest.mark.long)]
)
def test_it_makes_a_counted_round_in_junction(trials: int) -> None:
    counted = [score.counted_rounds for score in scores("junction", KEEPER, trials)]
    assert sum(rounds > 0 for rounds in counted) >= trials / 2, counted


@pytest.mark.long
def test_in_town_it_makes_more_rounds_before_the_first_breach_than_lanes() -> None:
    keeper, lanes = (
        estimate(np.array([score.rounds_before_breach for score in scores("town", controller, TRIALS)]))
        for controller in (KEEPER, "lanes")
    )
    assert keeper.mean_interval is not None
    assert lanes.mean_interval is not None
    assert keeper.mean_interval[0] > lanes.mean_interval[1]


@pytest.mark.path
def test_each_step_of_the_tutorial_is_better_and_the_last_is_clean(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    written = [code for _, code in runnable(TUTORIAL) if FILE_NAME.match(code)]
    for code in written:
        named = FILE_NAME.match(code)
        assert named
        (tmp_path / named[1]).write_text(code)
    lines = [line for code in written for line in code.splitlines() if line.strip()]
    assert len(lines) <= MOST_LINES
    assert internal_names(written) == set()
    monkeypatch.chdir(tmp_path)
    steps = ("follow.py:Follow", "stops.py:Stops", "lane_keeper.py:LaneKeeper")
    found = [scores("junction", step, FEW) for step in steps]
    before = [sum(score.rounds_before_breach for score in own) for own in found]
    assert before == sorted(set(before)), before
    assert [score.counted_rounds > 0 for score in found[-1]] == [True] * FEW


@pytest.mark.path
def test_the_line_under_the_table_names_a_command_that_shows_the_breach(tmp_path: Path) -> None:
    program = [sys.executable, "-m", "dubins_traffic.cli"]
    around = os.environ | {"COLUMNS": "80"}
    words = [*program, "run", "junction", "--controller", "lanes", "--trials", "1"]
    ran = subprocess.run(
        [*words, "--records", "kept here"],
        cwd=tmp_path,
        env=around,
        capture_output=True,
        text=True,
        check=True,
    )
    told = re.search(r"^Cost most: (\S+), (\d+ times|once), .*trial 0 at (\S+) s\.$", ran.stdout, re.MULTILINE)
    assert told
    command = re.search(r"^To see it: dubins-traffic (.*)$", ran.stdout, re.MULTILINE)
    assert command
    path = f"{Path(sys.executable).parent}{os.pathsep}{os.environ['PATH']}"
    subprocess.run(
        ["bash", "-c", f"dubins-traffic {command[1]}"], cwd=tmp_path, env=around | {"PATH": path}, check=True
    )
    page = (tmp_path / "kept here" / "trial-0000.html").read_text(encoding="utf-8")
    data = re.search(r'id="data">(.*?)</script>', page, re.DOTALL)
    assert data
    assert json.loads(data[1])["begin"] == pytest.approx(max(0.0, float(told[3]) - 1.0), abs=0.006)
    late = subprocess.run(
        [*program, "replay", "kept here/trial-0000.mcap", "-o", "late.html", "--at", "1e9"],
        cwd=tmp_path, env=around, capture_output=True, text=True, check=False,
    )  # fmt: skip
    assert late.returncode == 2
    assert "--at" in late.stderr
    assert not (tmp_path / "late.html").exists()
