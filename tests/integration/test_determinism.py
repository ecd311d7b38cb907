"""The same seed gives the same bytes: in any order, in one process or several, compiled or interpreted."""

import math
import os
import subprocess
import sys
from dataclasses import replace

import numpy as np
import pytest

from dubins_traffic.cars.state import Pose
from dubins_traffic.kernels.angles import sincos
from dubins_traffic.problem.configuration import load_config
from dubins_traffic.problem.draw import draw
from dubins_traffic.runs.jobs import Job, run_trials
from dubins_traffic.runs.single import run_trial
from tests.unit.test_trial import Collect

RUN = """
import sys
from dataclasses import replace
from dubins_traffic.runs.single import run_trial
from dubins_traffic.problem.configuration import load_config
from dubins_traffic.problem.draw import draw
instance = replace(draw(load_config(sys.argv[1]), 3, 1), duration=float(sys.argv[3]))
run_trial(instance, sys.argv[2], record=sys.argv[4])
"""


def shipped():
    from dubins_traffic.problem.configuration import shipped_names

    return shipped_names()


def jobs(folder, order):
    folder.mkdir()
    demo = load_config("mc-small-4grid-agents2")
    return [Job(k, 5, "lanes", configuration=demo, record=folder / f"{k}.mcap") for k in order]


@pytest.mark.path
def test_order_and_processes_do_not_change_a_byte(tmp_path) -> None:
    bytes_of = []
    for name, order, workers in (("a", [0, 1, 2, 3], 1), ("b", [3, 1, 0, 2], 1), ("c", [0, 1, 2, 3], 2)):
        results = list(run_trials(jobs(tmp_path / name, order), workers))
        assert sorted(result.instance.trial for result in results) == [0, 1, 2, 3]
        bytes_of.append([(tmp_path / name / f"{k}.mcap").read_bytes() for k in range(4)])
    assert bytes_of[0] == bytes_of[1] == bytes_of[2]
    assert len(set(bytes_of[0])) == 4


@pytest.mark.parametrize("controller", ["lanes", "simple"])
@pytest.mark.parametrize("name", shipped())
def test_compiled_and_interpreted_records_are_equal(tmp_path, name, controller) -> None:
    for mode, disabled in (("compiled", "0"), ("interpreted", "1")):
        subprocess.run(
            [sys.executable, "-W", "error", "-c", RUN, name, controller, "4", str(tmp_path / f"{mode}.mcap")],
            env={**os.environ, "NUMBA_DISABLE_JIT": disabled},
            check=True,
        )
    assert (tmp_path / "compiled.mcap").read_bytes() == (tmp_path / "interpreted.mcap").read_bytes()


@pytest.mark.parametrize("theta", [0.5, 2.0, -2.9])
@pytest.mark.path
def test_a_rigid_motion_of_the_network_commutes_with_the_whole_trial(theta) -> None:
    here = draw(load_config("demo"), 11, 0)
    c, s = sincos(theta)
    tx, ty = 13.7, -4.2

    def carried(x, y):
        return c * x - s * y + tx, s * x + c * y + ty

    network = replace(here.problem.network, transform=(tx, ty, theta))
    starts = tuple(Pose(*carried(p.x, p.y), p.c * c - p.s * s, p.s * c + p.c * s) for p in here.starts)
    there = replace(here, problem=replace(here.problem, network=network), starts=starts)
    one, other = Collect(), Collect()
    score = run_trial(here, "lanes", sinks=[one]).score
    moved = run_trial(there, "lanes", sinks=[other]).score
    x, y = carried(one.column("x"), one.column("y"))
    assert np.abs(x - other.column("x")).max() < 1e-9
    assert np.abs(y - other.column("y")).max() < 1e-9
    assert (one.column("bits") == other.column("bits")).all()
    assert score.rounds == moved.rounds
    assert math.isclose(score.icra2016, moved.icra2016)
