"""Compiled kernels on disk: found by what the sources say, and checked before they are used.

Numba's own cache is keyed by the path and the time of a source, so that the same version in another environment
compiles all anew; and it loads a damaged file as it is, which ends the process. Here a kernel's file lies in a folder
named by its module's sources (`kernels.compile.module_folder`), is named by the kernel and its argument types, and
begins with the hash of what follows. A file that does not fit its hash is removed, and the kernel compiled again.
"""

from __future__ import annotations

import hashlib
import os
import pickle
import sys
import tempfile
from collections.abc import Callable
from functools import cache
from pathlib import Path
from typing import Any, cast

from numba.core import caching, compiler, serialize  # pyright: ignore[reportMissingTypeStubs]

SUFFIX = ".kernel"
"""Ending of the files of compiled kernels."""

_DIGEST = hashlib.sha256().digest_size
_library = cast(Any, caching)
_compiler = cast(Any, compiler)


class KernelFiles:
    """The files of one kernel, one for each combination of argument types.

    Parameters
    ----------
    folder : Path
        Where they are kept.
    name : str
        Name of the kernel.
    """

    def __init__(self, folder: Path, name: str) -> None:
        self._folder = folder
        self._name = name

    def load(self, key: object) -> object | None:
        """Return what has been saved under `key`, None if nothing has, or nothing that is whole."""
        path = self._path(key)
        try:
            data = path.read_bytes()
        except OSError:
            return None
        digest, payload = data[:_DIGEST], data[_DIGEST:]
        if hashlib.sha256(payload).digest() != digest:
            _say_damaged(path)
            path.unlink(missing_ok=True)
            return None
        try:
            saved_key, value = pickle.loads(payload)
        except (ImportError, AttributeError):
            # A type among the arguments was defined where it is no more: another version of this package saved it.
            return None
        return value if saved_key == key else None

    def save(self, key: object, value: object) -> None:
        """Keep `value` under `key`; where that cannot be written, say so once and go on without."""
        payload: bytes = cast(Any, serialize).dumps((key, value))
        path = self._path(key)
        try:
            self._folder.mkdir(parents=True, exist_ok=True)
            handle, written = tempfile.mkstemp(dir=self._folder, prefix=f"{path.stem[:64]}.", suffix=".tmp")
            try:
                with os.fdopen(handle, "wb") as file:
                    file.write(hashlib.sha256(payload).digest())
                    file.write(payload)
                Path(written).replace(path)
            except BaseException:
                Path(written).unlink(missing_ok=True)
                raise
        except OSError as error:
            _say_not_kept(str(self._folder), error.strerror or str(error))

    def flush(self) -> None:
        """Remove what has been saved."""
        for path in self._folder.glob(f"{self._name}-*{SUFFIX}"):
            path.unlink(missing_ok=True)

    def _path(self, key: object) -> Path:
        """Return the file of `key`, whose text names the argument types, the processor and the kernel's code."""
        digest = hashlib.sha256(repr(key).encode()).hexdigest()[:24]
        return self._folder / f"{self._name}-{digest}{SUFFIX}"


@cache
def _say_damaged(path: Path) -> None:
    print(
        f"dubins-traffic: the compiled kernel {path.name} in {path.parent} is damaged; it is compiled again",
        file=sys.stderr,
    )


@cache
def _say_not_kept(folder: str, why: str) -> None:
    print(f"dubins-traffic: compiled kernels cannot be kept in {folder}: {why}", file=sys.stderr)


class KernelCache(_library._Cache):
    """What Numba's dispatcher asks for the compiled code of one kernel.

    Parameters
    ----------
    function : callable
        The kernel's Python function.
    folder : Path
        A folder named by all that decides what the kernels of a module are compiled to, except the types of the
        arguments and the processor.
    """

    def __init__(self, function: Callable[..., Any], folder: Path) -> None:
        self._files = KernelFiles(folder, function.__qualname__)
        self._line = function.__code__.co_firstlineno
        self._enabled = True
        self.folder = folder

    @property
    def cache_path(self) -> str:
        """The folder, as text."""
        return str(self.folder)

    def load_overload(self, sig: Any, target_context: Any) -> Any:
        """Return the compiled code for argument types `sig`, None if there is none."""
        target_context.refresh()
        if not self._enabled:
            return None
        reduced: Any = self._files.load(self._key(sig, target_context.codegen()))
        return None if reduced is None else _compiler.CompileResult._rebuild(target_context, *reduced)

    def save_overload(self, sig: Any, data: Any) -> None:
        """Keep compiled code, unless it holds addresses of this process."""
        if self._enabled and not data.library.has_dynamic_globals:
            self._files.save(self._key(sig, data.codegen), data._reduce())

    def enable(self) -> None:
        """Use the cache."""
        self._enabled = True

    def disable(self) -> None:
        """Neither look into the cache nor write to it."""
        self._enabled = False

    def flush(self) -> None:
        """Remove the kernel's files."""
        self._files.flush()

    def _key(self, sig: Any, codegen: Any) -> object:
        return self._line, sig, codegen.magic_tuple()
