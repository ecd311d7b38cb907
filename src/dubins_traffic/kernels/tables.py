"""Tables: named groups of arrays that kernels take as one argument, a pointer.

    class Roads(Tables):
        '''The roads of a batch.'''

        segment: Rows[Segment]
        vertex: Rows[Vertex]

    roads = Roads(segment=..., vertex=...)

Numba hands a tuple of arrays from function to function by value: hundreds of numbers, at which it works in every
function that is called, and which it copies out of Python's tuple at every call. What a kernel gets of a `Tables` is
the place where all that is known of its arrays stands (`compiling.lowering`), however many they are.
"""

from __future__ import annotations

import ctypes
from collections.abc import Iterator
from functools import cached_property
from typing import Any, ClassVar, NoReturn, Self, dataclass_transform

import numpy as np

from dubins_traffic.kernels.arrays import Ints


@dataclass_transform(frozen_default=True)
class Tables:
    """A group of arrays, single rows, and other such groups, with names; these are the annotations of the class.

    It can't be changed: what kernels know of the arrays is written down once.
    """

    field_names: ClassVar[tuple[str, ...]] = ()
    """Names of the arrays, in order."""

    def __init_subclass__(cls) -> None:
        names = tuple(name for name in vars(cls).get("__annotations__", {}) if name.islower())
        known = dict.fromkeys(name for base in cls.__bases__ for name in getattr(base, "field_names", ()))
        cls.field_names = (*known, *names)

    def __init__(self, *values: Any, **named: Any) -> None:
        fields = self.field_names
        given = {**dict(zip(fields, values, strict=False)), **named}
        if len(given) != len(values) + len(named) or given.keys() != set(fields):
            raise TypeError(f"{type(self).__name__} is made of {', '.join(fields)}")
        vars(self).update((name, given[name]) for name in fields)

    def __setattr__(self, name: str, value: object) -> NoReturn:
        raise AttributeError(f"{type(self).__name__} can't be changed; see replace")

    def __iter__(self) -> Iterator[Any]:
        return (vars(self)[name] for name in self.field_names)

    def __getitem__(self, places: slice) -> tuple[Any, ...]:
        """Return some of the arrays."""
        return tuple(self)[places]

    def __reduce__(self) -> tuple[type[Self], tuple[Any, ...]]:
        return type(self), tuple(self)

    def __repr__(self) -> str:
        return f"<{type(self).__name__}: {', '.join(self.field_names)}>"

    def replace(self, **changes: Any) -> Self:
        """Return these tables with some of them others."""
        return type(self)(**{**{name: vars(self)[name] for name in self.field_names}, **changes})

    @cached_property
    def description(self) -> Ints:
        """What kernels read: of each array its first element's address and its lengths, of a row its address."""
        words: list[int] = []
        for value in self:
            words += value.description.tolist() if isinstance(value, Tables) else _words(value)
        return np.array(words, dtype=np.int64)

    @cached_property
    def address(self) -> int:
        """Where `description` stands."""
        return self.description.ctypes.data


def _words(array: Any) -> list[int]:
    """Return an array's address and lengths; kernels take only those whose elements follow each other."""
    if isinstance(array, ctypes.Structure):
        return [ctypes.addressof(array)]
    if not array.flags.c_contiguous:
        raise TypeError("the elements of a table follow each other in memory")
    return [array.ctypes.data, *array.shape]
