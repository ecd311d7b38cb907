"""Bags: records are written as bags of ROS 1 with the trial data of 2016 beside them, so that tools of 2016 score them.

A bag holds what the topics of `transports.ros1` carry, one message a frame, and two topics of ours so that nothing is
lost on the way back: the whole instance, and contacts, events and the end as JSON. Bags written here, and bags
recorded beside any program with the topics of 2016, are read as records.
"""

from __future__ import annotations

import json
import math
from collections.abc import Mapping
from dataclasses import asdict, dataclass, field, replace
from importlib import import_module
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np

from dubins_traffic.cars.state import Contact, Event, Frames, Pose, State
from dubins_traffic.errors import InputError, needs
from dubins_traffic.files import begins_with, replace_file, require_output
from dubins_traffic.problem.configuration import Configuration
from dubins_traffic.problem.document import instance_from_document, instance_to_document
from dubins_traffic.problem.files import DOCUMENTS, parse_json
from dubins_traffic.problem.instance import EAgent, Instance
from dubins_traffic.problem.kinds import REMOTE
from dubins_traffic.problem.trial_data import TrialData
from dubins_traffic.protocols import End, Ending, Sink
from dubins_traffic.record.reader import Record
from dubins_traffic.record.writer import RecordWriter, record_paths
from dubins_traffic.rules.labeller import Labeller
from dubins_traffic.transports.labels import words
from dubins_traffic.transports.ros import half, heading
from dubins_traffic.transports.ros1.messages import definitions
from dubins_traffic.transports.ros1.transport import COMMANDS
from dubins_traffic.trial.buffer import FrameBuffer

STATES = "/gazebo/model_states"
LABELS = "/loutput"
PROBLEM = "/dubins_traffic_maestro/probleminstance_JSON"
INSTANCE = "/dubins_traffic/instance_JSON"
NOTES = "/dubins_traffic/notes"
BEGIN = 1_000_000_000
"""Time of the first frame, nanoseconds: bags can't begin at 0."""
DATE = "1970-01-01 00:00:01"
"""The date of trial data whose record has no sidecar: that of the bag's first message."""
SLACK = 1_000
"""Largest delay of a message after the frame to which it belongs, nanoseconds."""
WHOLE = 0.1
"""Tolerance for the duration of a trial of 2016, of whole seconds, in a bag, and for the end of its poses, seconds."""
MAGIC = b"#ROSBAG V2.0"
METADATA = "metadata.yaml"
"""What a folder has that is a bag of ROS 2."""
Sample = tuple[float, ...]


def typestore() -> Any:
    """Return the message types of ROS 1 together with those of this package.

    MissingExtraError without the extra `ros1`.
    """
    with needs("reading and writing bags", "ros1"):
        types = import_module("rosbags.typesys")
    store = types.get_typestore(types.Stores.ROS1_NOETIC)
    for file in definitions():
        if file.suffix == ".msg":
            name = f"{file.parent.parent.name}/msg/{file.stem}"
            store.register(types.get_types_from_msg(file.read_text(encoding="utf-8"), name))
    return store


def ros2_typestore() -> Any:
    """Return the message types that come with ROS 2; MissingExtraError without the extra `ros2`."""
    with needs("reading and writing bags of ROS 2", "ros2"):
        types = import_module("rosbags.typesys")
    return types.get_typestore(types.Stores.ROS2_JAZZY)


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
    replace_file(Path(path), lambda neighbour: BagWriter(record, store).write(neighbour))
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


