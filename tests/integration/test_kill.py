"""A process that is killed loses at most one simulated second of its record."""

import os
import signal
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from dubins_traffic.problem.configuration import load_config
from dubins_traffic.problem.draw import draw
from dubins_traffic.record import reader
from dubins_traffic.runs.single import run_trial
from dubins_traffic.scoring.score import score
from dubins_traffic.verification.verify import verify

PACED = """
import sys, time
from dataclasses import replace
from dubins_traffic.runs.single import run_trial
from dubins_traffic.problem.configuration import load_config
from dubins_traffic.problem.draw import draw
period = float(sys.argv[2])
class Paced:
    def start(self, problem):
        self.began = time.monotonic()
    def act(self, observation):
        if period:
            time.sleep(max(0.0, self.began + observation.tick * period - time.monotonic()))
        print(observation.tick, flush=True)
        return (0.3, 0.1)
instance = replace(draw(load_config("demo"), 1, 0), duration=36000.0)
run_trial(instance, Paced(), record=sys.argv[1])
"""


@pytest.mark.parametrize("rate", [30.0, 0.0], ids=["real time", "full speed"])
@pytest.mark.parametrize("last", [51, 93])
@pytest.mark.path
def test_a_killed_run_leaves_a_record_up_to_its_last_second(tmp_path: Path, rate: float, last: int) -> None:
    record = tmp_path / "killed.mcap"
    period = 1 / rate if rate else 0.0
    arguments = [sys.executable, "-c", PACED, str(record), str(period)]
    with subprocess.Popen(arguments, stdout=subprocess.PIPE, text=True) as process:
        assert process.stdout is not None
        while int(process.stdout.readline()) < last:
            continue
        os.kill(process.pid, signal.SIGKILL)
        ticks = [last, *(int(line) for line in process.stdout.read().split())]
    found = reader.read(record)
    assert found.ending is None
    assert len(found.frames) % 30 == 0
    assert len(found.frames) > ticks[-1] - 30
    assert found.frames.command_speed[1:, 0] == pytest.approx(0.3)
    assert (np.diff(found.frames.time) > 0).all()
    assert score(found).end is None
    verified = verify(record)
    assert verified.verified, verified
    assert str(verified).startswith("verified, ends early: cut off after tick")


def test_the_instance_of_a_killed_record_runs_again(tmp_path: Path) -> None:
    record = tmp_path / "whole.mcap"
    run_trial(draw(load_config("mc-small-4grid-agents2"), 4, 2), "simple", record=record)
    data = record.read_bytes()
    cut = tmp_path / "cut.mcap"
    cut.write_bytes(data[: len(data) // 2])
    again = tmp_path / "again.mcap"
    run_trial(reader.read(cut).instance, "simple", record=again)
    assert again.read_bytes() == data
