"""Simulates a recorded trial again from its instance and recorded commands, and compares the two."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from dubins_traffic.agents.late import fleet_of
from dubins_traffic.cars.state import EGO, Contact, Event, Frames
from dubins_traffic.kernels.arrays import Floats
from dubins_traffic.problem.instance import Instance
from dubins_traffic.problem.kinds import REMOTE
from dubins_traffic.protocols import Driver, End, Ending
from dubins_traffic.record import schema
from dubins_traffic.record.reader import Record
from dubins_traffic.simulators.embedded import Embedded
from dubins_traffic.trial.trial import Trial
from dubins_traffic.verification.result import OURS, Difference
from dubins_traffic.verification.worlds import Replayed, Shown, commands_of

_BY_ITSELF = (End.DURATION, End.COLLISION)
"""Ends that follow from the instance and the frames."""
_FIELDS = (*schema.FRAME_FIELDS[6:], *schema.FRAME_FIELDS[:6], *schema.LABEL_FIELDS)
"""Columns in the order in which they follow from each other within a tick: commands, poses, labels."""


def trial_difference(record: Record) -> Difference | None:
    """Return the first difference of `record` from what follows from its instance and recorded commands.

    The commands of e-agents that a trial drives by itself are decided again; those of the ego and of remote cars are
    taken as recorded. So are the poses of a world that is not ours.
    """
    frames = record.frames
    if not len(frames):
        return None if record.ending is None else Difference("frames", None, "the start")
    witness = _Witness(record)
    world = Embedded() if record.instance.simulator == OURS else Shown(frames)
    trial = Trial(record.instance, simulator=world, agents=drivers(record), sinks=[witness])
    reported = _controller_events(record)
    for tick, command in enumerate(_commands_of_ego(record.instance, frames)):
        _report(trial, reported.get(tick, ()))
        trial.advance(command)
        if trial.ending is not None or witness.difference is not None:
            break
    return _concluded(record, trial, witness, reported)


def drivers(record: Record) -> Sequence[Driver]:
    """Return the drivers of the e-agents: the trial's own, and for remote cars one that plays the record."""
    agents = record.instance.e_agents
    remote = [n for n, agent in enumerate(agents, start=1) if agent.kind == REMOTE]
    local: list[Driver] = [fleet_of(record.instance)] if len(remote) < len(agents) else []
    return [*local, Replayed(record.frames, remote)] if remote else local


def _commands_of_ego(instance: Instance, frames: Frames) -> Sequence[tuple[float, float]]:
    """Return the commands that the ego's controller gave in each tick, as far as delays let the record show them.

    A command that was delayed beyond the end, or lost, has left no trace; in its place stands what makes none.
    """
    delay = instance.added.command_delay
    rows: list[list[float]] = commands_of(frames)[delay:, EGO].tolist()
    rows += [[0.0, 0.0]] * min(delay, len(frames) - 1)
    return [(speed, yaw_rate) for speed, yaw_rate in rows]


def _controller_events(record: Record) -> dict[int, list[Event]]:
    """Return the events of the ego's controller by their ticks; the event of the trial's end is not one."""
    events = list(record.frames.events)
    ending = record.ending
    if ending is not None and events and events[-1] == _event_of(ending):
        events.pop()
    reported: dict[int, list[Event]] = {}
    for event in events:
        if event.car == EGO:
            reported.setdefault(event.tick, []).append(event)
    return reported


def _event_of(ending: Ending) -> Event:
    return Event(ending.ticks, ending.end.value, EGO, ending.detail)


def _report(trial: Trial, events: Sequence[Event]) -> None:
    for event in events:
        trial.note(event.kind, event.detail)


def _concluded(record: Record, trial: Trial, witness: _Witness, reported: dict[int, list[Event]]) -> Difference | None:
    """End the trial as the record says if that is possible, and return the first difference."""
    last = len(record.frames) - 1
    if trial.ending is not None and trial.tick < last:
        early = witness.difference
        if early is not None and early.tick is not None and early.what != "event":
            return early
        return Difference("end", "the trial goes on", _ending_text(trial.ending), trial.tick)
    if witness.difference is not None:
        return witness.difference
    if trial.ending is None:
        _report(trial, reported.get(last, ()))
        wrong = _end(record, trial, witness)
        if wrong is not None:
            return wrong
    if witness.difference is not None:
        return witness.difference
    if record.ending is None or witness.ending == record.ending:
        return None
    return Difference("end", _ending_text(record.ending), _ending_text(witness.ending), last)


def _end(record: Record, trial: Trial, witness: _Witness) -> Difference | None:
    """End a trial that has not ended by itself, as the record does or, cut off, without leaving a trace."""
    ending = record.ending
    if ending is None:
        witness.ends_early = True
        trial.end(End.RESET)
        return None
    if ending.end in _BY_ITSELF:
        planned = f"no end before tick {record.instance.ticks}"
        return Difference("end", _ending_text(ending), planned, trial.tick)
    ours = all(agent.kind != REMOTE for agent in record.instance.e_agents)
    if ending.end is End.AGENT_FAULT and ours:
        trial.advance((0.0, 0.0))
        if trial.ending is None or trial.ending.end is not End.AGENT_FAULT:
            return Difference("end", _ending_text(ending), "commands of e-agents that are finite", trial.tick)
        return None
    if ending.end is End.INTERRUPTED and abs(ending.ticks - trial.tick) <= 1:
        witness.put_off = ending.ticks - trial.tick
    trial.end(ending.end, ending.detail)
    return None


