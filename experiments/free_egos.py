"""Egos as free programs under the shield, many at a time, for `experiments.contract`.

`Free` does as the law says, or a share of it, or stands, or drives and turns as it likes, each for a while, and the
shield keeps it clean. `Stands` stands where it starts.
"""

from __future__ import annotations

import hashlib
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Final
from weakref import WeakKeyDictionary

import numpy as np
from tests.mutated import Block, Mutant, Seen

from dubins_traffic.cars.state import EGO
from dubins_traffic.shield.car_shields import EgoShields

if TYPE_CHECKING:
    from collections.abc import Sequence

    from dubins_traffic.engine.controlled import BatchView
    from dubins_traffic.kernels.arrays import Floats
    from dubins_traffic.problem.instance import Problem

SHORT, LONG, LONGEST = 0.2, 8.0, 70.0
"""Seconds of a whim; it stands for up to the longest."""
LAWFUL: Final = 0.4
"""Share of the whims in which it does as the law says, in a third of these at a share of its speed."""
STANDS: Final = 0.4
"""Of the others, in which it stands."""


@dataclass(frozen=True, slots=True)
class _Whims:
    """The shields of the egos of a block, and what each likes to do: share, speed and yaw rate, until which tick."""

    shields: EgoShields
    own: Floats
    until: Floats
    dice: dict[int, np.random.Generator] = field(default_factory=dict[int, np.random.Generator])


class Free(Mutant):
    """Drives as it likes under the shield; what it likes follows from the problem and from where it starts."""

    def __init__(self) -> None:
        self._whims: WeakKeyDictionary[Block, _Whims] = WeakKeyDictionary()

    def prepare(self, block: Block) -> None:
        """Give the egos of a block their shields; they have no whims yet."""
        count, traffic = len(block.problems), block.traffic
        shields = EgoShields(block.problems, traffic.state, traffic.labels)
        self._whims[block] = _Whims(shields, np.zeros((count, 3)), np.zeros(count))

    def driven(self, view: Seen, answer: Floats) -> Floats:
        """Return what the egos like to do, as far as the shield lets them."""
        block, rows, whims = view.block, view.rows, self._whims[view.block]
        for k in np.flatnonzero(whims.until[rows] <= view.tick).tolist():
            row, problem = int(rows[k]), block.problems[int(rows[k])]
            if row not in whims.dice:
                x, y = float(view.state.x[k, EGO]), float(view.state.y[k, EGO])
                whims.dice[row] = _dice(problem, x, y)
            whims.until[row] = view.tick[k] + _think(whims.dice[row], problem, whims.own[row])
        share, own = whims.own[rows, :1], whims.own[rows, 1:]
        block.commands[:, EGO] = 0.0
        block.commands[rows, EGO] = np.where(share >= 0.0, share * answer, own)
        ticks = np.full(len(block.problems), -1)
        ticks[rows] = view.tick
        whims.shields.filter(ticks, block.commands)
        return block.commands[rows, EGO]


def _dice(problem: Problem, x: float, y: float) -> np.random.Generator:
    """Return where the whims of an ego come from that starts at (x, y)."""
    text = f"{problem.goals} {x + 0.0} {y + 0.0}".encode()
    return np.random.default_rng(int.from_bytes(hashlib.sha256(text).digest()[:8], "big"))


def _think(dice: np.random.Generator, problem: Problem, whim: Floats) -> float:
    """Write what the ego likes to do next: share of the law, or -1, speed and yaw rate; return its ticks."""
    bounds, seconds = problem.car.bounds, SHORT * (LONG / SHORT) ** dice.random()
    whim[:] = 1.0, 0.0, 0.0
    if dice.random() < LAWFUL:
        whim[0] = 1.0 if dice.random() < 2.0 / 3.0 else dice.random()
    elif dice.random() < STANDS:
        whim[0] = 0.0
        seconds = SHORT * (LONGEST / SHORT) ** dice.random()
    else:
        yaw_rate = bounds.yaw_rate * dice.uniform(-1.0, 1.0) if dice.random() < 0.5 else 0.0
        whim[:] = -1.0, bounds.speed * dice.uniform(-1.0, 1.0), yaw_rate
    return max(1.0, seconds * problem.rate)


class Stands:
    """Stands where it starts."""

    def start(self, problem: Problem) -> None:
        """There is nothing to begin."""

    def act(self, observation: object) -> tuple[float, float]:
        """Stand."""
        del observation
        return 0.0, 0.0

    def start_batch(self, trials: Sequence[int], problems: Sequence[Problem]) -> None:
        """There is nothing to begin."""

    def act_batch(self, view: BatchView) -> Floats:
        """Stand in all trials."""
        return np.zeros((len(view.trial), 2))