class BagWriter:
    """Writes one record as a bag of ROS 1; `ros2_bags` as one of ROS 2."""

    def __init__(self, record: Record, store: Any) -> None:
        self._record, self._store = record, store
        self._instance: Instance = record.instance
        self._seq = 0

    def _open(self, path: Path) -> Any:
        return import_module("rosbags.rosbag1").Writer(path)

    def write(self, path: Path) -> None:
        """Write the file; frame by frame, poses last, as a session publishes them."""
        frames, rate = self._record.frames, self._instance.problem.rate
        with self._open(path) as self._writer:
            self._connections: dict[str, Any] = {}
            self._put_still()
            for f in range(len(frames)):
                self._put_frame(frames, f, stamp(f, rate))
            last = stamp(len(frames) - 1, rate)
            self._put_notes(last)
            self._put_json(PROBLEM, last + 1, "")

    def _put_still(self) -> None:
        """Put what stays as it is throughout the trial."""
        self._put_json(PROBLEM, BEGIN, json.dumps(instance_to_document(self._instance, version=0)))
        self._put_json(INSTANCE, BEGIN, json.dumps(instance_to_document(self._instance)))

    def _connect(self, topic: str, kind: str) -> Any:
        return self._writer.add_connection(topic, kind, typestore=self._store)

    def _serialized(self, message: Any, kind: str) -> Any:
        return self._store.serialize_ros1(message, kind)

    def _put(self, topic: str, kind: str, time: int, *fields: Any) -> None:
        if topic not in self._connections:
            self._connections[topic] = self._connect(topic, kind)
        data = self._serialized(self._store.types[kind](*fields), kind)
        self._writer.write(self._connections[topic], time, data)

    def _put_json(self, topic: str, time: int, text: str) -> None:
        self._put(topic, "integrator_chains_msgs/msg/ProblemInstanceJSON", time, self._time(time), text)

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
        poses = self._put_cars(frames, f, time)
        twists: list[Any] = []
        for n in range(len(names)):
            c, s = float(frames.c[f, n]), float(frames.s[f, n])
            speed = float(frames.speed[f, n])
            twists.append(self._twist(speed * c, speed * s, float(frames.yaw_rate[f, n])))
        self._put(STATES, "gazebo_msgs/msg/ModelStates", time, list(names), poses, twists)

    def _put_cars(self, frames: Frames, f: int, time: int) -> list[Any]:
        """Put odometry and commands of all cars; return their poses."""
        names = self._instance.names
        poses = [self._pose(frames, f, n) for n in range(len(names))]
        for n, name in enumerate(names):
            twist = self._twist(float(frames.speed[f, n]), 0.0, float(frames.yaw_rate[f, n]))
            self._put_odometry(name, time, poses[n], twist)
            if f + 1 < len(frames):
                command = float(frames.command_speed[f + 1, n]), float(frames.command_yaw_rate[f + 1, n])
                twist = self._twist(command[0], 0.0, command[1])
                self._put(COMMANDS.format(name), "geometry_msgs/msg/Twist", time, twist.linear, twist.angular)
        return poses

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


@dataclass(slots=True)
class _Track:
    """Samples of one quantity, in order of time."""

    times: list[int] = field(default_factory=list[int])
    samples: list[Sample] = field(default_factory=list[Sample])

    def add(self, time: int, sample: Sample) -> None:
        """Append a sample."""
        self.times.append(time)
        self.samples.append(sample)

    def at(self, time: int) -> Sample | None:
        """Return the latest sample at `time`, None before the first."""
        k = int(np.searchsorted(self.times, time + SLACK, side="right")) - 1
        return self.samples[k] if k >= 0 else None

    def until(self, time: int) -> int:
        """Return the time of the latest sample at `time`; that of the first if there is none."""
        return self.times[max(0, int(np.searchsorted(self.times, time, side="right")) - 1)]


@dataclass(slots=True)
class _Run:
    """One trial in a bag: time and text of its problem, the time of its end, and the notes of bags written here."""

    began: int
    text: str
    over: int | None = None
    instance: str | None = None
    notes: list[dict[str, Any]] = field(default_factory=list[dict[str, Any]])


@dataclass(slots=True)
class _BagTopics:
    """The content of a bag: poses (x, y, c, s, speed), twists and commands (speed, yaw rate) by car; trials; texts.

    `of_ros1` tells whether poses are those of `STATES`; else they are those of odometry.
    """

    of_ros1: bool
    poses: dict[str, _Track] = field(default_factory=dict[str, _Track])
    twists: dict[str, _Track] = field(default_factory=dict[str, _Track])
    commands: dict[str, _Track] = field(default_factory=dict[str, _Track])
    runs: list[_Run] = field(default_factory=list[_Run])
    instances: list[tuple[int, str]] = field(default_factory=list[tuple[int, str]])
    notes: list[tuple[int, str]] = field(default_factory=list[tuple[int, str]])

    def assign(self) -> None:
        """Give each trial the notes of bags written here; messages of one time come in any order."""
        for run, following in zip(self.runs, [*self.runs[1:], None], strict=True):
            end = math.inf if following is None else following.began
            run.instance = next((text for time, text in self.instances if run.began <= time < end), None)
            run.notes = [json.loads(text) for time, text in self.notes if run.began <= time < end]


def is_bag(path: Path | str) -> bool:
    """Tell whether a bag is at `path`: a file of ROS 1, or a folder of ROS 2."""
    return is_ros2_bag(path) or (Path(path).is_file() and begins_with(path, MAGIC))


def is_ros2_bag(path: Path | str) -> bool:
    """Tell whether the folder at `path` is a bag of ROS 2."""
    return (Path(path) / METADATA).is_file()


