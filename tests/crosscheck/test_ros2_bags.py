"""Bags of ROS 2 against other readers of them: Foxglove's and rclpy's own."""

from __future__ import annotations

import base64
import shutil
import subprocess
from collections import defaultdict
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from mcap.reader import make_reader
from mcap_ros2.decoder import DecoderFactory

import dubins_traffic as dt
from dubins_traffic.cli.main import main
from dubins_traffic.interchange.bags import ros2_typestore
from dubins_traffic.transports.marks import BREACHES, CARS, CUBE, CYLINDER, GREEN, ROADS, STRIP
from tests.tools import interpreter_with

pytestmark = pytest.mark.path

rosbag2 = pytest.importorskip("rosbags.rosbag2")
ROOT = Path(__file__).parents[2]


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A trial of some seconds with breaches and an obstacle, as a record and as a bag."""
    folder = tmp_path_factory.mktemp("bags")
    config = {
        **dt.load_config("town").to_document(),
        "obstacles": [
            {"disc": {"x": 0.4, "y": 0.1, "radius": 0.1}},
            {"polygon": {"vertices": [[9, 9], [9.2, 9], [9, 9.2]]}},
        ],
    }
    instance = replace(dt.draw(dt.load_config(config), seed=4), duration=12.0)
    dt.run_trial(instance, "simple", record=folder / "trial.mcap")
    assert main(["convert", str(folder / "trial.mcap"), "-o", str(folder / "trial")]) == 0
    return folder


@pytest.fixture(scope="module")
def topics(folder: Path) -> dict[str, list[Any]]:
    """The messages of the bag by topic, as Foxglove's reader for Python has them."""
    found: dict[str, list[Any]] = defaultdict(list)
    with (folder / "trial" / "trial.mcap").open("rb") as file:
        reader = make_reader(file, decoder_factories=[DecoderFactory()])
        for _, channel, _, message in reader.iter_decoded_messages():
            found[channel.topic].append(message)
    return found


def test_foxglove_reads_odometry_transforms_and_time(folder: Path, topics: dict[str, list[Any]]) -> None:
    frames = dt.load_record(folder / "trial.mcap").frames
    names = dt.load_record(folder / "trial.mcap").instance.names
    for n, name in enumerate(names):
        odometry = topics[f"/{name}/odom"]
        assert [one.pose.pose.position.x for one in odometry] == frames.x[:, n].tolist()
        assert [one.twist.twist.angular.z for one in odometry] == frames.yaw_rate[:, n].tolist()
        moved = [tf.transforms[n].transform.translation.y for tf in topics["/tf"]]
        assert moved == frames.y[:, n].tolist()
        commands = topics[f"/{name}/mobile_base/commands/velocity"]
        assert [one.linear.x for one in commands] == frames.command_speed[1:, n].tolist()
    seconds = [one.clock.sec + 1e-9 * one.clock.nanosec - 1.0 for one in topics["/clock"]]
    assert seconds == pytest.approx(frames.time.tolist(), abs=1e-8)
    fixed = {(one.header.frame_id, one.child_frame_id) for one in topics["/tf_static"][0].transforms}
    assert ("map", "ego/odom") in fixed
    assert ("ego/base_footprint", "ego/base_link") in fixed


def test_markers_show_roads_goals_obstacles_cars_and_breaches(folder: Path, topics: dict[str, list[Any]]) -> None:
    record = dt.load_record(folder / "trial.mcap")
    problem, frames = record.instance.problem, record.frames
    (roads,) = topics[ROADS]
    by_group: dict[str, list[Any]] = defaultdict(list)
    for marker in roads.markers:
        by_group[marker.ns].append(marker)
    assert len(by_group["roads"]) == problem.network.lanes // 2
    assert {marker.scale.x for marker in by_group["roads"]} == {2.0 * problem.car.lane_width}
    green = [marker.id for marker in by_group["intersections"] if marker.color.g == np.float32(GREEN[1])]
    assert green == sorted(set(problem.goal_vertices))
    assert [marker.type for marker in by_group["obstacles"]] == [CYLINDER, STRIP]
    last = topics[CARS][-1].markers
    bodies = [marker for marker in last if marker.ns == "bodies"]
    assert [(one.pose.position.x, one.pose.position.y) for one in bodies] == list(
        zip(frames.x[-1].tolist(), frames.y[-1].tolist(), strict=True)
    )
    assert {one.type for one in bodies} <= {CUBE, CYLINDER}
    verdict = dt.score(record).verdict
    assert verdict is not None
    assert verdict.violations
    told = [marker.text for array in topics[BREACHES] for marker in array.markers]
    assert sorted(told) == sorted(f"{one.car}: {one.rule}" for one in verdict.violations)


