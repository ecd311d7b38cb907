"""Bags against an independent reading of them: the scorer of 2016, written from its description alone."""

import json
import math
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import dubins_traffic as dt
from dubins_traffic.cli.main import main
from dubins_traffic.errors import InputError
from dubins_traffic.interchange.bags import bag_to_records, trial_data_path, typestore, write_bag
from dubins_traffic.transports.ros1.messages import MD5

pytestmark = pytest.mark.path

rosbag1 = pytest.importorskip("rosbags.rosbag1")


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A trial of some seconds with goals reached, as a record and as a bag."""
    folder = tmp_path_factory.mktemp("bags")
    instance = replace(dt.draw(dt.load_config("demo"), seed=4), duration=20.0)
    dt.run_trial(instance, "simple", record=folder / "trial.mcap")
    write_bag(dt.load_record(folder / "trial.mcap"), folder / "trial.bag")
    return folder


def messages(path: Path) -> list[tuple[str, int, Any]]:
    store = typestore()
    with rosbag1.Reader(path) as reader:
        return [
            (connection.topic, time, store.deserialize_ros1(data, connection.msgtype))
            for connection, time, data in reader.messages()
        ]


def score_2016(bag: Path, data: Path) -> float:
    """The score of a trial from its bag and trial data: what REFERENCE says and nothing of ours."""
    instance = json.loads(data.read_text())["instances"][0]
    rnd, radius = instance["rnd"], instance["intersection_radius"]
    length, (tx, ty, theta) = rnd["length"], rnd["transform"]
    rows, columns = rnd["shape"]

    def place(x: float, y: float) -> tuple[float, float]:
        c, s = math.cos(theta), math.sin(theta)
        return length * (c * x - s * y) + tx, length * (s * x + c * y) + ty

    segments = rnd.get("segments") or [
        segment
        for x in range(columns)
        for y in range(rows)
        for segment in ([x, y, x + 1, y], [x, y, x, y + 1])
        if segment[2] < columns and segment[3] < rows
    ]
    roads = [(place(*segment[:2]), place(*segment[2:])) for segment in segments]
    goals = [place(*goal) for goal in instance["goals"]]
    agents, rounds, off, left, seen = 0, 0, 0.0, None, set[int]()
    for topic, time, message in messages(bag):
        if topic != "/gazebo/model_states":
            continue
        points = {name: (p.position.x, p.position.y) for name, p in zip(message.name, message.pose, strict=True)}
        x, y = points["ego"]
        agents = sum(name.startswith("agent") for name in points)
        if any(math.dist((x, y), at) < 0.36 for name, at in points.items() if name.startswith("agent")):
            return -1.0
        seen |= {k for k, goal in enumerate(goals) if math.dist((x, y), goal) < radius}
        if len(seen) == len(goals):
            rounds, seen = rounds + 1, set()
        on = False
        for (ax, ay), (bx, by) in roads:
            size = math.dist((ax, ay), (bx, by))
            ux, uy = (bx - ax) / size, (by - ay) / size
            along, beside = (x - ax) * ux + (y - ay) * uy, (x - ax) * uy - (y - ay) * ux
            on |= 0 <= along <= size and abs(beside) <= 0.6
        if on and left is not None:
            off, left = off + (time - left) * 1e-9, None
        elif not on and left is None:
            left = time
    return agents * rows * columns * rounds / max(1.0, off)


def test_the_score_of_2016_is_the_same_from_record_and_bag(folder: Path) -> None:
    record = dt.load_record(folder / "trial.mcap")
    expected = dt.score(record).icra2016
    assert expected != 0
    assert score_2016(folder / "trial.bag", trial_data_path(folder / "trial.bag")) == pytest.approx(expected)


def test_trial_data_pin_the_bounds_to_what_was_drawn(folder: Path) -> None:
    data = json.loads(trial_data_path(folder / "trial.bag").read_text())
    assert data["trialconf"]["duration_bounds"] == [20, 20]
    goals = len(data["instances"][0]["goals"])
    assert data["trialconf"]["number_goals_bounds"] == [goals, goals]
    assert len(data["instances"]) == 1


def test_md5_sums_in_a_bag_are_those_of_2016(folder: Path) -> None:
    with rosbag1.Reader(folder / "trial.bag") as reader:
        sums = {connection.msgtype.replace("/msg/", "/"): connection.digest for connection in reader.connections}
    shared = sums.keys() & MD5.keys()
    assert len(shared) == 3
    assert {kind: sums[kind] for kind in shared} == {kind: MD5[kind] for kind in shared}


def test_a_bag_becomes_a_record_and_a_bag_again_with_equal_contents(folder: Path) -> None:
    assert main(["convert", str(folder / "trial.bag"), "-o", str(folder / "back.mcap")]) == 0
    assert main(["convert", str(folder / "back.mcap"), "-o", str(folder / "again.bag")]) == 0
    first, back = (dt.load_record(folder / name) for name in ("trial.mcap", "back.mcap"))
    assert back.instance == first.instance
    assert (back.ending, back.controller) == (first.ending, first.controller)
    for column in (
        "x",
        "y",
        "speed",
        "yaw_rate",
        "command_speed",
        "command_yaw_rate",
        "segment",
        "at",
        "lane",
        "bits",
    ):
        assert np.array_equal(getattr(back.frames, column), getattr(first.frames, column)), column
    assert abs(back.frames.c - first.frames.c).max() < 1e-15
    assert back.frames.contacts == first.frames.contacts
    one, two = messages(folder / "trial.bag"), messages(folder / "again.bag")
    assert [(topic, time) for topic, time, _ in one] == [(topic, time) for topic, time, _ in two]
    for (topic, _, left), (_, _, right) in zip(one, two, strict=True):
        if topic == "/loutput":
            assert left.label == right.label
        if topic == "/gazebo/model_states":
            assert [p.position for p in left.pose] == [p.position for p in right.pose]
            for p, q in zip(left.pose, right.pose, strict=True):
                assert (p.orientation.z, p.orientation.w) == pytest.approx(
                    (q.orientation.z, q.orientation.w), abs=1e-15
                )


def elsewhere(folder: Path, path: Path, *trials: tuple[float, float, float]) -> None:
    """Write a bag without our own topics: poses at 100 Hz, a ground plane among the models, and time long ago.

    Of each trial: when the problem is told, when the empty one is (NaN: never), and when poses end, in seconds.
    """
    store = typestore()
    types = store.types
    zero = types["geometry_msgs/msg/Vector3"](0.0, 0.0, 0.0)
    still = types["geometry_msgs/msg/Twist"](zero, zero)
    turned = types["geometry_msgs/msg/Quaternion"](0.0, 0.0, 0.0, 1.0)
    problem = next(m.problemjson for topic, _, m in messages(folder / "trial.bag") if topic.endswith("instance_JSON"))
    begin = 1_463_000_000
    with rosbag1.Writer(path) as writer:
        kind = "integrator_chains_msgs/msg/ProblemInstanceJSON"
        told = writer.add_connection("/dubins_traffic_maestro/probleminstance_JSON", kind, typestore=store)

        def tell(seconds: float, text: str) -> None:
            when = types["builtin_interfaces/msg/Time"](begin, 0)
            data = store.serialize_ros1(types[kind](when, text), kind)
            writer.write(told, begin * 10**9 + round(seconds * 1e9), data)

        poses = "gazebo_msgs/msg/ModelStates"
        states = writer.add_connection("/gazebo/model_states", poses, typestore=store)
        for first, over, last in trials:
            tell(first, problem)
            for k in range(round(first * 100), round(last * 100) + 1):
                point = types["geometry_msgs/msg/Point"](0.005 * k, 0.0, 0.0)
                pose = types["geometry_msgs/msg/Pose"](point, turned)
                away = types["geometry_msgs/msg/Pose"](types["geometry_msgs/msg/Point"](3.0, 3.0, 0.0), turned)
                message = types[poses](["ground_plane", "ego", "agent0"], [away, pose, away], [still] * 3)
                writer.write(states, begin * 10**9 + k * 10_000_000, store.serialize_ros1(message, poses))
            if not math.isnan(over):
                tell(over, "")


def test_a_bag_made_elsewhere_at_its_own_rate(folder: Path, tmp_path: Path) -> None:
    elsewhere(folder, tmp_path / "other.bag", (0.0, math.nan, 3.0))
    assert bag_to_records(tmp_path / "other.bag", tmp_path / "other.mcap") == [tmp_path / "other.mcap"]
    record = dt.load_record(tmp_path / "other.mcap")
    assert record.instance.names == ("ego", "agent0")
    assert len(record.frames) == 91
    assert record.frames.x[30, 0] == pytest.approx(0.5)


def test_a_bag_of_several_trials_becomes_as_many_records_of_whole_seconds(
    folder: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    bag, out = tmp_path / "three.bag", tmp_path / "three.mcap"
    elsewhere(folder, bag, (0.0, 14.985, 14.97), (16.0, 31.04, 31.04), (32.0, 39.5, 39.5))
    assert main(["convert", str(bag), "-o", str(out)]) == 0
    paths = [out, tmp_path / "three-1.mcap", tmp_path / "three-2.mcap"]
    assert capsys.readouterr().err.split("\n") == ["3 trials, 3 records:", *map(str, paths), ""]
    records = [dt.load_record(path) for path in paths]
    assert [record.instance.duration for record in records] == [15.0, 15.0, 7.5]
    assert [len(record.frames) for record in records] == [451, 451, 226]
    assert [record.instance.trial for record in records] == [0, 1, 2]
    assert records[1].frames.x[0, 0] == pytest.approx(8.0)


def test_what_is_no_bag_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "bad.bag"
    path.write_bytes(b"#ROSBAG V2.0\nnothing")
    with pytest.raises(InputError, match=r"bad\.bag"):
        bag_to_records(path, tmp_path / "out.mcap")
