"""A controller that ends its trials is never clean, in no command: they name the fault, count it, and fail."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest

from dubins_traffic.campaign.results import load_results
from dubins_traffic.cli.main import main

CONTROLLERS = '''
class Raises:
    """Raises in its first tick."""

    def start(self, problem):
        pass

    def act(self, observation):
        raise RuntimeError("out of ideas")


class GivesUp:
    """Stands, and gives up at tick 4."""

    def start(self, problem):
        pass

    def act(self, observation):
        return None if observation.tick == 4 else (0.0, 0.0)
'''
SUITE: dict[str, Any] = {
    "version": 0,
    "name": "mine",
    "title": "One town",
    "metric": "counted_rounds",
    "campaign": {
        "version": 0,
        "seed": 1,
        "trials": 2,
        "controllers": ["rules"],
        "configurations": [
            {
                "name": "town",
                "document": {
                    "version": 1,
                    "problem_domain": "dubins_traffic",
                    "network": {"random": {"intersections": 9, "segments": 11}},
                    "e-agents": [{"type": "lawful", "count": 1}],
                    "duration": 5,
                    "rules": True,
                },
            }
        ],
    },
}
CAMPAIGN = """
version = 0
name = "mine"
seed = 1
trials = 2
configurations = ["junction"]
controllers = ["own.py:GivesUp", "own.py:Raises"]
"""


@pytest.fixture(autouse=True)
def own(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    Path("own.py").write_text(CONTROLLERS)


WHO = pytest.mark.parametrize(
    ("who", "end", "reason"),
    [("Raises", "controller_fault", "out of ideas"), ("GivesUp", "gave_up", "gave up at tick 4")],
)


@WHO
@pytest.mark.parametrize("command", ["run", "batch"])
def test_run_and_batch_name_each(
    command: str, who: str, end: str, reason: str, capsys: pytest.CaptureFixture[str]
) -> None:
    arguments = [command, "junction", "--controller", f"own.py:{who}", "--trials", "2", "--json"]
    assert main(arguments) == 1
    out, err = capsys.readouterr()
    sheet = json.loads(out)
    assert sheet["ended_by_controller"] == 2
    assert [own["verdict"]["clean"] for own in sheet["trials"]] == [False, False]
    assert [own["end"] for own in sheet["trials"]] == [end, end]
    lines = [line for line in err.splitlines() if f"{end}: " in line]
    assert len(lines) == 2
    assert all(reason in line for line in lines)


def test_a_suite_of_cases_counts_no_crash_as_clean(capsys: pytest.CaptureFixture[str]) -> None:
    arguments = [
        "suite",
        "run",
        "adversary-2026",
        "--controller",
        "own.py:Raises",
        "-o",
        "out",
        "--workers",
        "1",
    ]
    for more in ([], ["--resume"]):
        assert main([*arguments, *more]) == 1
        out, err = capsys.readouterr()
        rows = {line.split(" | ")[0]: line for line in out.splitlines()}
        assert "0 of 57" in rows["| clean"]
        assert "| 57 |" in rows["| ended by the controller"]
        assert "| controller fault |" in out
        assert "57 of 57 trials ended by a fault (57 controller_fault); the first: " in err
        assert "RuntimeError: out of ideas" in err
    file = next(path for path in Path("out").glob("adversary-2026-*.json") if ".wall." not in path.name)
    document = json.loads(file.read_text())
    document["entries"][0]["columns"]["clean"][3] = True
    file.write_text(json.dumps(document))
    assert main(["suite", "compare", str(file)]) == 2
    assert "a clean trial that its controller ended: got 'controller_fault'" in capsys.readouterr().err


def test_cases_that_were_damaged_are_refused(capsys: pytest.CaptureFixture[str]) -> None:
    arguments = [
        "suite",
        "run",
        "adversary-2026",
        "--controller",
        "own.py:Raises",
        "-o",
        "out",
        "--workers",
        "1",
    ]
    assert main(arguments) == 1
    kept = Path("out/cases.jsonl")
    first, second, *rest = kept.read_text().splitlines()
    for row in ({}, [], "x"):
        line = json.loads(second)
        kept.write_text("\n".join([first, json.dumps({**line, "row": row}), *rest]))
        assert main([*arguments, "--resume"]) == 2
    assert "can't be read as results" in capsys.readouterr().err


@WHO
def test_a_suite_of_trials(who: str, end: str, reason: str, capsys: pytest.CaptureFixture[str]) -> None:
    Path("mine.json").write_text(json.dumps(SUITE))
    arguments = ["suite", "run", "mine.json", "--controller", f"own.py:{who}", "--controller", "rules"]
    assert main([*arguments, "-o", "out", "--workers", "1"]) == 1
    out, err = capsys.readouterr()
    lines = [[cell.strip() for cell in line.split("|")] for line in out.splitlines() if line.startswith("|")]
    table = {line[1]: dict(zip(lines[0], line, strict=True)) for line in lines[2:]}
    own = table[f"own.py:{who}"]
    assert own["clean"].startswith("0.0% [")
    assert (own["ended by the controller"], own["came to nothing"]) == ("2", "0")
    assert table["rules"]["ended by the controller"] == "0"
    assert f"2 of 4 trials ended by a fault (2 {end}); the first: " in err
    assert reason in err


def test_a_campaign_and_its_report(capsys: pytest.CaptureFixture[str]) -> None:
    Path("mine.toml").write_text(CAMPAIGN)
    assert main(["campaign", "run", "mine.toml", "-o", "out", "--workers", "1"]) == 1
    err = capsys.readouterr().err
    assert "4 of 4 trials ended by a fault (2 controller_fault, 2 gave_up); the first: trial 0 with" in err
    found = load_results("out")
    assert found.table["clean"].to_pylist() == [False] * 4
    assert "satisfied" not in found._repr_html_()
    assert main(["campaign", "report", "out", "--worst", "0"]) == 0
    told = [line.split() for line in capsys.readouterr().out.splitlines()]
    counts = [line for line in told if line[:4] == ["ended", "by", "the", "controller"]]
    assert [line[-5:-3] for line in counts] == [["2", "100.0%"]] * 2
    page = Path("out/report/index.html").read_text()
    assert "<th>ended by the controller</th>" in page
