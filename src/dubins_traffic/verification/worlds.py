"""The worlds of a record: who plays its cars again, where bodies overlap, labels and contacts found from poses, and
formulas that are asked of it afterwards.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from itertools import combinations, product
from math import hypot
from typing import Final

import numpy as np

from dubins_traffic.cars.clip_and_move import clip, rows
from dubins_traffic.cars.motion import PARTED
from dubins_traffic.cars.state import EGO, Contact, Frames, Labels, State
from dubins_traffic.cars.tables import pack_cars
from dubins_traffic.cars.touching import Bodies, Touching
from dubins_traffic.kernels.arrays import Floats
from dubins_traffic.problem.formulas import check_formulas
from dubins_traffic.problem.instance import OUTSIDE, Instance
from dubins_traffic.problem.parts import Disturbances
from dubins_traffic.protocols import Capabilities, Ending
from dubins_traffic.record.reader import Record
from dubins_traffic.scoring.blocks import joined
from dubins_traffic.simulators.embedded import Embedded
from dubins_traffic.trial.trial import Trial
from dubins_traffic.verification.result import OURS

POSES: Final = ("x", "y", "c", "s", "speed", "yaw_rate")


def put_frame(state: State, frames: Frames, f: int) -> None:
    """Write frame f of a record into trial 0 of `state`."""
    for name in POSES:
        getattr(state, name)[0] = getattr(frames, name)[f]


class Meetings:
    """The pairs of bodies that are near each other in the frames of a trial, and those that have touched.

    Parameters
    ----------
    instance : Instance
        What bodies there are; obstacle k is number -1 - k.
    frames : Frames
        All frames of the trial.
    """

    def __init__(self, instance: Instance, frames: Frames) -> None:
        problem = instance.problem
        self.bodies = Bodies(problem.car, problem.obstacles)
        self._near: dict[int, list[tuple[int, int]]] = {}
        self._touching: set[tuple[int, int]] = set()
        self._collect(frames)

    def note(self, contacts: tuple[Contact, ...]) -> None:
        """Take the contacts of the next frame: two bodies that touch count as one meeting until they have parted."""
        self._touching.update((contact.car, contact.other) for contact in contacts)

    def gaps(self, f: int, state: State) -> Iterator[tuple[tuple[int, int], float]]:
        """Yield each pair that is near in frame f, whose state is given, and the gap between the bodies, metres.

        Pairs that have touched and not parted since are left out.
        """
        near = self._near.get(f, [])
        self._touching.intersection_update(near)
        for pair in near:
            gap = self.bodies.separation(state, *pair)[0]
            if gap > PARTED:
                self._touching.discard(pair)
            if pair not in self._touching:
                yield pair, gap

    def _collect(self, frames: Frames) -> None:
        reach = self.bodies.reach + 0.5 * PARTED
        for car, other in combinations(range(frames.x.shape[1]), 2):
            dx, dy = frames.x[:, car] - frames.x[:, other], frames.y[:, car] - frames.y[:, other]
            self._add((car, other), dx * dx + dy * dy <= (2.0 * reach) ** 2)
        for car, (number, parts) in product(range(frames.x.shape[1]), self.bodies.parts.items()):
            close = np.zeros(len(frames), dtype=bool)
            for part in parts:
                far = reach + PARTED + hypot(part[4], part[5]) + part[6]
                dx, dy = frames.x[:, car] - part[0], frames.y[:, car] - part[1]
                close |= dx * dx + dy * dy <= far * far
            self._add((car, number), close)

    def _add(self, pair: tuple[int, int], close: Floats | np.ndarray) -> None:
        for f in np.flatnonzero(close).tolist():
            self._near.setdefault(f, []).append(pair)


ROUNDING: Final = 1e-9
"""Largest difference between commands as clipped here and by the world of another program, m/s and rad/s."""
OVERLAP: Final = 1e-6
"""Bodies of the embedded simulator that overlap by more than this without a contact have been moved, metres."""


class Replayed:
    """Drives some cars by their recorded commands (a `protocols.Driver`)."""

    def __init__(self, frames: Frames, cars: Sequence[int]) -> None:
        self._cars = list(cars)
        self._commands = commands_of(frames)[:, self._cars]

    def reset(self, instances: Sequence[Instance], state: State) -> None:
        """Do nothing."""

    def decide(self, tick: int, state: State, labels: Labels, commands: Floats) -> None:  # noqa: ARG002
        """Write the recorded commands for [t_k, t_k+1)."""
        commands[0, self._cars] = self._commands[tick]


def commands_of(frames: Frames) -> Floats:
    """Return the commands of each tick, (F - 1, N, 2), in the order of the ticks."""
    return np.stack([frames.command_speed[1:], frames.command_yaw_rate[1:]], axis=2)


class Shown:
    """Plays the recorded world of another program (a `protocols.Simulator`).

    Contacts are those of the record, except where poses alone tell them: there they are found again.
    """

    capabilities = Capabilities(batched=False, deterministic=True, lockstep=True)

    def __init__(self, frames: Frames) -> None:
        self._frames = frames
        self._contacts = by_tick(frames.contacts)

    def reset(self, instances: Sequence[Instance]) -> State:
        """Return the state of the first frame."""
        (instance,) = instances
        problem = instance.problem
        cars = len(instance.names)
        self._touching = None
        if instance.simulator in OUTSIDE:
            self._touching = Touching(problem.car, problem.obstacles, problem.period)
        self._rows = rows(pack_cars([problem.car]), cars, problem.period)
        self._asked = np.zeros((2, cars))
        self._commands = commands_of(self._frames)
        self._tick = 0
        self.state = State.zeros(1, cars)
        put_frame(self.state, self._frames, 0)
        return self.state

    def step(self, commands: Floats) -> Sequence[Sequence[Contact]]:
        """Clip the commands, go to the next frame and return its contacts."""
        speed, yaw_rate = self._asked
        clip(self._rows, 0, commands[0], speed, yaw_rate, 0, len(speed))
        recorded = self._commands[self._tick]
        alike = np.abs(commands[0] - recorded) <= ROUNDING
        commands[0][alike] = recorded[alike]
        self._tick += 1
        put_frame(self.state, self._frames, self._tick)
        if self._touching is not None:
            return [self._touching.update(self._tick, self.state)]
        return [tuple(self._contacts.get(self._tick, ()))]

    def close(self) -> None:
        """Do nothing: there are no resources."""


class FromPoses:
    """A world in which every tick begins where its recorded frame says (a `protocols.Simulator`).

    The contacts of a tick are those of the recorded commands from there; where that leaves out bodies that overlap in a
    frame, they touch in that frame. A world that is not ours may tell of them a tick later.
    """

    capabilities = Capabilities(batched=False, deterministic=True, lockstep=True)

    def __init__(self, frames: Frames, world: Embedded | Shown, slack: float) -> None:
        self._frames, self._world, self._slack = frames, world, slack
        self._soon = by_tick(frames.contacts) if isinstance(world, Shown) else {}

    def reset(self, instances: Sequence[Instance]) -> State:
        """Return the state of the first frame."""
        (instance,) = instances
        problem = instance.problem
        self._meetings = Meetings(instance, self._frames)
        self._at_frames = Touching(problem.car, problem.obstacles, problem.period)
        self._tick = 0
        self.state = self._world.reset(instances)
        put_frame(self.state, self._frames, 0)
        return self.state

    def step(self, commands: Floats) -> Sequence[Sequence[Contact]]:
        """Go to the next frame and return the contacts on the way there, and those of bodies that overlap there."""
        (contacts,) = self._world.step(commands)
        self._tick += 1
        put_frame(self.state, self._frames, self._tick)
        self._meetings.note((*contacts, *self._soon.get(self._tick + 1, ())))
        touching = tuple(
            self._at_frames.contact(self._tick, self.state, pair)
            for pair, gap in self._meetings.gaps(self._tick, self.state)
            if gap <= -self._slack
        )
        self._meetings.note(touching)
        return [(*contacts, *touching)]

    def close(self) -> None:
        """Close the simulator within."""
        self._world.close()


def by_tick(contacts: Sequence[Contact]) -> dict[int, list[Contact]]:
    """Return contacts by the frames in which their ticks end."""
    contacts_by_tick: dict[int, list[Contact]] = {}
    for contact in contacts:
        contacts_by_tick.setdefault(contact.tick, []).append(contact)
    return contacts_by_tick


def from_poses(record: Record) -> Record:
    """Return a record with the labels and contacts that follow from its poses and commands.

    In a world of ours every tick begins at its recorded frame and is moved by the recorded commands: what touches on
    the way is a contact. Bodies that overlap in a frame touch there, in any world, unless they have touched already.
    Contacts of a world that is not ours are kept beside these. What follows the end of the trial is left out.
    """
    if len(record.frames) < 2:
        return record
    frames = record.frames
    ours = record.instance.simulator == OURS
    world = FromPoses(frames, Embedded() if ours else Shown(frames), OVERLAP if ours else 0.0)
    instance = replace(record.instance, disturbances=Disturbances())
    kept = _Kept()
    others = Replayed(frames, range(1, len(instance.names)))
    trial = Trial(instance, simulator=world, agents=[others], sinks=[kept])
    rows: list[list[float]] = commands_of(frames)[:, EGO].tolist()
    for speed, yaw_rate in rows:
        if trial.ending is not None:
            break
        trial.advance((speed, yaw_rate))
    trial.close()
    frames_of_poses = replace(joined(kept.blocks), events=frames.events)
    return replace(record, frames=frames_of_poses, blocks=(frames_of_poses,))


class _Kept:
    """A sink that keeps all frames."""

    def begin(self, instance: Instance) -> None:  # noqa: ARG002  # all frames are kept alike
        """Do nothing: no frame has come yet."""
        self.blocks: list[Frames] = []

    def frames(self, frames: Frames) -> None:
        """Keep a block."""
        self.blocks.append(frames)

    def end(self, ending: Ending) -> None:
        """Do nothing."""


def with_formulas(instance: Instance, formulas: Mapping[str, str]) -> Instance:
    """Return an instance whose problem carries formulas.

    FormulaError if one can't be read or monitored, or names what the problem lacks.
    """
    problem = replace(instance.problem, formulas=dict(formulas))
    check_formulas(problem, instance.names)
    return replace(instance, problem=problem)
