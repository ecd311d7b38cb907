"""Commands with --sandbox, and boxes whose worker dies."""

from __future__ import annotations

import json
import secrets
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

from dubins_traffic.cli.main import main
from dubins_traffic.sandbox.cgroups import NAME, trees
from tests.boxes import needs_boxes, written

pytestmark = needs_boxes
GOOD = "return 0.25, 0.0"
BROKEN = "os._exit(5)"

WORKER = """
import sys
from dubins_traffic.sandbox import Box, Limits, available_layers
from dubins_traffic.sandbox.launch import Program
words = ("/bin/sh", "-c", "read -r line; echo here; sleep 600 & sleep 600", sys.argv[1])
box = Box(Program(words), Limits(), available_layers())
print(box.ask(b"come\\n").decode(), flush=True)
sys.stdin.read()
"""


def test_run_and_batch_score_alike_in_boxes(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    controller = written(tmp_path, GOOD)
    words = ["demo", "--controller", controller, "--trials", "2", "--json"]
    scores: list[list[object]] = []
    for command in (["run", *words], ["run", *words, "--sandbox"], ["batch", *words, "--sandbox"]):
        assert main(command) == 0
        trials = json.loads(capsys.readouterr().out)["trials"]
        scores.append([[each["goals"], each["collisions"], each["distance_m"]] for each in trials])
        assert [each["end"] for each in trials] == ["duration", "duration"]
    assert scores[0] == scores[1] == scores[2]


def test_a_fault_in_a_box_is_told_by_its_name(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    words = ["run", "demo", "--trials", "1", "--sandbox", "--limits", "memory=256M", "--shield"]
    assert main([*words, "--controller", written(tmp_path, BROKEN)]) == 1
    assert "peer_lost: its program ended with status 5" in capsys.readouterr().err


@pytest.mark.parametrize(
    "words",
    [
        ["--limits", "speed=1"],
        ["--limits", "memory=much"],
        ["--trust-submissions"],
        ["--sandbox", "--controller", "nobody"],
        ["--sandbox", "--controller", "program:/no/such/file"],
    ],
)
def test_what_makes_no_box_is_wrong_input(words: list[str], capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["run", "demo", "--trials", "1", *words]) == 2
    assert capsys.readouterr().err.startswith("dubins-traffic: --")


def test_a_campaign_in_boxes(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    pytest.importorskip("pyarrow")
    spec = written(tmp_path, GOOD)
    (tmp_path / "c.toml").write_text(
        f'version = 0\nname = "small"\nseed = 3\ntrials = 2\nconfigurations = ["demo"]\nfactors.duration = [1.0]\n'
        f'controllers = ["{spec}", "{written(tmp_path, BROKEN, "bad.py")}"]\n'
    )
    words = ["campaign", "run", str(tmp_path / "c.toml"), "-o", str(tmp_path / "out"), "--workers", "1"]
    assert main([*words, "--sandbox"]) == 1
    told = capsys.readouterr()
    assert "2 of 4 trials ended by a fault" in told.err
    assert "peer_lost" in told.err


def test_a_controller_is_checked_in_boxes(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["check-controller", written(tmp_path, GOOD), "--sandbox", "--json"]) == 0
    found = json.loads(capsys.readouterr().out)
    assert found["controller"].endswith(":Mine+sandbox")
    assert found["passed"], found
    assert main(["check-controller", "./drive", "--sandbox", "--over", "lcm"]) == 2


def test_a_box_ends_with_its_worker() -> None:
    mark = f"worker-{secrets.token_hex(8)}"
    with subprocess.Popen(
        [sys.executable, "-c", WORKER, mark], stdin=subprocess.PIPE, stdout=subprocess.PIPE
    ) as worker:
        assert worker.stdout is not None
        assert worker.stdout.readline() == b"here\n"
        assert marked(mark) - {worker.pid}
        worker.send_signal(signal.SIGKILL)
        worker.wait()
    waited = time.monotonic() + 600.0
    while marked(mark) and time.monotonic() < waited:
        time.sleep(0.05)
    assert marked(mark) == set()
    trees.cache_clear()
    left = [each for folder in set(trees().folders.values()) for each in folder.glob(f"{NAME}-{worker.pid}-*")]
    assert left == []


def marked(mark: str) -> set[int]:
    """Return the processes whose command line holds a mark."""
    found: set[int] = set()
    for folder in Path("/proc").iterdir():
        try:
            if folder.name.isdigit() and mark.encode() in (folder / "cmdline").read_bytes():
                found.add(int(folder.name))
        except OSError:
            continue
    return found
