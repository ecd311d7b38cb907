"""Where chunks are run: the seam between a campaign's schedule and processes or machines."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Protocol

from dubins_traffic.campaign.chunks import Chunk


@dataclass(frozen=True, slots=True)
class Outcome:
    """What became of a chunk: its part of the table, or None if it was lost with its worker."""

    chunk: Chunk
    part: bytes | None


class Engine(Protocol):
    """Runs chunks, several at a time, and loses none without saying so."""

    @property
    def capacity(self) -> int:
        """How many chunks may be under way: enough that no worker waits for the next."""
        ...

    def submit(self, chunk: Chunk) -> None:
        """Take a chunk to run."""
        ...

    def wait(self) -> Sequence[Outcome]:
        """Return what has become of chunks since the last call, at least one if any is under way."""
        ...

    def close(self) -> None:
        """Interrupt the chunks under way and free all resources."""
        ...
