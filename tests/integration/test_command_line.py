"""The commands, as their users see them."""

from __future__ import annotations

import csv
import io
import json
import os
import re
import signal
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from dubins_traffic.cli import listing, options
from dubins_traffic.cli.main import main
from dubins_traffic.cli.tables import NOTE
from dubins_traffic.controllers import registry
from dubins_traffic.problem.kinds import KINDS
from dubins_traffic.problem.trial_data import TrialData
from dubins_traffic.release import commit_of, sources_hash
from dubins_traffic.roads.network import RoadNetwork

COMMAND = str(Path(sys.executable).with_name("dubins-traffic"))
DRAWING = ("network", "instance", "spec", "synth")
JUDGING = ("run", "batch", "score", "check", "check-controller")
COMMANDS = (*DRAWING, *JUDGING, "plot", "replay", "convert", "list")
CONFIG = "mc-small-4grid-agents2"

CONTROLLERS = """
import time

class Straight:
    def start(self, problem): ...
    def act(self, observation):
        return 0.3, 0.1

class Faulty(Straight):
    def start(self, problem):
        self.goals = problem.goals
    def act(self, observation):
        if len(self.goals) > 1 and observation.tick == 7:
            raise ValueError("lost\\nthe way")
        return 0.3, 0.0

class Late(Straight):
    def act(self, observation):
        time.sleep(5.0 if observation.tick == 3 else 0.0)
        return 0.3, 0.0

class Slow(Straight):
    def act(self, observation):
        time.sleep(0.002)
        return 0.3, 0.1
"""

Run = Callable[..., str]


@pytest.fixture(autouse=True)
def place(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "mine.py").write_text(CONTROLLERS)
    return tmp_path


@pytest.fixture
def run(capsys: pytest.CaptureFixture[str]) -> Run:
    """Return a function that runs a command, asserts its exit status and returns what it printed."""

    def command(*arguments: str, status: int = 0) -> str:
        capsys.readouterr()
        code = main([str(argument) for argument in arguments])
        out, err = capsys.readouterr()
        assert code == status, err
        return out

    return command


def scores(text: str) -> dict[str, Any]:
    """Return JSON of scores without what a wall clock measured and where the records lie."""
    sheet = json.loads(text)
    for trial in sheet["trials"]:
        del trial["time_to_begin_s"], trial["record"]
    return sheet


@pytest.mark.parametrize("command", COMMANDS)
@pytest.mark.path
def test_help_shows_examples_of_the_command(command, run):
    text = run(command, "--help")
    assert "Examples" in text
    assert f"$ dubins-traffic {command} " in text


def test_help_without_a_command(run):
    assert all(f" {command} " in run(status=2) for command in COMMANDS)


@pytest.mark.path
def test_version(run):
    import dubins_traffic

    version, commit, sources = run("--version").splitlines()
    assert version == f"dubins-traffic {dubins_traffic.__version__}"
    assert re.fullmatch(r"commit (unknown|[0-9a-f]{40})", commit)
    assert sources == f"sources sha256 {sources_hash()}"


def test_the_commit_of_a_checkout_is_told(tmp_path):
    assert commit_of(tmp_path) is None
    git = tmp_path / ".git"
    git.mkdir()
    (git / "HEAD").write_text("ref: refs/heads/main\n")
    (git / "packed-refs").write_text(f"# pack-refs\n{'a' * 40} refs/heads/main\n")
    assert commit_of(tmp_path) == "a" * 40
    (git / "refs" / "heads").mkdir(parents=True)
    (git / "refs" / "heads" / "main").write_text(f"{'b' * 40}\n")
    assert commit_of(tmp_path) == "b" * 40
    (git / "HEAD").write_text("c" * 40)
    assert commit_of(tmp_path) == "c" * 40


