"""Bags of ROS 2: records are written as `ros2 bag record` would have, with markers that RViz and Foxglove show.

A bag is a folder with a file of messages, MCAP in CDR, and `metadata.yaml`. All messages come with ROS 2. It holds the
topics of `transports.ros2`, one message a frame, commands, markers of roads, goals, obstacles, cars and breaches, and,
as a bag of ROS 1, the whole instance and notes as JSON, so that nothing is lost on the way back.
"""

from __future__ import annotations

import shutil
from collections.abc import Iterable
from importlib import import_module
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any, Final

import numpy as np

from dubins_traffic.cars.state import Frames
from dubins_traffic.errors import InputError
from dubins_traffic.files import require_output
from dubins_traffic.interchange.bags import (
    BEGIN,
    INSTANCE,
    LABELS,
    NOTES,
    PROBLEM,
    BagWriter,
    is_ros2_bag,
    ros2_typestore,
)
from dubins_traffic.record.reader import Record
from dubins_traffic.scoring.score import score
from dubins_traffic.transports import marks
from dubins_traffic.transports.labels import words
from dubins_traffic.transports.ros1.world import BASE

LATCHED: Final = frozenset({PROBLEM, INSTANCE, LABELS, NOTES, marks.ROADS, marks.BREACHES, "/tf_static"})
"""Topics whose last messages who comes late is given."""


def write_ros2_bag(record: Record, path: Path | str, *, overwrite: bool = False) -> None:
    """Write `record` as a bag of ROS 2, a folder, whole or not at all.

    Raises
    ------
    MissingExtraError
        Without the extra `ros2`.
    InputError
        If the path is refused (`files.require_output`), or a folder is there that is no such bag.
    """
    target = require_bag(path, overwrite=overwrite)
    store = ros2_typestore()
    with TemporaryDirectory(prefix=f".{target.name}.", dir=target.parent) as beside:
        made = Path(beside) / target.name
        _Ros2BagWriter(record, store).write(made)
        if target.exists():
            shutil.rmtree(target)
        made.rename(target)


def require_bag(path: Path | str, *, overwrite: bool = False) -> Path:
    """Return where a bag of ROS 2 is to be written; InputError as of `write_ros2_bag`."""
    target = Path(path)
    if not target.is_dir():
        require_output(target, "a bag of ROS 2", ("",), overwrite=overwrite)
    elif not is_ros2_bag(target):
        raise InputError("a folder that is no bag of ROS 2", file=str(path), expected="a new name")
    elif not overwrite:
        raise InputError("exists already", file=str(path), expected="a new name, or --overwrite")
    return target


