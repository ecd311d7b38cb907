"""The counter-based generator Philox4x32-10, in plain Python integers or compiled.

Every random number is a function of (seed, trial, car, tick, draw): no state, no order, no global generator.

Source: J. Salmon, M. Moraes, R. Dror, D. Shaw, "Parallel random numbers: as easy as 1, 2, 3", SC 2011.
Products of two 32-bit words fit 64 bits, so that nothing overflows in either mode.
"""

from __future__ import annotations

from types import FunctionType
from typing import Any

import numpy as np

from dubins_traffic.errors import InputError

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


_PLAIN: dict[str, Any] = {
    name: int(word) for name, word in (("M0", M0), ("M1", M1), ("W0", W0), ("W1", W1), ("LOW", LOW), ("HALF", HALF))
}
_plain_philox = FunctionType(philox4x32.__code__, _PLAIN | {"range": range})
"""The same function on plain integers, in a fifth of the time that NumPy's take where nothing is compiled."""


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

    Attributes
    ----------
    drawn : int
        How many words have been drawn.

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
            raise InputError("not a seed", field="seed", value=seed, expected=f"an integer >= 0 and < {SEEDS}")
        self.seed, self.trial, self.stream = seed, int(trial), int(stream)
        self.drawn = 0
        self._block: tuple[int, int, int, int] = (0, 0, 0, 0)

    @property
    def block(self) -> tuple[int, int, int, int]:
        """The four words of the position at which the stream stands; any, where it is about to go to the next."""
        return self._block

    def go_to(self, drawn: int) -> None:
        """Go on as after so many words."""
        if drawn & 3:
            self._block = self._words(drawn >> 2)
        self.drawn = drawn

    def word(self) -> int:
        """Return the next 32 random bits."""
        at = self.drawn & 3
        if not at:
            self._block = self._words(self.drawn >> 2)
        self.drawn += 1
        return self._block[at]

    def _words(self, position: int) -> tuple[int, int, int, int]:
        key = self.seed & 0xFFFFFFFF, self.seed >> 32
        return _plain_philox(self.trial, 0xFFFFFFFF, position, self.stream, *key)

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
