"""How compiled kernels are put together: an entry and all kernels that it calls are optimised as one program.

Numba keeps every compiled function callable from outside, so that a kernel's tables, hundreds of numbers, are handed
from function to function whole, which takes longer than most kernels do. Here the functions that an entry calls become
its own: what only it calls is put into it, and the others are handed only what they use. Kernels that only other
kernels call are left as they are until an entry takes them up, since all work on them before would be done again.

Numba also looks at every index for whether it is negative, and then counts from the end. Kernels never count from the
end, and an index is the number of an element.

Both rest on inner functions of Numba's (`docs/design/030-batch.md`). Where Numba has them no more, kernels work as they
did, slower. Functions of other packages are left alone.
"""

from __future__ import annotations

from typing import Any, cast

MARK = "dubins_traffic"
"""Part of the names of our compiled functions."""

FOR_PYTHON = "_ZN7cpython"
"""How the names of functions begin that Python calls."""

_inner: set[str] = set()
"""How the names of compiled functions begin that only other kernels call."""

_wide: set[str] = set()
"""How the names of entries begin in which straight code, not only loops, is put into vectors."""


def mark_inner(module: str, name: str) -> None:
    """Note that the function `name` of `module` is only called from other kernels."""
    _inner.add(_mangled(module, name))


def mark_wide(module: str, name: str) -> None:
    """Note that straight code of the function `name` of `module`, and of all that it calls, is put into vectors."""
    _wide.add(_mangled(module, name))


def _mangled(module: str, name: str) -> str:
    return "_ZN" + "".join(f"{len(part)}{part}" for part in (*module.split("."), name))


def install() -> None:
    """Let Numba put our kernels together as said above; to be called before any is compiled."""
    from numba.core import codegen, config, types  # pyright: ignore[reportMissingTypeStubs]
    from numba.np import arrayobj  # pyright: ignore[reportMissingTypeStubs]

    _optimise_whole(cast(Any, codegen).CPUCodeLibrary, cast(Any, config))
    _index_plainly(cast(Any, arrayobj), cast(Any, types).intp)


def _optimise_whole(library: Any, config: Any) -> None:
    optimise = getattr(library, "_optimize_final_module", None)
    if optimise is None or hasattr(optimise, "of_kernels"):
        return

    def optimise_kernels(self: Any) -> None:
        defined = [function for function in self._final_module.functions if not function.is_declaration]
        ours = [function for function in defined if MARK in function.name]
        own = [function.name for function in ours if function.linkage.name == "external"]
        names = {name.partition("B")[0] for name in own if not name.startswith(FOR_PYTHON)}
        if own:
            if names <= _inner:
                return
            for function in ours:
                if function.linkage.name == "linkonce_odr":
                    function.linkage = "internal"
        usual = config.SLP_VECTORIZE
        config.SLP_VECTORIZE = int(usual or not names.isdisjoint(_wide))
        try:
            optimise(self)
        finally:
            config.SLP_VECTORIZE = usual

    cast(Any, optimise_kernels).of_kernels = True
    library._optimize_final_module = optimise_kernels


def _index_plainly(arrays: Any, number: Any) -> None:
    wrap = getattr(arrays, "fix_integer_index", None)
    if wrap is None or hasattr(wrap, "of_kernels"):
        return

    def keep_index(context: Any, builder: Any, kind: Any, index: Any, size: Any) -> Any:
        if kind.signed and MARK in builder.function.name:
            return context.cast(builder, index, kind, number)
        return wrap(context, builder, kind, index, size)

    cast(Any, keep_index).of_kernels = True
    arrays.fix_integer_index = keep_index
