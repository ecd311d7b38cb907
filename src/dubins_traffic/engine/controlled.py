"""Batched trials whose egos are driven by controllers in Python, asked in every tick: one a trial, or one for all."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
from copy import copy
from dataclasses import replace
from functools import partial
from itertools import islice
from typing import TYPE_CHECKING, Any, NamedTuple, Protocol, runtime_checkable

import numpy as np
import numpy.typing as npt

from dubins_traffic.cars.sensing import mark_sensed
from dubins_traffic.cars.state import EGO, Labels, State
from dubins_traffic.controllers import blame
from dubins_traffic.controllers.registry import made
from dubins_traffic.engine.group import Group, Outcome
from dubins_traffic.errors import ControllerError, DubinsTrafficError, InputError
from dubins_traffic.kernels.arrays import Floats, Ints
from dubins_traffic.kernels.tables import Tables
from dubins_traffic.observations.senses import Senses
from dubins_traffic.protocols import Controller, End
from dubins_traffic.record.sink import SHIELD
from dubins_traffic.record.wall import summary
from dubins_traffic.scoring.metric import Maker as MetricMaker
from dubins_traffic.trial.disturbance import CommandLine
from dubins_traffic.trial.forking import forked
from dubins_traffic.trial.seat import Seat, fault

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


class Controlled:
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

    Attributes
    ----------
    group : Group
        The trials.
    """

    def __init__(
        self,
        instances: Sequence[Instance],
        make: Maker,
        shared: BatchController | None = None,
        metrics: Sequence[MetricMaker] = (),
        numbers: Sequence[int] | None = None,
    ) -> None:
        self.group = Group(instances, keeps_rules=False, metrics=metrics)
        self._lines = [CommandLine(instance) for instance in instances]
        self._senses = [Senses(instance) for instance in instances] if shared is None else []
        self._seats = [Seat(made(make)) for _ in instances] if shared is None else []
        self._clear = all(line.clear for line in self._lines)
        self._interventions = [0] * len(instances)
        self._told = np.zeros(len(instances), dtype=bool)
        own = [instance.trial for instance in instances] if numbers is None else numbers
        self._trials = np.array(own)
        self._look()
        if shared is not None:
            try:
                shared.start_batch(self._trials.tolist(), [instance.problem for instance in instances])
            except KeyboardInterrupt:
                raise
            except BaseException as error:
                blame.show(error)
                self.fail(error)
        for b, (seat, instance) in enumerate(zip(self._seats, instances, strict=False)):
            try:
                seat.start(instance.problem)
            except ControllerError as error:
                self._end(b, error)

    def _look(self) -> None:
        """Set up what each ego observes, and where the reports of its controller go."""
        trials = range(len(self.group.instances))
        self._views = [self.group.of_trial(b) for b in trials]
        self._notes = [partial(self._hear, b) for b in trials]

    def fork(self, trials: Sequence[int], seeds: Sequence[int] | None = None) -> Controlled:
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
        twin = copy(self)
        twin.group = self.group.fork(trials, seeds)
        own: list[Any] = []
        for b, instance in zip(trials, twin.group.instances, strict=True):
            mine = self._lines[b], self._senses[b], self._seats[b]
            own.append(forked(mine, self.group.instances[b], instance))
        twin._lines, twin._senses, twin._seats = map(list, zip(*own, strict=True))
        twin._interventions = [self._interventions[b] for b in trials]
        twin._told = np.zeros(len(trials), dtype=bool)
        twin._trials = self._trials[list(trials)]
        twin._look()
        return twin

    def ask_each(self) -> None:
        """Ask the controller of each running trial for its command."""
        group = self.group
        active: list[int] = group.active.tolist()
        for b in active:
            seen = self._senses[b].observe(int(group.ticks[b]), *self._views[b])
            try:
                command = self._seats[b].act(seen, self._notes[b])
            except ControllerError as error:
                self._end(b, error)
            else:
                self.take(b, seen.tick, command)

    def take(self, b: int, tick: int, command: object) -> None:
        """Let a command take effect in trial b, or end the trial if it is not two finite numbers."""
        try:
            self.group.commands[b, EGO] = self._lines[b].take(tick, command)
        except ControllerError as error:
            self._end(b, error)

    def take_all(self, ticks: Ints, commands: Floats) -> None:
        """Let the commands of all running trials take effect, (K, 2); one that is not finite ends its trial."""
        group = self.group
        if self._clear and np.isfinite(commands).all():
            group.commands[group.active, EGO] = commands
            return
        for b, tick, command in zip(group.active.tolist(), ticks.tolist(), commands.tolist(), strict=True):
            self.take(b, tick, command)

    def _end(self, b: int, error: ControllerError) -> None:
        self.group.end(b, End(error.reason), error.detail)

    def _hear(self, b: int, kind: str, detail: str) -> None:
        """Pass the report of a controller to the metrics of trial b, and count the interventions of a shield."""
        self._interventions[b] += kind == SHIELD
        self.group.note(b, kind, detail)

    def view(self, places: int) -> BatchView:
        """Return what a BatchController is shown of these trials, with `places` columns for cars."""
        group = self.group
        b = group.active
        missing = places - group.state.x.shape[1]
        arrays: list[Any] = [array[b] for array in (*group.state[:6], *group.labels)]
        if missing:
            arrays = [np.pad(array, ((0, 0), (0, missing))) for array in arrays]
        count = group.state.count[b]
        sensed = np.zeros((len(b), places), dtype=np.int64)
        mark_sensed(b, np.ascontiguousarray(group.world.progress.trial["sight2"]), group.state, sensed)
        seen = sensed != 0
        hidden = ~seen
        for array, nothing in zip(arrays, (*[np.nan] * 6, 0, -1, -1, -1, 0), strict=True):
            array[hidden] = nothing
        state, labels = State(*arrays[:6], count=count), Labels(*arrays[6:])
        return BatchView(self._trials[b], group.ticks[b], state, labels, seen)

    def fail(self, error: BaseException) -> None:
        """End all trials with a fault of their controller."""
        for b in self.group.active.tolist():
            self._end(b, fault(error, int(self.group.ticks[b])))

    def step(self, controller: str) -> Iterator[Outcome]:
        """Step all trials by a tick; yield the outcomes of those that have ended."""
        self.group.advance()
        ended: list[int] = np.flatnonzero(
            ~self._told & [ending is not None for ending in self.group.endings]
        ).tolist()
        for b in ended:
            self._told[b] = True
            ending = self.group.endings[b]
            if self._seats and ending is not None:
                self.group.endings[b] = self._seats[b].end(ending)
        begin = {b: seat.begin for b, seat in enumerate(self._seats)}
        for b, outcome in zip(ended, self.group.outcomes(ended, controller, begin), strict=True):
            score = replace(outcome.score, interventions=self._interventions[b])
            yield replace(
                outcome, score=score, act_s=summary(self._seats[b].latencies if self._seats else ())
            )


