"""Writes records as ROS 1 bags with the trial data of 2016 beside them, so that tools of 2016 can score them.

A bag holds what the topics of `transports.ros1` carry, one message a frame, and two topics of ours so that nothing
is lost on the way back: the whole instance, and contacts, events and the end as JSON.
"""

from __future__ import annotations

import json
import math
from dataclasses import asdict
from importlib import import_module
from pathlib import Path
from typing import Any

import numpy as np

from dubins_traffic.cars.state import Frames
from dubins_traffic.errors import MissingExtraError
from dubins_traffic.files import replace_file, require_output
from dubins_traffic.problem.configuration import Configuration
from dubins_traffic.problem.document import instance_to_document
from dubins_traffic.problem.files import DOCUMENTS
from dubins_traffic.problem.instance import Instance
from dubins_traffic.problem.trial_data import TrialData
from dubins_traffic.record.reader import Record
from dubins_traffic.rules.labels import words
from dubins_traffic.transports.ros import half
from dubins_traffic.transports.ros1.messages import definitions
from dubins_traffic.transports.ros1.transport import COMMANDS

STATES = "/gazebo/model_states"
LABELS = "/loutput"
PROBLEM = "/dubins_traffic_maestro/probleminstance_JSON"
INSTANCE = "/dubins_traffic/instance_JSON"
NOTES = "/dubins_traffic/notes"
BEGIN = 1_000_000_000
"""Time of the first frame, nanoseconds: bags can't begin at 0."""
DATE = "1970-01-01 00:00:01"
"""The date of trial data whose record has no sidecar: that of the bag's first message."""


def typestore() -> Any:
    """Return the message types of ROS 1 together with those of this package.

    Raises
    ------
    MissingExtraError
        Without the extra `ros1`.
    """
    try:
        types = import_module("rosbags.typesys")
    except ImportError as error:
        raise MissingExtraError("reading and writing bags", "ros1") from error
    store = types.get_typestore(types.Stores.ROS1_NOETIC)
    for file in definitions():
        if file.suffix == ".msg":
            name = f"{file.parent.parent.name}/msg/{file.stem}"
            store.register(types.get_types_from_msg(file.read_text(encoding="utf-8"), name))
    return store


def trial_data_path(bag: Path | str) -> Path:
    """Return where the trial data of a bag stands: ``NAME.trial.json`` beside ``NAME.bag``."""
    return Path(bag).with_suffix(".trial.json")


def write_bag(record: Record, path: Path | str, *, overwrite: bool = False) -> Path:
    """Write `record` as a bag, and its trial data beside it; return where those are.

    Raises
    ------
    MissingExtraError
        Without the extra `ros1`.
    InputError
        If a path is refused (`files.require_output`), or a file can't be written.
    """
    require_output(path, "a bag", (".bag",), overwrite=overwrite)
    data = trial_data_path(path)
    require_output(data, "trial data", DOCUMENTS, overwrite=overwrite)
    store = typestore()
    replace_file(Path(path), lambda neighbour: _Bag(record, store).write(neighbour))
    trial_data(record).write(data, overwrite=overwrite)
    return data


def trial_data(record: Record) -> TrialData:
    """Return the trial data of one trial: its configuration has bounds equal to what was drawn."""
    instance = record.instance
    goals, duration = len(instance.problem.goals), math.ceil(instance.duration)
    configuration = {
        "version": 0,
        "problem_domain": "dubins_traffic",
        "rnd": instance.problem.network.to_document(),
        "e-agents": [{"type": agent.type, "name": agent.name} for agent in instance.e_agents],
        "number_trials": 1,
        "duration_bounds": [duration, duration],
        "number_goals_bounds": [goals, goals],
    }
    Configuration.from_document(configuration)
    date = DATE if record.wall is None else record.wall.date[:19].replace("T", " ")
    return TrialData.of(date, configuration, [instance_to_document(instance, version=0)])


def stamp(tick: int, rate: float) -> int:
    """Return the time of a frame in a bag, nanoseconds."""
    return BEGIN + round(tick * 1e9 / rate)


