"""A competition from nothing: entries judged at home, the same however they are run; seeds, places, the commands."""

from __future__ import annotations

import json
import os
import random
import re
import resource
import shutil
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Sequence
from datetime import UTC, datetime
from pathlib import Path

import pytest

from dubins_traffic import load_record
from dubins_traffic.cli.main import main
from dubins_traffic.competition.competition import Competition, load_competition
from dubins_traffic.competition.judging import RESULTS, FramesHash, Judged, evaluate, judge, load_evaluation
from dubins_traffic.competition.ranking import rank
from dubins_traffic.competition.rehearsal import Rehearsed
from dubins_traffic.competition.sealing import seal
from dubins_traffic.competition.submission import Submission, check_submission
from dubins_traffic.competition.templates import template_files, write_template
from dubins_traffic.competition.visibility import SubmissionState, visible
from dubins_traffic.errors import InputError
from dubins_traffic.runs.single import run_trial
from tests.boxes import needs_boxes
from tests.competitions import CONTROLLERS, IDLE, KEY, PRACTICE, ROAD, TEST, competition
from tests.ros import need_compiler
from tests.services import competition_text

ROOT = Path(__file__).parents[2]
SHORT = {**ROAD, "duration": 6}


def short(trials: int, **more: object) -> Competition:
    practice = {**PRACTICE, "trials": trials, **more}
    return competition(configurations=[{"name": "road", "document": SHORT}], phases={"practice": practice})


def entry(name: str, store: Path) -> Submission:
    return check_submission(CONTROLLERS[name].encode(), store)


def told(results: Sequence[Judged]) -> dict[int, object]:
    return {own.number: own.to_json() for own in results}


@pytest.fixture
def command(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> Callable[..., subprocess.CompletedProcess[str]]:
    """Run a command in this process, in the folder of the test."""
    monkeypatch.chdir(tmp_path)

    def run(*words: str | Path) -> subprocess.CompletedProcess[str]:
        capsys.readouterr()
        status = main([str(word) for word in words])
        out, err = capsys.readouterr()
        return subprocess.CompletedProcess(words, status, out, err)

    return run


@needs_boxes
def test_frames_are_the_same_in_any_order_and_number_of_workers(tmp_path: Path) -> None:
    phase, submission = short(8).phase("practice"), entry("speaks_lines", tmp_path / "store")
    first = evaluate(phase, submission, tmp_path / "one")
    evaluate(phase, submission, tmp_path / "two", workers=2)
    assert (tmp_path / "one" / RESULTS).read_bytes() == (tmp_path / "two" / RESULTS).read_bytes()
    order = list(phase.numbers)
    random.Random(1).shuffle(order)
    assert told(list(judge(phase, order, submission))) == told(first.results)
    assert len({own.frames for own in first.results}) == 8
    assert {own.end for own in first.results} == {"duration"}


@needs_boxes
def test_the_box_changes_no_frame(tmp_path: Path) -> None:
    phase, submission = short(3).phase("practice"), entry("homes", tmp_path / "store")
    boxed = list(judge(phase, phase.numbers, submission))
    for own, seed in zip(boxed, phase.seeds(), strict=True):
        digest = FramesHash()
        controller = f"{submission.path}/controller.py:Controller"
        run_trial(phase.instance(own.number, seed), controller, sinks=(digest,))
        assert own.frames == digest.result()
        assert "goals" in own.log


@needs_boxes
def test_what_is_finished_is_not_run_again(tmp_path: Path) -> None:
    phase, submission = short(4).phase("practice"), entry("speaks_lines", tmp_path / "store")
    whole = evaluate(phase, submission, tmp_path / "out")
    lines = (tmp_path / "out" / RESULTS).read_text().splitlines()
    changed = lines[1].replace('"log":"', '"log":"kept ')
    (tmp_path / "out" / RESULTS).write_text("\n".join([lines[0], changed, lines[3], lines[4][:50]]))
    seen: list[tuple[int, int]] = []
    again = evaluate(phase, submission, tmp_path / "out", progress=lambda done, of: seen.append((done, of)))
    assert seen == [(2, 4), (3, 4), (4, 4)]
    assert [own.frames for own in again.results] == [own.frames for own in whole.results]
    assert again.results[0].log.startswith("kept ")
    with pytest.raises(InputError, match="holds another evaluation"):
        evaluate(phase, entry("homes", tmp_path / "store"), tmp_path / "out")
    with pytest.raises(InputError, match="holds another evaluation"):
        evaluate(short(5).phase("practice"), submission, tmp_path / "out")


@needs_boxes
def test_records_hold_what_was_judged(tmp_path: Path) -> None:
    phase, submission = short(2).phase("practice"), entry("speaks_lines", tmp_path / "store")
    found = evaluate(phase, submission, tmp_path / "out", records=True)
    for own in found.results:
        record = load_record(tmp_path / "out" / "records" / f"trial-{own.number:06d}.mcap")
        assert record.instance.trial == own.number
        assert record.controller == f"{submission.digest[:12]}+sandbox"


@needs_boxes
def test_entries_that_do_not_drive_rank_last(tmp_path: Path) -> None:
    phase = competition(phases={"practice": {**PRACTICE, "trials": 2}}).phase("practice")
    entries = {name: list(judge(phase, phase.numbers, entry(name, tmp_path))) for name in ("rules", *IDLE)}
    places = rank(entries, phase)
    assert places[0].entry == "rules"
    assert places[0].estimate.mean is not None
    assert places[0].estimate.mean > 0
    assert {own.entry: own.place for own in places[1:]} == dict.fromkeys(IDLE, 2)
    ends = {name: {own.end for own in results} for name, results in entries.items()}
    owners = {name: {own.owner for own in results} for name, results in entries.items()}
    assert ends["crashes"] == ends["never_starts"] == {"controller_fault"}
    assert ends["gives_up"] == {"gave_up"}
    assert owners["crashes"] == {"submission"}
    assert owners["stands"] == {None}


@needs_boxes
def test_what_is_finished_is_kept_on_a_full_disk(tmp_path: Path) -> None:
    phase, submission = short(3).phase("practice"), entry("speaks_lines", tmp_path / "store")
    whole = evaluate(phase, submission, tmp_path / "one")
    size = (tmp_path / "one" / RESULTS).stat().st_size
    soft, hard = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (size - 100, hard))
    try:
        with pytest.raises(InputError, match="what is finished is kept"):
            evaluate(phase, submission, tmp_path / "two")
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, (soft, hard))
    assert [own.number for own in load_evaluation(tmp_path / "two").results] == [0, 1]
    assert evaluate(phase, submission, tmp_path / "two") == whole


