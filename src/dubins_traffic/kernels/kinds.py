"""Kinds of arguments: what a kernel is compiled for, and how a call hands arguments over to machine code.

A kind is a nested tuple of texts and numbers, so that it can be written down (`repr`) and read back:

- ``("number", "i8")`` and the like for a number, with NumPy's letter and size; ``("none",)``.
- ``("array", dtype, ndim, layout, writable)``, layout ``C``, ``F`` or ``A``.
- ``("row", dtype)`` for a row of `kernels.records`, ``("tables", name, fields)`` for `kernels.tables.Tables`.
- ``("tuple", kinds)`` and ``("named", module, name, kinds)`` for a tuple and a named tuple.

A call hands over one frame: eight bytes for each argument, which hold a number, the address of a row or of what tables
say of their arrays, or the address of a block for an array or tuple. A block has eight bytes for each number in it, and
for an array its address, its number of elements, the bytes of one, its shape and its strides.
"""

from __future__ import annotations

import ctypes
import struct
from functools import cache
from typing import Any, Self, TypeAlias, cast

import numpy as np

from dubins_traffic.kernels.records import layout as record_layout
from dubins_traffic.kernels.tables import Tables

Kind: TypeAlias = tuple[Any, ...]

NONE: Kind = ("none",)
TRUTH: Kind = ("number", "b1")
WHOLE: Kind = ("number", "i8")
NATURAL: Kind = ("number", "u8")
REAL: Kind = ("number", "f8")
MOST = 2**63
"""Integers from here on are without a sign, as Numba takes them."""


class UnfitError(TypeError):
    """An argument of which no kernel can be compiled."""


def kind_of(value: object) -> Kind:
    """Return the kind of an argument.

    Raises
    ------
    UnfitError
        If kernels can't be compiled for it.
    """
    kind = _PLAIN.get(type(value))
    if kind is not None:
        return kind if kind is not WHOLE or -MOST <= cast(int, value) < MOST else NATURAL
    if isinstance(value, np.ndarray):
        array = cast("np.ndarray[Any, Any]", value)
        flags = array.flags
        if not flags.aligned:
            raise UnfitError("an array that is not aligned")
        layout = "C" if flags.c_contiguous else "F" if flags.f_contiguous else "A"
        return "array", _dtype_kind(array.dtype), array.ndim, layout, flags.writeable
    if isinstance(value, Tables):
        return _kind_of_tables(value)
    if isinstance(value, ctypes.Structure):
        return "row", _dtype_kind(record_layout(cast(Any, type(cast(object, value)))))
    if isinstance(value, tuple):
        kinds = tuple([kind_of(part) for part in cast("tuple[object, ...]", value)])
        kind_of_tuple = type(cast(object, value))
        return (
            ("tuple", kinds)
            if kind_of_tuple is tuple
            else ("named", kind_of_tuple.__module__, kind_of_tuple.__qualname__, kinds)
        )
    if isinstance(value, bool | np.bool_):
        return TRUTH
    if isinstance(value, int):
        return WHOLE if -MOST <= value < MOST else NATURAL
    if isinstance(value, float) and not isinstance(value, np.generic):
        return REAL
    if isinstance(value, np.integer | np.floating):
        return "number", cast(Any, value).dtype.str[1:]
    raise UnfitError(f"a {type(value).__name__}")


_PLAIN: dict[type, Kind] = {
    float: REAL, int: WHOLE, bool: TRUTH, type(None): NONE, np.float64: REAL, np.int64: WHOLE, np.uint64: NATURAL,
    np.bool_: TRUTH,
}  # fmt: skip


class _Hashed(tuple[Any, ...]):
    """A long kind, whose hash is found once."""

    def __new__(cls, parts: tuple[Any, ...]) -> Self:
        made = super().__new__(cls, parts)
        made.number = hash(parts)
        return made

    number: int

    def __hash__(self) -> int:
        return self.number


_KINDS: dict[_Hashed, _Hashed] = {}
"""The kinds of tables met so far: equal ones are one object, of which the garbage collector has to look at few."""


def _kind_of_tables(tables: Tables) -> Kind:
    known = vars(tables)
    kind = known.get("_kind")
    if kind is None:
        fields = tuple((name, kind_of(value)) for name, value in zip(tables.field_names, tables, strict=True))
        kind = _Hashed(("tables", type(tables).__name__, fields))
        kind = known["_kind"] = _KINDS.setdefault(kind, kind)
    return kind


@cache
def _dtype_kind(dtype: np.dtype[Any]) -> Any:
    """Return what describes a type of elements: NumPy's text, or a tuple for rows with names."""
    if dtype.subdtype is not None:
        base, shape = dtype.subdtype
        return "block", _dtype_kind(base), shape
    if dtype.fields is None:
        if dtype.kind not in "biuf" or not dtype.isnative:
            raise UnfitError(f"an array of {dtype}")
        return dtype.str[1:]
    fields = cast("dict[str, Any]", dtype.fields)
    parts = [(name, _dtype_kind(fields[name][0]), fields[name][1]) for name in cast("tuple[str, ...]", dtype.names)]
    return "rows", tuple(parts), dtype.itemsize, dtype.isalignedstruct


def dtype_of(kind: Any) -> np.dtype[Any]:
    """Return the type of elements that `kind_of` has described."""
    if isinstance(kind, str):
        return np.dtype(kind)
    if kind[0] == "block":
        return np.dtype((dtype_of(kind[1]), kind[2]))
    _, fields, size, aligned = kind
    parts = {
        "names": [name for name, _, _ in fields],
        "formats": [dtype_of(part) for _, part, _ in fields],
        "offsets": [offset for _, _, offset in fields],
        "itemsize": size,
    }
    return np.dtype(cast(Any, parts), align=aligned)


def is_number(kind: Kind) -> bool:
    """Tell whether a kind is that of numbers, which stand in the frame itself."""
    return kind[0] == "number"


def is_place(kind: Kind) -> bool:
    """Tell whether of a kind the address of the value itself is handed over."""
    return kind[0] in ("row", "tables")


def place_of(value: Any) -> int:
    """Return the address of a row, or of what tables say of their arrays."""
    return value.address if isinstance(value, Tables) else ctypes.addressof(value)


@cache
def letters(kind: Kind) -> str:
    """Return how `struct` packs a number, or the block of an array or tuple."""
    if kind[0] == "number":
        return _LETTERS[kind[1][0]]
    if kind[0] == "array":
        return "q" * (3 + 2 * kind[2])
    if is_place(kind):
        return "q"
    return "" if kind == NONE else "".join(letters(part) for part in kind[-1])


_LETTERS = {"b": "?7x", "i": "q", "u": "Q", "f": "d"}


def leaves(value: object, into: list[int | float]) -> None:
    """Append what a block holds of a value, number by number."""
    if isinstance(value, np.ndarray):
        array = cast("np.ndarray[Any, Any]", value)
        into.append(array.ctypes.data)
        into.append(array.size)
        into.append(array.itemsize)
        into.extend(array.shape)
        into.extend(array.strides)
    elif isinstance(value, Tables | ctypes.Structure):
        into.append(place_of(value))
    elif isinstance(value, tuple):
        for part in cast("tuple[object, ...]", value):
            leaves(part, into)
    elif value is not None:
        into.append(cast(Any, value))


def packed(value: object, kind: Kind) -> ctypes.Array[ctypes.c_char]:
    """Return the block of an array or tuple; it is valid as long as the value is kept."""
    numbers: list[int | float] = []
    leaves(value, numbers)
    return ctypes.create_string_buffer(struct.pack("@" + letters(kind), *numbers))
