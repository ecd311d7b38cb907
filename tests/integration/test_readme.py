"""The code of the README, and then that of the tour, runs as it stands, in its order."""

from __future__ import annotations

import json
import os
import re
import subprocess
import sys
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import pytest

from dubins_traffic import run_batch, run_trial
from tests.minute import a_minute
from tests.shown_scores import require_progress, tables

ROOT = Path(__file__).parents[2]
README = (ROOT / "README.md").read_text(encoding="utf-8")
TOUR = (ROOT / "docs" / "tour.md").read_text(encoding="utf-8")
BLOCK = re.compile(r"^```(\w+)\n(.*?)^```$", re.MULTILINE | re.DOTALL)
ALL = os.environ.get("DUBINS_TRAFFIC_PAGES") == "all"
MANY = "--trials 500"
"""Of the search on the page."""
FILE_NAME = re.compile(r"# (\w+\.(?:py|toml))\n")


def blocks(language: str) -> list[str]:
    return [text for found, text in BLOCK.findall(README) if found == language]


def runnable(page: str) -> list[tuple[str, str]]:
    return [(language, text) for language, text in BLOCK.findall(page) if language in {"sh", "python", "toml"}]


def run_block(language: str, text: str, folder: Path) -> str:
    """Run a block of shell or Python in `folder`, or save it if its first line names a file.

    Returns what it printed. On standard error stand the files that were written, what a search has not met, and
    nothing else.
    """
    named = FILE_NAME.match(text)
    if named:
        (folder / named[1]).write_text(text)
        return ""
    program = ["bash", "-euo", "pipefail", "-c"] if language == "sh" else [sys.executable, "-c"]
    path = f"{Path(sys.executable).parent}{os.pathsep}{os.environ['PATH']}"
    ran = subprocess.run(
        [*program, text],
        cwd=folder,
        env=os.environ | {"PATH": path},
        capture_output=True,
        text=True,
        check=False,
    )
    said = [line for line in ran.stderr.splitlines() if not line.endswith("cells were never put to the test")]
    told = [line for line in said if not (folder / line).exists()]
    assert (ran.returncode, told) == (0, []), text
    return ran.stdout


@pytest.mark.path
def test_the_first_example_has_a_number_that_the_change_which_the_page_names_makes_better(tmp_path):
    """A part of a round before the first breach as it stands; counted rounds after the change."""
    page = README.partition("## A controller of your own")[2].partition("\n## ")[0]
    (code,) = [text for language, text in runnable(page) if language == "python"]
    (before,) = re.findall(r"breaks a rule after ([\d.]+) rounds on average", page)
    (after, old) = re.findall(r"Write `([^`]+)` in the place of `([^`]+)`", page)[0]
    assert code.count(old) == 1
    (counted,) = re.findall(r"same two trials have (\w+) counted rounds", page)
    found = []
    for name, own in (("homing", code), ("mine", code.replace(old, after))):
        (tmp_path / f"{name}.py").write_text(own)
        words = f"dubins-traffic run town --controller {name}.py:Homing --trials 2"
        found += tables(run_block("sh", words, tmp_path))
    assert found[0].before == float(before) > 0
    assert found[1].counted == ["no", "one", "two", "three", "four", "five"].index(counted)


def test_all_code_runs(tmp_path):
    """As it stands; of the trials of the search `make test` runs a part, and `make test-all` all."""
    ran = [*runnable(README), *runnable(TOUR)]
    assert len(ran) >= 12
    assert sum(MANY in text for _, text in ran) == 1
    found = []
    for language, text in ran:
        out = run_block(language, text if ALL else text.replace(MANY, "--trials 100"), tmp_path)
        if (language, text) in runnable(README):
            found += tables(out)
    require_progress(found)
    made = {path.suffix for path in tmp_path.rglob("*")}
    assert {".mcap", ".png", ".svg", ".pdf", ".html", ".csv", ".json", ".rnd"} <= made


def test_the_page_on_batches_runs_and_ten_thousand_cars_keep_the_rules(tmp_path):
    for language, text in runnable((ROOT / "docs" / "batches.md").read_text(encoding="utf-8")):
        run_block(language, text, tmp_path)
    (trial,) = json.loads((tmp_path / "crowd-score.json").read_text())["trials"]
    assert (trial["end"], trial["verdict"]["violations"], trial["collisions_among_others"]) == (
        "duration",
        [],
        0,
    )


def test_the_page_on_python_runs(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    page = (ROOT / "docs" / "python.md").read_text(encoding="utf-8")
    names: dict[str, Any] = {}
    for language, text in runnable(page):
        assert language == "python"
        if text.startswith("# with the extra pandas") and find_spec("pandas") is None:
            continue
        exec(compile(text, "python.md", "exec"), names)
    told = capsys.readouterr().out
    for told_there in re.findall(r"print\(.*#\s*(.*)$", page, re.MULTILINE):
        pattern = re.escape(told_there).replace(r"\.\.\.", ".*")
        assert re.search(f"^{pattern}$", told, re.MULTILINE), told_there
    assert {path.suffix for path in tmp_path.iterdir()} == {".mcap", ".json", ".png", ".svg", ".html"}


def test_the_controller_on_the_page_on_batches_drives_alike_alone():
    page = (ROOT / "docs" / "batches.md").read_text(encoding="utf-8")
    (code,) = [text for language, text in runnable(page) if language == "python" and FILE_NAME.match(text)]
    made: dict[str, Any] = {}
    exec(compile(code, "keeper.py", "exec"), made)
    config = a_minute("town")
    for outcome in run_batch(config, made["Keeper"], trials=6, batch=4).outcomes:
        assert run_trial(outcome.instance, made["Keeper"]()).score.driven == outcome.score.driven


@pytest.mark.path
def test_a_controller_takes_few_lines():
    (controller,) = [text for text in blocks("python") if FILE_NAME.match(text)]
    code = [line for line in controller.splitlines() if line.strip() and not line.startswith("#")]
    assert len(code) <= 14  # with ten it follows its lane, but breaks rules before its first visit


@pytest.mark.parametrize("target", ["demo", "test", "check", "bench"])
@pytest.mark.path
def test_make_targets_are_named_and_exist(target):
    assert f"make {target}" in README
    assert re.search(rf"^{target}:.*## ", (ROOT / "Makefile").read_text(), re.MULTILINE)


@pytest.mark.path
def test_links_lead_somewhere():
    for target in re.findall(r"\]\(([^)#]+)\)", README):
        assert "://" in target or (ROOT / target).exists(), target
