"""How Numba compiles `kernels.ahead.fetch`: an instruction for each line of memory, which need not be there."""

from __future__ import annotations

from typing import Any, cast

from llvmlite import ir as _ir  # pyright: ignore[reportMissingTypeStubs]
from numba import extending as _extending  # pyright: ignore[reportMissingTypeStubs]
from numba.core import cgutils as _cgutils  # pyright: ignore[reportMissingTypeStubs]
from numba.core import types as _types  # pyright: ignore[reportMissingTypeStubs]
from numba.core.typing import templates as _templates  # pyright: ignore[reportMissingTypeStubs]

from dubins_traffic.kernels.ahead import fetch

ir, extending, types = cast(Any, _ir), cast(Any, _extending), cast(Any, _types)
templates, cgutils = cast(Any, _templates), cast(Any, _cgutils)

INTRINSIC = "llvm.prefetch.p0i8"
READ, NEAREST, DATA = 0, 3, 1
"""What is fetched is to be read, and often; it is no instruction."""
LINE = 64
"""Bytes of a line of memory."""


class Fetch(templates.AbstractTemplate):
    """What calls are understood: an array or table, and a tuple of numbers."""

    def generic(self, args: Any, kws: Any) -> Any:
        """Return the type of a call."""
        array, place = args
        known = isinstance(array, types.Array) and isinstance(place, types.BaseTuple)
        return None if kws or not known else templates.signature(types.none, array, place)


def learn() -> None:
    """Let Numba compile calls so from now on."""
    templates.infer_global(fetch)(Fetch)
    extending.lower_builtin(fetch, types.Array, types.BaseTuple)(_fetch)


def _fetch(context: Any, builder: Any, signature: Any, args: Any) -> Any:
    kind, places = signature.args
    array = context.make_array(kind)(context, builder, args[0])
    byte, number, word = ir.IntType(8).as_pointer(), ir.IntType(32), ir.IntType(64)
    address, size = builder.ptrtoint(array.data, word), word(LINE)
    for k, own in enumerate(places):
        index = context.cast(builder, builder.extract_value(args[1], k), own, types.intp)
        size = builder.extract_value(array.strides, k)
        address = builder.add(address, builder.mul(index, size))
    end = builder.add(address, size)
    first = builder.and_(address, word(-LINE))
    module = builder.module
    function = module.globals.get(INTRINSIC)
    if function is None:
        function = ir.Function(
            module, ir.FunctionType(ir.VoidType(), [byte, number, number, number]), INTRINSIC
        )
    with cgutils.for_range_slice(builder, first, end, word(LINE)) as (line, _):
        builder.call(function, [builder.inttoptr(line, byte), number(READ), number(NEAREST), number(DATA)])
    return context.get_dummy_value()
