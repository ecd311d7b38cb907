"""Suites on the command line: the same results however they are run, and what is finished is kept."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
import time
from pathlib import Path
from typing import Any

import pytest

from dubins_traffic.suites.suite import load_suite
from tests.boxes import needs_boxes
from tests.campaigns import COMMAND
from tests.suites import cases, document, games, written

ROOT = Path(__file__).parents[2]
SLOW = """
import time
from pathlib import Path


class Slow:
    def start(self, problem):
        begun, go = (Path(__file__).with_name(name) for name in ("begun", "go"))
        with begun.open("a") as file:
            file.write(".")
        while begun.stat().st_size > 6 and not go.exists():
            time.sleep(0.02)

    def act(self, observation):
        return (0.3, 0.1)
"""
"""A controller that begins six trials, and waits for a file before it begins more."""


def run(*arguments: str | Path, cwd: Path | None = None) -> subprocess.CompletedProcess[str]:
    words = [COMMAND, "suite", *map(str, arguments)]
    return subprocess.run(words, check=False, capture_output=True, text=True, timeout=3600, cwd=cwd)


def result(folder: Path) -> bytes:
    (path,) = (path for path in folder.glob("*-*.json") if not path.name.endswith(".wall.json"))
    return path.read_bytes()


TRIALS = int(os.environ.get("DUBINS_TRAFFIC_SUITE_TRIALS", "1"))
"""Trials of each combination of rules-2026; `make test-all` runs both."""


@pytest.fixture(scope="module")
def rules(tmp_path_factory: pytest.TempPathFactory) -> list[Path]:
    """Results of rules-2026 with some trials of each combination, by one worker and by two."""
    folder = tmp_path_factory.mktemp("rules")
    options = ("run", "rules-2026", "--controller", "rules", "--trials", str(TRIALS))
    for workers in ("1", "2"):
        done = run(*options, "--workers", workers, "-o", folder / workers)
        assert done.returncode == 0, done.stderr
    return [folder / "1", folder / "2"]


def test_the_number_of_workers_does_not_show(rules: list[Path]) -> None:
    suite = load_suite("rules-2026")
    label = suite.label if suite.trials == TRIALS else f"{suite.label}-trials{TRIALS}"
    for folder in rules:
        assert (folder / f"{label}.json").is_file()
        assert (folder / f"{label}.wall.json").is_file()
    assert result(rules[0]) == result(rules[1])
    columns = json.loads(result(rules[0]))["entries"][0]["columns"]
    assert len(columns["end"]) == 80 * TRIALS
    assert set(columns["end"]) == {"duration"}
    assert all(columns["clean"])


def shown(name: str) -> dict[str, Any]:
    """Return the file of results of a suite that the site shows; `make results` makes it anew."""
    file = ROOT / "website" / "results" / f"{load_suite(name).label}.json"
    return json.loads(file.read_text())


def first(entry: dict[str, Any], trials: int, of: int) -> dict[str, list[Any]]:
    """Return the columns of a controller for the first of its trials of each combination."""
    places = [place for place in range(len(entry["columns"]["end"])) if place % of < trials]
    return {name: [values[place] for place in places] for name, values in entry["columns"].items()}


def test_the_results_that_the_site_shows_are_these(rules: list[Path]) -> None:
    (kept,) = [entry for entry in shown("rules-2026")["entries"] if entry["controller"] == "rules"]
    (own,) = json.loads(result(rules[0]))["entries"]
    assert own["columns"] == first(kept, TRIALS, 2)


@pytest.mark.parametrize(
    "name", ["icra2016", *(("towns-2026", "adversary-2026", "synthesis-2026") if TRIALS == 2 else ())]
)
def test_every_controller_comes_to_the_results_that_the_site_shows(name: str, tmp_path: Path) -> None:
    """A trial of each combination; `make test-all` runs all of every suite."""
    suite, kept = load_suite(name), shown(name)
    options: list[str] = []
    if suite.trials is not None and TRIALS != 2:
        options = ["--trials", "1"]
    if suite.model.cases is not None:
        options = [word for entry in kept["entries"] for word in ("--controller", entry["controller"])]
    done = run("run", name, *options, "-o", tmp_path / "out")
    assert done.returncode == 0, done.stderr
    own = json.loads(result(tmp_path / "out"))
    trials = own["trials"] or 1
    for entry, before in zip(own.get("entries", []), kept.get("entries", []), strict=True):
        assert entry["controller"] == before["controller"]
        assert entry["columns"] == first(before, trials, suite.trials or 1)
    assert own.get("solvers") == kept.get("solvers")


def test_results_are_compared_and_other_hashes_refused(rules: list[Path], tmp_path: Path) -> None:
    one, two = rules
    done = run("compare", f"ada={one}", f"bob={two}", "-o", tmp_path / "page")
    assert done.returncode == 0, done.stderr
    assert f"| ada | {80 * TRIALS} |" in done.stdout
    assert f"| bob | {80 * TRIALS} |" in done.stdout
    assert (tmp_path / "page" / "index.html").is_file()
    assert "different versions" not in done.stderr
    code = json.loads(result(one))["code"]
    older = tmp_path / "older.json"
    older.write_bytes(result(one).replace(code.encode(), b"0" * 64))
    done = run("compare", f"ada={one}", f"bob={older}")
    assert done.returncode == 0, done.stderr
    assert "Made by different versions of the code" in done.stderr
    other = tmp_path / "other.json"
    other.write_bytes(result(one).replace(load_suite("rules-2026").hash.encode(), b"0" * 64))
    done = run("compare", one, other)
    assert done.returncode == 2
    assert "hash: results of another suite" in done.stderr
    assert done.stdout == ""


SEES_ITSELF = """
import sys


