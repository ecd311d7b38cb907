"""Calls of kernels, tick after tick, with arguments of the same kinds: what is to be known of them is found once."""

from __future__ import annotations

import ctypes
from collections.abc import Callable, Sequence
from functools import cache
from typing import Any, Generic, ParamSpec, TypeVar, cast

from dubins_traffic.kernels.compile import Kernel
from dubins_traffic.kernels.kinds import NONE, Kind, UnfitError, is_number, kind_of
from dubins_traffic.kernels.machine import Code, address

P = ParamSpec("P")
R = TypeVar("R")


def bound(kernel: Callable[P, R]) -> Callable[P, R]:
    """Return a kernel that is to be called often, with arguments of the same kinds, most of which are the same.

    Parameters
    ----------
    kernel
        A function made by `kernels.compile.jit`, without a parameter that takes any number of arguments.

    Notes
    -----
    What comes of it writes its arguments where the call before wrote them: a thread needs one of its own.
    """
    return cast("Callable[P, R]", Bound(cast("Kernel[..., R]", kernel))) if isinstance(kernel, Kernel) else kernel


class Bound(Generic[R]):
    """A kernel that is called again and again: it looks at an argument only if that is another object than last time.

    Parameters
    ----------
    kernel : Kernel
        The kernel.
    """

    def __init__(self, kernel: Kernel[..., R]) -> None:
        self._kernel = kernel
        self._call: Callable[..., R] | None = None

    def __call__(self, *args: Any) -> R:
        """Run the kernel, interpreted until there is machine code."""
        call = self._call or self._find(args)
        if call is None:
            return self._kernel.interpreted(*args)
        try:
            return call(*args)
        except UnfitError:
            return self._kernel(*args)

    def __reduce__(self) -> tuple[Any, ...]:
        """Be copied as calls that have not been made yet: a copy writes its arguments elsewhere."""
        return Bound, (self._kernel,)

    def _find(self, args: Sequence[Any]) -> Callable[..., R] | None:
        if self._kernel.is_waiting:
            return None
        try:
            code = self._kernel.code(tuple([kind_of(value) for value in args]))
        except UnfitError:
            return None
        if code is not None:
            self._call = _compiled(code)
        return self._call


def _compiled(code: Code) -> Callable[..., Any]:
    """Return a function that calls machine code; it raises UnfitError if an argument is of another kind than before."""
    kinds = code.kinds
    kept: dict[int, list[Any]] = {}

    def placed(k: int, value: Any) -> int:
        """Return the address of an array or table, as argument k from now on."""
        if kind_of(value) != kinds[k]:
            raise UnfitError(f"argument {k} is of another kind than before")
        blocks: list[Any] = []
        at = address(value, kinds[k], blocks)
        kept[k] = blocks
        return at

    frame = ctypes.create_string_buffer(8 * len(kinds))
    room = code.room() or ctypes.create_string_buffer(8)
    words, reals = _views(frame)
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