def _ending_text(ending: Ending | None) -> str:
    if ending is None:
        return "no end"
    detail = f" ({ending.detail})" if ending.detail else ""
    return f"{ending.end.value} after {ending.ticks} ticks{detail}"


class _Witness:
    """A sink that compares the frames of a trial with its record, block by block.

    `ends_early`: the last event is of this trial's end alone, and not the record's. `put_off`: by how many ticks an
    interruption was noted beside the last frame.
    """

    def __init__(self, record: Record) -> None:
        self._record = record
        self._block = 0
        self.difference: Difference | None = None
        self.ending: Ending | None = None
        self.ends_early = False
        self.put_off = 0

    def begin(self, instance: Instance) -> None:
        """Do nothing: no frame has come yet."""

    def frames(self, frames: Frames) -> None:
        """Compare the next block."""
        if self.difference is None:
            self.difference = self._compare(frames)
        self._block += 1

    def end(self, ending: Ending) -> None:
        """Keep the ending, and compare the number of blocks."""
        self.ending = replace(ending, ticks=ending.ticks + self.put_off)
        if self.difference is None and self._block < len(self._record.blocks):
            extra = self._record.blocks[self._block]
            if extra.events:
                self.difference = _unequal("event", extra.events, (), self._record.instance)
            else:
                self.difference = Difference(f"block {self._block}", f"{len(extra)} frames", None)

    def _compare(self, frames: Frames) -> Difference | None:
        record, names = self._record, self._record.instance.names
        events = self._events(frames)
        if self._block >= len(record.blocks):
            first = _unequal("event", (), events, record.instance)
            return first or (Difference(f"block {self._block}", None, "frames") if len(frames) else None)
        difference = _columns_differ(record.frames, frames, names)
        block_before = record.blocks[self._block]
        contact = _unequal("contact", block_before.contacts, frames.contacts, record.instance)
        if contact is not None and (difference is None or (contact.tick or 0) < (difference.tick or 0)):
            return contact
        if difference is not None:
            return difference
        if (block_before.first, len(block_before)) != (frames.first, len(frames)):
            one, two = (f"{len(block)} frames from {block.first} on" for block in (block_before, frames))
            return Difference(f"block {self._block}", one, two)
        return _unequal("event", block_before.events, events, record.instance)

    def _events(self, frames: Frames) -> tuple[Event, ...]:
        """Return the events of a block, the last one as the record would hold it."""
        events = frames.events
        if self.ends_early:
            return events[:-1]
        if self.put_off and events:
            return (*events[:-1], replace(events[-1], tick=events[-1].tick + self.put_off))
        return events


def _columns_differ(recorded: Frames, frames: Frames, names: Sequence[str]) -> Difference | None:
    """Return the first number of a block that differs from the recorded one in any bit."""
    last = min(frames.first + len(frames), len(recorded))
    count = max(0, last - frames.first)
    best: Difference | None = None
    for name in _FIELDS:
        one, two = getattr(recorded, name)[frames.first : last], getattr(frames, name)[:count]
        unlike = np.argwhere(_bits(one) != _bits(two))
        if len(unlike) and (best is None or best.tick is None or unlike[0, 0] + frames.first < best.tick):
            f, n = int(unlike[0, 0]), int(unlike[0, 1])
            best = Difference(name, one[f, n].item(), two[f, n].item(), frames.first + f, names[n])
    return best


def _bits(column: Floats | np.ndarray) -> np.ndarray:
    return np.ascontiguousarray(column).view(np.int64) if column.dtype == np.float64 else column


def _unequal(
    what: str, recorded: Sequence[Contact | Event], expected: Sequence[Contact | Event], instance: Instance
) -> Difference | None:
    """Return the first contact or event that differs from the expected one."""
    for k in range(max(len(recorded), len(expected))):
        one = recorded[k] if k < len(recorded) else None
        two = expected[k] if k < len(expected) else None
        if one == two and repr(one) == repr(two):
            continue
        both = [each for each in (one, two) if each is not None]
        first = min(both, key=lambda each: each.tick)
        if isinstance(one, Contact) and isinstance(two, Contact) and one.tick == two.tick:
            return _contact_differs(one, two, instance)
        name = instance.names[first.car] if 0 <= first.car < len(instance.names) else None
        return Difference(what, _named(one), _named(two), first.tick, name)
    return None


def _contact_differs(one: Contact, two: Contact, instance: Instance) -> Difference:
    names = [name for name in Contact.__slots__ if repr(getattr(one, name)) != repr(getattr(two, name))]
    recorded, expected = (getattr(each, names[0]) for each in (one, two))
    return Difference(f"contact.{names[0]}", recorded, expected, one.tick, instance.names[two.car])


def _named(entry: Contact | Event | None) -> str | None:
    if entry is None:
        return None
    if isinstance(entry, Event):
        return f"{entry.kind} {entry.detail}".strip()
    return f"contact of car {entry.car} with {entry.other} at {entry.time:.6f} s"
