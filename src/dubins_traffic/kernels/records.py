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

In plain Python a row is a structure of `ctypes` on the table's memory, kept by the table: where kernels run interpreted
they read a field of it in less time than an element of an array, and of a row of NumPy's in a tenth of the time.

For loops that take several cars at once (`kernels.arrays.BLOCK`) there are blocks of columns with names:

    @columns(BLOCK)
    class Places:
        x: Floats

    block = places[b, n // BLOCK]
    block.x[n % BLOCK] += 1.0

Compiled, a block is a pointer and a column an array at a fixed distance from it, so that the compiler knows how far
columns are apart and puts loops over them into vectors.
"""

from __future__ import annotations

import ctypes
from collections.abc import Callable, Sequence
from functools import cached_property
from types import MappingProxyType
from typing import Any, Protocol, TypeVar, cast, dataclass_transform, get_type_hints, overload

import numpy as np
import numpy.typing as npt

from dubins_traffic.kernels.arrays import Ints

R = TypeVar("R")
R_co = TypeVar("R_co", covariant=True)
KINDS: dict[Any, Any] = {int: ctypes.c_int64, float: ctypes.c_double, np.uint64: ctypes.c_uint64}
"""What a field may be, and how it is kept: eight bytes each."""
MOST_KNOWN = 1 << 12
"""Rows of a table that are kept once they have been made; of longer tables others are made anew each time."""


class _Array(Protocol):
    """What all arrays of rows have."""

    @property
    def shape(self) -> tuple[int, ...]:
        """Lengths of the array's axes."""
        ...

    def __len__(self) -> int: ...


class Rows(_Array, Protocol[R_co]):
    """A NumPy array whose elements are rows of one record: what kernels see of it."""

    @overload
    def __getitem__(self, place: str) -> npt.NDArray[Any]: ...
    @overload
    def __getitem__(self, place: int | tuple[int, ...]) -> R_co: ...
    @overload
    def __getitem__(self, place: Ints | slice) -> Rows[R_co]: ...
    def __getitem__(self, place: str | int | tuple[int, ...] | Ints | slice) -> Any:
        """Return the row at a place with a number for each axis, a field of all rows as an array, or some rows."""
        ...

    def __setitem__(self, place: str | int | tuple[int, ...], value: Any) -> None:
        """Write a row, or a field of all rows."""
        ...


class Grid(_Array, Protocol[R_co]):
    """As `Rows`, with two axes: a row at each place (b, n)."""

    @overload
    def __getitem__(self, place: str) -> npt.NDArray[Any]: ...
    @overload
    def __getitem__(self, place: int) -> Rows[R_co]: ...
    @overload
    def __getitem__(self, place: tuple[int, int]) -> R_co: ...
    def __getitem__(self, place: str | int | tuple[int, int]) -> Any:
        """Return the row at a place, those of one number, or a field of all rows as an array."""
        ...

    def __setitem__(self, field: str, values: Any) -> None:
        """Write a field of all rows."""
        ...


class Table(np.ndarray[Any, Any]):
    """A structured array whose rows are made once: what `table` returns.

    `RECORD` is the class of its rows; `KIND` makes them: from the array and how many bytes from its beginning one is.
    """

    RECORD: Any
    KIND: Callable[[Any, int], Any]
    known: dict[Any, Any] = cast(Any, MappingProxyType({}))  # a dictionary of its own once a row is asked for

    @cached_property
    def plain(self) -> npt.NDArray[Any] | None:
        """The memory of the table as an array that does not refer to it, None if it is the table's own.

        What a table keeps must not keep the table: NumPy does not show the garbage collector what an array is a view
        of, so that such a circle would never be let go.
        """
        root: npt.NDArray[Any] = self
        while isinstance(root.base, np.ndarray):
            root = root.base
        if root is self or not root.flags.c_contiguous or not self.size:
            return None
        far = self.ctypes.data - root.ctypes.data  # in `__array_interface__` NumPy drops Ctrl-C
        return np.ndarray(self.shape, self.dtype, buffer=root, offset=far, strides=self.strides)

    def __getitem__(self, place: Any) -> Any:
        """Return the row, the field or the part of the table at a place."""
        try:
            return self.known[place]
        except KeyError:
            return self._find(place)
        except TypeError:
            part = super().__getitem__(place)
            return part.view(type(self)) if part.base is None else part

    def copy(self, order: Any = "C") -> Any:
        """Return a table of the same values on memory of its own."""
        return np.array(self, order=order).view(type(self))

    def __deepcopy__(self, memo: Any) -> Any:
        """Return a copy."""
        return self.copy()

    def __reduce__(self) -> Any:
        """Be pickled as the array that it is."""
        return _revive, (self.RECORD, np.asarray(self))

    def __setitem__(self, place: Any, value: Any) -> None:
        """Write a row, which may be one of another table, or a field of all rows."""
        if isinstance(value, ctypes.Structure):
            value = np.frombuffer(cast(Any, value), dtype=cast(Any, self).dtype)[0]
        cast(Any, super()).__setitem__(place, value)

    def _find(self, place: Any) -> Any:
        plain = self.plain
        part: Any
        if plain is not None and type(place) is int and plain.ndim == 1 and 0 <= place < len(plain):
            part = self.KIND(plain, place * plain.strides[0])
        else:
            part = self._look_up(plain, place)
        if plain is not None and len(self.known) < MOST_KNOWN:
            if not self.known:
                self.known = {}
            self.known[place] = part
        return part

    def _look_up(self, plain: npt.NDArray[Any] | None, place: Any) -> Any:
        part = super().__getitem__(place) if plain is None else plain[place]
        if isinstance(place, str):
            return part.view(np.ndarray)
        if not isinstance(part, np.void):
            return part.view(type(self))
        axes = cast(tuple[int, ...], place if isinstance(place, tuple) else (place,))
        far = sum(int(number) * step for number, step in zip(axes, self.strides, strict=True))
        return self.KIND(self if plain is None else plain, far)


def _revive(kind: Any, rows: npt.NDArray[Any]) -> Any:
    return rows.view(kind.TABLE)


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
    wrapping = {name: f"_{name}" for name, hint in fields.items() if hint is np.uint64}
    members: dict[str, Any] = {name: _wrapping(own) for name, own in wrapping.items()}
    members |= {
        "_fields_": [(wrapping.get(name, name), KINDS[hint]) for name, hint in fields.items()],
        "__doc__": kind.__doc__,
        "__module__": kind.__module__,
        "__qualname__": kind.__qualname__,
        "__slots__": (),
        "__setattr__": _set,
        "__reduce__": _reduced,
        "FIRST_VALUES": {name: vars(kind)[name] for name in fields if name in vars(kind)},
    }
    row: Any = type(kind.__name__, (ctypes.Structure,), members)
    row.LAYOUT = np.dtype([(name, np.dtype(KINDS[hint])) for name, hint in fields.items()], align=True)
    row.TABLE = type(f"{kind.__name__}Table", (Table,), {"KIND": row.from_buffer, "RECORD": row})
    return cast(type[R], row)


def _set(row: Any, name: str, value: Any) -> None:
    """Write a field; `ctypes` takes no integers of NumPy's."""
    try:
        object.__setattr__(row, name, value)
    except TypeError:
        object.__setattr__(row, name, int(value))


def _reduced(row: Any) -> tuple[Any, ...]:
    """Be copied and pickled with its values, as a row of its own."""
    return _copied, (type(row), bytes(row))


def _copied(kind: Any, data: bytes) -> Any:
    return kind.from_buffer_copy(data)


def _wrapping(name: str) -> property:
    """Return a property for an unsigned field, whose values wrap around as they do where they are compiled."""
    return property(lambda row: np.uint64(getattr(row, name)), lambda row, value: _set(row, name, int(value)))


def layout(kind: type[Any]) -> np.dtype[Any]:
    """Return the dtype of the rows of a record."""
    return kind.LAYOUT


@overload
def table(kind: type[R], shape: int) -> Rows[R]: ...
@overload
def table(kind: type[R], shape: tuple[int, ...]) -> Any: ...
def table(kind: type[R], shape: int | tuple[int, ...]) -> Any:
    """Return an array of new rows of a record, each with the first values of its fields.

    Parameters
    ----------
    kind : type
        A class made by `record`.
    shape : int or tuple of int
        Lengths of the axes.
    """
    rows: Any = np.zeros(shape, dtype=layout(kind)).view(cast(Any, kind).TABLE)
    for name, value in cast(Any, kind).FIRST_VALUES.items():
        rows[name] = value
    return rows


def stack(tables: Sequence[Rows[R]]) -> Any:
    """Return a table of which each row of the first axis is one of some tables of equal lengths."""
    rows: Any = np.stack([cast(Any, table) for table in tables])
    return rows.view(type(tables[0]))


def join(tables: Sequence[Rows[R]]) -> Rows[R]:
    """Return a table of the rows of some tables, one after another."""
    rows: Any = np.concatenate([cast(Any, table) for table in tables])
    return rows.view(type(tables[0]))


def numbers(rows: Rows[Any], kind: type[np.generic]) -> npt.NDArray[Any]:
    """Return a table whose fields are all of one kind as an array of numbers, with a column for each field: a view."""
    return np.asarray(rows).view(kind).reshape(*rows.shape, -1)


def columns(size: int) -> Callable[[type[R]], type[R]]:
    """Make a class the type of the rows of structured arrays: each annotated field is `size` float64 numbers.

    Its tables are made by `kernels.records.table`; new ones are 0.
    """

    def make(kind: type[R]) -> type[R]:
        names = list(get_type_hints(kind))
        layout = np.dtype([(name, "f8", (size,)) for name in names])

        def at(rows: Any, far: int) -> Any:
            block = np.ndarray((), layout, rows, far)
            block_row = row()
            for name in names:
                setattr(block_row, name, block[name])
            return block_row

        row: Any = type(
            kind.__name__,
            (),
            {
                "__doc__": kind.__doc__,
                "__module__": kind.__module__,
                "__qualname__": kind.__qualname__,
                "__slots__": tuple(names),
                "FIRST_VALUES": {},
                "LAYOUT": layout,
            },
        )
        row.TABLE = type(f"{kind.__name__}Table", (Table,), {"KIND": staticmethod(at), "RECORD": row})
        return cast(type[R], row)

    return make
