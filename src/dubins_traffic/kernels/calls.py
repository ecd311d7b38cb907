"""Calls of compiled kernels, tick after tick, with the same arrays.

Numba looks at the type of every argument of every call, and copies many arrays given one after another once more: of
a call with forty arrays that is most of the time. `bound` looks at them once.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any, TypeVar, cast

R = TypeVar("R")


def bound(kernel: Callable[..., R], leading: Sequence[Any], arrays: Sequence[Any]) -> Callable[..., R]:
    """Return a kernel that is to be called with other leading arguments and the same arrays after them.

    Parameters
    ----------
    kernel
        A function made by `kernels.compile.jit`, whose last parameter takes any number of arrays.
    leading
        Leading arguments as those of the calls to come: an integer where they have integers, and so on. Arrays among
        them have to be the same in every call, or of the same type for certain.
    arrays
        The arrays.
    """
    after = tuple(arrays)
    if not hasattr(kernel, "py_func"):
        return lambda *first: kernel(*first, *after)
    import numba  # pyright: ignore[reportMissingTypeStubs]

    kind = cast(Any, numba).typeof
    entry = cast(Any, kernel).compile((*(kind(value) for value in leading), kind(after)))
    return lambda *first: entry(*first, after)
