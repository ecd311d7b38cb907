"""ROS 1 bags as records: of ours, and of those recorded beside any program with the topics of 2016."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from importlib import import_module
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np

from dubins_traffic.campaign.bags import INSTANCE, NOTES, PROBLEM, STATES, typestore
from dubins_traffic.cars.state import Contact, Event, Pose, State
from dubins_traffic.errors import InputError
from dubins_traffic.problem.document import instance_from_document
from dubins_traffic.problem.files import parse_json
from dubins_traffic.problem.instance import EAgent, Instance
from dubins_traffic.problem.kinds import REMOTE
from dubins_traffic.protocols import End, Ending, Sink
from dubins_traffic.record.writer import RecordWriter
from dubins_traffic.spec.labeller import Labeller
from dubins_traffic.transports.quaternion import heading
from dubins_traffic.transports.ros1.transport import COMMANDS
from dubins_traffic.trial.buffer import FrameBuffer

SLACK = 1_000
"""Nanoseconds by which a message may be later than the frame it belongs to."""
MAGIC = b"#ROSBAG V2.0"
Sample = tuple[float, ...]


@dataclass(slots=True)
class _Track:
    """Samples of one thing, in order of time."""

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


@dataclass(slots=True)
class _Bag:
    """What is read of a bag: poses (x, y, c, s, speed), twists and commands (speed, yaw rate) by car; texts."""

    poses: dict[str, _Track] = field(default_factory=dict[str, _Track])
    twists: dict[str, _Track] = field(default_factory=dict[str, _Track])
    commands: dict[str, _Track] = field(default_factory=dict[str, _Track])
    problem: tuple[int, str] | None = None
    over: int | None = None
    instance: str | None = None
    notes: list[dict[str, Any]] = field(default_factory=list[dict[str, Any]])


def is_bag(path: Path | str) -> bool:
    """Tell whether the file at `path` is a ROS 1 bag."""
    try:
        with Path(path).open("rb") as file:
            return file.read(len(MAGIC)) == MAGIC
    except OSError:
        return False


def bag_to_record(path: Path | str, output: Path | str, *, overwrite: bool = False) -> None:
    """Write the first trial in the bag at `path` as a record.

    The trial begins with the problem instance and ends with the empty one, or with the last poses. Frames are taken at
    the control rate, each the latest poses at its time. A bag made elsewhere has no contacts and says nothing of
    cars and bounds: those are the usual ones, and the e-agents are remote.

    Raises
    ------
    MissingExtraError
        Without the extra `ros1`.
    InputError
        If the file is no bag, lacks poses or a problem instance, or the record can't be written.
    """
    name = str(path)
    bag = _read(Path(path))
    if bag.problem is None:
        raise InputError("no problem instance", file=name, expected=f"a message on {PROBLEM}")
    if "ego" not in bag.poses:
        raise InputError("no poses of the ego", file=name, expected=f"messages on {STATES}")
    instance = _instance(bag, name)
    controller = next((note["controller"] for note in bag.notes if "controller" in note), None)
    writer = RecordWriter(output, controller=controller, overwrite=overwrite)
    try:
        _replay(bag, instance, writer)
    finally:
        writer.close()


def _read(path: Path) -> _Bag:
    store = typestore()
    rosbag1 = import_module("rosbags.rosbag1")
    bag = _Bag()
    try:
        with rosbag1.Reader(path) as reader:
            for connection, time, data in reader.messages():
                kind = connection.msgtype
                if connection.topic in (STATES, PROBLEM, INSTANCE, NOTES) or kind in _BY_CAR:
                    _take(bag, connection.topic, time, store.deserialize_ros1(data, kind))
    except (rosbag1.ReaderError, OSError, ValueError, KeyError) as error:
        raise InputError(
            f"can't be read as a bag: {error}", file=str(path), expected="a ROS 1 bag"
        ) from error
    return bag


_BY_CAR = frozenset({"nav_msgs/msg/Odometry", "geometry_msgs/msg/Twist"})
_BEFORE, _AFTER = COMMANDS.split("{}")


def _take(bag: _Bag, topic: str, time: int, message: Any) -> None:
    if topic == STATES:
        for name, pose, twist in zip(message.name, message.pose, message.twist, strict=True):
            c, s = heading(pose.orientation.z, pose.orientation.w)
            speed = twist.linear.x * c + twist.linear.y * s
            sample = (pose.position.x, pose.position.y, c, s, speed, twist.angular.z)
            bag.poses.setdefault(name, _Track()).add(time, sample)
    elif topic == PROBLEM:
        if message.problemjson and bag.problem is None:
            bag.problem = time, message.problemjson
        elif not message.problemjson and bag.problem is not None and bag.over is None:
            bag.over = time
    elif topic == INSTANCE:
        bag.instance = bag.instance or message.problemjson
    elif topic == NOTES:
        bag.notes.append(json.loads(message.data))
    elif topic.startswith(_BEFORE) and topic.endswith(_AFTER):
        name = topic[len(_BEFORE) : -len(_AFTER)]
        bag.commands.setdefault(name, _Track()).add(time, (message.linear.x, message.angular.z))
    elif topic.endswith("/odom"):
        twist = message.twist.twist
        name = topic[1 : -len("/odom")]
        bag.twists.setdefault(name, _Track()).add(time, (twist.linear.x, twist.angular.z))


def _instance(bag: _Bag, file: str) -> Instance:
    """Return the instance: the whole one of a bag of ours, else the problem with cars where they began."""
    assert bag.problem is not None
    began, text = bag.problem
    if bag.instance is not None:
        return instance_from_document(parse_json(bag.instance, file), file)
    others = [
        name for name in bag.poses if name != "ego" and (name in bag.twists or name.startswith("agent"))
    ]
    document = parse_json(text, file)
    alone = instance_from_document({**document, "version": 1, "duration": 1.0, "e-agents": []}, file)
    starts = [bag.poses[name].at(began) or bag.poses[name].samples[0] for name in ("ego", *others)]
    last = bag.over if bag.over is not None else bag.poses["ego"].times[-1]
    ticks = max(1, int((last - began + SLACK) * 1e-9 * alone.problem.rate))
    return replace(
        alone,
        problem=replace(alone.problem, e_agents=tuple(others)),
        starts=tuple(Pose(*start[:4]) for start in starts),
        duration=ticks / alone.problem.rate,
        e_agents=tuple(EAgent(REMOTE, name, REMOTE) for name in others),
    )


def _replay(bag: _Bag, instance: Instance, sink: Sink) -> None:
    """Label the frames as a trial does and push them."""
    assert bag.problem is not None
    began, rate = bag.problem[0], instance.problem.rate
    last = min(track.times[-1] for name, track in bag.poses.items() if name in instance.names)
    over = last if bag.over is None else min(last, bag.over)
    ticks = min(instance.ticks, int((over - began + SLACK) * 1e-9 * rate + 1e-6))
    times = [began + round(tick * 1e9 / rate) for tick in range(ticks + 1)]
    contacts, events, ending = _notes(bag, ticks)
    labeller, buffer = Labeller([instance]), FrameBuffer(instance, [sink])
    state = _state(bag, instance, times[0])
    labels = labeller.reset(state)
    buffer.push(state, labels, np.zeros((1, len(instance.names), 2)), (), events.get(0, ()))
    for tick, (before, now) in enumerate(pairwise(times), start=1):
        new = _state(bag, instance, now)
        for old, column in zip(state, new, strict=True):
            old[:] = column
        touched = labeller.update(tick, state, [contacts.get(tick, ())])[0]
        buffer.push(state, labels, _commands(bag, instance, before, state), touched, events.get(tick, ()))
    buffer.end(ending)


def _state(bag: _Bag, instance: Instance, time: int) -> State:
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


def _commands(bag: _Bag, instance: Instance, time: int, state: State) -> np.ndarray:
    """Return the commands held since `time`; those of cars that have none are how they moved."""
    commands = np.stack([state.speed, state.yaw_rate], axis=2)
    for n, name in enumerate(instance.names):
        command = bag.commands[name].at(time) if name in bag.commands else None
        if command is not None:
            commands[0, n] = command
    return commands


def _notes(
    bag: _Bag, ticks: int
) -> tuple[Mapping[int, tuple[Contact, ...]], Mapping[int, tuple[Event, ...]], Ending]:
    contacts: dict[int, tuple[Contact, ...]] = {}
    events: dict[int, tuple[Event, ...]] = {}
    ending = Ending(End.DURATION, ticks)
    for note in bag.notes:
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
