"""Logs of lcm-logger as records."""

from __future__ import annotations

import struct
from collections.abc import Mapping
from dataclasses import dataclass, field
from itertools import count, takewhile
from pathlib import Path
from typing import Any

import numpy as np

from dubins_traffic.cars.state import Pose, State
from dubins_traffic.errors import InputError, MissingExtraError
from dubins_traffic.problem.instance import EAgent, Instance
from dubins_traffic.problem.kinds import REMOTE
from dubins_traffic.protocols import End, Ending, Sink
from dubins_traffic.record.writer import RecordWriter
from dubins_traffic.spec.labeller import Labeller
from dubins_traffic.transports.lcm import connection
from dubins_traffic.transports.lcm.dubins_traffic_lcm import car_t, end_t, instance_t, world_t
from dubins_traffic.transports.lcm.encoding import problem_from_message
from dubins_traffic.trial.buffer import FrameBuffer

MAGIC = b"\xed\xa1\xda\x01"
"""With which every event of a log begins."""
BROKEN = (ValueError, struct.error, IndexError)


@dataclass(slots=True)
class _Log:
    """The first trial of a log: its announcement, the cars at each tick, its end."""

    instance: instance_t | None = None
    cars: dict[int, list[car_t]] = field(default_factory=dict[int, list[car_t]])
    end: end_t | None = None


def is_log(path: Path | str) -> bool:
    """Tell whether the file at `path` is a log of lcm-logger."""
    try:
        with Path(path).open("rb") as file:
            return file.read(len(MAGIC)) == MAGIC
    except OSError:
        return False


def log_to_record(path: Path | str, output: Path | str, *, overwrite: bool = False) -> None:
    """Write the first trial in the log at `path` as a record.

    Frames and labels are those of the trial, bit for bit. A log tells no contacts, seeds or kinds of e-agents: there
    are none, 0, and `remote`; commands are how the cars moved.

    Raises
    ------
    MissingExtraError
        Without the extra `lcm`.
    InputError
        If the file is no log, lacks the announcement of a trial or frames, or the record can't be written.
    """
    name = str(path)
    log = _read(name)
    if log.instance is None:
        raise InputError("no trial", file=name, expected=f"a message on {connection.INSTANCE}")
    ticks = len(list(takewhile(log.cars.__contains__, count()))) - 1
    if ticks < 1 or ticks + 1 < len(log.cars):
        raise InputError(
            "frames are missing", file=name, field=connection.WORLD, value=f"tick {ticks + 1}", expected="all ticks"
        )  # fmt: skip
    instance = _instance(log.instance, log.cars[0], ticks)
    writer = RecordWriter(output, controller="lcm", overwrite=overwrite)
    try:
        _replay(log, instance, ticks, writer)
    finally:
        writer.close()


def _read(name: str) -> _Log:
    try:
        from lcm import EventLog
    except ImportError as error:
        raise MissingExtraError("LCM", "lcm") from error
    log = _Log()
    try:
        for event in EventLog(name):
            _take(log, event.channel, event.data)
    except (OSError, *BROKEN) as error:
        raise InputError(f"can't be read: {error}", file=name, expected="a log of lcm-logger") from error
    return log


def _take(log: _Log, channel: str, data: bytes) -> None:
    if channel == connection.INSTANCE:
        log.instance = log.instance or instance_t.decode(data)
    elif log.instance is None:
        return
    elif channel == connection.WORLD:
        world: Any = world_t.decode(data)
        if world.trial == log.instance.trial:
            log.cars[world.tick] = world.car
    elif channel == connection.END and log.end is None:
        end = end_t.decode(data)
        log.end = end if end.trial == log.instance.trial else None


def _instance(message: instance_t, cars: list[car_t], ticks: int) -> Instance:
    problem = problem_from_message(message)
    agents = tuple(EAgent(REMOTE, name, REMOTE) for name in problem.e_agents)
    starts = tuple(Pose(car.x, car.y, car.c, car.s) for car in cars)
    return Instance(problem, starts, ticks / problem.rate, agents, seed=0, trial=message.trial)


def _replay(log: _Log, instance: Instance, ticks: int, sink: Sink) -> None:
    """Label the frames as a trial does and push them."""
    labeller, buffer = Labeller([instance]), FrameBuffer(instance, [sink])
    state = State.zeros(1, len(instance.names))
    _fill(state, log.cars, 0)
    labels = labeller.reset(state)
    buffer.push(state, labels, np.zeros((1, len(instance.names), 2)), (), ())
    for tick in range(1, ticks + 1):
        _fill(state, log.cars, tick)
        labeller.update(tick, state, [()])
        buffer.push(state, labels, np.stack([state.speed, state.yaw_rate], axis=2), (), ())
    buffer.end(_ending(log.end, ticks))


def _fill(state: State, cars: Mapping[int, list[car_t]], tick: int) -> None:
    for n, car in enumerate(cars[tick]):
        state.x[0, n], state.y[0, n], state.c[0, n], state.s[0, n] = car.x, car.y, car.c, car.s
        state.speed[0, n], state.yaw_rate[0, n] = car.speed, car.yaw_rate


def _ending(end: end_t | None, ticks: int) -> Ending:
    if end is None:
        return Ending(End.INTERRUPTED, ticks, "the log ends before the trial")
    try:
        return Ending(End(end.reason), ticks, end.detail)
    except ValueError:
        return Ending(End.INTERRUPTED, ticks, f"{end.reason}: {end.detail}")