def bag_to_records(path: Path | str, output: Path | str, *, overwrite: bool = False) -> list[Path]:
    """Write each trial in the bag of ROS 1 or ROS 2 at `path` as a record.

    The first is written to `output`, others to ``-1``, ``-2``, ... of it.

    A trial begins with the problem instance and ends with the empty one, or with the last poses. Frames are taken at
    the control rate, each the latest poses at its time. A bag made elsewhere has no contacts and says nothing of
    cars and bounds: those are the usual ones, the e-agents are remote, and a duration within 0.1 s of whole seconds is
    taken for them, as all durations of 2016 are.

    Returns
    -------
    list of Path
        The records.

    Raises
    ------
    MissingExtraError
        Without the extra `ros1`, or `ros2`.
    InputError
        If it is no bag, lacks poses or a problem instance, or a record can't be written.
    """
    name, output = str(path), Path(output)
    bag = _read(Path(path))
    if not bag.runs:
        raise InputError("no problem instance", file=name, expected=f"a message on {PROBLEM}")
    if "ego" not in bag.poses:
        raise InputError("no poses of the ego", file=name, expected=f"messages on {STATES}, or of ROS 2 on /ego/odom")
    records = record_paths(output, len(bag.runs), overwrite=overwrite)
    for number, (run, record) in enumerate(zip(bag.runs, records, strict=True)):
        instance = _instance(bag, run, number, name)
        controller = next((note["controller"] for note in run.notes if "controller" in note), None)
        writer = RecordWriter(record, controller=controller, overwrite=overwrite)
        try:
            _replay(bag, run, instance, writer)
        finally:
            writer.close()
    return records


def _read(path: Path) -> _BagTopics:
    bag = _BagTopics(of_ros1=not path.is_dir())
    store = typestore() if bag.of_ros1 else ros2_typestore()
    deserialize = store.deserialize_ros1 if bag.of_ros1 else store.deserialize_cdr
    library = import_module("rosbags.rosbag1" if bag.of_ros1 else "rosbags.rosbag2")
    try:
        with library.Reader(path) as reader:
            for connection, time, data in reader.messages():
                kind = connection.msgtype
                if connection.topic in (STATES, PROBLEM, INSTANCE, NOTES) or kind in _BY_CAR:
                    _take(bag, connection.topic, time, deserialize(data, kind))
    except (library.ReaderError, OSError, ValueError, KeyError) as error:
        raise InputError(
            f"can't be read as a bag: {error}", file=str(path), expected="a bag of ROS 1 or ROS 2"
        ) from error
    bag.assign()
    return bag


_BY_CAR = frozenset({"nav_msgs/msg/Odometry", "geometry_msgs/msg/Twist"})
_BEFORE, _AFTER = COMMANDS.split("{}")


def _take(bag: _BagTopics, topic: str, time: int, message: Any) -> None:
    if topic == STATES:
        for name, pose, twist in zip(message.name, message.pose, message.twist, strict=True):
            c, s = heading(pose.orientation.z, pose.orientation.w)
            speed = twist.linear.x * c + twist.linear.y * s
            sample = (pose.position.x, pose.position.y, c, s, speed, twist.angular.z)
            bag.poses.setdefault(name, _Track()).add(time, sample)
    elif topic == PROBLEM:
        _take_problem(bag, time, message.problemjson if bag.of_ros1 else message.data)
    elif topic == INSTANCE:
        bag.instances.append((time, message.problemjson if bag.of_ros1 else message.data))
    elif topic == NOTES:
        bag.notes.append((time, message.data))
    elif topic.startswith(_BEFORE) and topic.endswith(_AFTER):
        name = topic[len(_BEFORE) : -len(_AFTER)]
        bag.commands.setdefault(name, _Track()).add(time, (message.linear.x, message.angular.z))
    elif topic.endswith("/odom"):
        twist = message.twist.twist
        name = topic[1 : -len("/odom")]
        bag.twists.setdefault(name, _Track()).add(time, (twist.linear.x, twist.angular.z))
        if not bag.of_ros1:
            pose = message.pose.pose
            place = (pose.position.x, pose.position.y, *heading(pose.orientation.z, pose.orientation.w))
            sample = (*place, twist.linear.x, twist.angular.z)
            bag.poses.setdefault(name, _Track()).add(time, sample)


def _take_problem(bag: _BagTopics, time: int, text: str) -> None:
    """Begin or end a trial; latched messages may come twice."""
    running = bag.runs[-1] if bag.runs and bag.runs[-1].over is None else None
    if running is not None and text != running.text:
        running.over, running = time, None
    if running is None and text:
        bag.runs.append(_Run(time, text))