def test_a_grid_is_printed_in_both_containers(run):
    made = RoadNetwork.from_text(run("network", "--grid", "3", "4"))
    assert made == RoadNetwork.grid(3, 4)
    assert RoadNetwork.from_text(run("network", "--grid", "3", "4", "--format", "text")) == made
    assert RoadNetwork.from_text(run("network")) == made


def test_a_random_network_follows_from_its_seed(run):
    ask = ["network", "--intersections", "9", "--segments", "11", "--seed"]
    first = run(*ask, "5")
    made = RoadNetwork.from_text(first)
    assert (len(made.intersections), len(made.segments)) == (9, 11)
    assert run(*ask, "5") == first != run(*ask, "6")


def test_output_goes_to_a_file_whole(run, place):
    text = run("network", "--grid", "2", "3")
    assert run("network", "--grid", "2", "3", "-o", "grid.json") == ""
    assert (place / "grid.json").read_text() == text
    assert [path.name for path in place.iterdir() if path.name.startswith(".")] == []


@pytest.mark.path
def test_conversion_there_and_back(run, place):
    run("network", "--intersections", "9", "--segments", "10", "-o", "a.json")
    run("convert", "a.json", "-o", "b.rnd")
    run("convert", "b.rnd", "-o", "c.json")
    assert (place / "c.json").read_text() == (place / "a.json").read_text()
    assert (place / "b.rnd").read_text().startswith("version:")


def test_an_instance_of_version_0_tells_what_a_controller_is_told(run):
    told = json.loads(run("instance", CONFIG, "--seed", "4", "--trial", "2"))
    assert sorted(told) == ["goals", "intersection_radius", "rnd", "version"]
    assert told["version"] == 0
    assert told["rnd"]["shape"] == [3, 4]
    assert len(told["rnd"]["segments"]) == 17


def test_a_full_instance_is_a_superset(run):
    told = json.loads(run("instance", CONFIG, "--seed", "4", "--trial", "2"))
    full = json.loads(run("instance", CONFIG, "--seed", "4", "--trial", "2", "--full"))
    assert {**full, "version": 0} == {**full, **told}
    assert full["version"] == 1
    assert {"starts", "duration", "e-agents", "seed", "trial"} <= set(full)
    assert sorted(full["starts"]) == ["agent0", "agent1", "ego"]


def test_a_trial_is_the_instance_of_its_seed_and_number(run, place):
    ask = ["--controller", "mine.py:Straight", "--json"]
    sheet = scores(run("run", CONFIG, "--seed", "4", "--trials", "3", "--records", "a", *ask))
    for trial in range(3):
        run(
            "instance",
            CONFIG,
            "--seed",
            "4",
            "--trial",
            str(trial),
            "--full",
            "-o",
            "one.json",
            "--overwrite",
        )
        alone = scores(run("run", "one.json", "--records", f"b{trial}", *ask))
        assert alone["trials"] == [sheet["trials"][trial]]
        name = f"trial-{trial:04d}.mcap"
        assert (place / f"b{trial}" / name).read_bytes() == (place / "a" / name).read_bytes()


@pytest.mark.path
def test_json_of_a_run(run):
    sheet = json.loads(run("run", CONFIG, "--trials", "2", "--seed", "1", "--records", "out/in", "--json"))
    assert sheet["icra2016_sum"] == sum(trial["icra2016"] for trial in sheet["trials"])
    for number, trial in enumerate(sheet["trials"]):
        assert (trial["trial"], trial["seed"], trial["end"]) == (number, 1, "duration")
        assert trial["controller"] == "lanes"
        assert Path(trial["record"]).is_file()
        assert Path(trial["record"]).suffix == ".mcap"
        assert trial["time_to_begin_s"] > 0
        wanted = {"collisions", "rounds", "goals_visited", "off_road_s", "min_clearance_m", "distance_m"}
        assert wanted <= set(trial)
    assert json.loads(run("run", CONFIG, "--json"))["trials"][0]["record"] is None


