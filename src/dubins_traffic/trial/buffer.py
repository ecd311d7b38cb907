"""Collects frames into blocks of one simulated second and hands them to the sinks."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from dubins_traffic.cars.state import Contact, Event, Frames, Labels, State
from dubins_traffic.kernels.arrays import Floats
from dubins_traffic.protocols import Ending, Sink

if TYPE_CHECKING:
    from dubins_traffic.problem.instance import Instance


class FrameBuffer:
    """The frames of one trial that the sinks have not seen yet.

    Block m holds the frames m * F to m * F + F - 1, where F is the number of whole ticks in a second; so blocks
    depend on nothing but the tick, and a record has the same chunks however it was made.
    """

    def __init__(self, instance: Instance, sinks: Sequence[Sink]) -> None:
        self._rate = instance.problem.rate
        self._capacity = max(1, int(self._rate))
        self._cars = len(instance.starts)
        self._sinks = tuple(sinks)
        self._first = 0
        for sink in self._sinks:
            sink.begin(instance)
        self._renew()

    def push(
        self,
        state: State,
        labels: Labels,
        commands: Floats,
        contacts: Sequence[Contact],
        events: Sequence[Event],
    ) -> None:
        """Take the frame just reached, the clipped commands that led to it, and what happened in its tick."""
        f = self._filled
        reals = self._reals
        reals[0, f] = state.x[0]
        reals[1, f] = state.y[0]
        reals[2, f] = state.c[0]
        reals[3, f] = state.s[0]
        reals[4, f] = state.speed[0]
        reals[5, f] = state.yaw_rate[0]
        reals[6:, f] = commands[0].T
        whole = self._whole
        whole[0, f] = labels.segment[0]
        whole[1, f] = labels.at[0]
        whole[2, f] = labels.crosses[0]
        whole[3, f] = labels.lane[0]
        self._bits[f] = labels.bits[0]
        if contacts:
            self._contacts += contacts
        if events:
            self._events += events
        self._filled = f + 1
        if self._filled == self._capacity:
            self.flush()

    def note(self, event: Event) -> None:
        """Add an event to the block in hand."""
        self._events.append(event)

    def flush(self) -> None:
        """Hand what is in hand to the sinks."""
        if not self._filled and not self._events:
            return
        filled = self._filled
        block = Frames(
            self._first,
            self._rate,
            *self._reals[:, :filled],
            *self._whole[:, :filled],
            bits=self._bits[:filled],
            contacts=tuple(self._contacts),
            events=tuple(self._events),
        )
        self._first += filled
        self._renew()
        for sink in self._sinks:
            sink.frames(block)

    def end(self, ending: Ending) -> None:
        """Hand over the rest and say how the trial ended."""
        self.flush()
        for sink in self._sinks:
            sink.end(ending)

    def _renew(self) -> None:
        shape = (self._capacity, self._cars)
        self._reals = np.zeros((8, *shape))
        self._whole = np.zeros((4, *shape), dtype=np.int64)
        self._bits = np.zeros(shape, dtype=np.uint32)
        self._contacts: list[Contact] = []
        self._events: list[Event] = []
        self._filled = 0
