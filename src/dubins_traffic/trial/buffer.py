"""Collects frames into blocks of one simulated second and hands them to the sinks."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from dubins_traffic.cars.state import Contact, Event, Frames, Labels, State
from dubins_traffic.kernels.arrays import Bits, Floats, Ints
from dubins_traffic.kernels.calls import bound
from dubins_traffic.kernels.compile import jit
from dubins_traffic.protocols import Ending, Forks, Sink

if TYPE_CHECKING:
    from dubins_traffic.problem.instance import Instance


@jit
def keep(
    f: int, reals: Floats, whole: Ints, bits: Bits, commands: Floats, state: State, labels: Labels
) -> None:
    """Copy trial 0 of the arrays of State and Labels, and its commands, into frame `f` (index) of a block.

    The block is `reals` (8, F, N): pose, twist and command, `whole` (4, F, N) and `bits` (F, N).
    """
    for n in range(reals.shape[2]):
        reals[0, f, n] = state.x[0, n]
        reals[1, f, n] = state.y[0, n]
        reals[2, f, n] = state.c[0, n]
        reals[3, f, n] = state.s[0, n]
        reals[4, f, n] = state.speed[0, n]
        reals[5, f, n] = state.yaw_rate[0, n]
        reals[6, f, n] = commands[0, n, 0]
        reals[7, f, n] = commands[0, n, 1]
        whole[0, f, n] = labels.segment[0, n]
        whole[1, f, n] = labels.at[0, n]
        whole[2, f, n] = labels.crosses[0, n]
        whole[3, f, n] = labels.lane[0, n]
        bits[f, n] = labels.bits[0, n]


@jit
def all_finite(commands: Floats) -> bool:
    """Tell whether all commands of trial 0, (1, N, 2), are finite."""
    finite = True
    for n in range(commands.shape[1]):
        for k in range(2):
            finite &= commands[0, n, k] - commands[0, n, k] == 0.0
    return finite


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
        self._keep = bound(keep)
        for sink in self._sinks:
            sink.begin(instance)
        self._renew()

    def __getstate__(self) -> dict[str, Any]:
        """Return the state that a fork copies: all but the sinks that can't go on in a fork."""
        carried = tuple(sink for sink in self._sinks if isinstance(sink, Forks) and sink.forks)
        return {**vars(self), "_sinks": carried}

    @property
    def sinks(self) -> tuple[Sink, ...]:
        """The sinks; if all of them can go on in a fork, the frames collected so far are handed to them first.

        Where blocks are cut makes no difference to such sinks. A record's writer is none of them.
        """
        if all(isinstance(sink, Forks) and sink.forks for sink in self._sinks):
            self.flush()
        return self._sinks

    def add(self, sink: Sink) -> None:
        """Add a sink that has been handed all frames before the present block; it receives that block and all later."""
        self._sinks = (*self._sinks, sink)

    def push(
        self,
        state: State,
        labels: Labels,
        commands: Floats,
        contacts: Sequence[Contact],
        events: Sequence[Event],
    ) -> None:
        """Append the frame just reached to the block, with the clipped commands that led to it and its tick's events.

        `state` and `labels` are (1, N), `commands` (1, N, 2) m/s and rad/s; all are copied.
        """
        f = self._filled
        self._keep(f, self._reals, self._whole, self._bits, commands, state, labels)
        if contacts:
            self._contacts += contacts
        if events:
            self._events += events
        self._filled = f + 1
        if self._filled == self._capacity:
            self.flush()

    def note(self, event: Event) -> None:
        """Append an event to the present block."""
        self._events.append(event)

    def flush(self) -> None:
        """Hand the frames and events of the present block to the sinks and begin the next block."""
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
        """Hand the last block to the sinks, then the ending."""
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