def _instance(bag: _BagTopics, run: _Run, number: int, file: str) -> Instance:
    """Return the instance: that of a bag written here, otherwise the problem with cars where their poses begin."""
    if run.instance is not None:
        return instance_from_document(parse_json(run.instance, file), file)
    others = [name for name in bag.poses if name != "ego" and (name in bag.twists or name.startswith("agent"))]
    document = parse_json(run.text, file)
    alone = instance_from_document({**document, "version": 1, "duration": 1.0, "e-agents": []}, file)
    starts = [bag.poses[name].at(run.began) or bag.poses[name].samples[0] for name in ("ego", *others)]
    last = run.over if run.over is not None else bag.poses["ego"].times[-1]
    return replace(
        alone,
        problem=replace(alone.problem, e_agents=tuple(others)),
        starts=tuple(Pose(*start[:4]) for start in starts),
        duration=_duration((last - run.began) * 1e-9, alone.problem.rate),
        e_agents=tuple(EAgent(REMOTE, name, REMOTE) for name in others),
        trial=number,
    )


def _duration(seconds: float, rate: float) -> float:
    """Return the duration of a trial from its length in a bag."""
    whole = round(seconds)
    if whole > 0 and abs(seconds - whole) <= WHOLE:
        return float(whole)
    return max(1, int((seconds + SLACK * 1e-9) * rate)) / rate


def _replay(bag: _BagTopics, run: _Run, instance: Instance, sink: Sink) -> None:
    """Label the frames as a trial does and hand them to the sink."""
    began, rate = run.began, instance.problem.rate
    over = math.inf if run.over is None else run.over
    last = min(
        track.times[-1] if run.over is None else track.until(run.over)
        for name, track in bag.poses.items()
        if name in instance.names
    )
    end = min(last, over) if run.instance is not None else last + WHOLE * 1e9
    ticks = min(instance.ticks, int((end - began + SLACK) * 1e-9 * rate + 1e-6))
    times = [began + round(tick * 1e9 / rate) for tick in range(ticks + 1)]
    contacts, events, ending = _notes(run, ticks)
    labeller, buffer = Labeller([instance]), FrameBuffer([instance], [[sink]])
    state = _state(bag, instance, times[0])
    labels = labeller.reset(state)
    for event in events.get(0, ()):
        buffer.note(event)
    buffer.push(state, labels, np.zeros((1, len(instance.names), 2)))
    for tick, (before, now) in enumerate(pairwise(times), start=1):
        new = _state(bag, instance, now)
        for old, column in zip(state, new, strict=True):
            old[:] = column
        buffer.touch(labeller.update(tick, state, [contacts.get(tick, ())])[0])
        for event in events.get(tick, ()):
            buffer.note(event)
        buffer.push(state, labels, _commands(bag, instance, before, state))
    buffer.end(ending)


def _state(bag: _BagTopics, instance: Instance, time: int) -> State:
    state = State.zeros(1, len(instance.names))
    for n, name in enumerate(instance.names):
        if name not in bag.poses:
            raise InputError(
                "no poses of a car", file=STATES, value=name, expected="a bag with all of the trial's cars"
            )
        sample = bag.poses[name].at(time) or bag.poses[name].samples[0]
        state.x[0, n], state.y[0, n], state.c[0, n], state.s[0, n] = sample[:4]
        twist = bag.twists[name].at(time) if name in bag.twists else None
        state.speed[0, n], state.yaw_rate[0, n] = twist or sample[4:]
    return state


def _commands(bag: _BagTopics, instance: Instance, time: int, state: State) -> np.ndarray:
    """Return the commands held since `time`; for cars without commands their speeds and yaw rates."""
    commands = np.stack([state.speed, state.yaw_rate], axis=2)
    for n, name in enumerate(instance.names):
        command = bag.commands[name].at(time) if name in bag.commands else None
        if command is not None:
            commands[0, n] = command
    return commands


def _notes(run: _Run, ticks: int) -> tuple[Mapping[int, tuple[Contact, ...]], Mapping[int, tuple[Event, ...]], Ending]:
    contacts: dict[int, tuple[Contact, ...]] = {}
    events: dict[int, tuple[Event, ...]] = {}
    ending = Ending(End.DURATION, ticks)
    for note in run.notes:
        if "contact" in note:
            given: dict[str, Any] = dict(note["contact"])
            given.update({name: tuple(given[name]) for name in ("closing", "moved", "at_fault")})
            contact = Contact(**given)
            contacts[contact.tick] = (*contacts.get(contact.tick, ()), contact)
        elif "event" in note:
            event = Event(**note["event"])
            events[event.tick] = (*events.get(event.tick, ()), event)
        elif "end" in note:
            ending = Ending(End(note["end"]["end"]), note["end"]["ticks"], note["end"]["detail"])
    return contacts, events, ending
