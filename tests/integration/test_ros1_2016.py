"""Programs of 2016 as they are written: the mode service is asked once, and any answer is taken for yes.

`DUBINS_TRAFFIC_TRIALS_2016=50 pytest tests/integration/test_ros1_2016.py` runs the full count.
"""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest

import dubins_traffic as dt
from dubins_traffic.record.sink import End
from tests.ros import (
    PATIENCE,
    ROOT,
    SYSTEM_PYTHON,
    Graph,
    configuration,
    finish,
    graph,
    lines,
    need_ros,
    read_until,
)

pytestmark = pytest.mark.tools

TRIALS = int(os.environ.get("DUBINS_TRAFFIC_TRIALS_2016", "5"))
LARGE = {"version": 0, "length": 3, "transform": [0, 0, 0], "shape": [40, 40]}


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


def untimed(folder: Path, trials: int, seconds: int, **more: object) -> Path:
    """Write a configuration whose trials another maestro ends after so many seconds."""
    document = json.loads(configuration(folder, number_trials=trials, duration_bounds=[seconds] * 2).read_text())
    del document["duration"]
    config = folder / "old.json"
    config.write_text(json.dumps(document | more))
    return config


def under_the_maestro(ros: Graph, config: Path, records: Path) -> tuple[subprocess.Popen[str], str]:
    """Start a session in which `lanes` drives, and the maestro of 2016; return it, and where messages are."""
    session = ros.session(config, "--maestro-elsewhere", "--controller", "lanes", "--records", records)
    read_until(session, "waiting for a problem instance")
    messages = str(ros.client_messages())
    ros.start([SYSTEM_PYTHON, ROOT / "tests" / "ros_maestro.py"], PYTHONPATH=messages)
    return session, messages


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
        status, _, err = finish(session, PATIENCE + 20 * TRIALS)
        assert status == 0, err
        status, out, err = finish(node)
        assert status == 0, err
    assert out.split() == [str(number) for number in range(TRIALS)]
    ends = [dt.load_record(path).ending for path in sorted(records.glob("*.mcap"))]
    assert [None if ending is None else ending.end for ending in ends] == [End.DURATION] * TRIALS


def test_the_maestro_of_2016_runs_the_trials_of_our_world(tmp_path: Path) -> None:
    """Its problems, its beginnings and its ends; our cars, our record, our score."""
    need_ros()
    config, records = untimed(tmp_path, 3, 3, number_goals_bounds=[2, 2]), tmp_path / "out"
    with graph(tmp_path) as ros:
        session = ros.session(config, "--maestro-elsewhere", "--records", records)
        said = read_until(session, "waiting for a problem instance")
        messages = str(ros.client_messages())
        maestro = ros.start([SYSTEM_PYTHON, ROOT / "tests" / "ros_maestro.py"], PYTHONPATH=messages)
        node = [SYSTEM_PYTHON, ROOT / "tests" / "ros_2016.py", "3"]
        ros.start(node, ROS_NAMESPACE="ego", PYTHONPATH=messages)
        status, out, err = finish(session)
        assert status == 0, said + err
        status, told, err = finish(maestro)
        assert status == 0, err
    trials = lines(told)
    found = [dt.load_record(path) for path in sorted(records.glob("*.mcap"))]
    assert len(trials) == len(found) == 3
    for trial, record in zip(trials, found, strict=True):
        assert [list(goal) for goal in record.instance.problem.goals] == trial["goals"]
        assert record.ending is not None
        assert record.ending.end is End.DURATION
        assert record.instance.duration == (len(record.frames) - 1) / 30
        assert record.instance.duration <= trial["seconds"] + 1 / 30
        assert [(pose.x, pose.y) for pose in record.instance.starts] == [(0.0, 0.0), (0.0, 1.5), (0.0, 3.0)]
        assert record.frames.command_speed[-1, 0] == 0.3
        assert record.frames.x[-1, 0] > 0.0
    assert [row["end"] for row in json.loads(out)["trials"]] == ["duration"] * 3


def test_a_trial_is_whole_by_the_clock_of_the_maestro_though_the_cars_moved_for_less(tmp_path: Path) -> None:
    """The session stands still for a second, as on a busy machine: it can't be caught up."""
    need_ros()
    config, records = untimed(tmp_path, 1, 3), tmp_path / "out"
    with graph(tmp_path) as ros:
        session, messages = under_the_maestro(ros, config, records)
        ros.start([SYSTEM_PYTHON, ROOT / "tests" / "ros_2016.py", "1"], ROS_NAMESPACE="ego", PYTHONPATH=messages)
        read_until(session, "begins")
        session.send_signal(signal.SIGSTOP)
        time.sleep(1.2)
        session.send_signal(signal.SIGCONT)
        status, _, err = finish(session)
        assert status == 0, err
    record = dt.load_record(records / "trial-0000.mcap")
    assert record.ending is not None
    assert record.ending.end is End.DURATION
    assert record.instance.duration == record.ending.ticks / 30 < 2.5


def test_a_reset_of_the_maestro_of_2016_is_a_reset(tmp_path: Path) -> None:
    need_ros()
    config, records = untimed(tmp_path, 1, 600), tmp_path / "out"
    with graph(tmp_path) as ros:
        session, messages = under_the_maestro(ros, config, records)
        code = (
            "import rospy; from dubins_traffic_msgs.srv import MMode; from std_srvs.srv import Empty\n"
            "rospy.wait_for_service('/dubins_traffic_maestro/mode')\n"
            "mode = rospy.ServiceProxy('/dubins_traffic_maestro/mode', MMode)\n"
            "while not mode(4).result: rospy.rostime.wallsleep(0.1)\n"
            "mode(5); rospy.rostime.wallsleep(1.0); mode(0)"
        )
        asker = ros.start([SYSTEM_PYTHON, "-c", code], PYTHONPATH=messages)
        assert finish(asker)[0] == 0
        status, out, err = finish(session)
        assert status == 0, err
    record = dt.load_record(records / "trial-0000.mcap")
    assert record.ending is not None
    assert record.ending.end is End.RESET
    assert record.instance.duration == 600.0
    assert [row["end"] for row in json.loads(out)["trials"]] == ["reset"]
