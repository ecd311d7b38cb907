"""CMA-ES on all numbers of the tables of one drawn trial (optional extra ``falsify``)."""

from __future__ import annotations

from collections.abc import Sequence
from importlib import import_module
from typing import TYPE_CHECKING, Any, Final

import numpy as np

from dubins_traffic.agents.choices import BOUNDS, CHOICE
from dubins_traffic.errors import MissingExtraError
from dubins_traffic.falsification.genome import Genome
from dubins_traffic.falsification.sampling import Source, Stream
from dubins_traffic.kernels.arrays import Floats

if TYPE_CHECKING:
    from dubins_traffic.falsification.trying import Tried

STEP: Final = 0.3
"""Standard deviation of the first proposals, in shares of the ranges."""
AWAY: Final = 1e6
"""Stands for the margin of a trial that could not come near the rule."""


class Cma:
    """Proposes tables for one drawn trial by CMA-ES; a generation is about one target, the next about the next.

    It begins anew, with another drawn trial, where it has converged or found a failure.

    Source: N. Hansen, "The CMA evolution strategy: a tutorial", arXiv:1604.00772.

    Raises
    ------
    MissingExtraError
        Without the extra `falsify`.
    """

    def __init__(self, source: Source, targets: Sequence[str]) -> None:
        try:
            self._cma: Any = import_module("cma")
        except ImportError as error:
            raise MissingExtraError("--strategy cma", "falsify") from error
        self._source, self._targets = source, tuple(targets)
        self._climbs: dict[str, _Climb] = {}
        self._past: list[tuple[int, int, list[float | None]]] = []
        self._numbers: list[int] = []
        self._values: list[float | None] = []

    def propose(self, numbers: Sequence[int]) -> list[Genome]:
        """Return the next proposals for one target."""
        self._numbers, self._values = list(numbers), []
        target = self._target()
        if target not in self._climbs:
            self._climbs[target] = _Climb(self._cma, self._source, numbers[0])
        self._source.forget({own.base for own in self._climbs.values()})
        return self._climbs[target].ask(len(numbers))

    def tell(self, number: int, genome: Genome, tried: Tried, known: bool) -> None:  # noqa: ARG002  # as all strategies
        """Learn what came of a proposal; after the last one of a generation the target's proposals move."""
        margin = None if tried.discarded or tried.faulty else tried.margins.get(self._target(), AWAY)
        self._hear(margin if margin is None or np.isfinite(margin) else AWAY)

    def state(self) -> Any:
        """Return all that was told, from which `restore` goes the same way again."""
        return [[first, count, values] for first, count, values in self._past]

    def restore(self, state: Any) -> None:
        """Go the way again that led to a state."""
        for first, count, values in state:
            self.propose(range(first, first + count))
            for value in values:
                self._hear(value)

    def _hear(self, value: float | None) -> None:
        self._values.append(value)
        if len(self._values) < len(self._numbers):
            return
        self._past.append((self._numbers[0], len(self._numbers), self._values))
        target = self._past_target()
        if self._climbs[target].tell(self._values):
            del self._climbs[target]

    def _target(self) -> str:
        return self._targets[len(self._past) % len(self._targets)]

    def _past_target(self) -> str:
        return self._targets[(len(self._past) - 1) % len(self._targets)]


class _Climb:
    """One run of CMA-ES, on the tables of the cars of the drawn trial `base`."""

    def __init__(self, cma: Any, source: Source, base: int) -> None:
        self.base = base
        drawn = source.fresh(base)
        self._whims = drawn.whims
        self._shapes = {car: table.shape for car, table in drawn.tables.items()}
        size = max(2, sum(rows * columns for rows, columns in self._shapes.values()))
        dice = source.dice(base, Stream.CHOICES)

        def normal(*shape: int) -> Floats:
            return dice.standard_normal(shape)

        options = {"bounds": [0.0, 1.0], "verbose": -9, "seed": np.nan, "randn": normal}
        self._strategy = cma.CMAEvolutionStrategy(size * [0.5], STEP, options)
        self._asked: list[Floats] = []

    def ask(self, count: int) -> list[Genome]:
        """Return proposals."""
        self._asked = self._strategy.ask(count)
        return [self._genome(np.asarray(point)) for point in self._asked]

    def tell(self, values: Sequence[float | None]) -> bool:
        """Move to where the values are least; tell whether it is over."""
        known = [AWAY if value is None else value for value in values]
        if min(known) < 0.0 or len(known) < self._strategy.popsize:
            return min(known) < 0.0
        self._strategy.tell(self._asked, known)
        return bool(self._strategy.stop())

    def _genome(self, point: Floats) -> Genome:
        low, high = BOUNDS[:, 0], BOUNDS[:, 1]
        tables: dict[int, Floats] = {}
        done = 0
        for car, (rows, columns) in self._shapes.items():
            share = point[done : done + rows * columns].reshape(rows, columns)
            done += rows * columns
            tables[car] = low + (high - low) * share
            exits = np.minimum(np.floor(share[:, CHOICE.EXIT] * (high[CHOICE.EXIT] + 1)), high[CHOICE.EXIT])
            tables[car][:, CHOICE.EXIT] = exits
        return Genome(self.base, self.base, {}, tables, self._whims)
