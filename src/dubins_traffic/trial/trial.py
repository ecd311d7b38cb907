"""One trial, tick by tick. Knows no concrete simulator, agent, controller, metric or file format."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, Self

import numpy as np

from dubins_traffic.cars.state import EGO, NONE, Contact, Event, Observation
from dubins_traffic.errors import ControllerError, DubinsTrafficError, InputError
from dubins_traffic.kernels.calls import bound
from dubins_traffic.observations.senses import Senses
from dubins_traffic.protocols import Controller, Draws, Driver, End, Ending, Reports, Scans, Simulator, Sink, Watcher
from dubins_traffic.record.wall import Wall, measured, summary
from dubins_traffic.rules.labeller import Labeller
from dubins_traffic.trial.buffer import FrameBuffer, all_finite
from dubins_traffic.trial.disturbance import CommandLine
from dubins_traffic.trial.endings import agent_fault, collision_detail
from dubins_traffic.trial.forking import forked, reseeded
from dubins_traffic.trial.interrupts import WHOLE, heard_between_frames
from dubins_traffic.trial.seat import Seat

if TYPE_CHECKING:
    from dubins_traffic.problem.instance import Instance


class Trial:
    """One trial, stepped by its caller; a tick is: sense, decide, clip, move, label, push (`docs/semantics.md`).

    Parameters
    ----------
    instance : Instance
        What is run; the instance and the ego's commands determine every byte of the frames.
    simulator : Simulator
        Moves the cars.
    agents : sequence of Driver
        Drive the e-agents.
    sinks : sequence of Sink
        Receive instance, frames, contacts, events and ending.
    watchers : sequence of Watcher
        Are shown every frame at once.
    linked : bool
        Whether one of them takes part from elsewhere and may end the trial as it likes.

    Examples
    --------
    >>> trial = Trial(instance, simulator=simulator, agents=agents)     # doctest: +SKIP
    >>> while trial.ending is None:                                     # doctest: +SKIP
    ...     trial.step((0.5, 0.0))
    """

    def __init__(
        self,
        instance: Instance,
        *,
        simulator: Simulator,
        agents: Sequence[Driver] = (),
        sinks: Sequence[Sink] = (),
        watchers: Sequence[Watcher] = (),
        linked: bool = False,
    ) -> None:
        self.instance = instance
        self.linked = linked
        self.ending: Ending | None = None
        self._simulator = simulator
        self._agents = tuple(agents)
        self._watchers = tuple(watchers)
        self._state = simulator.reset([instance])
        self._commands = np.zeros((1, len(instance.starts), 2))
        self._ticks = instance.ticks
        self._line = CommandLine(instance)
        self._labeller = Labeller([instance])
        self._labels = self._labeller.reset(self._state)
        for agent in self._agents:
            agent.reset([instance], self._state)
        self._senses = Senses(instance, scanner=simulator if isinstance(simulator, Scans) else None)
        self._buffer = FrameBuffer([instance], [sinks])
        self._buffer.push(self._state, self._labels, self._commands)
        self._tick = 0
        self._all_finite = bound(all_finite)
        self._tellers = [agent for agent in self._agents if isinstance(agent, Reports)]
        self._note_agents()
        self._observation: Observation | None = None
        for watcher in self._watchers:
            watcher.begin(instance)
            watcher.watch(0, self._state, self._labels, (), self._observe)

    @property
    def tick(self) -> int:
        """Number of the present frame."""
        return self._tick

    @property
    def sinks(self) -> Sequence[Sink]:
        """The sinks of this trial; a fork has those that could be copied.

        They have been handed all frames up to the present one, unless one of them can't go on in a fork: the writer
        of a record gets whole seconds.
        """
        return self._buffer.sinks()

    @property
    def observation(self) -> Observation:
        """What the ego knows in the present frame."""
        return self._observe()

    def step(self, command: tuple[float, float]) -> Observation:
        """Hold `command` (speed m/s, yaw rate rad/s) for one tick and return the next observation.

        Raises
        ------
        ControllerError
            If the command is not two finite numbers; the trial has then ended as a controller fault.
        DubinsTrafficError
            If the trial has ended before.
        """
        self.advance(command)
        return self.observation

    def advance(self, command: tuple[float, float]) -> Sequence[Contact]:
        """Step the trial as `step` does, but return the contacts of the tick and make no observation."""
        if self.ending is not None:
            raise DubinsTrafficError(f"the trial has ended ({self.ending.end}) and can't be stepped: make a new one")
        try:
            speed, yaw = self._line.take(self._tick, command)
        except ControllerError as error:
            self.end(End.CONTROLLER_FAULT, error.detail)
            raise
        commands = self._commands
        for agent in self._agents:
            agent.decide(self._tick, self._state, self._labels, commands)
        self._note_agents()
        commands[0, EGO, 0] = speed
        commands[0, EGO, 1] = yaw
        if not self._all_finite(commands):
            return self._agent_fault()
        with WHOLE:
            contacts = self._simulator.step(commands)
            self._tick += 1
            self._observation = None
            contacts = self._labeller.update(self._tick, self._state, contacts)[0]
            if contacts:
                self._buffer.touch(contacts)
            self._buffer.push(self._state, self._labels, commands)
        if self._tick >= self._ticks:
            self.end(End.DURATION)
        elif contacts and self.instance.end_on_collision:
            self._end_on_collision(contacts)
        for watcher in self._watchers:
            watcher.watch(self._tick, self._state, self._labels, contacts, self._observe)
        return contacts

    def fork(self, seed: int | None = None) -> Self:
        """Return an independent copy of this trial at its present frame; see `runs.single.Trial.fork`.

        Parameters
        ----------
        seed : int, optional
            Seed of all random numbers drawn from here on; by default that of the instance.

        Raises
        ------
        DubinsTrafficError
            If the trial has ended.
        InputError
            If its simulator, one of its drivers or a sink can't be copied.
        """
        if self.ending is not None:
            raise DubinsTrafficError(f"the trial has ended ({self.ending.end}) and can't be forked")
        if not self._simulator.capabilities.forks:
            raise InputError(
                "a trial on this simulator can't be forked",
                field="simulator",
                value=self.instance.simulator,
                expected="embedded, or another simulator with the capability `forks`",
            )
        again = seed is not None and seed != self.instance.seed
        instance = replace(self.instance, seed=seed) if again else self.instance
        twin = object.__new__(type(self))
        vars(twin).update(forked({**vars(self), "_watchers": ()}, self.instance, instance))
        if again:
            twin._reseed()
        return twin

    def _reseed(self) -> None:
        """Draw all random numbers from the present frame on from the instance's seed, which has changed."""
        seed = self.instance.seed
        self._observation = None
        for agent in self._agents:
            if isinstance(agent, Draws):
                agent.reseed(seed)
        self._buffer.note(reseeded(self._tick, seed))

    def note(self, kind: str, detail: str = "") -> None:
        """Hand an event of the ego, at the present tick, to the sinks."""
        self._buffer.note(Event(self._tick, kind, EGO, detail))

    def end(self, end: End, detail: str = "") -> Ending:
        """End the trial for the reason `end` unless it has ended; return its ending."""
        if self.ending is None:
            with WHOLE:
                if end is not End.DURATION:
                    self.note(end.value, detail)
                self.ending = Ending(end, self._tick, detail)
                self._buffer.end(self.ending)
        return self.ending

    def close(self) -> None:
        """End the trial as `reset` if it is running, and free the simulator; `with` does so by itself."""
        self.end(End.RESET)
        self._simulator.close()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_error: object) -> None:
        self.close()

    def _observe(self) -> Observation:
        if self._observation is None:
            self._observation = self._senses.observe(self._tick, self._state, self._labels)
        return self._observation

    def _note_agents(self) -> None:
        """Hand the reports of the e-agents' drivers to the sinks, as events of no car."""
        for agent in self._tellers:
            for kind, detail in agent.report():
                self._buffer.note(Event(self._tick, kind, NONE, detail))

    def _agent_fault(self) -> Sequence[Contact]:
        self.end(End.AGENT_FAULT, agent_fault(self.instance, self._commands[0]))
        return ()

    def _end_on_collision(self, contacts: Sequence[Contact]) -> None:
        for contact in contacts:
            if EGO in (contact.car, contact.other):
                self.end(End.COLLISION, collision_detail(self.instance, contact))
                return


def run(trial: Trial, controller: Controller, deadline: float | None = None) -> tuple[Ending, Wall]:
    """Run `controller` through `trial` until it ends and return its ending and wall-clock figures.

    A controller that raises, gives up (None), answers nonsense, or takes longer than `deadline` seconds for one
    `act` ends its own trial with a named reason; nothing is raised but what interrupts the program.
    """
    seat = Seat(controller, deadline, linked=trial.linked)
    with heard_between_frames():
        try:
            seat.start(trial.instance.problem, trial.tick)
            act, advance, note = seat.act, trial.advance, trial.note
            while trial.ending is None:
                advance(act(trial.observation, note))
        except (KeyboardInterrupt, SystemExit):
            trial.end(End.INTERRUPTED)
            raise
        except ControllerError as error:
            trial.end(End(error.reason), error.detail)
    ending = seat.end(trial.end(End.DURATION))
    return ending, measured(seat.begin, summary(seat.latencies), reproducible=ending.end is not End.DEADLINE)
