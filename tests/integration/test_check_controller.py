"""`dubins-traffic check-controller` on controllers with one fault each."""

import json
import os
import re
import shlex
import shutil
import signal
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from dubins_traffic.checkup import checkup, over_transport, watch
from dubins_traffic.checkup.checkup import Checkup, check_controller
from dubins_traffic.checkup.passes import FIRST
from dubins_traffic.checkup.scenarios import scenarios
from dubins_traffic.checkup.watch import Waited, see_off
from dubins_traffic.cli.main import main
from dubins_traffic.roads.network import RoadNetwork
from dubins_traffic.transports.ros1.messages import DIST_PACKAGES, write_python
from tests.ros import SYSTEM_PYTHON, need_ros
from tests.tools import need_module

ROOT = Path(__file__).resolve().parents[2]
COMMAND = str(Path(sys.executable).with_name("dubins-traffic"))

FAULTY = """
import math, os, time

class Good:
    def start(self, problem): ...
    def act(self, observation):
        return 0.3, 0.1

class Undetermined(Good):
    def act(self, observation):
        return 0.3, 0.1 * (hash("word") % 1000) / 1000

class Everything(Good):
    def start(self, problem):
        self.goals = len(problem.goals)
        if len(problem.network.segments) == 1:
            raise ValueError("no way")
    def act(self, observation):
        if self.goals == 1 and observation.tick == 9:
            return math.nan, 0.0
        if self.goals == 4:
            time.sleep(0.04 if observation.tick < 30 else 0.0)
            return 7.0, 0.0
        return 0.3, 0.0
    def close(self):
        raise OSError("can't close")

class Deadly(Good):
    def act(self, observation):
        if observation.tick == 50:
            os._exit(7)
        return 0.3, 0.0

class Killed(Good):
    def start(self, problem):
        os.kill(os.getpid(), 9)

class Asleep(Good):
    def act(self, observation):
        time.sleep(1e6)

class Stubborn(Good):
    def act(self, observation):
        print("asked", flush=True)
        while True:
            try:
                time.sleep(1e6)
            except BaseException:
                print("caught", flush=True)

class Lingering(Good):
    def close(self):
        import threading
        threading.Thread(target=time.sleep, args=(600,)).start()
"""


@pytest.fixture
def faulty(tmp_path: Path) -> str:
    (tmp_path / "mine.py").write_text(FAULTY)
    return str(tmp_path / "mine.py")


def verdicts(found: Checkup) -> dict[str, bool]:
    return {finding.check: finding.passed for finding in found.findings}


def test_the_course_is_odd() -> None:
    instances = scenarios()
    networks: list[RoadNetwork] = [instance.problem.network for instance in instances.values()]
    assert any(network.transform[2] != 0.0 for network in networks)
    assert any(min(network.degrees) == 1 and len(network.segments) > 1 for network in networks)
    assert {len(instance.problem.goals) for instance in instances.values()} == {1, 2, 3, 4}
    assert any(not instance.e_agents for instance in instances.values())


@pytest.mark.path
def test_a_good_controller_passes(faulty: str, capsys: pytest.CaptureFixture[str]) -> None:
    status = main(["check-controller", f"{faulty}:Good", "--json"])
    found: dict[str, Any] = json.loads(capsys.readouterr().out)
    assert found["passed"] is (status == 0)
    assert [check["check"] for check in found["checks"] if not check["passed"]] in ([], ["answers in time"])
    assert sum(row["answers"] for row in found["histogram"]) == found["latency_s"]["count"] == 7 * 150


def test_each_fault_is_named(faulty: str) -> None:
    found = check_controller(f"{faulty}:Everything")
    assert verdicts(found) == {
        "starts": False,
        "survives odd instances": False,
        "answers in time": False,
        "finite commands": False,
        "commands within bounds": False,
        "deterministic": True,
        "ends cleanly": False,
    }
    details = " ".join(finding.detail for finding in found.findings)
    for word in ("no way", "one goal", "tick 9", "7 m/s", "can't close"):
        assert word in details, details
    late = re.search(r"(\d+) of \d+ answers later", details)
    assert late is not None, details
    assert int(late[1]) >= 30, "others may be late, too, on a busy machine"


