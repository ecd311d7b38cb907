"""Collects frames into blocks of one simulated second and hands them to the sinks, of one trial or of many."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from dubins_traffic.cars.state import Contact, Event, Frames, Labels, State
from dubins_traffic.kernels.arrays import Bits, Floats, Ints
from dubins_traffic.kernels.calls import bound
from dubins_traffic.kernels.compile import jit
from dubins_traffic.kernels.tables import Tables
from dubins_traffic.protocols import Ending, Forks, Sink
from dubins_traffic.trial.forking import forked

if TYPE_CHECKING:
    from dubins_traffic.problem.instance import Instance


class Block(Tables):
    """The frames of B trials in the present second, of F at most: `filled` (B,) are there.

    `reals` (8, B, F, N): pose, twist and command; `whole` (4, B, F, N): segment, disc, disc met and lane state; `bits`
    (B, F, N).
    """

    filled: Ints
    reals: Floats
    whole: Ints
    bits: Bits


@jit
def keep(trials: Ints, commands: Floats, state: State, labels: Labels, block: Block) -> bool:
    """Append the present frames of some `trials` (K,), with their commands, to a block; tell whether one is full."""
    full = False
    reals, whole, bits = block.reals, block.whole, block.bits
    for k in range(trials.shape[0]):
        b: int = trials[k]
        f: int = block.filled[b]
        for n in range(bits.shape[2]):
            reals[0, b, f, n] = state.x[b, n]
            reals[1, b, f, n] = state.y[b, n]
            reals[2, b, f, n] = state.c[b, n]
            reals[3, b, f, n] = state.s[b, n]
            reals[4, b, f, n] = state.speed[b, n]
            reals[5, b, f, n] = state.yaw_rate[b, n]
            reals[6, b, f, n] = commands[b, n, 0]
            reals[7, b, f, n] = commands[b, n, 1]
            whole[0, b, f, n] = labels.segment[b, n]
            whole[1, b, f, n] = labels.at[b, n]
            whole[2, b, f, n] = labels.crosses[b, n]
            whole[3, b, f, n] = labels.lane[b, n]
            bits[b, f, n] = labels.bits[b, n]
        block.filled[b] = f + 1
        full |= f + 1 == bits.shape[1]
    return full


@jit
def all_finite(commands: Floats) -> bool:
    """Tell whether all commands of trial 0, (1, N, 2), are finite."""
    finite = True
    for n in range(commands.shape[1]):
        for k in range(2):
            finite &= commands[0, n, k] - commands[0, n, k] == 0.0
    return finite


class FrameBuffer:
    """The frames of trials of one control rate that their sinks have not seen yet.

    Block m of a trial holds the frames m * F to m * F + F - 1, where F is the number of whole ticks in a second; so
    blocks depend on nothing but the tick, and a record has the same chunks however it was made.

    Parameters
    ----------
    instances : sequence of Instance
        One a trial. Whoever has one trial need not name it afterwards.
    sinks : sequence of sequences of Sink
        Those of each trial.
    """

    def __init__(self, instances: Sequence[Instance], sinks: Sequence[Sequence[Sink]]) -> None:
        self._instances = tuple(instances)
        self._sinks = [tuple(sink) for sink in sinks]
        trials, cars = len(instances), max(len(instance.starts) for instance in instances)
        shape = trials, max(1, int(instances[0].problem.rate)), cars
        self._first = [0] * trials
        self._contacts: list[list[Contact]] = [[] for _ in instances]
        self._events: list[list[Event]] = [[] for _ in instances]
        self._block = Block(
            np.zeros(trials, dtype=np.int64),
            np.zeros((8, *shape)),
            np.zeros((4, *shape), dtype=np.int64),
            np.zeros(shape, dtype=np.uint32),
        )
        self._all: Ints = np.arange(trials)
        self._keep = bound(keep)
        for instance, given_sinks in zip(self._instances, self._sinks, strict=True):
            for sink in given_sinks:
                sink.begin(instance)

    def __getstate__(self) -> dict[str, Any]:
        """Return the state that a fork copies: all but the sinks that can't go on in a fork."""
        carried = [tuple(sink for sink in sinks if isinstance(sink, Forks) and sink.forks) for sinks in self._sinks]
        return {**vars(self), "_sinks": carried}

    def fork(self, trials: Sequence[int], instances: Sequence[Instance]) -> FrameBuffer:
        """Return the buffer of forks of some trials, whose instances are `instances`: sinks go on as deep copies."""
        twin = object.__new__(FrameBuffer)
        rows, block = list(trials), self._block
        twin._instances = tuple(instances)
        twin._block = Block(
            block.filled[rows], block.reals[:, rows].copy(), block.whole[:, rows].copy(), block.bits[rows]
        )
        twin._first = [self._first[b] for b in rows]
        twin._contacts = [list(self._contacts[b]) for b in rows]
        twin._events = [list(self._events[b]) for b in rows]
        twin._all = np.arange(len(rows))
        twin._keep = bound(keep)
        twin._sinks = [
            forked(self._sinks[b], self._instances[b], instance) for b, instance in zip(rows, instances, strict=True)
        ]
        return twin

    def sinks(self, b: int = 0) -> tuple[Sink, ...]:
        """Return the sinks of a trial; if all can go on in a fork, they are handed the frames collected so far first.

        Where blocks are cut makes no difference to such sinks. A record's writer is none of them.
        """
        if all(isinstance(sink, Forks) and sink.forks for sink in self._sinks[b]):
            self.flush(b)
        return self._sinks[b]

    def add(self, sink: Sink, b: int = 0) -> None:
        """Add a sink that has been handed all frames before the present block; it receives that block and all later."""
        self._sinks[b] = (*self._sinks[b], sink)

    def push(self, state: State, labels: Labels, commands: Floats, trials: Ints | None = None) -> None:
        """Append the frames that trials, by default all, have just reached, with the clipped commands that led there.

        `state` and `labels` are (B, N), `commands` (B, N, 2) m/s and rad/s; all are copied. The contacts and events of
        the tick are noted before.
        """
        trials = self._all if trials is None else trials
        if self._keep(trials, commands, state, labels, self._block):
            size = self._block.bits.shape[1]
            for b in trials[self._block.filled[trials] == size].tolist():
                self.flush(b)

    def touch(self, contacts: Sequence[Contact], b: int = 0) -> None:
        """Append contacts to the present block of a trial."""
        self._contacts[b] += contacts

    def note(self, event: Event, b: int = 0) -> None:
        """Append an event to the present block of a trial."""
        self._events[b].append(event)

    def flush(self, b: int = 0) -> None:
        """Hand the frames and events of the present block of a trial to its sinks and begin the next block."""
        block, filled, cars = self._block, int(self._block.filled[b]), len(self._instances[b].starts)
        if not filled and not self._events[b]:
            return
        reals = block.reals[:, b, :filled, :cars].copy()
        whole = block.whole[:, b, :filled, :cars].copy()
        bits = block.bits[b, :filled, :cars].copy()
        for array in (reals, whole, bits):
            array.flags.writeable = False
        frames = Frames(
            self._first[b],
            self._instances[b].problem.rate,
            *reals,
            *whole,
            bits=bits,
            contacts=tuple(self._contacts[b]),
            events=tuple(self._events[b]),
        )
        self._first[b] += filled
        self._contacts[b], self._events[b] = [], []
        block.filled[b] = 0
        for sink in self._sinks[b]:
            sink.frames(frames)

    def end(self, ending: Ending, b: int = 0) -> None:
        """Hand the last block of a trial to its sinks, then the ending."""
        self.flush(b)
        for sink in self._sinks[b]:
            sink.end(ending)
