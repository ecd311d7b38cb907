"""A world that is not ours, judged by our referee; `tests/ros_world.py` is that world."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

import dubins_traffic as dt
from dubins_traffic.record.sink import End
from dubins_traffic.sessions.plan import rehearse
from tests.judged_outside import (
    COURSE,
    FAULTS,
    SMOOTH,
    require_driven,
    require_lost,
    require_measured,
    verified,
)
from tests.ros import Graph, configuration, finish, graph, need_ros

pytestmark = pytest.mark.tools


@pytest.fixture(scope="module", autouse=True)
def _compiled() -> None:
    rehearse(dt.draw(dt.load_config("demo")))


def run(ros: Graph, folder: Path, fault: str, **more: object) -> dt.Record:
    ros.world(fault)
    records = folder / "out"
    options = [
        "--simulator",
        "ros1-world",
        "--controller",
        SMOOTH,
        "--records",
        records,
    ]
    status, _, err = finish(ros.session(configuration(folder, **{**COURSE, **more}), *options))
    assert status in (0, 1), err
    (folder / "said").write_text(err)
    return verified(records, "ros1-world")


def test_cars_elsewhere_are_driven_and_judged_here(tmp_path: Path) -> None:
    need_ros()
    with graph(tmp_path) as ros:
        record = run(ros, tmp_path, "none")
    require_driven(record)
    sheet = dt.score(record)
    assert sheet.icra2016 is not None


def test_a_node_drives_the_ego_and_a_tracker_sees_the_cars(tmp_path: Path) -> None:
    need_ros()
    with graph(tmp_path) as ros:
        ros.world()
        options = ["--simulator", "ros1-world", "--poses", "/tracker/{}", "--records", tmp_path / "out"]
        session = ros.session(configuration(tmp_path, **COURSE), *options)
        status, _, err = finish(ros.client("drive"))
        assert status == 0, err
        assert finish(session)[0] == 0
    record = dt.load_record(tmp_path / "out" / "trial-0000.mcap")
    assert record.ending is not None
    assert record.ending.end is End.DURATION
    assert record.instance.simulator == "ros1-world"
    assert record.frames.command_speed[-1, 0] > 0.2
    assert record.frames.x[-1, 0] > 0.3


@pytest.mark.parametrize(("fault", "word"), FAULTS)
def test_a_world_that_fails_ends_the_trial_with_its_reason(tmp_path: Path, fault: str, word: str) -> None:
    need_ros()
    with graph(tmp_path) as ros:
        record = run(ros, tmp_path, fault, duration=20.0)
    require_lost(record, word)


def test_a_car_that_is_nowhere(tmp_path: Path) -> None:
    need_ros()
    with graph(tmp_path) as ros:
        ros.world()
        more = {"e-agents": [{"type": "wander", "name": "agent7"}]}
        options = ["--simulator", "ros1-world", "--controller", "simple"]
        status, _, err = finish(ros.session(configuration(tmp_path, **{**COURSE, **more}), *options))
    assert status == 2
    assert "no pose of agent7" in err
    assert json.loads((tmp_path / "config.json").read_text())["number_trials"] == 1


def test_a_world_is_measured_before_its_first_trial(tmp_path: Path) -> None:
    need_ros()
    with graph(tmp_path) as ros:
        record = run(ros, tmp_path, "0.05,0.005,0.0", rules=False, duration=2.0)
    require_measured(record, (tmp_path / "said").read_text())


def test_a_delay_that_is_declared_is_not_measured(tmp_path: Path) -> None:
    need_ros()
    with graph(tmp_path) as ros:
        ros.world()
        options = ["--simulator", "ros1-world", "--controller", SMOOTH]
        options += ["--records", str(tmp_path / "out"), "--delay", "0.3", "--noise", "0.03"]
        status, _, err = finish(ros.session(configuration(tmp_path, **{**COURSE, "duration": 1.0}), *options))
    assert status in (0, 1), err
    assert "commands take effect late (300 ms; " in err
    declared = dt.load_record(tmp_path / "out" / "trial-0000.mcap").instance.disturbances
    assert declared.command_delay >= 9
    assert declared.position_noise == pytest.approx(0.01)
