"""The seam between a campaign's schedule and the processes or machines that run its chunks."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Generic, Protocol, TypeVar, runtime_checkable


class Numbered(Protocol):
    """Work that is pickled and sent to a worker: a chunk of a campaign, or an errand."""

    @property
    def number(self) -> int:
        """Its number, unique among all work under way."""
        ...


@runtime_checkable
class Errand(Numbered, Protocol):
    """Work for a worker other than a chunk of a campaign, such as the trials of a search."""

    def run(self, cancelled: Callable[[], bool]) -> bytes:
        """Do the work and return its result; call `cancelled` now and then, and raise if it returns true."""
        ...


Work = TypeVar("Work", bound=Numbered)


@dataclass(frozen=True, slots=True)
class Outcome(Generic[Work]):
    """The outcome of a chunk: its part of the table, or None if it was lost with its worker."""

    chunk: Work
    part: bytes | None


class Engine(Protocol[Work]):
    """Runs chunks, several at a time, and returns an outcome for every one, even if it was lost."""

    @property
    def capacity(self) -> int:
        """How many chunks may be under way: enough that no worker waits for the next."""
        ...

    def submit(self, chunk: Work) -> None:
        """Take a chunk to run."""
        ...

    def wait(self) -> Sequence[Outcome[Work]]:
        """Return the outcomes since the last call; wait for at least one if any chunk is under way."""
        ...

    def close(self) -> None:
        """Interrupt the chunks under way and free all resources."""
        ...
