"""Trials of a batch whose egos are driven by controllers in Python: one for each trial, or one for all at once."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
from copy import copy
from dataclasses import replace
from functools import partial
from itertools import islice
from typing import TYPE_CHECKING, Any, NamedTuple, Protocol, runtime_checkable

import numpy as np
import numpy.typing as npt

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
    """What a vectorised controller is shown of all trials that are running.

    Attributes
    ----------
    trial : (K,) int64
        Number of each trial, by which `start_batch` has announced it.
    tick : (K,) int64
        Its present frame.
    state : State
        Poses and twists, (K, N): car 0 is the ego. What the ego does not see is NaN.
    labels : Labels
        Propositions, (K, N). Of what the ego does not see: 0 for `segment` and `bits`, else -1.
    seen : (K, N) bool
        Which places hold the ego or a car within its sensing radius.
    """

    trial: Ints
    tick: Ints
    state: State
    labels: Labels
    seen: npt.NDArray[np.bool_]


@runtime_checkable
class BatchController(Controller, Protocol):
    """Drives the egos of many trials at once; one object drives all trials of a batch.

    It has `start` and `act` as well, by which a trial can be run by itself, and must do the same then.
    """

    def start_batch(self, trials: Sequence[int], problems: Sequence[Problem]) -> None:
        """Learn the problems of trials that are about to begin."""
        ...

    def act_batch(self, view: BatchView) -> Floats:
        """Return speed (m/s) and yaw rate (rad/s) of each ego for the coming tick, (K, 2), in the order of `view`."""
        ...


Maker = Callable[[], Controller]


class Controlled:
    """The trials of one group and the controllers that drive their egos.

    Parameters
    ----------
    instances : sequence of Instance
        One a trial.
    make : callable
        Makes the controller of a trial.
    shared : BatchController, optional
        Drives the egos of all trials instead.
    metrics : sequence of callable
        What makes further metrics of a trial.
    numbers : sequence of int, optional
        By which the shared controller is told of the trials; by default their own, which must differ then.

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
        """Note what each ego is shown, and who hears what its controller reports."""
        trials = range(len(self.group.instances))
        self._views = [self._of_trial(b) for b in trials]
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
            raise DubinsTrafficError(
                "a controller of whole batches can't go on twice: it knows trials by number"
            )
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
        """Let each ego's own controller choose its command."""
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
        """Let a command take effect, or end the trial if it is none."""
        try:
            self.group.commands[b, EGO] = self._lines[b].take(tick, command)
        except ControllerError as error:
            self._end(b, error)

    def _end(self, b: int, error: ControllerError) -> None:
        self.group.end(b, End(error.reason), error.detail)

    def _hear(self, b: int, kind: str, detail: str) -> None:
        """Count how often a shield has stepped in, and tell the metrics of what a controller reports."""
        self._interventions[b] += kind == SHIELD
        self.group.note(b, kind, detail)

    def view(self, places: int) -> BatchView:
        """Return what a vectorised controller is shown of these trials, with `places` for cars."""
        group = self.group
        b = group.active
        missing = places - group.state.x.shape[1]
        arrays: list[Any] = [array[b] for array in (*group.state[:6], *group.labels)]
        if missing:
            arrays = [np.pad(array, ((0, 0), (0, missing))) for array in arrays]
        x, y = arrays[0], arrays[1]
        radii = np.array([instance.problem.sensing_radius for instance in group.instances])
        radius = radii[b][:, None]
        count = group.state.count[b]
        dx, dy = x - x[:, :1], y - y[:, :1]
        seen = (dx * dx + dy * dy <= radius * radius) & (np.arange(places) < count[:, None])
        hidden = ~seen
        for array, nothing in zip(arrays, (*[np.nan] * 6, 0, -1, -1, -1, 0), strict=True):
            array[hidden] = nothing
        state, labels = State(*arrays[:6], count=count), Labels(*arrays[6:])
        return BatchView(self._trials[b], group.ticks[b], state, labels, seen)

    def fail(self, error: BaseException) -> None:
        """End all trials as a fault of their controller."""
        for b in self.group.active.tolist():
            self._end(b, fault(error, int(self.group.ticks[b])))

    def step(self, controller: str) -> Iterator[Outcome]:
        """Take all trials to their next frame; yield what came of those that have ended."""
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

    def _of_trial(self, b: int) -> tuple[State, Labels]:
        """Return the state and labels of trial b alone; they follow those of the group."""
        group, cars = self.group, len(self.group.instances[b].starts)
        reals: list[Any] = [array[b : b + 1, :cars] for array in group.state[:6]]
        whole: list[Any] = [array[b : b + 1, :cars] for array in group.labels]
        return State(*reals, count=group.state.count[b : b + 1]), Labels(*whole)


def ask(
    instances: Iterable[Instance],
    make: Maker,
    controller: str,
    batch: int,
    cancelled: Callable[[], bool] = lambda: False,
    metrics: Sequence[MetricMaker] = (),
) -> Iterator[Outcome]:
    """Run trials, `batch` at a time, and yield what came of each as it ends; another one then takes its place.

    When `cancelled`, which is asked in every tick, it raises KeyboardInterrupt.

    Parameters
    ----------
    instances
        One a trial.
    make
        Makes the controller: one for each trial, or one for all if it is a `BatchController`.
    controller
        Its name.
    batch
        How many trials run at a time.
    metrics
        What makes further metrics for a trial.
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


def grouped(instances: Sequence[Instance]) -> list[list[Instance]]:
    """Return instances in groups that can be stepped together: of one control rate, width, and reach of memory."""
    groups: dict[tuple[float, float, float], list[Instance]] = {}
    for instance in instances:
        gap = max((agent.driver.parameters.get("gap") or 0.0 for agent in instance.e_agents), default=0.0)
        groups.setdefault((instance.problem.rate, instance.problem.car.w, gap), []).append(instance)
    return list(groups.values())


def ask_all(seats: Sequence[Controlled], controller: BatchController) -> None:
    """Let one controller choose the commands of all egos."""
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
        answer = np.asarray(controller.act_batch(whole), dtype=np.float64)
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
        for b, tick in zip(own.group.active.tolist(), view.tick.tolist(), strict=True):
            own.take(b, tick, answer[row].tolist())
            row += 1


def _joined(tables: Sequence[Tables]) -> list[Any]:
    """Return the arrays of several tables, one after another, column by column."""
    return [np.concatenate(arrays) for arrays in zip(*tables, strict=True)]


def check_clear(instances: Sequence[Instance]) -> None:
    """Refuse instances with noise in observations, which a controller of whole batches is not shown."""
    for instance in instances:
        noise = instance.disturbances
        if noise.position_noise > 0.0 or noise.heading_noise > 0.0:
            raise InputError(
                "a controller of whole batches is shown poses without noise",
                field="disturbances",
                value=noise,
                expected="no noise, or a controller with start and act",
            )