def test_what_differs_from_run_to_run_is_found(faulty: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["check-controller", f"{faulty}:Undetermined"]) == 1
    out = capsys.readouterr().out
    assert "FAILED deterministic" in out
    assert out.count("FAILED") == 1 + out.count("FAILED answers in time")


def test_what_a_thread_has_waited_for_a_processor_counts_after_its_end(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    for thread in ("1", "2"):
        (tmp_path / thread).mkdir()
        (tmp_path / thread / "schedstat").write_text("0 0 0\n")
    monkeypatch.setattr(watch, "_tasks_of", lambda _pid: tmp_path)
    monkeypatch.setattr(watch, "monotonic", iter((0.0, 9.0, 10.0)).__next__)
    waited = Waited(1)
    (tmp_path / "1" / "schedstat").write_text("0 8000000000 0\n")
    assert waited.seconds() == 1.0
    shutil.rmtree(tmp_path / "1")
    assert waited.seconds() == 2.0


def test_a_controller_that_kills_its_process_in_mid_trial(faulty: str) -> None:
    found = check_controller(f"{faulty}:Deadly")
    assert {name for name, passed in verdicts(found).items() if not passed} == {
        "survives odd instances",
        "answers in time",
    }
    details = {finding.check: finding.detail for finding in found.findings}
    said = "two goals and two e-agents: died at tick 50: the process ended with status 7; 6 of 7 trials were not run"
    assert details["survives odd instances"] == said
    (drive,) = found.drives
    assert (drive.end, drive.ticks) == ("died", 50)


def test_a_controller_that_kills_its_process_in_start(faulty: str) -> None:
    found = check_controller(f"{faulty}:Killed")
    assert not verdicts(found)["starts"]
    assert "the process was ended by SIGKILL" in found.findings[0].detail


def test_an_answer_that_never_comes_is_a_failed_check_and_the_end(faulty: str) -> None:
    found = check_controller(f"{faulty}:Asleep")
    details = {finding.check: finding.detail for finding in found.findings if not finding.passed}
    said = f"two goals and two e-agents: deadline act took more than {FIRST} s at tick 0; 6 of 7 trials were not run"
    assert details["survives odd instances"] == said
    assert details.keys() == {"survives odd instances", "answers in time", "deterministic"}


def test_nor_does_one_end_it_that_catches_everything(faulty: str) -> None:
    found = check_controller(f"{faulty}:Stubborn")
    details = {finding.check: finding.detail for finding in found.findings if not finding.passed}
    assert "died at tick 0: was ended: nothing more after 60 s" in details["survives odd instances"]


def test_ctrl_c_ends_it_with_a_line(faulty: str) -> None:
    words = [COMMAND, "check-controller", f"{faulty}:Stubborn"]
    with subprocess.Popen(words, stderr=subprocess.PIPE, text=True, start_new_session=True) as process:
        assert process.stderr is not None
        assert process.stderr.readline() == "asked\n"
        os.killpg(process.pid, signal.SIGINT)
        assert process.stderr.read() == "dubins-traffic: interrupted\n"  # the process of the course has ended, too
        assert process.wait() == 1


def test_what_a_controller_leaves_behind_is_no_clean_end(faulty: str) -> None:
    found = check_controller(f"{faulty}:Lingering")
    details = {finding.check: finding.detail for finding in found.findings if not finding.passed}
    assert details.pop("ends cleanly") == "the process was still there after 5 s"
    assert not details.keys() - {"answers in time"}


def test_a_process_that_waits_for_a_processor_is_not_late() -> None:
    """Nor is one that waits for what another does that has no processor."""
    spin = [sys.executable, "-c", "while True: pass"]
    crowd = [subprocess.Popen(spin) for _ in range(2 * len(os.sched_getaffinity(0)))]
    slow, idle = subprocess.Popen(["nice", "-n", "19", *spin]), subprocess.Popen(["sleep", "infinity"])
    try:
        waited, began = Waited(idle.pid, slow.pid), time.monotonic()
        while (elapsed := time.monotonic() - began) < 0.5 or waited.seconds() >= elapsed / 2:
            assert elapsed < 600.0  # the system tells of a wait when it is over
            time.sleep(0.05)
        assert see_off(slow.pid, slow.poll, 0.05).startswith("the process was still there")
    finally:
        for process in (*crowd, slow, idle):
            process.kill()
            process.wait()
    assert see_off(slow.pid, slow.poll) == ""


def assert_well(out: str) -> None:
    """All is well; on a busy machine a program elsewhere may be late, and nothing else."""
    failed = [line for line in out.splitlines() if line.startswith("FAILED")]
    assert all("answers in time" in line for line in failed), out
    assert out.count("ok ") + len(failed) == 7


@pytest.mark.tools
def test_over_lcm_a_program_is_started_and_ended(capsys: pytest.CaptureFixture[str]) -> None:
    need_module("lcm")
    command = f"{sys.executable} {ROOT / 'examples' / 'lcm' / 'controller.py'}"
    main(["check-controller", command, "--over", "lcm"])
    assert_well(capsys.readouterr().out)


@pytest.mark.tools
def test_a_command_that_ignores_ctrl_c_lets_the_program_hear_it() -> None:
    need_module("lcm")
    command = f"{sys.executable} {ROOT / 'examples' / 'lcm' / 'controller.py'}"
    deaf = [
        "sh",
        "-c",
        "trap '' INT; exec \"$@\"",
        "sh",
        COMMAND,
        "check-controller",
        command,
        "--over",
        "lcm",
    ]
    assert_well(subprocess.run(deaf, check=False, capture_output=True, text=True, timeout=600).stdout)


@pytest.mark.tools
def test_over_ros1_a_node_is_started_and_ended(tmp_path: Path) -> None:
    need_ros()
    write_python(tmp_path)
    node = ROOT / "examples" / "ros1" / "controller.py"
    command = ["env", f"PYTHONPATH={tmp_path}:{DIST_PACKAGES}", SYSTEM_PYTHON, str(node)]
    done = subprocess.run(
        [COMMAND, "check-controller", shlex.join(command), "--over", "ros1"],
        check=False, capture_output=True, text=True, timeout=600,
    )  # fmt: skip
    assert_well(done.stdout)


def noted(order: list[str], name: str) -> Callable[..., Any]:
    """Return what does as a function of `over_transport` does, and notes when."""
    real = getattr(over_transport, name)

    def call(*given: Any) -> Any:
        order.append(name)
        return real(*given)

    return call


@pytest.mark.tools
def test_over_lcm_a_program_that_ends_at_once(monkeypatch: pytest.MonkeyPatch) -> None:
    """All that trials need is compiled before the program is started: its patience is not ours to spend."""
    need_module("lcm")
    order: list[str] = []
    for name in ("rehearse", "_start"):
        monkeypatch.setattr(over_transport, name, noted(order, name))
    found = check_controller("false", "lcm")
    assert not found.passed
    assert "ended with status 1" in found.findings[0].detail
    assert order == ["rehearse", "_start", "_start"]


@pytest.mark.parametrize("arguments", [["nobody"], ["no-such-program-here", "--over", "lcm"]])
def test_no_such_controller(arguments: list[str], capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["check-controller", *arguments]) == 2
    assert arguments[0] in capsys.readouterr().err


def test_the_histogram_counts_every_answer_once() -> None:
    rows = checkup._histogram([0.00005, 0.0001, 0.02, 5.0], (1e-4, 1e-2, 0.033))
    assert rows == ((1e-4, 2), (1e-2, 0), (0.033, 1), (None, 1))
