"""How a search proposes what to try next: at random, by evolution, or by CMA-ES."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any, Final, Protocol

from dubins_traffic.errors import InputError
from dubins_traffic.falsification.continuous import Cma
from dubins_traffic.falsification.evolution import Evolution
from dubins_traffic.falsification.genome import Genome
from dubins_traffic.falsification.sampling import Source

if TYPE_CHECKING:
    from dubins_traffic.falsification.trying import Tried


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
