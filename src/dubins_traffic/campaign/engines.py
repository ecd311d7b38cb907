"""Where chunks are run: the seam between a campaign's schedule and processes or machines."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Generic, Protocol, TypeVar, runtime_checkable


class Numbered(Protocol):
    """What a worker is handed, pickled: a chunk of a campaign, or an errand."""

    @property
    def number(self) -> int:
        """Its number, which tells it from all others that are under way."""
        ...


@runtime_checkable
class Errand(Numbered, Protocol):
    """What a worker is sent for that is no chunk of a campaign, such as the trials of a search."""

    def run(self, cancelled: Callable[[], bool]) -> bytes:
        """Do it, and return what came of it; ask now and then whether it is `cancelled`, and if so raise."""
        ...


Work = TypeVar("Work", bound=Numbered)


@dataclass(frozen=True, slots=True)
class Outcome(Generic[Work]):
    """What became of a chunk: its part of the table, or None if it was lost with its worker."""

    chunk: Work
    part: bytes | None


class Engine(Protocol[Work]):
    """Runs chunks, several at a time, and loses none without saying so."""

    @property
    def capacity(self) -> int:
        """How many chunks may be under way: enough that no worker waits for the next."""
        ...

    def submit(self, chunk: Work) -> None:
        """Take a chunk to run."""
        ...

    def wait(self) -> Sequence[Outcome[Work]]:
        """Return what has become of chunks since the last call, at least one if any is under way."""
        ...

    def close(self) -> None:
        """Interrupt the chunks under way and free all resources."""
        ...