@pytest.mark.path
def test_two_jobs_leave_the_same_bytes_as_one(run, place):
    ask = ["run", CONFIG, "--trials", "3", "--controller", "mine.py:Straight", "--json"]
    one = scores(run(*ask, "--records", "one"))
    two = scores(run(*ask, "--records", "two", "--jobs", "2"))
    assert one == two
    names = sorted(path.name for path in (place / "one").glob("*.mcap"))
    assert len(names) == 3
    for name in names:
        assert (place / "one" / name).read_bytes() == (place / "two" / name).read_bytes()


@pytest.mark.path
def test_scores_of_records_are_those_of_the_run(run):
    live = json.loads(run("run", CONFIG, "--trials", "2", "--records", "out", "--json"))
    records = [trial["record"] for trial in live["trials"]]
    assert json.loads(run("score", *records, "--json")) == live


def test_a_table_for_people(run):
    out = run("run", CONFIG, "--trials", "2", "--controller", "simple")
    assert "controller simple" in out
    assert "duration" in out
    assert out.split("───")[0].splitlines()[-1].split()[-2:] == ["paper", "2016"]
    note = NOTE.splitlines()
    assert out.splitlines()[-len(note) :] == note
    assert max(map(len, out.splitlines())) <= 80


def test_a_table_of_judged_trials_under_the_shield_fits_too(run):
    out = run("run", "town", "--controller", "lanes", "--shield", "--trials", "1")
    heading = out.split("───")[0].splitlines()[-1].split()
    assert max(map(len, out.splitlines())) <= 80
    assert heading[:4] == ["trial", "clean", "rounds", "breach"]
    assert "verdict" in heading
    assert heading[-3:] == ["ticks", "paper", "2016"]


def test_scores_of_several_controllers_name_each(run):
    for controller in ("simple", "mine.py:Straight"):
        run("run", CONFIG, "--controller", controller, "--records", controller[:4])
    out = run("score", "simp/trial-0000.mcap", "mine/trial-0000.mcap")
    assert "controller simple" not in out
    assert " simple " in out


def test_a_record_is_run_again_with_its_own_controller(run, place):
    run("run", CONFIG, "--trials", "2", "--controller", "simple", "--records", "a")
    sheet = json.loads(run("run", "a/trial-0001.mcap", "--repeat", "2", "--records", "b", "--json"))
    assert [trial["controller"] for trial in sheet["trials"]] == ["simple", "simple"]
    again = [Path(trial["record"]) for trial in sheet["trials"]]
    assert len(set(again)) == 2
    for record in again:
        assert record.read_bytes() == (place / "a" / "trial-0001.mcap").read_bytes()


def test_trial_data_are_those_of_2016(run, place):
    run("run", CONFIG, "--trials", "2", "--seed", "9", "-f", "data.json")
    data = TrialData.read("data.json")
    assert data.trialconf["problem_domain"] == "dubins_traffic"
    told = [json.loads(run("instance", CONFIG, "--seed", "9", "--trial", str(trial))) for trial in range(2)]
    assert list(data.instances) == told
    before = (place / "data.json").read_bytes()
    run("run", CONFIG, "-f", "data.json", status=2)
    assert (place / "data.json").read_bytes() == before
    run("run", CONFIG, "-F", "data.json")
    assert len(TrialData.read("data.json").instances) == 1


def test_another_network_for_a_configuration(run):
    run("network", "--grid", "2", "2", "--format", "text", "-o", "small.rnd")
    run("run", CONFIG, "--rnd", "small.rnd", "-f", "data.json", "--controller", "simple")
    assert TrialData.read("data.json").instances[0]["rnd"]["shape"] == [2, 2]


