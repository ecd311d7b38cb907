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

from dubins_traffic.cars.body import DiscObstacle, Rectangle
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
from dubins_traffic.transports.labels import words
from dubins_traffic.transports.ros1.world import BASE

ROADS, CARS, BREACHES = (f"/dubins_traffic/{name}" for name in ("roads", "cars", "breaches"))
"""Topics of markers: the first once, the second in each frame, the third when a rule is broken."""
LATCHED: Final = frozenset({PROBLEM, INSTANCE, LABELS, NOTES, ROADS, BREACHES, "/tf_static"})
"""Topics whose last messages who comes late is given."""
SHOWN_FOR: Final = 3
"""Seconds for which a breach is shown."""
GREY, LINE, PALE, GREEN, BROWN, BLUE, ORANGE, RED = (
    (0.35, 0.35, 0.38), (0.9, 0.9, 0.9), (0.45, 0.45, 0.48), (0.3, 0.7, 0.35), (0.5, 0.35, 0.2), (0.15, 0.4, 0.8),
    (0.9, 0.55, 0.1), (0.85, 0.1, 0.1),
)  # fmt: skip
Color = tuple[float, float, float]
ARROW, CUBE, CYLINDER, STRIP, TEXT = 0, 1, 3, 4, 9
"""Types of markers."""
ADD = 0
"""What is done with a marker."""


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
        self._put_roads()
        self._put_mounts()
        self._breaches = _breaches(self._record)

    def _put_frame(self, frames: Frames, f: int, time: int) -> None:
        instance = self._instance
        self._put("/clock", "rosgraph_msgs/msg/Clock", time, self._time(time))
        text = " ".join(words(instance.problem.network, instance.names, frames.segment[f], frames.at[f]))
        self._put(LABELS, "std_msgs/msg/String", time, text)
        poses = self._put_cars(frames, f, time)
        self._put_transforms(poses, time)
        self._put_markers(
            CARS, time, [one for n, pose in enumerate(poses) for one in self._car(n, pose, time)]
        )
        for n, rule in self._breaches.get(f, ()):
            said = f"{instance.names[n]}: {rule}"
            place = self._at(float(frames.x[f, n]), float(frames.y[f, n]), 0.5)
            lasting = {"text": said, "lifetime": self._make("builtin_interfaces/msg/Duration", SHOWN_FOR, 0)}
            shown = self._marker("breaches", f, TEXT, place, (0.0, 0.0, 0.3), RED, time=time, **lasting)
            self._put_markers(BREACHES, time, [shown])

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

    def _put_roads(self) -> None:
        """Put what does not move: roads, their middle lines, discs of intersections, goals, obstacles."""
        problem = self._instance.problem
        network, wide = problem.network, 2.0 * problem.car.lane_width
        shown: list[Any] = []
        for s in range(network.lanes // 2):
            points = [self._point(x, y) for x, y in network.lane_curve(2 * s, 0.0).tolist()]
            shown.append(self._marker("roads", s, STRIP, self._at(), (wide, 0.0, 0.0), GREY, points=points))
            shown.append(
                self._marker("lines", s, STRIP, self._at(z=0.01), (0.03, 0.0, 0.0), LINE, points=points)
            )
        across = 2.0 * problem.intersection_radius
        for v, (x, y) in enumerate(network.points.tolist()):
            colour = GREEN if v in problem.goal_vertices else PALE
            place = self._at(x, y, 0.005)
            shown.append(self._marker("intersections", v, CYLINDER, place, (across, across, 0.01), colour))
        for k, obstacle in enumerate(problem.obstacles):
            if isinstance(obstacle, DiscObstacle):
                size = (2.0 * obstacle.radius, 2.0 * obstacle.radius, 0.3)
                shown.append(
                    self._marker(
                        "obstacles", k, CYLINDER, self._at(obstacle.x, obstacle.y, 0.15), size, BROWN
                    )
                )
            else:
                corners = [self._point(x, y) for x, y in (*obstacle.vertices, obstacle.vertices[0])]
                shown.append(
                    self._marker(
                        "obstacles", k, STRIP, self._at(z=0.1), (0.05, 0.0, 0.0), BROWN, points=corners
                    )
                )
        self._put_markers(ROADS, BEGIN, shown)

    def _car(self, n: int, pose: Any, time: int) -> list[Any]:
        """Return a car's body and an arrow along its heading."""
        body, colour = self._instance.problem.car.body, BLUE if n == 0 else ORANGE
        place = self._at(pose.position.x, pose.position.y, 0.1, pose.orientation)
        over = self._at(pose.position.x, pose.position.y, 0.22, pose.orientation)
        if isinstance(body, Rectangle):
            kind, size = CUBE, (body.length, body.width, 0.2)
        else:
            kind, size = CYLINDER, (2.0 * body.radius, 2.0 * body.radius, 0.2)
        return [
            self._marker("bodies", n, kind, place, size, colour, time=time),
            self._marker("headings", n, ARROW, over, (0.3, 0.05, 0.05), LINE, time=time),
        ]

    def _put_markers(self, topic: str, time: int, markers: list[Any]) -> None:
        self._put(topic, "visualization_msgs/msg/MarkerArray", time, markers)

    def _marker(
        self, group: str, number: int, kind: int, pose: Any, scale: tuple[float, float, float], color: Color,
        *, time: int = BEGIN, points: Iterable[Any] = (), text: str = "", lifetime: Any = None,
    ) -> Any:  # fmt: skip
        lasts = lifetime or self._make("builtin_interfaces/msg/Duration", 0, 0)
        header, nothing = self._header(time, "map"), np.zeros(0, dtype=np.uint8)
        image = self._make("sensor_msgs/msg/CompressedImage", header, "", nothing)
        mesh = self._make("visualization_msgs/msg/MeshFile", "", nothing)
        return self._make(
            "visualization_msgs/msg/Marker", header, group, number, kind, ADD, pose, self._vector(*scale),
            self._make("std_msgs/msg/ColorRGBA", *color, 1.0), lasts, False, list(points), [], "", image, [], text, "",
            mesh, False,
        )  # fmt: skip

    def _make(self, kind: str, *fields: Any) -> Any:
        return self._store.types[kind](*fields)

    def _point(self, x: float = 0.0, y: float = 0.0, z: float = 0.0) -> Any:
        return self._make("geometry_msgs/msg/Point", x, y, z)

    def _vector(self, x: float = 0.0, y: float = 0.0, z: float = 0.0) -> Any:
        return self._make("geometry_msgs/msg/Vector3", x, y, z)

    def _quaternion(self) -> Any:
        return self._make("geometry_msgs/msg/Quaternion", 0.0, 0.0, 0.0, 1.0)

    def _at(self, x: float = 0.0, y: float = 0.0, z: float = 0.0, turn: Any = None) -> Any:
        return self._make("geometry_msgs/msg/Pose", self._point(x, y, z), turn or self._quaternion())


def _breaches(record: Record) -> dict[int, list[tuple[int, str]]]:
    """Return the car and the rule of each breach, by frame."""
    verdict = score(record).verdict
    names, found = record.instance.names, dict[int, list[tuple[int, str]]]()
    for broken in verdict.violations if verdict is not None else ():
        found.setdefault(broken.tick, []).append((names.index(broken.car), broken.rule))
    return found


def _latched() -> Any:
    """Return the quality of service of topics whose last message late listeners get."""
    given = import_module("rosbags.interfaces")
    never = given.QosTime(2147483647, 4294967295)
    return given.Qos(
        given.QosHistory.KEEP_LAST, 10, given.QosReliability.RELIABLE, given.QosDurability.TRANSIENT_LOCAL,
        never, never, given.QosLiveliness.AUTOMATIC, never, False,
    )  # fmt: skip