@pytest.mark.path
def test_a_trial_that_can_not_be_drawn_is_no_fault_of_the_submission(tmp_path: Path) -> None:
    full = {**SHORT, "e-agents": [{"type": "lawful", "name": "car", "count": 90}]}
    found = competition(
        tmp_path,
        configurations=[{"name": "road", "document": full}],
        phases={"practice": {**PRACTICE, "trials": 1}, "test": {**TEST, "trials": 1}},
    )
    (own,) = judge(found.phase("practice"), [0], entry("speaks_lines", tmp_path / "store"))
    assert (own.end, own.owner, own.counts, own.frames) == ("failed", "platform", False, None)
    assert "can't be drawn" in own.row["reason"]
    with pytest.raises(InputError, match="practice: road"):
        found.phase("practice").check_draws()
    with pytest.raises(InputError):
        seal(found.phase("test"), KEY)


@needs_boxes
def test_other_seeds_of_a_test_phase_show_the_same(tmp_path: Path) -> None:
    seen: list[str] = []
    frames: list[str | None] = []
    for name in ("one", "two"):
        phase = competition(
            tmp_path / name,
            configurations=[{"name": "road", "document": SHORT}],
            phases={"test": {**TEST, "trials": 2}},
        ).phase("test")
        seal(phase, KEY)
        seeds = dict(enumerate(phase.seeds(KEY)))
        found = list(judge(phase, phase.numbers, entry("speaks_lines", tmp_path / "store"), seeds=seeds))
        frames += [own.frames for own in found]
        within = datetime(2026, 1, 15, tzinfo=UTC)
        seen.append(json.dumps(visible(phase, SubmissionState("done"), found, now=within)))
    assert len(set(frames)) == 4
    assert seen[0] == seen[1]