class _Bag:
    """Writes one record."""

    def __init__(self, record: Record, store: Any) -> None:
        self._record, self._store = record, store
        self._instance: Instance = record.instance
        self._seq = 0

    def write(self, path: Path) -> None:
        """Write the file; frame by frame, poses last, as a session publishes them."""
        frames, rate = self._record.frames, self._instance.problem.rate
        with import_module("rosbags.rosbag1").Writer(path) as self._writer:
            self._connections: dict[str, Any] = {}
            self._put_problem(BEGIN, json.dumps(instance_to_document(self._instance, version=0)))
            whole = json.dumps(instance_to_document(self._instance))
            self._put(
                INSTANCE, "integrator_chains_msgs/msg/ProblemInstanceJSON", BEGIN, self._time(BEGIN), whole
            )
            for f in range(len(frames)):
                self._put_frame(frames, f, stamp(f, rate))
            last = stamp(len(frames) - 1, rate)
            self._put_notes(last)
            self._put_problem(last + 1, "")

    def _put(self, topic: str, kind: str, time: int, *fields: Any) -> None:
        if topic not in self._connections:
            self._connections[topic] = self._writer.add_connection(topic, kind, typestore=self._store)
        data = self._store.serialize_ros1(self._store.types[kind](*fields), kind)
        self._writer.write(self._connections[topic], time, data)

    def _put_problem(self, time: int, text: str) -> None:
        self._put(PROBLEM, "integrator_chains_msgs/msg/ProblemInstanceJSON", time, self._time(time), text)

    def _put_notes(self, time: int) -> None:
        record = self._record
        notes: list[dict[str, Any]] = [{"contact": asdict(contact)} for contact in record.frames.contacts]
        notes += [{"event": asdict(event)} for event in record.frames.events]
        if record.ending is not None:
            notes.append({"end": asdict(record.ending)})
        notes.append({"controller": record.controller})
        for note in notes:
            self._put(NOTES, "std_msgs/msg/String", time, json.dumps(note))

    def _put_frame(self, frames: Frames, f: int, time: int) -> None:
        instance = self._instance
        names = instance.names
        header = self._header(time, "map")
        text = list(words(instance.problem.network, names, frames.segment[f], frames.at[f]))
        self._put(LABELS, "dubins_traffic_msgs/msg/LabelStamped", time, header, text)
        poses = [self._pose(frames, f, n) for n in range(len(names))]
        twists: list[Any] = []
        for n, name in enumerate(names):
            c, s = float(frames.c[f, n]), float(frames.s[f, n])
            speed, yaw_rate = float(frames.speed[f, n]), float(frames.yaw_rate[f, n])
            twists.append(self._twist(speed * c, speed * s, yaw_rate))
            self._put_odometry(name, time, poses[n], self._twist(speed, 0.0, yaw_rate))
            if f + 1 < len(frames):
                command = float(frames.command_speed[f + 1, n]), float(frames.command_yaw_rate[f + 1, n])
                twist = self._twist(command[0], 0.0, command[1])
                self._put(COMMANDS.format(name), "geometry_msgs/msg/Twist", time, twist.linear, twist.angular)
        self._put(STATES, "gazebo_msgs/msg/ModelStates", time, list(names), poses, twists)

    def _put_odometry(self, name: str, time: int, pose: Any, twist: Any) -> None:
        types = self._store.types
        none = np.zeros(36)
        self._put(
            f"/{name}/odom",
            "nav_msgs/msg/Odometry",
            time,
            self._header(time, f"{name}/odom"),
            f"{name}/base_footprint",
            types["geometry_msgs/msg/PoseWithCovariance"](pose, none),
            types["geometry_msgs/msg/TwistWithCovariance"](twist, none),
        )

    def _pose(self, frames: Frames, f: int, n: int) -> Any:
        types = self._store.types
        z, w = half(float(frames.c[f, n]), float(frames.s[f, n]))
        point = types["geometry_msgs/msg/Point"](float(frames.x[f, n]), float(frames.y[f, n]), 0.0)
        return types["geometry_msgs/msg/Pose"](point, types["geometry_msgs/msg/Quaternion"](0.0, 0.0, z, w))

    def _twist(self, x: float, y: float, yaw_rate: float) -> Any:
        vector, twist = (self._store.types[f"geometry_msgs/msg/{name}"] for name in ("Vector3", "Twist"))
        return twist(vector(x, y, 0.0), vector(0.0, 0.0, yaw_rate))

    def _header(self, time: int, frame: str) -> Any:
        self._seq += 1
        return self._store.types["std_msgs/msg/Header"](self._seq, self._time(time), frame)

    def _time(self, time: int) -> Any:
        return self._store.types["builtin_interfaces/msg/Time"](time // 10**9, time % 10**9)
