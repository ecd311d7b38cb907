"""The compiler's settings, and where compiled kernels are kept.

The cache folder is named by the versions of the compiler; each folder in it by a module and a hash of its text and of
all that it imports (`kernels.sources`). What is compiled depends on the functions that a kernel calls and the constants
that it reads, wherever they stand.
"""

from __future__ import annotations

import os
import tempfile
from collections.abc import Callable
from functools import cache
from pathlib import Path
from typing import Any, ParamSpec, TypeVar, cast

import numba
from platformdirs import user_cache_path

from dubins_traffic.kernels import linking
from dubins_traffic.kernels.sources import PACKAGE, kernel_files, source_hash, versions_hash
from dubins_traffic.kernels.store import KernelCache

P = ParamSpec("P")
R = TypeVar("R")


@cache
def cache_folder() -> Path:
    """Return a folder for compiled kernels that can be written: the user's cache, else a temporary one."""
    root = os.environ.get("NUMBA_CACHE_DIR")
    base = Path(root) if root else user_cache_path("dubins-traffic") / "kernels"
    folder = base / versions_hash()
    try:
        folder.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryFile(dir=folder):
            pass
    except OSError:
        folder = Path(tempfile.gettempdir()) / f"dubins-traffic-{os.getuid()}" / versions_hash()
        folder.mkdir(parents=True, exist_ok=True)
    return folder


def nothing_compiled() -> bool:
    """Whether the cache can be looked into, holds no kernel of these sources yet, and kernels are to be compiled."""
    if cast(Any, numba).config.DISABLE_JIT:
        return False
    try:
        present = {path.name for path in cache_folder().iterdir()}
    except OSError:
        return False
    return present.isdisjoint(module_folder(file).name for file in kernel_files())


def module_folder(file: Path) -> Path:
    """Return the folder for the compiled kernels of a file, of this package or another."""
    name = ".".join(file.relative_to(PACKAGE).with_suffix("").parts) if PACKAGE in file.parents else file.stem
    return cache_folder() / f"{name}-{source_hash(file)}"


def jit(function: Callable[P, R]) -> Callable[P, R]:
    """Compile `function` on first use, without fast-math and without exceptions on division.

    The compiled code is cached on disk. With ``NUMBA_DISABLE_JIT=1`` the function is returned as it is. Kernels
    don't allocate, so references to arrays are not counted (`_nrt`): each call would else count every array of
    the tables it is given up and down, which takes longer than most kernels do.

    A kernel whose name begins with an underscore can be called from other kernels only: the code that would unpack
    Python's arguments often takes longer to compile than the kernel.
    """
    return _compiled(function)


def jit_inline(function: Callable[P, R]) -> Callable[P, R]:
    """Compile as `jit` does, and always into the caller: for small functions that take whole tables.

    Handing over a table of arrays costs more than the few operations of such a function.
    """
    return _compiled(function, inlined=True)


def jit_inner(function: Callable[P, R]) -> Callable[P, R]:
    """Compile as `jit` does a kernel whose name begins with an underscore: only other kernels can call it."""
    return _compiled(function, inner=True)


def jit_wide(function: Callable[P, R]) -> Callable[P, R]:
    """Compile as `jit` does, and make the same steps for several cars one instruction: the compiler takes longer."""
    return _compiled(function, wide=True)


def _compiled(
    function: Callable[P, R], *, inlined: bool = False, inner: bool = False, wide: bool = False
) -> Callable[P, R]:
    library = cast(Any, numba)
    linking.install()
    inner = inner or function.__name__.startswith("_")
    if inner or inlined:
        linking.mark_inner(function.__module__, function.__qualname__)
    if wide:
        linking.mark_wide(function.__module__, function.__qualname__)
    compiler = library.njit(
        error_model="numpy",
        nogil=True,
        forceinline=inlined,
        _nrt=False,
        no_cfunc_wrapper=True,
        no_cpython_wrapper=inner,
    )
    compiled = compiler(function)
    if not library.config.DISABLE_JIT:
        compiled._cache = KernelCache(function, module_folder(Path(function.__code__.co_filename)))
    return cast(Callable[P, R], compiled)
