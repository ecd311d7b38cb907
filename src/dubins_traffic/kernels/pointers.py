"""How Numba compiles `kernels.tables.Tables`: a pointer, of which every array is read when it is asked for.

What stands there never changes while a kernel runs, which the compiler is told: it reads each once, wherever it likes.
"""

from __future__ import annotations

import hashlib
from typing import Any, cast

import numba  # pyright: ignore[reportMissingTypeStubs]
from llvmlite import ir as _ir  # pyright: ignore[reportMissingTypeStubs]
from numba import extending as _extending  # pyright: ignore[reportMissingTypeStubs]
from numba.core import types as _types  # pyright: ignore[reportMissingTypeStubs]
from numba.core.typing import templates as _templates  # pyright: ignore[reportMissingTypeStubs]

WORD = 8
"""Bytes of what is known of an array: its address, and each of its lengths."""

library, ir, extending = cast(Any, numba), cast(Any, _ir), cast(Any, _extending)
types, templates = cast(Any, _types), cast(Any, _templates)


class TablesType(types.Type):
    """The type of a `Tables` whose arrays have certain types.

    Parameters
    ----------
    name : str
        Of the class.
    fields : tuple of (str, type)
        Names and types of its arrays, rows and groups.
    """

    def __init__(self, name: str, fields: tuple[tuple[str, Any], ...]) -> None:
        self.fields = fields
        digest = hashlib.sha256(repr(fields).encode()).hexdigest()[:12]
        super().__init__(name=f"{name}-{digest}")  # pyright: ignore[reportUnknownMemberType]

    def place(self, field: str) -> tuple[Any, int]:
        """Return the type of a field, and at which byte what is known of it begins."""
        words = 0
        for name, kind in self.fields:
            if name == field:
                return kind, WORD * words
            words += _words(kind)
        raise AttributeError(field)

    @property
    def words(self) -> int:
        """How many numbers are known of all of its arrays."""
        return sum(_words(kind) for _, kind in self.fields)


def _words(kind: Any) -> int:
    """Return how many numbers are known of a field: of a row only where it is."""
    if isinstance(kind, TablesType):
        return kind.words
    return 1 if isinstance(kind, types.Record) else 1 + kind.ndim


@extending.register_model(TablesType)
class _Pointer(extending.models.OpaqueModel):  # pyright: ignore[reportUnusedClass]
    pass


@extending.infer_getattr
class _Fields(templates.AttributeTemplate):  # pyright: ignore[reportUnusedClass]
    key = TablesType

    def generic_resolve(self, kind: TablesType, name: str) -> Any:
        """Return the type of a field."""
        return dict(kind.fields).get(name)


@extending.lower_getattr_generic(TablesType)
def _read(context: Any, builder: Any, kind: TablesType, pointer: Any, name: str) -> Any:  # pyright: ignore[reportUnusedFunction]
    field, begin = kind.place(name)
    start = builder.gep(pointer, [ir.IntType(64)(begin)])
    if isinstance(field, TablesType):
        return start
    steady = builder.module.add_metadata([])
    if isinstance(field, types.Record):
        row = builder.load(builder.bitcast(start, context.get_value_type(field).as_pointer()), align=WORD)
        row.set_metadata("invariant.load", steady)
        return row
    words = builder.bitcast(start, ir.IntType(64).as_pointer())

    def word(k: int) -> Any:
        value = builder.load(builder.gep(words, [ir.IntType(64)(k)]), align=WORD)
        value.set_metadata("invariant.load", steady)
        return value

    size = ir.IntType(64)(context.get_abi_sizeof(context.get_data_type(field.dtype)))
    lengths = [word(1 + k) for k in range(field.ndim)]
    strides = [size]
    for length in reversed(lengths[1:]):
        strides.insert(0, builder.mul(strides[0], length))
    items = lengths[0]
    for length in lengths[1:]:
        items = builder.mul(items, length)
    place = context.data_model_manager[field].get_field_position
    array = ir.Constant(context.get_value_type(field), None)
    data = builder.load(builder.bitcast(start, array.type.elements[place("data")].as_pointer()), align=WORD)
    data.set_metadata("invariant.load", steady)
    for part, value in (("data", data), ("nitems", items), ("itemsize", size)):
        array = builder.insert_value(array, value, place(part))
    for k in range(field.ndim):
        array = builder.insert_value(array, lengths[k], [place("shape"), k])
        array = builder.insert_value(array, strides[k], [place("strides"), k])
    return array
