"""Groups of trials whose egos are driven from Python in every tick: by controllers that are asked, or by `lanes`."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import partial
from typing import TYPE_CHECKING, Any, NamedTuple, Protocol, Self, runtime_checkable

import numpy as np
import numpy.typing as npt

from dubins_traffic.cars.sensing import mark_sensed
from dubins_traffic.cars.state import EGO, Labels, State
from dubins_traffic.controllers import blame
from dubins_traffic.controllers.lanes import Lanes
from dubins_traffic.controllers.registry import made
from dubins_traffic.engine.group import Group, Outcome
from dubins_traffic.errors import ControllerError, DubinsTrafficError, InputError
from dubins_traffic.kernels.arrays import Floats, Ints
from dubins_traffic.kernels.tables import Tables
from dubins_traffic.observations.senses import Senses
from dubins_traffic.protocols import Controller
from dubins_traffic.record.sink import SHIELD
from dubins_traffic.record.wall import summary
from dubins_traffic.scoring.metric import Maker as MetricMaker
from dubins_traffic.shield.car_shields import EgoShields
from dubins_traffic.shield.tables import Overtakes
from dubins_traffic.trial.disturbance import CommandLine
from dubins_traffic.trial.endings import checked_command
from dubins_traffic.trial.forking import forked
from dubins_traffic.trial.seat import Answerable, Seat, fault

if TYPE_CHECKING:
    from dubins_traffic.problem.instance import Instance, Problem


class BatchView(NamedTuple):
    """What a BatchController is shown of all running trials.

    Attributes
    ----------
    trial : (K,) int64
        Number of each trial, as given to `start_batch`.
    tick : (K,) int64
        Present frame of each trial.
    state : State
        Poses and twists, (K, N): car 0 is the ego. What the ego does not see is NaN.
    labels : Labels
        Propositions, (K, N). Of what the ego does not see: 0 for `segment` and `bits`, else -1.
    seen : (K, N) bool
        True where there is the ego or a car within its sensing radius.
    """

    trial: Ints
    tick: Ints
    state: State
    labels: Labels
    seen: npt.NDArray[np.bool_]


@runtime_checkable
class BatchController(Controller, Protocol):
    """Drives the egos of many trials at once; one object drives all trials of a batch.

    It also has `start` and `act`, for trials that run by themselves, and must do the same there.
    """

    def start_batch(self, trials: Sequence[int], problems: Sequence[Problem]) -> None:
        """Prepare for the problems of trials that are about to begin; `trials` are their numbers."""
        ...

    def act_batch(self, view: BatchView) -> Floats:
        """Return speed (m/s) and yaw rate (rad/s) of each ego for the coming tick, (K, 2), in the order of `view`."""
        ...


Maker = Callable[[], Controller]
STAND = (0.0, 0.0)
"""The command of an ego whose trial has ended."""


class SteppedGroup(Group):
    """Trials whose egos somebody in Python drives, a tick at a time."""

    def drive(self, ticks: int) -> None:
        """Take each trial that has not ended up to `ticks` ticks farther; decide on commands before each."""
        for _ in range(ticks):
            self.decide()
            self.advance()

    def finish(self, cancelled: Callable[[], bool] = lambda: False) -> None:
        """Run all trials to their ends; stop between ticks when `cancelled`."""
        while len(self.active) and not cancelled():
            self.drive(1)


class AskedGroup(SteppedGroup):
    """A group of trials and the controllers that drive their egos.

    Parameters
    ----------
    instances : sequence of Instance
        One a trial.
    make : callable
        Makes the controller of a trial.
    shared : BatchController, optional
        Drives the egos of all trials in place of controllers of their own.
    metrics : sequence of callable
        Each makes a further metric of a trial.
    numbers : sequence of int, optional
        The numbers of the trials for the shared controller; by default their own, which must then differ.
    """

    def __init__(
        self,
        instances: Sequence[Instance],
        make: Maker,
        shared: BatchController | None = None,
        metrics: Sequence[MetricMaker] = (),
        numbers: Sequence[int] | None = None,
    ) -> None:
        super().__init__(instances, keeps_rules=False, metrics=metrics)
        if shared is not None:
            check_clear(instances)
        self._shared = shared
        self._lines = [CommandLine(instance) for instance in instances]
        self._senses = [Senses(instance) for instance in instances] if shared is None else []
        self._seats = [Seat(made(make)) for _ in instances] if shared is None else []
        self._clear = all(line.clear for line in self._lines)
        self._interventions = [0] * len(instances)
        self._closed = np.zeros(len(instances), dtype=bool)
        places = [instance.trial for instance in instances] if numbers is None else numbers
        self._trials = np.array(places)
        self._look()
        if shared is not None:
            try:
                shared.start_batch(self._trials.tolist(), [instance.problem for instance in instances])
            except KeyboardInterrupt:
                raise
            except BaseException as error:
                blame.show(error)
                self.fail_all(error)
        for b, (seat, instance) in enumerate(zip(self._seats, instances, strict=False)):
            try:
                seat.start(instance.problem)
            except ControllerError as error:
                self.fail(b, error)
        self._close()

    def _look(self) -> None:
        """Set up what each ego observes, and where the reports of its controller go."""
        trials = range(len(self.instances))
        self._views = [self.of_trial(b) for b in trials]
        self._notes = [partial(self._hear, b) for b in trials]

    def fork(self, trials: Sequence[int], seeds: Sequence[int] | None = None) -> Self:
        """Return forks of some trials, as `Group.fork` does; each goes on with a deep copy of its controller.

        Raises
        ------
        DubinsTrafficError
            If one of the trials has ended, or one controller drives all.
        InputError
            If a controller can't be copied.
        """
        if not self._seats:
            raise DubinsTrafficError("trials of a BatchController can't be forked: it knows trials by number")
        twin = super().fork(trials, seeds)
        drivers: list[Any] = []
        for b, instance in zip(trials, twin.instances, strict=True):
            mine = self._lines[b], self._senses[b], self._seats[b]
            drivers.append(forked(mine, self.instances[b], instance))
        twin._lines, twin._senses, twin._seats = map(list, zip(*drivers, strict=True))
        twin._interventions = [self._interventions[b] for b in trials]
        twin._closed = np.zeros(len(trials), dtype=bool)
        twin._trials = self._trials[list(trials)]
        twin._look()
        return twin

    def reseeded(self, seeds: Sequence[int]) -> Self:
        """Return forks of all trials, each of which draws from another seed from here on."""
        return self.fork(range(len(seeds)), seeds)

    def decide(self) -> None:
        """Ask the controllers of all running trials for the commands of the coming tick."""
        if self._shared is not None:
            ask_all([self], self._shared)
            return
        active: list[int] = self.active.tolist()
        for b in active:
            seen = self._senses[b].observe(int(self.ticks[b]), *self._views[b])
            try:
                command = self._seats[b].act(seen, self._notes[b])
            except ControllerError as error:
                self.fail(b, error)
            else:
                self.take(b, seen.tick, command)

    def advance(self, most: int = 1) -> None:
        """Step each trial that has not ended by up to `most` ticks; close the controllers of those that end."""
        super().advance(most)
        self._close()

    def _close(self) -> None:
        ended = np.flatnonzero(~self._closed & ~self._going)
        self._closed[ended] = True
        for b in ended.tolist() if self._seats else ():
            ending = self.endings[b]
            self.endings[b] = None if ending is None else self._seats[b].end(ending)

    def take(self, b: int, tick: int, command: object) -> None:
        """Let a command take effect in trial b, or end the trial if it is not two finite numbers."""
        try:
            self.commands[b, EGO] = self._lines[b].take(tick, command)
        except ControllerError as error:
            self.fail(b, error)

    def take_all(self, ticks: Ints, commands: Floats) -> None:
        """Let the commands of all running trials take effect, (K, 2); one that is not finite ends its trial."""
        if self._clear and np.isfinite(commands).all():
            self.commands[self.active, EGO] = commands
            return
        for b, tick, command in zip(self.active.tolist(), ticks.tolist(), commands.tolist(), strict=True):
            self.take(b, tick, command)

    def _hear(self, b: int, kind: str, detail: str) -> None:
        """Pass the report of a controller to the metrics of trial b, and count the interventions of a shield."""
        self._interventions[b] += kind == SHIELD
        self.note(b, kind, detail)

    def view(self, places: int) -> BatchView:
        """Return what a BatchController is shown of these trials, with `places` columns for cars."""
        b = self.active
        missing = places - self.state.x.shape[1]
        arrays: list[Any] = [array[b] for array in (*self.state[:6], *self.labels)]
        if missing:
            arrays = [np.pad(array, ((0, 0), (0, missing))) for array in arrays]
        count = self.state.count[b]
        sensed = np.zeros((len(b), places), dtype=np.int64)
        mark_sensed(b, np.ascontiguousarray(self.world.progress.trial["sight2"]), self.state, sensed)
        seen = sensed != 0
        hidden = ~seen
        for array, nothing in zip(arrays, (*[np.nan] * 6, 0, -1, -1, -1, 0), strict=True):
            array[hidden] = nothing
        state, labels = State(*arrays[:6], count=count), Labels(*arrays[6:])
        return BatchView(self._trials[b], self.ticks[b], state, labels, seen)

    def fail_all(self, error: BaseException) -> None:
        """End all trials with a fault of their controller."""
        for b in self.active.tolist():
            self.fail(b, fault(error, int(self.ticks[b])))

    def outcomes(self, trials: Sequence[int], controller: str) -> list[Outcome]:
        """Return the outcomes of trials that have ended, with what their controllers took and their shields did."""
        ended: list[Outcome] = []
        for b, outcome in zip(trials, super().outcomes(trials, controller), strict=True):
            score = replace(outcome.score, interventions=self._interventions[b])
            latencies = summary(self._seats[b].latencies if self._seats else ())
            ended.append(replace(outcome, score=score, act_s=latencies))
        return ended

    def _time_to_begin(self, b: int) -> float | None:
        return self._seats[b].begin if self._seats else None


class LanesGroup(SteppedGroup):
    """Trials whose egos the controller `lanes` drives without observations, under a shield or not.

    Verdicts, metrics and endings are those of the same trials with the controllers ``lanes`` or ``lanes+shield``, bit
    for bit, in a fraction of the time: what the egos see is read where it stands, and one kernel shields them all. What
    the shield does is not counted.

    Parameters
    ----------
    instances : sequence of Instance
        One a trial, of cars that can keep the rules, undisturbed.
    overtakes : {"sure", "law", "never"} or None
        When the shield lets an ego cross the centre line; None: there is no shield.
    """

    def __init__(self, instances: Sequence[Instance], overtakes: Overtakes | None) -> None:
        super().__init__(instances, keeps_rules=False)
        problems = [instance.problem for instance in instances]
        self._shields = None
        if overtakes is not None:
            self._shields = EgoShields(problems, self.state, self.labels, overtakes=overtakes)
        self._ticks = np.full(len(instances), -1)
        self._guard = Answerable()
        self._lanes = [(Lanes(), problem.sensing_radius) for problem in problems]
        for b, ((lanes, _), problem) in enumerate(zip(self._lanes, problems, strict=True)):
            try:
                with self._guard:
                    lanes.start(problem)
            except ControllerError as error:
                self.fail(b, error)

    def fork(self, trials: Sequence[int], seeds: Sequence[int] | None = None) -> Self:  # noqa: ARG002  # refused
        """Refuse: what `lanes` and the shields of these trials know is not copied."""
        raise DubinsTrafficError("trials that `lanes` drives without observations can't be forked")

    def decide(self) -> None:
        """Write the commands of the egos of all running trials."""
        now: list[int] = self.ticks.tolist()
        driven: list[int] = self.active.tolist()
        commands = [self._command(b, now[b]) for b in driven]
        if driven:
            self.commands[driven, EGO] = commands
        if self._shields is not None:
            self._ticks[:] = -1
            self._ticks[self.active] = self.ticks[self.active]
            self._shields.filter(self._ticks, self.commands)

    def _command(self, b: int, tick: int) -> tuple[float, float]:
        """Return the command of the ego of trial b; a fault ends the trial.

        The guard, whose `with` takes as long as some commands, is entered only when something has been raised.
        """
        lanes, radius = self._lanes[b]
        try:
            command = lanes.act_in(b, tick, radius, self.state)
            return command if self._shields is not None else checked_command(command, tick)
        except ControllerError as error:
            self.fail(b, error)
        except Exception:
            self._guard.tick = tick
            try:
                with self._guard:
                    raise
            except ControllerError as error:
                self.fail(b, error)
        return STAND


def ask_all(groups: Sequence[AskedGroup], controller: BatchController) -> None:
    """Ask one controller for the commands of all egos."""
    groups = [group for group in groups if len(group.active)]
    if not groups:
        return
    places = max(group.state.x.shape[1] for group in groups)
    views = [group.view(places) for group in groups]
    whole = BatchView(
        np.concatenate([view.trial for view in views]),
        np.concatenate([view.tick for view in views]),
        State(*_joined([view.state for view in views])),
        Labels(*_joined([view.labels for view in views])),
        np.concatenate([view.seen for view in views]),
    )
    try:
        answer = np.array(controller.act_batch(whole), dtype=np.float64)  # a copy: it may keep its own
        if answer.shape != (len(whole.trial), 2):
            raise TypeError(f"act_batch returned {answer.shape}, not {(len(whole.trial), 2)}")
    except KeyboardInterrupt:
        raise
    except BaseException as error:
        blame.show(error)
        for group in groups:
            group.fail_all(error)
        return
    row = 0
    for group, view in zip(groups, views, strict=True):
        group.take_all(view.tick, answer[row : row + len(view.tick)])
        row += len(view.tick)


def _joined(tables: Sequence[Tables]) -> list[Any]:
    """Return, for each column, the arrays of several tables concatenated."""
    return [np.concatenate(arrays) for arrays in zip(*tables, strict=True)]


def check_clear(instances: Sequence[Instance]) -> None:
    """Refuse instances with noise in observations: a BatchController is shown the true poses."""
    for instance in instances:
        noise = instance.disturbances
        if noise.position_noise > 0.0 or noise.heading_noise > 0.0:
            raise InputError(
                "a controller with start_batch and act_batch is shown poses without noise",
                field="disturbances",
                value=noise,
                expected="no noise, or a controller with start and act",
            )
