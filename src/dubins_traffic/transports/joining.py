"""A transport that has just been opened, and is refused: others drive there already."""

from __future__ import annotations

from collections.abc import Callable, Generator
from contextlib import contextmanager

from dubins_traffic.errors import TransportError


@contextmanager
def closing_if_refused(close: Callable[[], None]) -> Generator[None]:
    """Call `close` if the body raises TransportError, which goes on."""
    try:
        yield
    except TransportError:
        close()
        raise
