"""The counter-based generator Philox4x32-10, in plain Python integers or compiled.

Every random number is a function of (seed, trial, car, tick, draw): no state, no order, no global generator.

Source: J. Salmon, M. Moraes, R. Dror, D. Shaw, "Parallel random numbers: as easy as 1, 2, 3", SC 2011.
Products of two 32-bit words fit 64 bits, so that nothing overflows in either mode.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from dubins_traffic.errors import InputError

if TYPE_CHECKING:
    from typing import Any

M0 = np.uint64(0xD2511F53)
M1 = np.uint64(0xCD9E8D57)
W0 = np.uint64(0x9E3779B9)
W1 = np.uint64(0xBB67AE85)
LOW = np.uint64(0xFFFFFFFF)
HALF = np.uint64(32)
SEEDS = 2**64


def philox4x32(c0: Any, c1: Any, c2: Any, c3: Any, k0: Any, k1: Any) -> tuple[Any, Any, Any, Any]:
    """Return four random 32-bit words (as uint64) of the counter (c0..c3) under the key (k0, k1)."""
    for _ in range(10):
        p0 = M0 * c0
        p1 = M1 * c2
        c0, c1, c2, c3 = (p1 >> HALF) ^ c1 ^ k0, p1 & LOW, (p0 >> HALF) ^ c3 ^ k1, p0 & LOW
        k0 = (k0 + W0) & LOW
        k1 = (k1 + W1) & LOW
    return c0, c1, c2, c3


class Draws:
    """A stream of random numbers for drawing instances, without compiled code.

    Parameters
    ----------
    seed : int
        Root seed, 0 <= seed < 2**64.
    trial : int
        Number of the trial, 0 <= trial < 2**32.
    stream : int
        What is drawn: each purpose has a stream of its own, 0 <= stream < 2**32.

    Raises
    ------
    InputError
        If the seed is out of range.

    Notes
    -----
    The counter is (trial, 0xFFFFFFFF, position, stream): cars have numbers below 0xFFFFFFFF, so these numbers
    never meet those of a running trial.
    """

    def __init__(self, seed: int, trial: int, stream: int) -> None:
        if not 0 <= seed < SEEDS:
            raise InputError(
                "not a seed", field="seed", value=seed, expected=f"an integer >= 0 and < {SEEDS}"
            )
        self._key = (np.uint64(seed & 0xFFFFFFFF), np.uint64(seed >> 32))
        self._trial = np.uint64(trial)
        self._stream = np.uint64(stream)
        self._position = 0
        self._words: list[int] = []

    def word(self) -> int:
        """Return the next 32 random bits."""
        if not self._words:
            block = philox4x32(self._trial, LOW, np.uint64(self._position), self._stream, *self._key)
            self._words = [int(word) for word in reversed(block)]
            self._position += 1
        return self._words.pop()

    def uniform(self, low: float = 0.0, high: float = 1.0) -> float:
        """Return a float in [low, high), on a grid of 2**-53 of the interval."""
        bits = (self.word() << 21) | (self.word() >> 11)
        return low + (high - low) * (bits * 2.0**-53)

    def below(self, bound: int) -> int:
        """Return an integer in [0, bound), every one equally likely (bound <= 2**32)."""
        limit = (1 << 32) - (1 << 32) % bound
        while True:
            word = self.word()
            if word < limit:
                return word % bound

    def between(self, low: int, high: int) -> int:
        """Return an integer in [low, high], both included."""
        return low + self.below(high - low + 1)

    def sample(self, count: int, bound: int) -> list[int]:
        """Return `count` distinct integers in [0, bound), in random order."""
        pool: dict[int, int] = {}
        chosen: list[int] = []
        for k in range(count):
            pick = self.between(k, bound - 1)
            chosen.append(pool.get(pick, pick))
            pool[pick] = pool.get(k, k)
        return chosen

    def shuffled(self, count: int) -> list[int]:
        """Return the integers 0..count-1 in random order."""
        return self.sample(count, count)