@pytest.mark.path
def test_a_fault_ends_its_own_trial_only(capsys):
    code = main(["run", "demo", "--seed", "1", "--controller", "mine.py:Faulty", "--json"])
    out, err = capsys.readouterr()
    ends = [trial["end"] for trial in json.loads(out)["trials"]]
    assert code == 1
    assert sorted(set(ends)) == ["controller_fault", "duration"]
    lines = err.splitlines()
    assert len(lines) == ends.count("controller_fault")
    assert all("controller_fault: ValueError: lost the way at tick 7" in line for line in lines)


def test_a_late_controller_ends_its_trial(run):
    sheet = json.loads(run("run", CONFIG, "--controller", "mine.py:Late", "--deadline", "0.5", "--json", status=1))
    assert sheet["trials"][0]["end"] == "deadline"


@pytest.mark.path
def test_records_become_tables(run):
    run("run", CONFIG, "--controller", "simple", "--records", "out")
    run("convert", "out/trial-0000.mcap", "-o", "a.csv")
    rows = list(csv.DictReader(io.StringIO(Path("a.csv").read_text())))
    assert list(rows[0]) == ["tick", "time", "car", "x", "y", "theta", "speed", "yaw_rate"]
    assert [row["car"] for row in rows[:3]] == ["ego", "agent0", "agent1"]
    assert rows[0]["x"] == repr(float(rows[0]["x"]))
    run("convert", "out/trial-0000.mcap", "-o", "a.parquet")
    assert Path("a.parquet").read_bytes()[:4] == b"PAR1"


def test_pictures_and_pages_have_a_name_even_if_none_is_given(run):
    run("network", "-o", "grid.json")
    assert run("plot", "grid.json") == ""
    run("run", CONFIG, "--controller", "simple", "--records", "out")
    assert run("plot", "out/trial-0000.mcap", "-o", "paths.pdf") == ""
    assert run("replay", "out/trial-0000.mcap") == ""
    assert Path("grid.png").read_bytes().startswith(b"\x89PNG")
    assert Path("paths.pdf").read_bytes().startswith(b"%PDF")
    assert "<html" in Path("out/trial-0000.html").read_text()


def test_standard_input(place):
    pipe = f"{COMMAND} instance {CONFIG} | {COMMAND} plot - -o x.svg && {COMMAND} network | {COMMAND} plot - -o y.svg"
    subprocess.run(["bash", "-o", "pipefail", "-ec", pipe], check=True, capture_output=True)
    assert "<svg" in (place / "x.svg").read_text()
    assert "<svg" in (place / "y.svg").read_text()


def test_records_and_instances_from_standard_input(run):
    run("instance", CONFIG, "--full", "-o", "one.json")
    run("run", "one.json", "--controller", "simple", "--records", "out")
    script = f"{COMMAND} score - --json <out/trial-0000.mcap && {COMMAND} run - --controller simple --json <one.json"
    ran = subprocess.run(["bash", "-ec", script], check=True, capture_output=True, text=True)
    scored, end = json.JSONDecoder().raw_decode(ran.stdout)
    assert scored["trials"][0]["icra2016"] == json.loads(ran.stdout[end:])["trials"][0]["icra2016"]


def test_a_reader_that_has_enough_is_no_error():
    ran = subprocess.run(
        ["bash", "-o", "pipefail", "-c", f"{COMMAND} network --grid 200 200 | head -c 10"],
        capture_output=True,
        text=True,
        check=False,
    )
    assert (ran.returncode, ran.stderr) == (0, "")


@pytest.mark.parametrize("subject", list(listing.Subject))
@pytest.mark.path
def test_lists(subject, run):
    lines = [line for line in run("list", subject).splitlines() if line[0] != " "]
    assert lines
    assert all(len(line.split(maxsplit=1)) == 2 for line in lines)


def test_lists_name_all_that_documents_may(run):
    kinds = [line.split()[0] for line in run("list", "agents").splitlines() if line[0] != " "]
    assert kinds == list(KINDS)
    assert {"wander", "loop", "follow", "parked", "scripted"} <= set(kinds)
    controllers = [line.split()[0] for line in run("list", "controllers").splitlines()]
    assert controllers == list(registry.names())
    assert {"lanes", "simple"} <= set(controllers)


