"""Collects the frames of batched trials, tick by tick, for metrics that are not compiled."""

from __future__ import annotations

from collections.abc import Sequence
from copy import copy
from typing import TYPE_CHECKING

import numpy as np

from dubins_traffic.cars.state import Contact, Event, Frames, Labels, State
from dubins_traffic.kernels.arrays import Floats, Ints
from dubins_traffic.record.sink import Ending
from dubins_traffic.scoring.blocks import cut
from dubins_traffic.scoring.metric import Maker, Measured
from dubins_traffic.scoring.own_metrics import OwnMetrics
from dubins_traffic.trial.forking import forked

if TYPE_CHECKING:
    from dubins_traffic.problem.instance import Instance


class Feed:
    """Hands the frames of each batched trial to its metrics in Python, in blocks of one second.

    Parameters
    ----------
    instances : sequence of Instance
        One a trial, of one control rate.
    cars : int
        Places for cars, N.
    metrics : sequence of callable
        Each makes a metric of a trial.
    """

    def __init__(self, instances: Sequence[Instance], cars: int, metrics: Sequence[Maker]) -> None:
        trials = len(instances)
        self._instances = instances
        self._size = max(1, int(instances[0].problem.rate))
        self._reals = np.zeros((8, trials, self._size, cars))
        self._whole = np.zeros((4, trials, self._size, cars), dtype=np.int64)
        self._bits = np.zeros((trials, self._size, cars), dtype=np.uint32)
        self._first = np.zeros(trials, dtype=np.int64)
        self._filled = np.zeros(trials, dtype=np.int64)
        self._events: list[list[Event]] = [[] for _ in instances]
        self._told = [0] * trials
        self._sinks = [OwnMetrics(metrics) for _ in instances]
        for sink, instance in zip(self._sinks, instances, strict=True):
            sink.begin(instance)

    def fork(self, trials: Sequence[int], instances: Sequence[Instance]) -> Feed:
        """Return the feed of forks of some trials, whose instances are `instances`: metrics go on as deep copies."""
        twin = copy(self)
        rows = np.array(trials, dtype=np.int64)
        twin._instances = instances
        twin._reals, twin._whole = self._reals[:, rows], self._whole[:, rows]
        twin._bits, twin._first, twin._filled = self._bits[rows], self._first[rows], self._filled[rows]
        twin._events = [list(self._events[b]) for b in trials]
        twin._told = [self._told[b] for b in trials]
        twin._sinks = [
            forked(self._sinks[b], self._instances[b], instance)
            for b, instance in zip(trials, instances, strict=True)
        ]
        return twin

    def push(
        self,
        moved: Ints,
        state: State,
        labels: Labels,
        commands: Floats,
        contacts: Sequence[Sequence[Contact]],
    ) -> None:
        """Take the present frame of the trials `moved`; `contacts` are all of each trial so far."""
        if not len(moved):
            return
        row = self._filled[moved]
        reals = (
            state.x,
            state.y,
            state.c,
            state.s,
            state.speed,
            state.yaw_rate,
            commands[..., 0],
            commands[..., 1],
        )
        for kept, array in zip(self._reals, reals, strict=True):
            kept[moved, row] = array[moved]
        for kept, array in zip(self._whole, labels[:4], strict=True):
            kept[moved, row] = array[moved]
        self._bits[moved, row] = labels.bits[moved]
        self._filled[moved] = row + 1
        full: list[int] = moved[row + 1 == self._size].tolist()
        for b in full:
            self._flush(b, contacts[b])

    def note(self, b: int, event: Event) -> None:
        """Add an event to trial b."""
        self._events[b].append(event)

    def result(self, b: int, ending: Ending, contacts: Sequence[Contact]) -> tuple[Measured, ...]:
        """Return the values of the metrics of trial b, which has ended."""
        self._flush(b, contacts)
        self._sinks[b].end(ending)
        return self._sinks[b].result()

    def _flush(self, b: int, contacts: Sequence[Contact]) -> None:
        filled, cars = int(self._filled[b]), len(self._instances[b].starts)
        block = Frames(
            int(self._first[b]),
            self._instances[b].problem.rate,
            *self._reals[:, b, :filled, :cars],
            *self._whole[:, b, :filled, :cars],
            bits=self._bits[b, :filled, :cars],
            contacts=tuple(contacts[self._told[b] :]),
            events=tuple(self._events[b]),
        )
        self._sinks[b].frames(cut(block, 0, filled))
        self._told[b] = len(contacts)
        self._events[b] = []
        self._first[b] += filled
        self._filled[b] = 0
