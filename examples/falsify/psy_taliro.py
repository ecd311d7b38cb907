"""Optimizers of psy-taliro search for the worst case: `--strategy examples/falsify/psy_taliro.py:DualAnnealing`.

An optimizer of psy-taliro asks for the costs of samples. So it runs in a thread of its own: the samples for which it
asks are what is proposed, and the margins of these trials are their costs. `UniformRandom` asks for many at a time.
"""

from __future__ import annotations

import itertools
import math
import queue
import threading
from collections.abc import Iterable, Sequence

import numpy as np
from staliro import optimizers
from staliro.signals import Interval

from dubins_traffic.falsification.plugged import Space, Trial

FAR = 100.0
"""Cost of a trial that says nothing of the ego, or in which it came near no breach."""


BUDGET = 10_000
"""Most trials for which an optimizer asks; `UniformRandom` draws all before the first one."""
AT_A_TIME = 64
"""Of many samples for which it asks together so many are proposed at a time."""


class PsyTaliro:
    """The base of all: lets an optimizer propose."""

    optimizer: type[optimizers.Optimizer[float, object]]

    def begin(self, space: Space) -> None:
        """Let the optimizer ask for its first samples."""
        self._samples: queue.SimpleQueue[list[list[float]]] = queue.SimpleQueue()
        self._costs: queue.SimpleQueue[list[float]] = queue.SimpleQueue()
        bounds = [Interval(0.0, 1.0)] * space.size
        given = optimizers.Optimizer.Params(seed=space.seed, budget=BUDGET, input_bounds=bounds)

        def search() -> None:
            self.optimizer().optimize(self, given)
            self._samples.put([])

        threading.Thread(target=search, daemon=True).start()

    def eval_sample(self, sample: optimizers.Sample) -> float:
        """Return the cost of a sample: the optimizer asks."""
        return self.eval_samples([sample])[0]

    def eval_samples(self, samples: Iterable[optimizers.Sample]) -> list[float]:
        """Return the costs of samples: the optimizer asks."""
        every, costs = iter(samples), list[float]()
        while some := list(itertools.islice(every, AT_A_TIME)):
            self._samples.put([np.clip(sample.values, 0.0, 1.0).tolist() for sample in some])
            costs += self._costs.get()
        return costs

    def propose(self, history: Sequence[Trial]) -> list[list[float]]:
        """Return the samples for which the optimizer asks."""
        del history
        return self._samples.get()

    def tell(self, results: Sequence[Trial]) -> None:
        """Answer the optimizer."""
        margins = [FAR if own.margin is None else own.margin for own in results]
        self._costs.put([FAR if math.isinf(margin) else margin for margin in margins])


class DualAnnealing(PsyTaliro):
    """Generalized simulated annealing, one trial after another."""

    optimizer = optimizers.DualAnnealing


class UniformRandom(PsyTaliro):
    """Draws."""

    optimizer = optimizers.UniformRandom
