"""Machines that read the environment's propositions and answer with the system's, whatever file they come from."""

from __future__ import annotations

from collections.abc import Collection, Hashable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, NamedTuple, Protocol, TypeAlias

from dubins_traffic.errors import InputError

State: TypeAlias = Hashable
Letter: TypeAlias = Mapping[str, bool]
"""Propositions and whether they hold."""


class Sides(NamedTuple):
    """Which propositions a machine reads, and which it answers."""

    read: Collection[str]
    answered: Collection[str]


MOST_BYTES = 64 << 20
"""Most bytes of a file of a strategy."""


class Machine(Protocol):
    """A Mealy machine."""

    @property
    def names(self) -> Sequence[str]:
        """All propositions that it knows, read or answered."""
        ...

    @property
    def sides(self) -> Sides | None:
        """Which of them it reads and which it answers; None where its file does not say."""
        ...

    def begin(self) -> State:
        """Return the state before the first letter."""
        ...

    def step(self, state: State, letter: Letter) -> tuple[State, Letter] | None:
        """Return the next state and the answer to a letter, None where the machine has none."""
        ...


@dataclass(frozen=True)
class Edge:
    """A way out of a state: what must hold of its propositions (`cube`), and where it leads."""

    cube: Letter
    target: State

    def answer(self, letter: Letter, outputs: Sequence[str]) -> dict[str, bool] | None:
        """Return the outputs, those that are free false; None where the edge is not for a letter."""
        if any(self.cube.get(name, value) != value for name, value in letter.items()):
            return None
        return {name: self.cube.get(name, False) for name in outputs}


@dataclass(frozen=True)
class Explicit:
    """A machine given by its edges; of several that fit a letter the first is taken."""

    edges: Mapping[State, Sequence[Edge]]
    """Of each state."""
    first: State
    """The state before the first letter."""
    names: Sequence[str]
    """All propositions."""
    sides: Sides | None = None
    """Which of them it reads and which it answers; None where its file does not say."""
    _outputs: dict[frozenset[str], list[str]] = field(
        default_factory=dict[frozenset[str], list[str]], init=False, repr=False, compare=False
    )

    def begin(self) -> State:
        """Return the state before the first letter."""
        return self.first

    def step(self, state: State, letter: Letter) -> tuple[State, Letter] | None:
        """Return the next state and the answer to a letter, None where no edge fits."""
        read = frozenset(letter)
        outputs = self._outputs.setdefault(read, [name for name in self.names if name not in read])
        for edge in self.edges.get(state, ()):
            answer = edge.answer(letter, outputs)
            if answer is not None:
                return edge.target, answer
        return None


def damaged(what: str, problem: str, *, line: int | None = None, **values: Any) -> InputError:
    """Return the error for a file of a strategy that is not as its format says; `value` is what was found there."""
    where = None if line is None else f"line {line}"
    return InputError(problem, field=where, expected=f"a strategy in {what}", **values)