class _Ros2BagWriter(BagWriter):
    """Writes one record as a bag of ROS 2."""

    def _open(self, path: Path) -> Any:
        rosbag2 = import_module("rosbags.rosbag2")
        writer = rosbag2.Writer(path, version=9, storage_plugin=rosbag2.StoragePlugin.MCAP)
        writer.set_compression(rosbag2.CompressionMode.STORAGE, rosbag2.CompressionFormat.ZSTD)
        return writer

    def _connect(self, topic: str, kind: str) -> Any:
        with_qos = [_latched()] if topic in LATCHED else []
        return self._writer.add_connection(topic, kind, typestore=self._store, offered_qos_profiles=with_qos)

    def _serialized(self, message: Any, kind: str) -> Any:
        return self._store.serialize_cdr(message, kind)

    def _header(self, time: int, frame: str) -> Any:
        return self._make("std_msgs/msg/Header", self._time(time), frame)

    def _put_json(self, topic: str, time: int, text: str) -> None:
        self._put(topic, "std_msgs/msg/String", time, text)

    def _put_still(self) -> None:
        super()._put_still()
        self._put_marks(marks.ROADS, BEGIN, marks.of_world(self._instance.problem))
        self._put_mounts()
        self._breaches = _breaches(self._record)

    def _put_frame(self, frames: Frames, f: int, time: int) -> None:
        instance = self._instance
        self._put("/clock", "rosgraph_msgs/msg/Clock", time, self._time(time))
        text = " ".join(words(instance.problem.network, instance.names, frames.segment[f], frames.at[f]))
        self._put(LABELS, "std_msgs/msg/String", time, text)
        poses = self._put_cars(frames, f, time)
        self._put_transforms(poses, time)
        body = instance.problem.car.body
        turned = [(pose.position, (pose.orientation.z, pose.orientation.w)) for pose in poses]
        self._put_marks(
            marks.CARS,
            time,
            [one for n, (at, turn) in enumerate(turned) for one in marks.of_car(n, body, at.x, at.y, turn)],
        )
        for n, rule in self._breaches.get(f, ()):
            place = float(frames.x[f, n]), float(frames.y[f, n])
            self._put_marks(marks.BREACHES, time, [marks.of_breach(f, f"{instance.names[n]}: {rule}", *place)])

    def _put_transforms(self, poses: Iterable[Any], time: int) -> None:
        """Put where each car's footprint is by its odometry."""
        moving = [
            self._transform(time, f"{name}/odom", f"{name}/base_footprint", pose.position, pose.orientation)
            for name, pose in zip(self._instance.names, poses, strict=True)
        ]
        self._put("/tf", "tf2_msgs/msg/TFMessage", time, moving)

    def _put_mounts(self) -> None:
        """Put where each car's odometry begins and its base is above its footprint, as a session tells it."""
        fixed: list[Any] = []
        for name in self._instance.names:
            for parent, child, height in (
                ("map", f"{name}/odom", 0.0),
                (f"{name}/base_footprint", f"{name}/base_link", BASE),
            ):
                place = self._vector(z=height)
                fixed.append(self._transform(BEGIN, parent, child, place, self._quaternion()))
        self._put("/tf_static", "tf2_msgs/msg/TFMessage", BEGIN, fixed)

    def _transform(self, time: int, parent: str, child: str, place: Any, turn: Any) -> Any:
        moved = self._make("geometry_msgs/msg/Transform", self._vector(place.x, place.y, place.z), turn)
        return self._make("geometry_msgs/msg/TransformStamped", self._header(time, parent), child, moved)

    def _put_marks(self, topic: str, time: int, shown: Iterable[marks.Mark]) -> None:
        self._put(topic, "visualization_msgs/msg/MarkerArray", time, [self._marker(one, time) for one in shown])

    def _marker(self, mark: marks.Mark, time: int) -> Any:
        header, nothing = self._header(time, "map"), np.zeros(0, dtype=np.uint8)
        points = [self._make("geometry_msgs/msg/Point", x, y, 0.0) for x, y in mark.points]
        image = self._make("sensor_msgs/msg/CompressedImage", header, "", nothing)
        mesh = self._make("visualization_msgs/msg/MeshFile", "", nothing)
        return self._make(
            "visualization_msgs/msg/Marker", header, mark.group, mark.number, mark.kind, marks.ADD, self._at(mark),
            self._vector(*mark.scale), self._make("std_msgs/msg/ColorRGBA", *mark.color, 1.0),
            self._make("builtin_interfaces/msg/Duration", mark.seconds, 0), False, points, [], "", image, [],
            mark.text, "", mesh, False,
        )  # fmt: skip

    def _make(self, kind: str, *fields: Any) -> Any:
        return self._store.types[kind](*fields)

    def _vector(self, x: float = 0.0, y: float = 0.0, z: float = 0.0) -> Any:
        return self._make("geometry_msgs/msg/Vector3", x, y, z)

    def _quaternion(self, z: float = 0.0, w: float = 1.0) -> Any:
        return self._make("geometry_msgs/msg/Quaternion", 0.0, 0.0, z, w)

    def _at(self, mark: marks.Mark) -> Any:
        point = self._make("geometry_msgs/msg/Point", *mark.place)
        return self._make("geometry_msgs/msg/Pose", point, self._quaternion(*mark.turn))


def _breaches(record: Record) -> dict[int, list[tuple[int, str]]]:
    """Return the car and the rule of each breach, by frame."""
    verdict = score(record).verdict
    names, by_tick = record.instance.names, dict[int, list[tuple[int, str]]]()
    for broken in verdict.violations if verdict is not None else ():
        by_tick.setdefault(broken.tick, []).append((names.index(broken.car), broken.rule))
    return by_tick


def _latched() -> Any:
    """Return the quality of service of topics whose last message late listeners get."""
    given = import_module("rosbags.interfaces")
    never = given.QosTime(2147483647, 4294967295)
    return given.Qos(
        given.QosHistory.KEEP_LAST, 10, given.QosReliability.RELIABLE, given.QosDurability.TRANSIENT_LOCAL,
        never, never, given.QosLiveliness.AUTOMATIC, never, False,
    )  # fmt: skip