def test_completion_offers_commands_configurations_and_controllers():
    def complete(line: str) -> list[str]:
        words = {"COMP_WORDS": line, "COMP_CWORD": str(len(line.split(" ")) - 1)}
        environment = os.environ | words | {"_DUBINS_TRAFFIC_COMPLETE": "complete_bash"}
        ran = subprocess.run([COMMAND], env=environment, capture_output=True, text=True, check=False)
        return ran.stdout.split()

    assert complete("dubins-traffic rep") == ["replay"]
    assert complete("dubins-traffic run mc") == [CONFIG]
    assert complete("dubins-traffic run demo --controller l") == ["lanes"]
    assert options.shipped("de") == ["demo"]
    assert options.controllers("s") == ["simple", "synthesized"]


@pytest.mark.parametrize("jobs", ["1", "2"])
def test_ctrl_c_keeps_finished_trials(jobs, place):
    ask = ["run", CONFIG, "--trials", "200", "--controller", "mine.py:Slow", "--records", "out", "--json"]
    process = subprocess.Popen(
        [COMMAND, *ask, "--jobs", jobs, "-F", "data.json"],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        start_new_session=True,
    )
    until = time.monotonic() + 600
    while len(list(place.glob("out/*.wall.json"))) < 3 and time.monotonic() < until:
        time.sleep(0.05)
    os.killpg(process.pid, signal.SIGINT)
    out, err = process.communicate(timeout=600)
    assert process.returncode == 1
    kept = json.loads(out)["trials"]
    assert err == f"dubins-traffic: interrupted after {len(kept)} of 200 trials\nout\ndata.json\n"
    assert 1 <= len(kept) < 200
    assert {trial["end"] for trial in kept} == {"duration"}
    assert len(TrialData.read("data.json").instances) == len(kept)
    assert main(["score", *(trial["record"] for trial in kept)]) == 0


def test_ctrl_c_keeps_the_finished_trials_of_a_batch(place):
    ask = ["batch", CONFIG, "--trials", "5000", "--batch", "2", "--keep", "all", "--records", "out", "--json"]
    process = subprocess.Popen(
        [COMMAND, *ask], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, start_new_session=True
    )
    until = time.monotonic() + 600
    while len(list(place.glob("out/*.wall.json"))) < 3 and time.monotonic() < until:
        time.sleep(0.05)
    os.killpg(process.pid, signal.SIGINT)
    out, err = process.communicate(timeout=600)
    assert process.returncode == 1
    kept = [trial["trial"] for trial in json.loads(out)["trials"]]
    assert err == f"dubins-traffic: interrupted after {len(kept)} of 5000 trials\nout\n"
    assert 2 <= len(kept) < 5000
    assert kept == list(range(len(kept)))


def processor_seconds(stat: Path) -> float:
    """Return how long a process has had a processor, whatever the clock says."""
    user, system = stat.read_text().rpartition(")")[2].split()[11:13]
    return (int(user) + int(system)) / os.sysconf("SC_CLK_TCK")


def test_ctrl_c_ends_a_long_search_and_writes_nothing(place):
    ask = ["synth", "demo", "--cars", "3", "--assume", "E1,E2,E3:one-forfeit,E4,E5,E6", "-o", "won.npz"]
    process = subprocess.Popen(
        [COMMAND, *ask], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, start_new_session=True
    )
    began = Path(f"/proc/{process.pid}/stat")
    while processor_seconds(began) < 5.0:
        assert process.poll() is None
        time.sleep(0.05)
    os.killpg(process.pid, signal.SIGINT)
    out, err = process.communicate(timeout=600)
    assert (process.returncode, out, err) == (1, "", "dubins-traffic: interrupted: the game is not solved\n")
    assert not (place / "won.npz").exists()
