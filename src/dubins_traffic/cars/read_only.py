"""Mappings that stay as they are: what a controller is told is what its judge goes by, in this and in later trials."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, NoReturn


class ReadOnly(dict[str, Any]):
    """A dictionary that can't be changed. It is pickled and copied as what it is; ``dict(it)`` can be changed.

    Examples
    --------
    >>> ReadOnly({"stop_time": 0.5})["stop_time"]
    0.5
    """

    def _refuse(self, *_arguments: object, **_more: object) -> NoReturn:
        raise TypeError("a problem is never changed: make a copy, by dict(...)")

    __setitem__ = __delitem__ = __ior__ = _refuse  # pyright: ignore[reportAssignmentType]
    clear = pop = popitem = setdefault = update = _refuse  # pyright: ignore[reportAssignmentType]

    def __reduce__(self) -> tuple[type[ReadOnly], tuple[dict[str, Any]]]:
        return ReadOnly, (dict(self),)


def read_only(values: Mapping[str, Any]) -> ReadOnly:
    """Return a mapping as one that stays as it is."""
    return values if isinstance(values, ReadOnly) else ReadOnly(values)
