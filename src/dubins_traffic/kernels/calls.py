"""Calls of kernels, tick after tick, with the same arrays: what has to be known of the arrays is found out once."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any, Generic, TypeVar, cast

import numpy as np

from dubins_traffic.kernels.compile import Kernel
from dubins_traffic.kernels.kinds import Kind, UnfitError, kind_of
from dubins_traffic.kernels.machine import Code, address

R = TypeVar("R")


def bound(kernel: Callable[..., R], leading: Sequence[Any], arrays: Sequence[Any]) -> Callable[..., R]:
    """Return a kernel that is to be called with other leading arguments and the same arrays after them.

    Parameters
    ----------
    kernel
        A function made by `kernels.compile.jit`, whose last parameter takes any number of arrays.
    leading
        Leading arguments as those of the calls to come: an integer where they have integers, and so on. Arrays among
        them may be others in each call, of the same type.
    arrays
        The arrays.
    """
    after = tuple(arrays)
    if not isinstance(kernel, Kernel):
        return lambda *first: kernel(*first, *after)
    own = cast("Kernel[..., R]", kernel)
    try:
        kinds = tuple(kind_of(value) for value in (*leading, after))
    except UnfitError:
        plain = own.interpreted
        return lambda *first: plain(*first, *after)
    code = own.code(kinds)
    return _Later(own, kinds, after) if code is None else _compiled(code, after)


class _Later(Generic[R]):
    """Calls that are interpreted until there is machine code."""

    def __init__(self, kernel: Kernel[..., R], kinds: tuple[Kind, ...], after: tuple[Any, ...]) -> None:
        self._kernel, self._kinds, self._after = kernel, kinds, after
        self._call: Callable[..., R] | None = None

    def __call__(self, *first: Any) -> R:
        if self._call is not None:
            return self._call(*first)
        code = None if self._kernel.is_waiting else self._kernel.code(self._kinds)
        if code is None:
            return self._kernel.interpreted(*first, *self._after)
        self._call = _compiled(code, self._after)
        return self._call(*first)


def steady(kernel: Callable[..., R]) -> Callable[..., R]:
    """Return a kernel that is to be called often, with arrays and tables most of which are those of the call before.

    Parameters
    ----------
    kernel
        A function made by `kernels.compile.jit`, without a parameter that takes any number of arguments. Numbers among
        its arguments have to be of the same kind in every call.
    """
    return _Steady(cast("Kernel[..., R]", kernel)) if isinstance(kernel, Kernel) else kernel


class _Steady(Generic[R]):
    """Calls that look only at the arguments that are others than before."""

    def __init__(self, kernel: Kernel[..., R]) -> None:
        self._kernel = kernel
        self._code: Code | None = None
        self._kinds: tuple[Kind, ...] = ()
        self._seen: dict[int, tuple[Any, Kind, int, list[Any]]] = {}

    def __deepcopy__(self, memo: object) -> _Steady[R]:
        return _Steady(self._kernel)

    def __call__(self, *args: Any) -> R:
        if self._kernel.is_waiting:
            return self._kernel.interpreted(*args)
        values: list[Any] = []
        same = self._code is not None
        for k, value in enumerate(args):
            if not _is_table(value):
                values.append(value)
                continue
            seen = self._seen.get(k)
            if seen is None or seen[0] is not value:
                kept: list[Any] = []
                kind = kind_of(value)
                same = same and seen is not None and seen[1] == kind
                seen = self._seen[k] = (value, kind, address(value, kind, kept), kept)
            values.append(seen[2])
        if not same:
            self._kinds = tuple(
                self._seen[k][1] if k in self._seen else kind_of(v) for k, v in enumerate(args)
            )
            self._code = self._kernel.code(self._kinds)
        code = self._code
        if code is None:
            return self._kernel.interpreted(*args)
        room = code.room()
        if code.function(code.pack(*values), room):
            raise RuntimeError("a kernel has failed")
        return code.read(room)


def _is_table(value: object) -> bool:
    return isinstance(value, np.ndarray | tuple)


def _compiled(code: Code, after: tuple[Any, ...]) -> Callable[..., Any]:
    """Return a function that calls machine code with leading arguments and the same arrays after them."""
    kinds = code.kinds[:-1]
    kept: list[Any] = []
    last = address(after, code.kinds[-1], kept)
    pack, function, read, room = code.pack, code.function, code.read, code.room()
    changing = [k for k, kind in enumerate(kinds) if kind[0] != "number"]
    known: dict[int, tuple[Any, int, list[Any]]] = {k: (kept, 0, []) for k in changing}

    def call(*first: Any) -> Any:
        values = first
        if changing:
            own = list(first)
            for k in changing:
                value = first[k]
                seen = known[k]
                if seen[0] is not value:
                    blocks: list[Any] = []
                    seen = known[k] = (value, address(value, kinds[k], blocks), blocks)
                own[k] = seen[1]
            values = own
        if function(pack(*values, last), room):
            raise RuntimeError("a kernel has failed")
        return None if room is None else read(room)

    call.kept = kept  # pyright: ignore[reportFunctionMemberAccess]  # as long as the calls
    return call