@needs_boxes
def test_a_season_on_the_command_line(tmp_path: Path, command: Callable[..., subprocess.CompletedProcess[str]]) -> None:
    shutil.copytree(ROOT / "examples" / "competition", tmp_path / "spring")
    file = tmp_path / "spring" / "competition.toml"
    dates = {"2027-02-15": "2026-01-01", "2027-03-01": "2026-02-01", "2027-01-01": "2025-12-01"}
    text = file.read_text().replace("trials = 20", "trials = 2").replace("trials = 4", "trials = 2")
    for before, after in dates.items():
        text = text.replace(before, after)
    file.write_text(text)
    key = tmp_path / "spring.key"

    def ours(*words: str | Path, status: int = 0) -> str:
        done = command(*words)
        assert done.returncode == status, done.stderr
        return done.stdout if status == 0 else done.stderr

    assert "2 trials of town; shows nothing; secret seeds" in ours("competition", "check", "spring")
    sealed = ours("competition", "seal", "spring", "--phase", "test", "--key-file", key)
    assert ours("competition", "open", "spring", "--phase", "test") == sealed
    assert "outside" in ours("competition", "reveal", "spring", "--phase", "test", "--key-file", "spring/key", status=2)
    ours("template", "python", "entry")
    (tmp_path / "good.py").write_text(CONTROLLERS["rules"])
    late = ours("evaluate", "entry", "--competition", "spring", "--phase", "test", status=2)
    assert "the seeds are secret" in late
    ours("competition", "reveal", "spring", "--phase", "test", "--key-file", key)
    digest = sealed.split()[1]
    assert "2 seeds, as committed to" in ours("competition", "verify", "spring", "--phase", "test")
    ours("competition", "verify", "spring", "--phase", "test", "--commitment", digest)
    wrong = ours("competition", "verify", "spring", "--phase", "test", "--commitment", "0" * 64, status=2)
    assert "not those that were committed to" in wrong
    for name, path in (("ours", "entry"), ("good", "good.py")):
        ours("evaluate", path, "--competition", "spring", "--phase", "test", "-o", f"results/{name}")
    places = json.loads(
        ours(
            "competition",
            "rank",
            "spring",
            "--phase",
            "test",
            "results/ours",
            "second=results/good",
            "--json",
        )
    )
    assert places["places"][0]["place"] == 1
    assert {own["entry"] for own in places["places"]} == {"ours", "second"}
    assert [(own["first"], own["second"]) for own in places["differences"]] == [("ours", "second")]
    assert "counted_rounds of 2 trials" in ours("competition", "rank", "spring", "--phase", "test", "results/ours")


@needs_boxes
def test_a_rehearsal_goes_through_all_phases_and_tells_the_load(
    command: Callable[..., subprocess.CompletedProcess[str]], tmp_path: Path
) -> None:
    (tmp_path / "competition.toml").write_text(competition_text(3))
    given = ("--trials", "2", "--trust-submissions", "--teams", "3", "--submissions", "1000")
    ran = command("competition", "rehearse", ".", "--controller", "simple", *given)
    assert ran.returncode == 0, ran.stderr
    *each, heading, _practice, _validation, _test, season = ran.stdout.splitlines()
    phases = load_competition(tmp_path).phases
    assert [line.split(" s each")[0].rpartition(", ")[0] for line in each] == [
        f"{phase.name}: simple: 2 trials" for phase in phases
    ]
    assert heading.startswith("With 3 teams, each with 1000 submissions")
    assert re.fullmatch(r"The season's load takes [\d.]+ (s|minutes|hours|days) on 1 such workers\.", season)
    assert list(tmp_path.iterdir()) == [tmp_path / "competition.toml"]


def test_a_load_is_that_of_the_trials_and_those_run_again_within_the_quota(tmp_path: Path) -> None:
    (tmp_path / "competition.toml").write_text(competition_text(3))
    practice, _, test = load_competition(tmp_path).phases
    assert Rehearsed(practice, "simple", 2, 0.5, ()).load(100) == 100 * (3 + 1) * 0.5
    assert Rehearsed(test, "simple", 2, 0.5, ()).load(100) == 10 * (3 + 1) * 0.5


def test_ctrl_c_keeps_what_is_finished(tmp_path: Path) -> None:
    (tmp_path / "entry").write_text(CONTROLLERS["speaks_lines"])
    shutil.copytree(ROOT / "examples" / "competition", tmp_path / "spring")
    file = tmp_path / "spring" / "competition.toml"
    file.write_text(file.read_text().replace("trials = 4", "trials = 200"))
    line = ["evaluate", "entry", "--competition", "spring", "-o", "out", "--workers", "2"]
    results = tmp_path / "out" / RESULTS
    with subprocess.Popen(
        [sys.executable, "-m", "dubins_traffic.cli", *line],
        cwd=tmp_path,
        stderr=subprocess.PIPE,
        text=True,
        start_new_session=True,
    ) as process:
        deadline = time.monotonic() + 600
        while not results.exists() or len(results.read_bytes().splitlines()) < 4:
            assert process.poll() is None
            assert time.monotonic() < deadline
            time.sleep(0.02)
        os.killpg(process.pid, signal.SIGINT)
        _, stderr = process.communicate(timeout=600)
    assert process.returncode == 1
    assert "of 200 trials are kept, the same command goes on" in stderr
    kept = len(load_evaluation(tmp_path / "out").results)
    assert 3 <= kept < 200


def drive_in_town(entry: Path, folder: Path) -> None:
    """Hand in a template as it is for the practice of the competition in the repository: most trials must count."""
    phase = load_competition(ROOT / "examples" / "competition").phase("practice")
    found = evaluate(phase, check_submission(entry, folder / "store"), folder / "out")
    assert {(own.end, own.log) for own in found.results} == {("duration", "2 goals")}
    counted = [own.row["counted_rounds"] for own in found.results]
    assert sum(rounds > 0 for rounds in counted) > len(counted) / 2, counted


