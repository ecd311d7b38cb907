"""The picture of 2016 as a whole: ROS topics outside, Gazebo inside."""

from __future__ import annotations

from pathlib import Path

import pytest

import dubins_traffic as dt
from dubins_traffic.record.sink import End
from tests.gazebo import installation
from tests.ros import configuration, finish, graph, lines, need_ros

pytestmark = pytest.mark.tools


def test_a_client_of_2016_drives_a_car_with_wheels(tmp_path: Path) -> None:
    need_ros()
    installation()
    records = tmp_path / "out"
    config = configuration(tmp_path, duration=4.0, number_trials=1)
    with graph(tmp_path) as ros:
        session = ros.session(config, "--simulator", "gazebo", "--records", records)
        client = ros.client("drive")
        status, out, err = finish(client)
        assert status == 0, err
        (seen,) = lines(out)
        status, _, err = finish(session)
        assert status == 0, err
    assert seen["names"] == ["ego", "agent0", "agent1"]
    assert seen["states"] >= 4.0 * 100
    record = dt.load_record(records / "trial-0000.mcap")
    assert record.ending is not None
    assert record.ending.end is End.DURATION
    assert record.instance.simulator == "gazebo"
    assert dt.score(record).driven.distance_m > 0.3


def test_a_simulator_that_is_not_there(tmp_path: Path) -> None:
    need_ros()
    with graph(tmp_path, core=False) as ros:
        status, _, err = finish(ros.session(configuration(tmp_path), "--master", "--simulator", "chess"))
    assert status == 2
    assert "--simulator: simulator: unknown simulator: got 'chess'; expected one of embedded, gazebo" in err
