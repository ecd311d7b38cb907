"""Tables with names: rows of structured arrays, whose fields compiled kernels and plain Python read by name.

A class with annotated fields says what a row holds; `record` makes it the type of the rows of a NumPy array:

    @record
    class Driver:
        waited: int
        '''Ticks for which something has been in its way.'''
        lane: int = -1
        '''The lane driven, -1 before the first.'''

    drivers = table(Driver, (trials, cars))
    drivers[b, n].waited += 1

Compiled, a row is a pointer and a field a load at a fixed distance from it (Numba's `Record`), so that a kernel that
takes a row takes one argument, however many fields it has.
"""

from __future__ import annotations

from collections.abc import Callable
from operator import itemgetter
from typing import Any, Protocol, TypeVar, cast, dataclass_transform, get_type_hints, overload

import numpy as np
import numpy.typing as npt

from dubins_traffic.kernels.arrays import Ints

R = TypeVar("R")
R_co = TypeVar("R_co", covariant=True)

KINDS: dict[Any, str] = {int: "i8", float: "f8", np.uint64: "u8"}
"""What a field may be, and how it is kept: eight bytes each."""


class Rows(Protocol[R_co]):
    """A NumPy array whose elements are rows of one record: what kernels see of it."""

    @property
    def shape(self) -> tuple[int, ...]:
        """Lengths of the array's axes."""
        ...

    @overload
    def __getitem__(self, place: str) -> npt.NDArray[Any]: ...
    @overload
    def __getitem__(self, place: int | tuple[int, ...]) -> R_co: ...
    @overload
    def __getitem__(self, place: Ints) -> Rows[R_co]: ...
    def __getitem__(self, place: str | int | tuple[int, ...] | Ints) -> Any:
        """Return the row at a place with a number for each axis, a field of all rows as an array, or some rows."""
        ...

    def __setitem__(self, place: str | int | tuple[int, ...], value: Any) -> None:
        """Write a row, or a field of all rows."""
        ...

    def __len__(self) -> int: ...


@dataclass_transform(kw_only_default=True)
def record(kind: type[R]) -> type[R]:
    """Make a class with annotated fields the type of the rows of structured arrays.

    Parameters
    ----------
    kind : type
        Its annotations are the fields, in order: ``int``, ``float`` or ``numpy.uint64``. A value given to a field is
        its value in a new row, else that is 0.

    Raises
    ------
    TypeError
        If a field is annotated otherwise.
    """
    fields = get_type_hints(kind)
    if not fields or any(hint not in KINDS for hint in fields.values()):
        raise TypeError(f"{kind.__name__}: the fields of a record are annotated int, float or numpy.uint64")
    members: dict[str, Any] = {name: property(itemgetter(name), _setter(name)) for name in fields}
    members |= {
        "__doc__": kind.__doc__,
        "__module__": kind.__module__,
        "__qualname__": kind.__qualname__,
        "__slots__": (),
        "FIRST_VALUES": {name: vars(kind)[name] for name in fields if name in vars(kind)},
    }
    row = type(kind.__name__, (np.void,), members)
    layout = np.dtype([(name, KINDS[hint]) for name, hint in fields.items()], align=True)
    cast(Any, row).LAYOUT = np.dtype((row, layout))
    return cast(type[R], row)


def _setter(name: str) -> Callable[[Any, Any], None]:
    def put(row: Any, value: Any) -> None:
        row[name] = value

    return put


def layout(kind: type[Any]) -> np.dtype[Any]:
    """Return the dtype of the rows of a record."""
    return kind.LAYOUT


def table(kind: type[R], shape: int | tuple[int, ...]) -> Rows[R]:
    """Return an array of new rows of a record, each with the first values of its fields.

    Parameters
    ----------
    kind : type
        A class made by `record`.
    shape : int or tuple of int
        Lengths of the axes.
    """
    rows: Any = np.zeros(shape, dtype=layout(kind))
    for name, value in cast(Any, kind).FIRST_VALUES.items():
        rows[name] = value
    return rows