@needs_boxes
@pytest.mark.tools
def test_the_template_in_cpp_has_counted_rounds_as_it_is(tmp_path: Path) -> None:
    need_compiler()
    write_template("cpp", tmp_path / "cpp")
    make = ["make", "-s", "CXXFLAGS=-O2 -std=c++17 -Wall -Wextra -Werror"]
    subprocess.run(make, cwd=tmp_path / "cpp", check=True)
    drive_in_town(tmp_path / "cpp", tmp_path)


@needs_boxes
def test_the_template_in_python_has_counted_rounds_as_it_is(tmp_path: Path) -> None:
    write_template("python", tmp_path / "python")
    drive_in_town(tmp_path / "python", tmp_path)


def test_the_template_in_python_is_the_lane_keeper() -> None:
    """But for its name, what is said above it, and the line that goes to the log."""
    example = (ROOT / "examples" / "lane_keeper.py").read_text()
    template = template_files("python")["controller.py"]
    code = [line for line in template.splitlines() if line != "import sys" and "sys.stderr" not in line]
    own = "\n".join(code).replace("class Controller", "class LaneKeeper")
    assert own[own.index("from math") :].strip() == example[example.index("from math") :].strip()


@needs_boxes
def test_results_kept_in_the_folder_of_an_entry_are_no_part_of_it(
    tmp_path: Path, command: Callable[..., subprocess.CompletedProcess[str]]
) -> None:
    (tmp_path / "entry").write_text(CONTROLLERS["speaks_lines"])
    (tmp_path / "controller.toml").write_text('program = ["./entry"]')
    words = ("evaluate", ".", "--competition", ROOT / "examples" / "competition")
    first, second = command(*words), command(*words)
    assert (first.returncode, first.stdout) == (0, second.stdout), first.stderr
    assert len(list((tmp_path / "evaluations" / "submissions").iterdir())) == 1
    for place in ("out", "."):
        refused = command(*words, "-o", place)
        assert refused.returncode == 2
        assert "lies in what is evaluated" in refused.stderr


@needs_boxes
def test_where_there_is_no_box_an_entry_runs_if_it_is_trusted_with_the_same_frames(
    tmp_path: Path, command: Callable[..., subprocess.CompletedProcess[str]]
) -> None:
    (tmp_path / "entry").write_text(CONTROLLERS["speaks_lines"])
    words = ["evaluate", "entry", "--competition", str(ROOT / "examples" / "competition"), "-o"]
    (tmp_path / "bin").mkdir()

    def without(*more: str) -> subprocess.CompletedProcess[str]:
        line = [sys.executable, "-m", "dubins_traffic.cli", *words, *more]
        around = {**os.environ, "PATH": str(tmp_path / "bin")}
        return subprocess.run(line, cwd=tmp_path, env=around, capture_output=True, text=True, check=False)

    refused = without("out")
    assert refused.returncode == 2
    assert "--trust-submissions" in refused.stderr
    trusted = without("out", "--trust-submissions")
    assert trusted.returncode == 0, trusted.stderr
    assert command(*words, "boxed").returncode == 0
    own, boxed = ((tmp_path / folder / RESULTS).read_bytes() for folder in ("out", "boxed"))
    assert (b'"ran":"trusted"' in own, b'"ran":"boxed"' in boxed) == (True, True)
    assert own.replace(b'"ran":"trusted"', b'"ran":"boxed"') == boxed


BASE = """
import sys
for name in ("pyarrow", "scipy", "matplotlib", "pandas", "cryptography", "httpx"):
    sys.modules[name] = None
from dubins_traffic.cli.main import main
sys.exit(main(sys.argv[1:]))
"""


@needs_boxes
def test_evaluating_needs_no_extra(tmp_path: Path) -> None:
    (tmp_path / "entry").write_text(CONTROLLERS["speaks_lines"])
    words = ["evaluate", "entry", "--competition", str(ROOT / "examples" / "competition"), "--json"]
    done = subprocess.run(
        [sys.executable, "-c", BASE, *words], cwd=tmp_path, capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stderr
    told = json.loads(done.stdout)
    assert [own["number"] for own in told["trials"]] == [0, 1, 2, 3]
    assert told["summary"]["trials"] == 4
    assert len(list(tmp_path.glob("evaluations/practice-*/results.jsonl"))) == 1


@pytest.mark.parametrize("name", ["python", "cpp", "ros2", "competition"])
@pytest.mark.path
def test_templates_are_whole_and_spoil_nothing(tmp_path: Path, name: str) -> None:
    paths = write_template(name, tmp_path / "new")
    assert all(path.read_text() for path in paths)
    with pytest.raises(InputError, match="a new or empty folder"):
        write_template(name, tmp_path / "new")
    if name == "competition":
        assert load_competition(tmp_path / "new").title == "My competition"
