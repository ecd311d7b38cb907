"""Calls of kernels, tick after tick, with arguments of the same kinds: what is to be known of them is found once."""

from __future__ import annotations

import ctypes
from collections.abc import Callable, Sequence
from functools import cache
from typing import Any, Generic, TypeVar, cast

from dubins_traffic.kernels.compile import Kernel
from dubins_traffic.kernels.kinds import NONE, Kind, UnfitError, is_number, kind_of
from dubins_traffic.kernels.machine import Code, address

R = TypeVar("R")


def bound(
    kernel: Callable[..., R], leading: Sequence[Any], arrays: Sequence[Any] | None = None
) -> Callable[..., R]:
    """Return a kernel that is to be called with other leading arguments and the same arrays after them.

    Parameters
    ----------
    kernel
        A function made by `kernels.compile.jit`.
    leading
        Leading arguments as those of the calls to come: an integer where they have integers, and so on. Arrays and
        tables among them may be others in each call, of the same type.
    arrays
        The arrays, if the kernel's last parameter takes any number of them.
    """
    after = () if arrays is None else tuple(arrays)
    if not isinstance(kernel, Kernel):
        return lambda *first: kernel(*first, *after)
    own = cast("Kernel[..., R]", kernel)
    tail = () if arrays is None else (after,)
    try:
        kinds = tuple(kind_of(value) for value in (*leading, *tail))
    except UnfitError:
        plain = own.interpreted
        return lambda *first: plain(*first, *after)
    code = own.code(kinds)
    return _Later(own, kinds, tail, after) if code is None else _compiled(code, tail)


class _Later(Generic[R]):
    """Calls that are interpreted until there is machine code."""

    def __init__(
        self, kernel: Kernel[..., R], kinds: tuple[Kind, ...], tail: tuple[Any, ...], after: tuple[Any, ...]
    ) -> None:
        self._kernel, self._kinds, self._tail, self._after = kernel, kinds, tail, after
        self._call: Callable[..., R] | None = None

    def __call__(self, *first: Any) -> R:
        if self._call is not None:
            return self._call(*first)
        code = None if self._kernel.is_waiting else self._kernel.code(self._kinds)
        if code is None:
            return self._kernel.interpreted(*first, *self._after)
        self._call = _compiled(code, self._tail)
        return self._call(*first)


def _compiled(code: Code, tail: tuple[Any, ...]) -> Callable[..., Any]:
    """Return a function that calls machine code with leading arguments, and with `tail` after them."""
    kinds = code.kinds[: len(code.kinds) - len(tail)]
    kept: dict[int, list[Any]] = {}

    def placed(k: int, value: Any) -> int:
        """Return the address of a table, as argument k from now on."""
        if kind_of(value) != code.kinds[k]:
            raise TypeError(f"argument {k} is of another kind than before")
        own: list[Any] = []
        found = address(value, code.kinds[k], own)
        kept[k] = own
        return found

    frame = ctypes.create_string_buffer(8 * len(code.kinds))
    room = code.room() or ctypes.create_string_buffer(8)
    words, reals = _views(frame)
    if tail:
        words[len(kinds)] = placed(len(kinds), tail[0])
    make = _maker(kinds, code.answer)
    function = ctypes.CFUNCTYPE(ctypes.c_int32)(code.address)
    where = ctypes.c_void_p(ctypes.addressof(frame)), ctypes.c_void_p(ctypes.addressof(room))
    call = make(function, words, reals, placed, *where, code.read, room, *_views(room), _fail)
    cast(Any, call).kept = frame, room, kept  # as long as the calls
    return call


def _views(block: ctypes.Array[ctypes.c_char]) -> tuple[memoryview[int], memoryview[float]]:
    """Return a block as integers and as floats."""
    whole = memoryview(block).cast("B")
    return whole.cast("q"), whole.cast("d")


def _fail() -> None:
    raise RuntimeError("a kernel has failed")


@cache
def _maker(kinds: tuple[Kind, ...], answer: Kind) -> Callable[..., Callable[..., Any]]:
    """Return what makes functions that write arguments of some kinds into a frame and call machine code.

    It is written as a text, line for line what is to be done: a loop over the arguments takes longer than most kernels.
    """
    tables = [k for k, kind in enumerate(kinds) if not is_number(kind)]
    lines = ["def make(function, words, reals, placed, frame, place, read, room, wholes, floats, fail):"]
    lines += [f"    t{k} = fail" for k in tables]
    lines += [f"    def call({', '.join(f'a{k}' for k in range(len(kinds)))}):"]
    lines += ["        nonlocal " + ", ".join(f"t{k}" for k in tables)] * bool(tables)
    for k, kind in enumerate(kinds):
        if k in tables:
            lines += [f"        if a{k} is not t{k}:", f"            words[{k}] = placed({k}, a{k})"]
            lines += [f"            t{k} = a{k}"]
        else:
            lines += [f"        {_WRITTEN[kind[1][0]].format(k=k)}"]
    lines += ["        if function(frame, place):", "            fail()"]
    lines += [f"        return {_READ.get(answer, 'read(room)')}", "    return call"]
    names: dict[str, Any] = {}
    exec("\n".join(lines), names)
    return names["make"]


_WRITTEN = {
    "b": "words[{k}] = bool(a{k})",
    "i": "words[{k}] = a{k}",
    "u": "words[{k}] = int(a{k}) - ((int(a{k}) >> 63) << 64)",
    "f": "reals[{k}] = a{k}",
}
_READ = {
    NONE: "None",
    ("number", "i8"): "wholes[0]",
    ("number", "f8"): "floats[0]",
    ("number", "b1"): "wholes[0] != 0",
}
