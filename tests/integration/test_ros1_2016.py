"""Programs of 2016 as they are written: the mode service is asked once, and any answer is taken for yes.

`DUBINS_TRAFFIC_TRIALS_2016=50 pytest tests/integration/test_ros1_2016.py` runs the full count.
"""

from __future__ import annotations

import os
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import dubins_traffic as dt
from dubins_traffic.record.sink import End
from tests.ros import ROOT, SYSTEM_PYTHON, configuration, finish, graph, need_ros

TRIALS = int(os.environ.get("DUBINS_TRAFFIC_TRIALS_2016", "5"))
LARGE = {"version": 0, "length": 3, "transform": [0, 0, 0], "shape": [40, 40]}
MINUTES = 60.0


@contextmanager
def busy(processes: int) -> Iterator[None]:
    """Keep so many processors busy."""
    spinners = [subprocess.Popen([sys.executable, "-c", "while True: pass"]) for _ in range(processes)]
    try:
        yield
    finally:
        for spinner in spinners:
            spinner.kill()
            spinner.wait()


def test_a_node_that_asks_once_goes_through_all_trials_on_a_large_network_under_load(tmp_path: Path) -> None:
    need_ros()
    config = configuration(tmp_path, rnd=LARGE, number_trials=TRIALS, duration=2.0)
    records = tmp_path / "out"
    with busy(2), graph(tmp_path) as ros:
        session = ros.session(config, "--records", records)
        node = ros.start(
            [SYSTEM_PYTHON, ROOT / "tests" / "ros_2016.py", str(TRIALS)],
            ROS_NAMESPACE="ego",
            PYTHONPATH=str(ros.client_messages()),
        )
        status, _, err = finish(session, 2 * MINUTES + 20 * TRIALS)
        assert status == 0, err
        status, out, err = finish(node, MINUTES)
        assert status == 0, err
    assert out.split() == [str(number) for number in range(TRIALS)]
    ends = [dt.load_record(path).ending for path in sorted(records.glob("*.mcap"))]
    assert [None if ending is None else ending.end for ending in ends] == [End.DURATION] * TRIALS
