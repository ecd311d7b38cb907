"""Suites on the command line: the same results however they are run, and what is finished is kept."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import time
from pathlib import Path

import pytest

from dubins_traffic.suites.suite import load_suite
from tests.campaigns import COMMAND
from tests.suites import document, games, written


def run(*arguments: str | Path, cwd: Path | None = None) -> subprocess.CompletedProcess[str]:
    words = [COMMAND, "suite", *map(str, arguments)]
    return subprocess.run(words, check=False, capture_output=True, text=True, timeout=900, cwd=cwd)


def result(folder: Path) -> bytes:
    (path,) = (path for path in folder.glob("*-*.json") if not path.name.endswith(".wall.json"))
    return path.read_bytes()


@pytest.fixture(scope="module")
def rules(tmp_path_factory: pytest.TempPathFactory) -> list[Path]:
    """Results of rules-2026 with one trial of each combination, by one worker and by two."""
    folder = tmp_path_factory.mktemp("rules")
    options = ("run", "rules-2026", "--controller", "rules", "--trials", "1")
    for workers in ("1", "2"):
        done = run(*options, "--workers", workers, "-o", folder / workers)
        assert done.returncode == 0, done.stderr
    return [folder / "1", folder / "2"]


def test_the_number_of_workers_does_not_show(rules: list[Path]) -> None:
    label = load_suite("rules-2026").label
    for folder in rules:
        assert (folder / f"{label}-trials1.json").is_file()
        assert (folder / f"{label}-trials1.wall.json").is_file()
    assert result(rules[0]) == result(rules[1])
    columns = json.loads(result(rules[0]))["entries"][0]["columns"]
    assert len(columns["end"]) == 80
    assert set(columns["end"]) == {"duration"}
    assert all(columns["clean"])


def test_results_are_compared_and_other_hashes_refused(rules: list[Path], tmp_path: Path) -> None:
    one, two = rules
    done = run("compare", f"ada={one}", f"bob={two}", "-o", tmp_path / "page")
    assert done.returncode == 0, done.stderr
    assert "| ada | 80 |" in done.stdout
    assert "| bob | 80 |" in done.stdout
    assert (tmp_path / "page" / "index.html").is_file()
    other = tmp_path / "other.json"
    other.write_bytes(result(one).replace(load_suite("rules-2026").hash.encode(), b"0" * 64))
    done = run("compare", one, other)
    assert done.returncode == 2
    assert "hash: results of another suite" in done.stderr
    assert done.stdout == ""


def test_ctrl_c_keeps_what_is_finished(tmp_path: Path) -> None:
    campaign = document()["campaign"] | {"trials": 200, "controllers": ["slow.py:Slow"], "chunk": 4}
    file = written(tmp_path / "suite.json", document(campaign=campaign))
    (tmp_path / "slow.py").write_text(
        "import time\n\n\nclass Slow:\n    def start(self, problem):\n        pass\n\n"
        "    def act(self, observation):\n        time.sleep(0.0005)\n        return (0.3, 0.1)\n"
    )
    out = tmp_path / "out"
    words = [COMMAND, "suite", "run", str(file), "-o", str(out), "--workers", "1"]
    with subprocess.Popen(
        words, stderr=subprocess.PIPE, text=True, cwd=tmp_path, start_new_session=True
    ) as process:
        assert process.stderr is not None
        while not list(out.glob("parts/[0-9]*.parquet")) and process.poll() is None:
            time.sleep(0.02)
        os.killpg(process.pid, signal.SIGINT)
        told = process.stderr.read()
        assert process.wait(timeout=600) == 1
    assert "trials are kept, --resume goes on" in told
    refused = run("run", file, "-o", out, cwd=tmp_path)
    assert refused.returncode == 2
    assert "--resume goes on" in refused.stderr
    done = run("run", file, "-o", out, "--resume", "--workers", "2", cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    again = run("run", file, "-o", tmp_path / "again", "--workers", "2", cwd=tmp_path)
    assert again.returncode == 0, again.stderr
    assert result(out) == result(tmp_path / "again")


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
