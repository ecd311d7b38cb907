"""Reads logs of lcm-logger as records."""

from __future__ import annotations

import struct
from collections.abc import Mapping
from dataclasses import dataclass, field
from itertools import count, takewhile
from pathlib import Path
from typing import Any

import numpy as np

from dubins_traffic.cars.state import Pose, State
from dubins_traffic.errors import InputError, needs
from dubins_traffic.files import begins_with
from dubins_traffic.problem.instance import EAgent, Instance
from dubins_traffic.problem.kinds import REMOTE
from dubins_traffic.protocols import End, Ending, Sink
from dubins_traffic.record.writer import RecordWriter, record_paths
from dubins_traffic.rules.labeller import Labeller
from dubins_traffic.transports.lcm import connection
from dubins_traffic.transports.lcm.dubins_traffic_lcm import car_t, end_t, instance_t, world_t
from dubins_traffic.transports.lcm.encoding import problem_from_message
from dubins_traffic.trial.buffer import FrameBuffer

MAGIC = b"\xed\xa1\xda\x01"
"""Bytes with which every event of a log begins."""
BROKEN = (ValueError, struct.error, IndexError)


@dataclass(slots=True)
class _Trial:
    """A trial in a log: its announcement, the cars at each tick, its end."""

    instance: instance_t
    cars: dict[int, list[car_t]] = field(default_factory=dict[int, list[car_t]])
    end: end_t | None = None

    @property
    def ticks(self) -> int:
        """Number of ticks that were logged without a gap; -1 without any frame."""
        return len(list(takewhile(self.cars.__contains__, count()))) - 1


@dataclass(slots=True)
class _Log:
    """The trials of a log, and the latest announcement."""

    trials: list[_Trial] = field(default_factory=list[_Trial])
    announced: instance_t | None = None

    def of(self, trial: int) -> _Trial | None:
        """Return the trial to which a frame belongs, None if it was not announced."""
        if self.announced is None or self.announced.trial != trial:
            return None
        if not self.trials or self.trials[-1].instance.trial != trial:
            self.trials.append(_Trial(self.announced))
        return self.trials[-1]


def is_log(path: Path | str) -> bool:
    """Tell whether the file at `path` is a log of lcm-logger."""
    return begins_with(path, MAGIC)


def log_to_records(path: Path | str, output: Path | str, *, overwrite: bool = False) -> list[Path]:
    """Write each trial in the log at `path` as a record, the first to `output`, others to ``-1``, ``-2``, ... of it.

    Frames and labels are those of the trials, bit for bit, and trials are numbered as they follow each other. A log
    tells no contacts, seeds or kinds of e-agents: there are none, 0, and `remote`; commands are how the cars moved. A
    trial of which frames are missing is left out.

    Returns
    -------
    list of Path
        The records.

    Raises
    ------
    MissingExtraError
        Without the extra `lcm`.
    InputError
        If the file is no log or has no trial, if frames of a trial are missing (the others have been written then),
        or if a record can't be written.
    """
    name, output = str(path), Path(output)
    trials = _read(name).trials
    if not trials:
        raise InputError("no trial", file=name, expected=f"a message on {connection.INSTANCE}, then frames")
    written: list[Path] = []
    broken: list[InputError] = []
    records = record_paths(output, len(trials), overwrite=overwrite)
    for number, (trial, record) in enumerate(zip(trials, records, strict=True)):
        ticks = trial.ticks
        if ticks < 1 or ticks + 1 < len(trial.cars):
            lost = f"tick {ticks + 1} of trial {number}"
            broken.append(
                InputError("frames are missing", file=name, field=connection.WORLD, value=lost, expected="all ticks")
            )
            continue
        _write(trial, number, ticks, record, overwrite=overwrite)
        written.append(record)
    if broken:
        raise broken[0]
    return written


def _write(trial: _Trial, number: int, ticks: int, record: Path, *, overwrite: bool) -> None:
    instance = _instance(trial.instance, trial.cars[0], ticks, number)
    writer = RecordWriter(record, controller="lcm", overwrite=overwrite)
    try:
        _replay(trial, instance, ticks, writer)
    finally:
        writer.close()


def _read(name: str) -> _Log:
    with needs("LCM", "lcm"):
        from lcm import EventLog
    log = _Log()
    try:
        for event in EventLog(name):
            _take(log, event.channel, event.data)
    except (OSError, *BROKEN) as error:
        raise InputError(f"can't be read: {error}", file=name, expected="a log of lcm-logger") from error
    return log


def _take(log: _Log, channel: str, data: bytes) -> None:
    if channel == connection.INSTANCE:
        log.announced = instance_t.decode(data)
    elif channel == connection.WORLD:
        world: Any = world_t.decode(data)
        trial = log.of(world.trial)
        if trial is not None:
            trial.cars[world.tick] = world.car
    elif channel == connection.END and log.trials:
        end, last = end_t.decode(data), log.trials[-1]
        if end.trial == last.instance.trial and last.end is None:
            last.end = end


def _instance(message: instance_t, cars: list[car_t], ticks: int, number: int) -> Instance:
    problem = problem_from_message(message)
    agents = tuple(EAgent(REMOTE, name, REMOTE) for name in problem.e_agents)
    starts = tuple(Pose(car.x, car.y, car.c, car.s) for car in cars)
    return Instance(problem, starts, ticks / problem.rate, agents, seed=0, trial=number)


def _replay(trial: _Trial, instance: Instance, ticks: int, sink: Sink) -> None:
    """Label the frames as a trial does and hand them to the sink."""
    labeller, buffer = Labeller([instance]), FrameBuffer([instance], [[sink]])
    state = State.zeros(1, len(instance.names))
    _fill(state, trial.cars, 0)
    labels = labeller.reset(state)
    buffer.push(state, labels, np.zeros((1, len(instance.names), 2)))
    for tick in range(1, ticks + 1):
        _fill(state, trial.cars, tick)
        labeller.update(tick, state, [()])
        buffer.push(state, labels, np.stack([state.speed, state.yaw_rate], axis=2))
    buffer.end(_ending(trial.end, ticks))


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