class Mine:
    def start(self, problem):
        self.inside = __file__.startswith("/submission")

    def act(self, observation):
        return (0.3, 0.0) if self.inside else None
"""
"""A controller that drives in a box, and gives up elsewhere."""


@needs_boxes
@pytest.mark.parametrize("kind", ["trials", "cases"])
def test_a_controller_that_is_not_ours_runs_in_a_box_and_the_results_say_so(kind: str, tmp_path: Path) -> None:
    file = written(tmp_path / "suite.json", document() if kind == "trials" else cases())
    (tmp_path / "mine.py").write_text(SEES_ITSELF)
    words = ["run", file, "--controller", "mine.py:Mine", "--controller", "rules", "--workers", "1"]
    boxed = run(*words, "-o", tmp_path / "boxed", cwd=tmp_path)
    assert boxed.returncode == 0, boxed.stderr
    own, rules = json.loads(result(tmp_path / "boxed"))["entries"]
    assert (own["controller"], own["ran"], rules["ran"]) == ("mine.py:Mine+sandbox", "boxed", "in process")
    assert set(own["columns"]["end"]) == {"duration"}
    assert "Where they ran: boxed: mine.py:Mine+sandbox; in process: rules." in boxed.stdout
    told = run(*words, "--in-process", "-o", tmp_path / "own", cwd=tmp_path)
    own, _ = json.loads(result(tmp_path / "own"))["entries"]
    assert (own["controller"], own["ran"]) == ("mine.py:Mine", "in process")
    assert set(own["columns"]["end"]) == {"gave_up"}
    assert "Where they ran: in process: mine.py:Mine, rules." in told.stdout


def test_ctrl_c_keeps_what_is_finished(tmp_path: Path) -> None:
    campaign = document()["campaign"] | {"trials": 8, "controllers": ["slow.py:Slow"], "chunk": 4}
    file = written(tmp_path / "suite.json", document(campaign=campaign))
    (tmp_path / "slow.py").write_text(SLOW)
    out = tmp_path / "out"
    words = [COMMAND, "suite", "run", str(file), "-o", str(out), "--workers", "1", "--in-process"]
    with subprocess.Popen(words, stderr=subprocess.PIPE, text=True, cwd=tmp_path, start_new_session=True) as process:
        assert process.stderr is not None
        while not list(out.glob("parts/[0-9]*.parquet")) and process.poll() is None:
            time.sleep(0.02)
        os.killpg(process.pid, signal.SIGINT)
        told = process.stderr.read()
        assert process.wait(timeout=600) == 1
    assert "trials are kept, --resume goes on" in told
    (tmp_path / "go").touch()
    refused = run("run", file, "-o", out, "--in-process", cwd=tmp_path)
    assert refused.returncode == 2
    assert "--resume goes on" in refused.stderr
    done = run("run", file, "-o", out, "--resume", "--workers", "2", "--in-process", cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    again = run("run", file, "-o", tmp_path / "again", "--workers", "2", "--in-process", cwd=tmp_path)
    assert again.returncode == 0, again.stderr
    assert result(out) == result(tmp_path / "again")


def interrupted(words: list[str], folder: Path, kept: Path) -> str:
    """Press Ctrl-C as soon as something is kept; return what the command says."""
    command = [COMMAND, "suite", "run", *words]
    with subprocess.Popen(command, stderr=subprocess.PIPE, text=True, cwd=folder, start_new_session=True) as process:
        assert process.stderr is not None
        while not (kept.exists() and kept.read_text().count("\n") > 1) and process.poll() is None:
            time.sleep(0.01)
        os.killpg(process.pid, signal.SIGINT)
        told = process.stderr.read()
        assert process.wait(timeout=600) == 1, told
    return told


def test_ctrl_c_keeps_the_cases_that_are_finished(tmp_path: Path) -> None:
    file = written(tmp_path / "cases.json", cases(number=12))
    (tmp_path / "slow.py").write_text(SLOW)
    words = [str(file), "--controller", "slow.py:Slow", "--workers", "1", "--in-process"]
    told = interrupted([*words, "-o", "out"], tmp_path, tmp_path / "out" / "cases.jsonl")
    assert "the cases that are finished are kept, --resume goes on" in told
    kept = len((tmp_path / "out" / "cases.jsonl").read_text().splitlines()) - 1
    assert 0 < kept < 12
    (tmp_path / "go").touch()
    for more in (["-o", "out", "--resume"], ["-o", "again", "--workers", "2"]):
        done = run("run", *words, *more, cwd=tmp_path)
        assert done.returncode == 0, done.stderr
    assert result(tmp_path / "out") == result(tmp_path / "again")


def test_ctrl_c_keeps_the_answers_that_are_there(tmp_path: Path) -> None:
    """The first game is answered at once; on the second the solver, a process of its own, waits for ever at first."""
    file = written(tmp_path / "games.json", games())
    first = 'print(json.dumps({"positions": 140, "winning": 140, "realizable": True}))'
    second = 'print(json.dumps({"positions": 1988, "winning": 0}))'
    (tmp_path / "solver.py").write_text(
        "import json, sys, time\nfrom pathlib import Path\n"
        f"if 'one' in sys.argv[1]:\n    {first}\n"
        f"else:\n    while not Path('go').exists():\n        time.sleep(0.05)\n    {second}\n"
    )
    words = [str(file), "--solver", f"{sys.executable} solver.py {{game}}"]
    told = interrupted([*words, "-o", "out"], tmp_path, tmp_path / "out" / "games.jsonl")
    assert "the answers that are there are kept, --resume goes on" in told
    assert len((tmp_path / "out" / "games.jsonl").read_text().splitlines()) == 2
    (tmp_path / "go").touch()
    for more in (["-o", "out", "--resume"], ["-o", "again"]):
        done = run("run", *words, *more, cwd=tmp_path)
        assert done.returncode == 0, done.stderr
        assert "2 of 2 right" in done.stdout
    assert result(tmp_path / "out") == result(tmp_path / "again")


@pytest.mark.path
def test_suites_are_listed_and_shown(tmp_path: Path) -> None:
    listed = run("list").stdout
    for name in ("icra2016", "rules-2026", "synthesis-2026"):
        assert load_suite(name).label in listed
        shown = run("show", name)
        assert load_suite(name).hash in shown.stdout
    assert json.loads(run("show", "icra2016", "--json").stdout)["name"] == "icra2016"
    entries = json.loads(run("list", "--json").stdout)["suites"]
    assert {entry["hash"] for entry in entries} >= {load_suite("icra2016").hash}
    wrong = run("show", tmp_path / "none.json")
    assert wrong.returncode == 2
    assert "no such suite" in wrong.stderr


def test_games_are_run_and_options_of_the_other_kind_refused(tmp_path: Path) -> None:
    file = written(tmp_path / "games.json", games())
    done = run("run", file, "-o", tmp_path / "out")
    assert done.returncode == 0, done.stderr
    assert "dubins-traffic: 2 of 2 right" in done.stdout
    run("run", file, "-o", tmp_path / "again")
    assert result(tmp_path / "out") == result(tmp_path / "again")
    compared = run("compare", f"ada={tmp_path / 'out'}", f"bob={tmp_path / 'again'}", "--suite", file)
    assert "ada: 2 of 2 right" in compared.stdout
    for options in (("--trials", "1"), ("--controller", "simple"), ("--workers", "2")):
        refused = run("run", file, "-o", tmp_path / "no", *options)
        assert refused.returncode == 2
        assert "nothing for a suite of games" in refused.stderr
    refused = run("run", "icra2016", "-o", tmp_path / "no", "--solver", "x {game}")
    assert "nothing for a suite of trials" in refused.stderr
    assert not (tmp_path / "no").exists()
