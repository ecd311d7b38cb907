"""A stream of random numbers inside kernels: the numbers that `kernels.philox.Draws` draws one by one."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from dubins_traffic.kernels.compile import jit
from dubins_traffic.kernels.philox import LOW
from dubins_traffic.kernels.random import DOWN, GRID, UP, block
from dubins_traffic.kernels.records import record

if TYPE_CHECKING:
    from dubins_traffic.kernels.arrays import Ints
    from dubins_traffic.kernels.philox import Draws


@record
class Stream:
    """A stream: what it is, and where it stands."""

    seed: np.uint64
    """The seed of all random numbers."""
    trial: int
    """Number of the trial."""
    purpose: int
    """Number of the stream."""
    drawn: int
    """How many words have been drawn."""
    first: np.uint64
    """The words of the block at which it stands: the first."""
    second: np.uint64
    """The second."""
    third: np.uint64
    """The third."""
    fourth: np.uint64
    """The fourth."""


def set_stream(stream: Stream, draws: Draws) -> None:
    """Let a stream be that of some draws, where these stand; they are to `go_to` where a kernel has left it."""
    stream.seed, stream.trial, stream.purpose, stream.drawn = (
        np.uint64(draws.seed),
        draws.trial,
        draws.stream,
        draws.drawn,
    )
    stream.first, stream.second, stream.third, stream.fourth = (np.uint64(word) for word in draws.block)


@jit
def next_word(stream: Stream) -> np.uint64:
    """Return the next 32 random bits."""
    place = stream.drawn & 3
    if place == 0:
        words = block(stream.seed, stream.trial, LOW, stream.drawn >> 2, stream.purpose)
        stream.first = words[0]
        stream.second = words[1]
        stream.third = words[2]
        stream.fourth = words[3]
    stream.drawn += 1
    if place == 0:
        return stream.first
    if place == 1:
        return stream.second
    return stream.third if place == 2 else stream.fourth


@jit
def next_uniform(stream: Stream) -> float:
    """Return the next float in [0, 1), on a grid of 2**-53."""
    high = next_word(stream)
    low = next_word(stream)
    return np.float64((high << UP) | (low >> DOWN)) * GRID


@jit
def next_below(stream: Stream, bound: int) -> int:
    """Return the next integer in [0, bound), `bound` (number) at most 2**32, every one equally likely."""
    limit = (1 << 32) - (1 << 32) % bound
    word = np.int64(next_word(stream))
    while word >= limit:
        word = np.int64(next_word(stream))
    return int(word % bound)


@jit
def shuffle(stream: Stream, order: Ints, count: int) -> None:
    """Write the integers 0..count-1 in random order, `count` (number) of them.

    `order` (K,) is set at its first `count` places; at others it may be anything.
    """
    for k in range(count):
        order[k] = k
    for k in range(count):
        pick = k + next_below(stream, count - k)
        held = order[pick]
        order[pick] = order[k]
        order[k] = held
