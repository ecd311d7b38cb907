"""Simulators and drivers that play a record, for running its trial again."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final

import numpy as np

from dubins_traffic.cars.clip_and_move import clip, rows
from dubins_traffic.cars.state import Contact, Frames, Labels, State
from dubins_traffic.cars.tables import pack_cars
from dubins_traffic.cars.touching import Touching
from dubins_traffic.kernels.arrays import Floats
from dubins_traffic.problem.instance import Instance
from dubins_traffic.protocols import Capabilities
from dubins_traffic.simulators.embedded import Embedded
from dubins_traffic.verification.bodies import Meetings, put_frame

ROUNDING: Final = 1e-9
"""Largest difference between commands as clipped here and by the world of another program, m/s and rad/s."""
OVERLAP: Final = 1e-6
"""Bodies of the embedded simulator that overlap by more than this without a contact have been moved, metres."""
MEASURED: Final = "ros1-world"
"""The simulator whose contacts are found from the poses at frames alone."""


class Replayed:
    """Drives some cars by their recorded commands (a `protocols.Driver`).

    Parameters
    ----------
    frames : Frames
        The whole trial.
    cars : sequence of int
        Which of its cars.
    """

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
        if instance.simulator == MEASURED:
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
        (found,) = self._world.step(commands)
        self._tick += 1
        put_frame(self.state, self._frames, self._tick)
        self._meetings.note((*found, *self._soon.get(self._tick + 1, ())))
        own = tuple(
            self._at_frames.contact(self._tick, self.state, pair)
            for pair, gap in self._meetings.gaps(self._tick, self.state)
            if gap <= -self._slack
        )
        self._meetings.note(own)
        return [(*found, *own)]

    def close(self) -> None:
        """Close the simulator within."""
        self._world.close()


def by_tick(contacts: Sequence[Contact]) -> dict[int, list[Contact]]:
    """Return contacts by the frames in which their ticks end."""
    found: dict[int, list[Contact]] = {}
    for contact in contacts:
        found.setdefault(contact.tick, []).append(contact)
    return found
