"""How Numba compiles what kernels hold that it does not know: tables, codes, elements of arrays, and fetches.

Tables (`kernels.tables.Tables`) are pointers, of which every array is read when it is asked for. What stands there
never changes while a kernel runs, which the compiler is told: it reads each once, wherever it likes.

A code is a field of a named tuple that is global: it is compiled as if the number stood there. Numba would take a
constant tuple apart, which the optimizer undoes, but not without other choices on the way: what is put into what. So a
group of codes costs nothing, and machine code is to the byte what it is of bare names.

An element of an array is a load or store at its place, without copies of the array. Numba keeps what is known of an
array in memory of the function, once for every element that is read, which the optimizer takes away again. It also
looks at every index for whether it is negative, and then counts from the end. Kernels never count from the end, and an
index is the number of an element.

A fetch (`kernels.arrays.fetch`) is an instruction for each line of memory, which need not be there.
"""

from __future__ import annotations

import hashlib
import operator
from collections.abc import Callable
from typing import Any, cast

import numba  # pyright: ignore[reportMissingTypeStubs]
from llvmlite import ir as _ir  # pyright: ignore[reportMissingTypeStubs]
from numba import extending as _extending  # pyright: ignore[reportMissingTypeStubs]
from numba.core import cgutils as _cgutils  # pyright: ignore[reportMissingTypeStubs]
from numba.core import ir as _numba_ir  # pyright: ignore[reportMissingTypeStubs]
from numba.core import rewrites as _rewrites  # pyright: ignore[reportMissingTypeStubs]
from numba.core import types as _types  # pyright: ignore[reportMissingTypeStubs]
from numba.core.typing import templates as _templates  # pyright: ignore[reportMissingTypeStubs]
from numba.np import arrayobj as _arrayobj  # pyright: ignore[reportMissingTypeStubs]

from dubins_traffic.kernels.arrays import fetch

library, ir, numba_ir = cast(Any, numba), cast(Any, _ir), cast(Any, _numba_ir)
extending, cgutils, rewrites = cast(Any, _extending), cast(Any, _cgutils), cast(Any, _rewrites)
types, templates, arrays = cast(Any, _types), cast(Any, _templates), cast(Any, _arrayobj)

WORD = 8
"""Bytes of what is known of an array: its address, and each of its lengths."""
OURS = "dubins_traffic"
"""Part of the names of our compiled functions."""
INTRINSIC = "llvm.prefetch.p0i8"
READ, NEAREST, DATA = 0, 3, 1
"""What is fetched is to be read, and often; it is no instruction."""
LINE = 64
"""Bytes of a line of memory."""


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


class Codes(rewrites.Rewrite):
    """Puts numbers in place of fields of groups, block for block, before types are inferred."""

    def match(self, func_ir: Any, block: Any, typemap: Any, calltypes: Any) -> bool:  # noqa: ARG002  # as Numba calls it
        """Look for codes in a block; return whether there are any."""
        self._block, self._found = block, dict[Any, Any]()
        groups: dict[str, Any] = {}
        for line in block.find_insts(numba_ir.Assign):
            value = line.value
            if isinstance(value, numba_ir.Global) and hasattr(value.value, "_fields"):
                groups[line.target.name] = value.value
            elif isinstance(value, numba_ir.Expr) and value.op == "getattr" and value.value.name in groups:
                code = numba_ir.Global(value.attr, getattr(groups[value.value.name], value.attr), line.loc)
                self._found[line] = numba_ir.Assign(code, line.target, line.loc)
        return bool(self._found)

    def apply(self) -> Any:
        """Return the block with the numbers in it."""
        made = self._block.copy()
        made.body = [self._found.get(line, line) for line in self._block.body]
        return made


def take_as_numbers() -> None:
    """Let Numba compile codes so from now on."""
    rewrites.register_rewrite("before-inference")(Codes)


def index_plainly() -> None:
    """Let kernels take an index as it is from now on, also where they take a part of an array."""
    wrap = arrays.fix_integer_index

    def keep_index(context: Any, builder: Any, kind: Any, index: Any, size: Any) -> Any:
        if kind.signed and OURS in builder.function.name:
            return context.cast(builder, index, kind, types.intp)
        return wrap(context, builder, kind, index, size)

    arrays.fix_integer_index = keep_index


