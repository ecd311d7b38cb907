"""How a search proposes what to try next: at random, by evolution, or by CMA-ES."""

from __future__ import annotations

from bisect import insort
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any, Final, Protocol

from dubins_traffic.errors import InputError
from dubins_traffic.falsification.continuous import Cma
from dubins_traffic.falsification.sampling import Genome, Source

if TYPE_CHECKING:
    from dubins_traffic.falsification.trying import Tried

FRESH: Final = 0.15
"""Share of proposals of an evolution that are drawn at random."""
POPULATION: Final = 16
"""Most genomes that an evolution keeps for each target."""
PRESSURE: Final = 2.0
"""The larger, the more often the best are taken as parents."""


class Strategy(Protocol):
    """Proposes genomes, and is told what came of them."""

    def propose(self, numbers: Sequence[int]) -> list[Genome]:
        """Return the genomes of the trials with these numbers, which follow one another."""
        ...

    def tell(self, number: int, genome: Genome, tried: Tried, known: bool) -> None:
        """Learn what came of a trial; `known`: the ego broke a rule, in a way that the archive has already."""
        ...

    def state(self) -> Any:
        """Return what a search that is resumed needs to go on as if it had never stopped, for JSON."""
        ...

    def restore(self, state: Any) -> None:
        """Take over what `state` gave."""
        ...


class Uniform:
    """Draws every trial anew."""

    def __init__(self, source: Source, targets: Sequence[str]) -> None:  # noqa: ARG002  # as all strategies
        self._source = source

    def propose(self, numbers: Sequence[int]) -> list[Genome]:
        """Return new genomes."""
        self._source.forget(set())
        self._source.draw(numbers)
        return [self._source.fresh(number) for number in numbers]

    def tell(self, number: int, genome: Genome, tried: Tried, known: bool) -> None:
        """Nothing is learnt."""

    def state(self) -> Any:
        """Return nothing."""
        return None

    def restore(self, state: Any) -> None:
        """Nothing is to be restored."""


@dataclass(order=True, slots=True)
class _Kept:
    margin: float
    number: int
    genome: Genome = field(compare=False)


class Evolution:
    """Changes the choices of the trials that came nearest to breaking each of the rules asked for.

    Trial n is about target n modulo their number. Its parent is one of the `POPULATION` trials of the least margins, of
    any target's trials; a share is drawn anew. A parent whose child breaks a rule as the archive knows already is left.
    """

    def __init__(self, source: Source, targets: Sequence[str]) -> None:
        self._source, self._targets = source, tuple(targets)
        self._best: dict[str, list[_Kept]] = {target: [] for target in targets}
        self._parents: dict[int, tuple[str, int]] = {}

    def propose(self, numbers: Sequence[int]) -> list[Genome]:
        """Return new genomes and children of those kept."""
        self._parents.clear()
        fresh: list[int] = []
        children: dict[int, Genome] = {}
        for number in numbers:
            target = self._targets[number % len(self._targets)]
            best, dice = self._best[target], self._source.dice(number)
            if not best or dice.random() < FRESH:
                fresh.append(number)
                continue
            parent = best[int(len(best) * dice.random() ** PRESSURE)]
            self._parents[number] = target, parent.number
            children[number] = self._source.varied(parent.genome, dice)
        self._source.forget({own.genome.base for best in self._best.values() for own in best})
        self._source.draw(fresh)
        return [children[number] if number in children else self._source.fresh(number) for number in numbers]

    def tell(self, number: int, genome: Genome, tried: Tried, known: bool) -> None:
        """Keep a trial for the targets to which it came near."""
        if known:
            if number in self._parents:
                target, parent = self._parents[number]
                self._best[target] = [own for own in self._best[target] if own.number != parent]
            return
        if tried.discarded or tried.faulty:
            return
        for target in self._targets:
            margin = tried.margins.get(target)
            best = self._best[target]
            if margin is None or margin < 0.0 or (len(best) == POPULATION and margin >= best[-1].margin):
                continue
            insort(best, _Kept(margin, number, genome))
            del best[POPULATION:]

    def state(self) -> Any:
        """Return the genomes kept."""
        return {
            target: [[own.margin, own.number, own.genome.to_json()] for own in best]
            for target, best in self._best.items()
        }

    def restore(self, state: Any) -> None:
        """Take over the genomes kept."""
        for target, best in state.items():
            self._best[target] = [
                _Kept(margin, number, Genome.from_json(own)) for margin, number, own in best
            ]


STRATEGIES: Final[Mapping[str, type[Uniform | Evolution | Cma]]] = {
    "uniform": Uniform,
    "evolution": Evolution,
    "cma": Cma,
}


def make(name: str, source: Source, targets: Sequence[str]) -> Strategy:
    """Return the strategy that a name stands for.

    Raises
    ------
    InputError
        If there is none.
    """
    if name not in STRATEGIES:
        expected = f"one of {', '.join(STRATEGIES)}"
        raise InputError("no such strategy", file="--strategy", value=name, expected=expected)
    return STRATEGIES[name](source, targets)
