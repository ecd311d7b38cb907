"""`dubins-traffic verify` and what `check` makes of records that conceal contacts."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from experiments.verify import CONTROLLERS, WAYS, case, verified

import dubins_traffic as dt
from dubins_traffic.campaign.run_campaign import run_campaign
from dubins_traffic.cli.main import main
from dubins_traffic.problem.document import instance_to_document
from dubins_traffic.record import schema, wall
from tests.campaigns import campaign, written
from tests.tampering import find, heading, put, rebuilt

Run = Callable[..., str]
DOCUMENT: dict[str, Any] = {
    "version": 1,
    "problem_domain": "dubins_traffic",
    "network": {"grid": {"rows": 3, "columns": 4}},
    "e-agents": [{"type": "wander", "name": "agent", "count": 2}],
    "duration": 3,
    "number_goals_bounds": [2, 2],
    "rules": True,
}


@pytest.fixture
def run(capsys: pytest.CaptureFixture[str]) -> Run:
    def command(*arguments: str | Path, status: int = 0) -> str:
        assert main([str(word) for word in arguments]) == status
        printed = capsys.readouterr()
        return printed.out + printed.err

    return command


@pytest.fixture
def config(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)
    path = tmp_path / "short.json"
    path.write_text(json.dumps(DOCUMENT))
    return path


@pytest.fixture
def record(run: Run, config: Path) -> Path:
    run("run", config, "--seed", "4", "--records", "out")
    return Path("out/trial-0000.mcap")


def test_records_of_runs_batches_and_campaigns_are_verified(run: Run, config: Path) -> None:
    run("run", config, "--seed", "4", "--records", "out", "--trials", "2")
    run("run", config, "--seed", "4", "--records", "shielded", "--shield", "--controller", "simple")
    run("batch", config, "--trials", "2", "--keep", "all", "--records", "kept")
    file = written(Path.cwd(), campaign(trials=2, controllers=["lanes", "rules", "controllers.py:Logged"]))
    run_campaign(file, "campaign", workers=1, records="all")
    folders = {"out": 2, "shielded": 1, "kept": 2, "campaign/records": 24}
    for folder, count in folders.items():
        records = sorted(Path(folder).glob("*.mcap"))
        assert len(records) == count
        assert run("verify", *records).splitlines() == [f"{path}: verified" for path in records]


@pytest.mark.path
def test_one_line_a_record_and_the_exit_status(run: Run, record: Path) -> None:
    data = record.read_bytes()
    Path("bad.mcap").write_bytes(rebuilt(data, put(schema.FRAMES, 40, "x", 0, 0.0, 3)))
    Path("cut.mcap").write_bytes(data[: len(data) // 2])
    Path("none.mcap").write_bytes(data[:100])
    told = run("verify", record, "bad.mcap", "cut.mcap", status=1).splitlines()
    assert told[0] == f"{record}: verified"
    assert told[1].startswith("bad.mcap: differs: x of ego at tick 40: recorded 0.0, expected ")
    assert told[2].startswith("cut.mcap: verified, ends early: cut off after tick ")
    told = run("verify", "none.mcap", "bad.mcap", record, status=2).splitlines()
    assert f"{record}: verified" in told
    assert any(line.startswith("dubins-traffic: none.mcap: cut off before") for line in told)
    assert "no.mcap: can't be read" in run("verify", "no.mcap", status=2)


def test_json_for_machines(run: Run, record: Path) -> None:
    Path("bad.mcap").write_bytes(rebuilt(record.read_bytes(), put(schema.LABELS, 0, "bits", 1, 0, 3)))
    found = json.loads(run("verify", record, "bad.mcap", "--json", status=1))["records"]
    assert [entry["verified"] for entry in found] == [True, False]
    assert found[0] == {
        "record": str(record),
        "verified": True,
        "difference": None,
        "world": "embedded",
        "ticks": 90,
        "cars": 3,
        "end": "duration",
        "written_by": dt.__version__,
        "unchecked": [
            "commands of the ego",
            "what the controller reported",
            "the controller's name and the versions",
            "the sidecar",
        ],
        "sheet": None,
    }
    difference = found[1]["difference"]
    assert (difference["what"], difference["tick"], difference["car"]) == ("bits", 0, "agent0")
    assert difference["recorded"] == 0


def test_the_instance_that_was_to_be_run(run: Run, config: Path, record: Path) -> None:
    assert "verified" in run("verify", record, "--configuration", config, "--seed", "4")
    assert "instance." in run("verify", record, "--configuration", config, "--seed", "5", status=1)
    assert "instance." in run("verify", record, "--configuration", config, "--seed", "4", "--trial", "1", status=1)
    given = dt.draw(dt.load_config(config), 4, 0)
    Path("given.json").write_text(json.dumps(instance_to_document(given)))
    assert "verified" in run("verify", record, "--instance", "given.json")
    elsewhere = heading(lambda own: own["instance"].update(simulator="gazebo"))
    Path("there.mcap").write_bytes(rebuilt(record.read_bytes(), elsewhere))
    assert "in the world gazebo" in run("verify", "there.mcap")
    told = run("verify", "there.mcap", "--instance", "given.json", status=1)
    assert "instance.simulator: recorded gazebo, expected embedded" in told
    run("verify", "there.mcap", "--instance", "given.json", "--simulator", "gazebo")
    assert "two sources" in run("verify", record, "--instance", "given.json", "--configuration", config, status=2)
    assert "needs more" in run("verify", record, "--trial", "1", status=2)


def test_scores_that_were_printed_are_those_of_the_records(run: Run, config: Path) -> None:
    printed = run("run", config, "--seed", "4", "--records", "out", "--trials", "2", "--json")
    printed = printed[: printed.rindex("}") + 1]
    Path("scores.json").write_text(printed)
    records = sorted(Path("out").glob("*.mcap"))
    told = run("verify", *records, "--scores", "scores.json").splitlines()
    assert told == [f"{path}: verified" for path in records]
    document = json.loads(printed)
    document["trials"][1]["icra2016"] += 1
    Path("scores.json").write_text(json.dumps(document))
    told = run("verify", *records, "--scores", "scores.json", status=1).splitlines()
    assert told[0] == f"{records[0]}: verified"
    assert told[1].startswith(f"{records[1]}: differs: score.icra2016: recorded ")
    Path("scores.json").write_text(json.dumps({"trials": document["trials"][:1]}))
    told = run("verify", *records, "--scores", "scores.json", status=1)
    assert "score: recorded nothing, expected a score of trial-0001.mcap" in told
    Path("scores.json").write_text("{}")
    assert "no scores" in run("verify", *records, "--scores", "scores.json", status=2)


def test_a_score_sheet_beside_the_records_is_checked_unasked(run: Run, config: Path) -> None:
    printed = run("run", config, "--seed", "4", "--records", "out", "--trials", "2", "--json")
    document = json.loads(printed[: printed.rindex("}") + 1])
    records = sorted(Path("out").glob("*.mcap"))
    sheet = Path("out/scores.json")
    sheet.write_text(json.dumps(document))
    assert run("verify", records[0]).strip() == f"{records[0]}: verified, with its score in {sheet}"
    document["trials"][0]["ran"] = "boxed"
    document["trials"][1]["counted_rounds"] += 1
    sheet.write_text(json.dumps(document))
    told = run("verify", *records, status=1).splitlines()
    assert told[0] == f"{records[0]}: differs: score.ran: recorded boxed, expected in process"
    assert told[1].startswith(f"{records[1]}: differs: score.counted_rounds: recorded ")
    sheet.write_text(json.dumps({"trials": document["trials"][:1]}))
    assert run("verify", records[1]).strip() == f"{records[1]}: verified"
    sheet.write_text("[]")
    assert "scores.json" in run("verify", records[1], status=2)


def test_an_altered_sidecar_is_no_concern_of_it(run: Run, record: Path) -> None:
    wall.write(record, wall.measured(0.0, {}))
    assert "verified" in run("verify", record)
    wall.sidecar(record).write_text("{")
    assert "verified" in run("verify", record)


class Rammer:
    """Drives straight into the car ahead."""

    def start(self, problem: dt.Problem) -> None:
        self.problem = problem

    def act(self, observation: dt.Observation) -> tuple[float, float]:
        return (1.0 if observation.tick < 120 else 0.0), 0.0


def test_check_judges_contacts_that_a_record_conceals(run: Run, tmp_path: Path) -> None:
    problem = DOCUMENT | {
        "duration": 5,
        "ego": {"start": [0.9, -0.3, 0.0]},
        "e-agents": [{"type": "parked", "name": "van", "start": [2.0, -0.3, 0.0]}],
        "network": {"grid": {"rows": 3, "columns": 4, "length": 6.0}},
    }
    path = tmp_path / "a.mcap"
    result = dt.run_trial(dt.draw(dt.load_config(problem), 0, 0), Rammer(), record=path)
    assert result.score.collisions

    def conceal(chunks: list[list[Any]]) -> None:
        m, k = find(chunks, schema.CONTACTS)
        del chunks[m][k]

    concealed = tmp_path / "b.mcap"
    concealed.write_bytes(rebuilt(path.read_bytes(), conceal))
    assert not dt.load_record(concealed).frames.contacts
    honest, found = (json.loads(run("check", each, "--json"))["records"][0] for each in (path, concealed))
    assert found["violations"] == honest["violations"]
    assert "1.collision" in {entry["rule"] for entry in found["violations"]}
    assert "contact of ego at tick" in run("verify", concealed, status=1)


@pytest.mark.skipif(not hasattr(signal, "SIGKILL"), reason="nothing kills here")
def test_a_controller_that_kills_its_process_leaves_what_can_be_verified(config: Path) -> None:
    Path("mine.py").write_text(
        "import os\nclass Mine:\n    def start(self, problem): pass\n"
        "    def act(self, seen):\n        if seen.tick == 70: os.kill(os.getpid(), 9)\n        return 0.3, 0.1\n"
    )
    program = [sys.executable, "-m", "dubins_traffic.cli", "run", str(config), "--controller", "mine.py:Mine"]
    subprocess.run([*program, "--records", "out"], capture_output=True, check=False, env=dict(os.environ))
    found = dt.verify("out/trial-0000.mcap")
    assert found.verified
    assert (found.end, found.ticks) == (None, 59)


def test_records_of_all_kinds_are_verified(tmp_path: Path) -> None:
    """`python -m experiments.verify 500` is the whole of it."""
    accepted, refused, _ = verified(36, tmp_path)
    assert refused == []
    assert accepted.total() == 36
    assert {case(number)[1] for number in range(36)} == set(CONTROLLERS)
    assert set(accepted) == {case(number)[2] for number in range(36)} == set(WAYS)