def test_a_bag_becomes_a_record_with_equal_contents(folder: Path) -> None:
    assert main(["convert", str(folder / "trial"), "-o", str(folder / "back.mcap")]) == 0
    first, back = (dt.load_record(folder / name) for name in ("trial.mcap", "back.mcap"))
    assert back.instance == first.instance
    assert (back.ending, back.controller) == (first.ending, first.controller)
    for column in ("x", "y", "speed", "yaw_rate", "command_speed", "command_yaw_rate", "at", "lane", "bits"):
        assert np.array_equal(getattr(back.frames, column), getattr(first.frames, column)), column
    assert back.frames.contacts == first.frames.contacts
    one, two = (dt.score(record).verdict for record in (first, back))
    assert one == two


def test_what_is_recorded_of_a_session_becomes_a_record(folder: Path, tmp_path: Path) -> None:
    """Odometry, commands and the problem alone, as a session publishes them, in the other format of storage."""
    bag = tmp_path / "recorded"
    with (
        rosbag2.Reader(folder / "trial") as reader,
        rosbag2.Writer(bag, version=9, storage_plugin=rosbag2.StoragePlugin.SQLITE3) as writer,
    ):
        ours = ("/odom", "/velocity", "/probleminstance_JSON")
        kept = {one.id: one for one in reader.connections if one.topic.endswith(ours)}
        made = {k: writer.add_connection(one.topic, one.msgtype, typestore=ros2_typestore()) for k, one in kept.items()}
        for connection, time, data in reader.messages(list(kept.values())):
            writer.write(made[connection.id], time, data)
    assert main(["convert", str(bag), "-o", str(tmp_path / "back.mcap")]) == 0
    first, back = dt.load_record(folder / "trial.mcap"), dt.load_record(tmp_path / "back.mcap")
    assert back.instance.names == first.instance.names
    assert {agent.kind for agent in back.instance.e_agents} == {"remote"}
    assert np.array_equal(back.frames.x, first.frames.x)
    assert np.array_equal(back.frames.command_speed, first.frames.command_speed)


def test_a_folder_is_replaced_only_if_it_is_such_a_bag_and_that_is_asked_for(
    folder: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    there = tmp_path / "there"
    there.mkdir()
    (there / "mine").write_text("kept")
    record = str(folder / "trial.mcap")
    for words in ([], ["--overwrite"]):
        assert main(["convert", record, "-o", str(there), *words]) == 2
        assert "no bag of ROS 2" in capsys.readouterr().err
    assert (there / "mine").read_text() == "kept"
    bag = tmp_path / "bag"
    assert main(["convert", record, "-o", f"{bag}/"]) == 0
    before = (bag / "bag.mcap").read_bytes()
    assert main(["convert", record, "-o", str(bag)]) == 2
    assert "--overwrite" in capsys.readouterr().err
    assert main(["convert", record, "-o", str(bag), "--overwrite"]) == 0
    assert (bag / "bag.mcap").read_bytes() == before
    assert sorted(path.name for path in tmp_path.iterdir()) == ["bag", "there"]


@pytest.mark.parametrize("part", ["trial.mcap", "metadata.yaml"])
@pytest.mark.parametrize("left", [0.0, 0.5])
def test_a_damaged_bag_is_named(
    folder: Path, tmp_path: Path, part: str, left: float, capsys: pytest.CaptureFixture[str]
) -> None:
    bag = tmp_path / "trial"
    shutil.copytree(folder / "trial", bag)
    whole = (bag / part).read_bytes()
    (bag / part).write_bytes(whole[: int(left * len(whole))])
    assert main(["convert", str(bag), "-o", str(tmp_path / "back.mcap")]) == 2
    assert str(bag) in capsys.readouterr().err
    assert not (tmp_path / "back.mcap").exists()


@pytest.mark.tools
@pytest.mark.parametrize("version", ["jazzy", "kilted"])
def test_rclpy_reads_its_messages(folder: Path, version: str) -> None:
    with rosbag2.Reader(folder / "trial") as reader:
        connections = [one for one in reader.connections if one.topic == "/ego/odom"]
        lines = [base64.b64encode(data).decode() for _, _, data in reader.messages(connections)]
    words = [interpreter_with(version), str(ROOT / "tests" / "bag_in_rclpy.py")]
    ran = subprocess.run(words, input="\n".join(lines), capture_output=True, text=True, check=False)
    assert ran.returncode == 0, ran.stderr
    frames = dt.load_record(folder / "trial.mcap").frames
    expected = zip(frames.x[:, 0].tolist(), frames.y[:, 0].tolist(), frames.speed[:, 0].tolist(), strict=True)
    assert ran.stdout.splitlines() == [f"ego/odom {x!r} {y!r} {speed!r}" for x, y, speed in expected]
