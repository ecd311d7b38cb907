"""Random numbers inside kernels: functions of (seed, trial, car, tick, draw) and of nothing else.

`draw` numbers the purposes within one car and tick: `DRAW`.
"""

from __future__ import annotations

from typing import Any, Final, NamedTuple

import numpy as np

from dubins_traffic.kernels.compile import jit
from dubins_traffic.kernels.philox import HALF, LOW
from dubins_traffic.kernels.philox import philox4x32 as _plain_philox

philox4x32 = jit(_plain_philox)

UP = np.uint64(21)
DOWN = np.uint64(11)
GRID = 2.0**-53


class _Draw(NamedTuple):
    """The first number that is drawn for each purpose; those of e-agents are below 100, of disturbances from 200."""

    LANE: int = 0
    """The lane in which an e-agent that wanders leaves an intersection."""
    TURN: int = 1
    """Whether an e-agent whose patience ended turns round."""
    RULES: int = 20
    """What cars by the rules do, eleven numbers: exits take four, violations six, places one."""
    NUDGE: int = 40
    """How much faster or slower a nudged e-agent drives."""
    FREE: int = 60
    """What a free e-agent likes to do, eight numbers."""
    POSITION: int = 200
    """Noise of a sensed position, six numbers."""
    HEADING: int = 206
    """Noise of a sensed heading, three numbers."""
    LOSS: int = 250
    """Whether a command is lost."""
    PLAY: int = 300
    """What the environment of a game does."""


DRAW: Final = _Draw()
CUT: Final = 3.0
"""The noise of what is sensed has at most so many standard deviations."""


@jit
def block(seed: Any, trial: Any, car: Any, tick: Any, draw: Any) -> tuple[Any, Any, Any, Any]:
    """Return four random 32-bit words, as uint64.

    Parameters
    ----------
    seed : uint64
        The seed of all random numbers, 0 to 2**64 - 1.
    trial, car, tick, draw : uint64
        The counter: trial and car by their numbers, the tick, and which of the numbers drawn in it; each below 2**32.
    """
    return philox4x32(np.uint64(trial), np.uint64(car), np.uint64(tick), np.uint64(draw), seed & LOW, seed >> HALF)


@jit
def uniform(seed: Any, trial: Any, car: Any, tick: Any, draw: Any) -> float:
    """Return a float in [0, 1), on a grid of 2**-53.

    Parameters
    ----------
    seed, trial, car, tick, draw : uint64
        The seed and the counter, numbers as in `block`.
    """
    a, b, _, _ = block(seed, trial, car, tick, draw)
    return np.float64((a << UP) | (b >> DOWN)) * GRID


@jit
def below(seed: Any, trial: Any, car: Any, tick: Any, draw: Any, bound: Any) -> Any:
    """Return an integer in [0, bound).

    Parameters
    ----------
    seed, trial, car, tick, draw : uint64
        The seed and the counter, numbers as in `block`.
    bound : uint64
        A number <= 2**16, so that the bias is below 2**-16 per value.
    """
    a, _, _, _ = block(seed, trial, car, tick, draw)
    return np.int64((a * np.uint64(bound)) >> HALF)


@jit
def bell(seed: Any, trial: Any, car: Any, tick: Any, draw: Any) -> float:
    """Return a number of mean 0 and variance 1, close to normal and bounded by 6: the sum of twelve uniform
    32-bit fractions less 6 (Irwin-Hall). Uses the draws `draw`, `draw` + 1 and `draw` + 2.

    Parameters
    ----------
    seed, trial, car, tick, draw : uint64
        The seed and the counter, numbers as in `block`.
    """
    total = 0.0
    for k in range(3):
        a, b, c, d = block(seed, trial, car, tick, draw + k)
        total += (np.float64(a) + np.float64(b)) + (np.float64(c) + np.float64(d))
    return (total + 6.0) * 2.0**-32 - 6.0


@jit
def cut_bell(seed: Any, trial: Any, car: Any, tick: Any, draw: Any) -> float:
    """Return what `bell` does, moved within CUT.

    Parameters
    ----------
    seed, trial, car, tick, draw : uint64
        The seed and the counter, numbers as in `block`.
    """
    return min(max(bell(seed, trial, car, tick, draw), -CUT), CUT)