def grouped(instances: Sequence[Instance]) -> list[list[Instance]]:
    """Return instances in groups that can be stepped together: of one control rate, width and length of trails."""
    groups: dict[tuple[float, float, float], list[Instance]] = {}
    for instance in instances:
        gap = max((agent.driver.parameters.get("gap") or 0.0 for agent in instance.e_agents), default=0.0)
        groups.setdefault((instance.problem.rate, instance.problem.car.w, gap), []).append(instance)
    return list(groups.values())


def ask(
    instances: Iterable[Instance],
    make: Maker,
    controller: str,
    batch: int,
    cancelled: Callable[[], bool] = lambda: False,
    metrics: Sequence[MetricMaker] = (),
) -> Iterator[Outcome]:
    """Run trials, `batch` at a time, and yield the outcome of each when it ends; another trial then takes its place.

    It calls `cancelled` in every tick and raises KeyboardInterrupt if that returns true.

    Parameters
    ----------
    instances
        One for each trial.
    make
        Makes the controller: one for each trial, or one for all if it is a `BatchController`.
    controller
        Name of the controller, for the outcomes.
    batch
        Most trials that run at a time.
    metrics
        Each makes a further metric for a trial.
    """
    made = make()
    shared = made if isinstance(made, BatchController) else None
    waiting = iter(instances)
    seats: list[Controlled] = []
    while True:
        if cancelled():
            raise KeyboardInterrupt
        free = batch - sum(len(own.group.active) for own in seats)
        taken = list(islice(waiting, free)) if 8 * free >= batch else []
        for own in grouped(taken):
            if shared is not None:
                check_clear(own)
            seats.append(Controlled(own, make, shared, metrics))
        if not seats:
            return
        if shared is None:
            for own in seats:
                own.ask_each()
        else:
            ask_all(seats, shared)
        for own in seats:
            yield from own.step(controller)
        seats = [own for own in seats if len(own.group.active)]


def ask_all(seats: Sequence[Controlled], controller: BatchController) -> None:
    """Ask one controller for the commands of all egos."""
    seats = [own for own in seats if len(own.group.active)]
    if not seats:
        return
    places = max(own.group.state.x.shape[1] for own in seats)
    views = [own.view(places) for own in seats]
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
        for own in seats:
            own.fail(error)
        return
    row = 0
    for own, view in zip(seats, views, strict=True):
        own.take_all(view.tick, answer[row : row + len(view.tick)])
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