def _place(context: Any, builder: Any, signature: Any, args: Any) -> Any:
    """Return the address of an element; None for a part of an array, or in a function that is not ours."""
    own, kind, array, index = *signature.args[:2], *args[:2]
    if isinstance(kind, types.BaseTuple):
        kinds, indices = tuple(kind), cgutils.unpack_tuple(builder, index, len(kind))
    else:
        kinds, indices = (kind,), (index,)
    if OURS not in builder.function.name or len(kinds) != own.ndim:
        return None
    if not all(isinstance(each, types.Integer) for each in kinds):
        return None
    position = context.data_model_manager[own].get_field_position

    def lengths(name: str) -> list[Any]:
        return [builder.extract_value(array, [position(name), k]) for k in range(own.ndim)]

    whole = [context.cast(builder, each, from_kind, types.intp) for each, from_kind in zip(indices, kinds, strict=True)]
    data = builder.extract_value(array, position("data"))
    strides = [] if own.layout == "C" else lengths("strides")
    return cgutils.get_item_pointer2(context, builder, data, lengths("shape"), strides, own.layout, whole)


def _loading(usual: Callable[..., Any]) -> Callable[..., Any]:
    """Return what writes the load of an element, and what `usual` writes of anything else."""

    def load(context: Any, builder: Any, signature: Any, args: Any) -> Any:
        place = _place(context, builder, signature, args)
        if place is None:
            return usual(context, builder, signature, args)
        return arrays.load_item(context, builder, signature.args[0], place)

    return load


def _store(context: Any, builder: Any, signature: Any, args: Any) -> Any:
    place = _place(context, builder, signature, args)
    if place is None:
        return arrays.setitem_array(context, builder, signature, args)
    array_type, _, kind = signature.args
    value = context.cast(builder, args[2], kind, array_type.dtype)
    return arrays.store_item(context, builder, array_type, value, place)


for _kind, _usual in (
    (types.Integer, arrays.getitem_arraynd_intp),
    (types.BaseTuple, arrays.getitem_array_tuple),
):
    extending.lower_builtin(operator.getitem, types.Array, _kind)(_loading(_usual))
    extending.lower_builtin(operator.setitem, types.Array, _kind, types.Any)(_store)


class Fetch(templates.AbstractTemplate):
    """What calls are understood: an array or table, and a tuple of numbers."""

    def generic(self, args: Any, kws: Any) -> Any:
        """Return the type of a call."""
        array, place = args
        known = isinstance(array, types.Array) and isinstance(place, types.BaseTuple)
        return None if kws or not known else templates.signature(types.none, array, place)


def learn_fetches() -> None:
    """Let Numba compile calls of `fetch` from now on."""
    templates.infer_global(fetch)(Fetch)
    extending.lower_builtin(fetch, types.Array, types.BaseTuple)(_fetch)


def _fetch(context: Any, builder: Any, signature: Any, args: Any) -> Any:
    kind, places = signature.args
    array = context.make_array(kind)(context, builder, args[0])
    byte, number, word = ir.IntType(8).as_pointer(), ir.IntType(32), ir.IntType(64)
    address, size = builder.ptrtoint(array.data, word), word(LINE)
    for k, place in enumerate(places):
        index = context.cast(builder, builder.extract_value(args[1], k), place, types.intp)
        size = builder.extract_value(array.strides, k)
        address = builder.add(address, builder.mul(index, size))
    end = builder.add(address, size)
    first = builder.and_(address, word(-LINE))
    module = builder.module
    function = module.globals.get(INTRINSIC)
    if function is None:
        function = ir.Function(module, ir.FunctionType(ir.VoidType(), [byte, number, number, number]), INTRINSIC)
    with cgutils.for_range_slice(builder, first, end, word(LINE)) as (line, _):
        builder.call(function, [builder.inttoptr(line, byte), number(READ), number(NEAREST), number(DATA)])
    return context.get_dummy_value()
