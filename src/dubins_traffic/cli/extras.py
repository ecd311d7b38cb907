"""Commands that need an optional extra."""

from __future__ import annotations

import contextlib
from collections.abc import Generator

from dubins_traffic.errors import MissingExtraError


@contextlib.contextmanager
def needs(feature: str, extra: str) -> Generator[None]:
    """Raise MissingExtraError where a library of an extra can't be imported in the body."""
    try:
        yield
    except ModuleNotFoundError as error:
        if (error.name or "").startswith("dubins_traffic"):
            raise
        raise MissingExtraError(feature, extra) from error
