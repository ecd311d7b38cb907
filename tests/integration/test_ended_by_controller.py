"""A controller that ends its trials is never clean, in no command: they name the fault, count it, and fail."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest

from dubins_traffic.campaign.report.statistics import clopper_pearson
from dubins_traffic.campaign.results import load_results
from dubins_traffic.cars.state import Observation
from dubins_traffic.cli.main import main
from dubins_traffic.errors import InputError
from dubins_traffic.falsification.estimate import by_counting
from dubins_traffic.falsification.sampling import prepared
from dubins_traffic.falsification.search import falsify
from dubins_traffic.falsification.trying import LocalRunner
from dubins_traffic.problem.configuration import load_config
from dubins_traffic.problem.draw import draw_many
from dubins_traffic.runs.single import run_trial
from tests.boxes import needs_boxes

CASES = Path(__file__).parent.parent / "cases"
SPRING = Path(__file__).parents[2] / "examples" / "competition"

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


@needs_boxes
@WHO
def test_a_submission(who: str, end: str, reason: str, capsys: pytest.CaptureFixture[str]) -> None:
    Path("entry.py").write_text(CONTROLLERS + f"\n\nController = {who}\n")
    arguments = ["evaluate", "entry.py", "--competition", str(SPRING), "-o", "out"]
    for _ in ("run", "read again"):
        assert main(arguments) == 1
        out, err = capsys.readouterr()
        rows = [[cell.strip() for cell in line.split("│")[1:-1]] for line in out.splitlines() if "│" in line]
        ended = [row for row in rows if row[0].isdecimal()]
        assert [row[0] for row in ended] == ["0", "1", "2", "3"]
        assert all((row[3], row[-1]) == ("0", "submission") for row in ended)
        assert sum(row.count("gave up") + row.count("controller") for row in rows) == 4
        assert "means of 4 trials, 4 ended by the controller: counted_rounds 0" in out
        assert f"4 of 4 trials ended by a fault (4 {end}); the first: trial 0: {end}: " in err
        assert reason in err
    assert main([*arguments, "--json"]) == 1
    sheet = json.loads(capsys.readouterr().out)
    assert [own["end"] for own in sheet["trials"]] == [end] * 4
    assert (sheet["summary"]["clean"], sheet["summary"]["counted_rounds"]) == (0.0, 0.0)


@WHO
def test_a_record_says_how_its_trial_ended(who: str, end: str, reason: str, capsys: pytest.CaptureFixture[str]) -> None:
    for name, out in ((f"own.py:{who}", "early"), ("lanes", "whole")):
        main(["run", "junction", "--controller", name, "--trials", "1", "--records", out])
    whole = Path("whole/trial-0000.mcap").read_bytes()
    Path("cut.mcap").write_bytes(whole[: len(whole) * 2 // 3])
    told: list[str] = []
    for record in ("early/trial-0000.mcap", "whole/trial-0000.mcap", "cut.mcap"):
        capsys.readouterr()
        assert main(["check", record]) == 0
        told.append(capsys.readouterr().out)
    (line,) = [line for line in told[0].splitlines() if "ended early" in line]
    assert line.startswith(f"  ended early: {end}: ")
    assert reason in line
    assert "ended early" not in told[1]
    assert "\n  ended early: cut off\n" in told[2]
    assert main(["check", "--json", "early/trial-0000.mcap", "cut.mcap"]) == 0
    found = json.loads(capsys.readouterr().out)["records"]
    assert [own["end"] for own in found] == [end, None]


BY_FAULTY = ["suite", "run", "adversary-2026", "--controller", "own.py:Raises", "-o", "out", "--workers", "1"]
BY_FAULTY += ["--in-process"]
"""The command that runs a controller that raises on a suite of cases."""


def test_a_suite_of_cases_counts_no_crash_as_clean(capsys: pytest.CaptureFixture[str]) -> None:
    for more in ([], ["--resume"]):
        assert main([*BY_FAULTY, *more]) == 1
        out, err = capsys.readouterr()
        rows = {line.split(" | ")[0]: line for line in out.splitlines()}
        assert "0 of 56" in rows["| clean"]
        assert "| 56 |" in rows["| ended by the controller"]
        assert "| controller fault |" in out
        assert "56 of 56 trials ended by a fault (56 controller_fault); the first: " in err
        assert "RuntimeError: out of ideas" in err
    file = next(path for path in Path("out").glob("adversary-2026-*.json") if ".wall." not in path.name)
    document = json.loads(file.read_text())
    document["entries"][0]["columns"]["clean"][3] = True
    file.write_text(json.dumps(document))
    assert main(["suite", "compare", str(file)]) == 2
    assert "a clean trial that its controller ended: got 'controller_fault'" in capsys.readouterr().err


def test_cases_that_were_damaged_are_refused(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(BY_FAULTY) == 1
    kept = Path("out/cases.jsonl")
    first, second, *rest = kept.read_text().splitlines()
    for row in ({}, [], "x"):
        line = json.loads(second)
        kept.write_text("\n".join([first, json.dumps({**line, "row": row}), *rest]))
        assert main([*BY_FAULTY, "--resume"]) == 2
    assert "can't be read as results" in capsys.readouterr().err


@WHO
def test_a_suite_of_trials(who: str, end: str, reason: str, capsys: pytest.CaptureFixture[str]) -> None:
    Path("mine.json").write_text(json.dumps(SUITE))
    arguments = ["suite", "run", "mine.json", "--controller", f"own.py:{who}", "--controller", "rules"]
    assert main([*arguments, "-o", "out", "--workers", "1", "--in-process"]) == 1
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
    each = "own.py:GivesUp 2 of 2, own.py:Raises 2 of 2"
    assert f"Trials ended by the controller: {each}." in capsys.readouterr().out.splitlines()
    assert main(["campaign", "report", "out", "--worst", "0", "--all", "--overwrite"]) == 0
    told = [line.split() for line in capsys.readouterr().out.splitlines()]
    counts = [line for line in told if line[:4] == ["ended", "by", "the", "controller"]]
    assert [line[-5:-3] for line in counts] == [["2", "100.0%"]] * 2
    page = Path("out/report/index.html").read_text()
    assert "<th>ended by the controller</th>" in page


def test_no_estimate_rests_on_trials_that_their_controller_ended(capsys: pytest.CaptureFixture[str]) -> None:
    arguments = ["estimate", "junction", "--controller", "own.py:Raises", "--trials", "8", "--duration", "1"]
    assert main(arguments) == 1
    out, err = capsys.readouterr()
    assert out == "1.collision is broken: no estimate, since all 8 trials ended by a fault\n"
    assert "8 of 8 trials ended by a fault (8 controller_fault); the first: trial 0: controller_fault: " in err
    assert "out of ideas" in err
    assert main([*arguments, "--json"]) == 1
    found = json.loads(capsys.readouterr().out)
    assert (found["probability"], found["interval"], found["wilson"]) == (None, [0.0, 1.0], None)
    assert (found["trials"], found["left_out"], found["events"]) == (8, 8, 0)
    assert main([*arguments, "--method", "splitting", "--particles", "10"]) == 1
    assert "ended by a fault (controller_fault: " in capsys.readouterr().err


def test_an_estimate_leaves_out_who_ended_a_trial_before_the_event_and_counts_who_did_after() -> None:
    drawn = list(draw_many(prepared(load_config("junction"), 4.0, {}), 0, range(16)))
    ticks = {own.trial: 6 + 6 * own.trial if own.trial % 2 else 10**6 for own in drawn}

    class Wild:
        """Drives in circles; in every second trial it raises after a while."""

        made = 0

        def __init__(self) -> None:
            self.trial, Wild.made = Wild.made - 1, Wild.made + 1

        def start(self, problem: object) -> None:
            pass

        def act(self, observation: Observation) -> tuple[float, float]:
            if observation.tick == ticks[self.trial]:
                raise RuntimeError("out of ideas")
            return 0.8, 0.6

    broke: list[bool] = []
    for own in drawn:
        Wild.made = own.trial + 1
        result = run_trial(own, Wild(), sketch=False)
        assert result.score.verdict is not None
        found = {one.rule for one in result.score.verdict.violations if one.car == "ego"}
        broke.append("1.road" in found)
    left = sum(own.trial % 2 and not bad for own, bad in zip(drawn, broke, strict=True))
    assert 0 < left < 8, "some of both kinds"
    Wild.made = 0
    once = by_counting(drawn, LocalRunner(Wild, "wild"), "1.road", 0.0, lambda _: None)
    assert (once.trials, once.left_out, once.events) == (16, left, sum(broke))
    assert once.probability == sum(broke) / (16 - left)
    assert once.interval == clopper_pearson(sum(broke), 16 - left)
    assert once.fault.startswith("8 of 16 trials ended by a fault (8 controller_fault); the first: trial 1: ")


@pytest.mark.parametrize("below", ["nan", "inf", "-inf"])
def test_a_margin_that_is_no_number_is_refused(below: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["estimate", "junction", f"--below={below}", "--trials", "2"]) == 2
    assert f"--below: not a margin: got {below}; expected a finite number" in capsys.readouterr().err
    with pytest.raises(InputError, match="--seconds"):
        falsify("junction", seconds=float("nan"))
    for name in ("begin", "silence"):
        assert main(["lines", "run", "junction", f"--{name}={below}"]) == 2
        assert f"--{name}: not a positive number: got {below}" in capsys.readouterr().err


@WHO
def test_a_search_names_the_fault_keeps_it_and_tests_nothing_by_it(
    who: str, end: str, reason: str, capsys: pytest.CaptureFixture[str]
) -> None:
    arguments = ["falsify", "junction", "--controller", f"own.py:{who}", "-o", "out"]
    for trials, more in (("32", []), ("64", ["--resume"])):
        assert main([*arguments, "--trials", trials, *more]) == 1
        out, err = capsys.readouterr()
        assert "the ego broke a rule in 0, " in out
        assert f"{trials} ended by a fault; " in out
        assert f"{trials} of {trials} trials ended by a fault ({trials} {end}); the first: trial 0: {end}: " in err
        assert reason in err
    report = json.loads(Path("out/search.json").read_text())
    assert (report["faulty"], report["faults"], report["violated"]) == (64, {end: 64}, 0)
    assert {name.partition("-")[0] for name in report["cases"]} == {end}
    assert all(f"the controller ended the trial: {end}: " in own for own in report["cases"].values())
    assert all(reason in own for own in report["cases"].values())
    assert all(row["tested"] == 0 for row in report["coverage"])


@WHO
def test_who_ends_a_case_has_not_passed_it_and_can_not_be_shrunk_by_it(
    who: str, end: str, reason: str, capsys: pytest.CaptureFixture[str]
) -> None:
    case = CASES / "lanes" / "3.order.json"
    Path("cases").mkdir()
    (Path("cases") / "one.json").write_text(case.read_text())
    assert main(["regress", "cases", "--controller", f"own.py:{who}"]) == 1
    out = capsys.readouterr().out
    assert out.startswith(f"one.json: {end}: ")
    assert reason in out
    assert "0 of 1 cases passed, 1 ended by a fault" in out
    assert main(["shrink", "cases/one.json", "--controller", f"own.py:{who}", "-o", "small.json"]) == 1
    err = capsys.readouterr().err
    assert f"{end}: " in err
    assert reason in err
    assert not Path("small.json").exists()
