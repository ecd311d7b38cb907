"""How Numba compiles an element of an array in a kernel: a load or store at its place, without copies of the array.

Numba keeps what is known of an array in memory of the function, once for every element that is read, which the
optimizer takes away again. It also looks at every index for whether it is negative, and then counts from the end.
Kernels never count from the end, and an index is the number of an element.
"""

from __future__ import annotations

import operator
from collections.abc import Callable
from typing import Any, cast

from numba import extending as _extending  # pyright: ignore[reportMissingTypeStubs]
from numba.core import cgutils as _cgutils  # pyright: ignore[reportMissingTypeStubs]
from numba.core import types as _types  # pyright: ignore[reportMissingTypeStubs]
from numba.np import arrayobj as _arrayobj  # pyright: ignore[reportMissingTypeStubs]

OURS = "dubins_traffic"
"""Part of the names of our compiled functions."""

extending, cgutils = cast(Any, _extending), cast(Any, _cgutils)
types, arrays = cast(Any, _types), cast(Any, _arrayobj)


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

    whole = [
        context.cast(builder, each, from_kind, types.intp)
        for each, from_kind in zip(indices, kinds, strict=True)
    ]
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
    own, _, kind = signature.args
    value = context.cast(builder, args[2], kind, own.dtype)
    return arrays.store_item(context, builder, own, value, place)


for _kind, _usual in (
    (types.Integer, arrays.getitem_arraynd_intp),
    (types.BaseTuple, arrays.getitem_array_tuple),
):
    extending.lower_builtin(operator.getitem, types.Array, _kind)(_loading(_usual))
    extending.lower_builtin(operator.setitem, types.Array, _kind, types.Any)(_store)
