"""Compiled kernels on disk: found by what the sources say, and checked before they are used.

The cache folder is named by the versions of the compiler; each folder in it by a module and a hash of its text and of
all that it imports (`kernels.sources`). What is compiled depends on the functions that a kernel calls and the constants
that it reads, wherever they stand. So the same version in another environment compiles nothing. A file is named by the
kernel, the kinds of its arguments and the processor, and begins with the hash of what follows. A file that does not
fit its hash is removed, and the kernel compiled again.
"""

from __future__ import annotations

import ast
import contextlib
import hashlib
import os
import sys
import tempfile
from collections.abc import Sequence
from functools import cache
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path

from dubins_traffic.kernels.folders import KEPT, TIER, base_folder, own_folder
from dubins_traffic.kernels.kinds import Kind
from dubins_traffic.kernels.sources import makers_hash

SUFFIX = ".kernel"
"""Ending of the files of compiled kernels."""

READABLE = 0o644
"""The mode of the files: a controller in a box (`dubins_traffic.sandbox`) is another user, and reads them."""

LIBRARIES = ("numba", "llvmlite", "numpy")
"""What compiles kernels."""

_DIGEST = hashlib.sha256().digest_size


@cache
def versions_hash() -> str:
    """Return a hash of the versions of what compiles kernels, and of how it is done here."""
    digest = hashlib.sha256(sys.version.encode())
    for name in LIBRARIES:
        digest.update(_version(name).encode())
    digest.update(makers_hash().encode())
    return digest.hexdigest()[:16]


@cache
def cache_folder() -> Path:
    """Return a folder for compiled kernels that can be written: the user's cache, else a temporary one.

    Raises
    ------
    OSError
        If there is none that others can't write.
    """
    folder = base_folder() / versions_hash()
    if os.environ.get(TIER) == KEPT:
        return folder
    with contextlib.suppress(OSError):
        own_folder(folder)
        with tempfile.TemporaryFile(dir=folder):
            pass
        return folder
    return own_folder(Path(tempfile.gettempdir()) / f"dubins-traffic-{os.getuid()}" / versions_hash())


def kernel_file(key: str, processor: Sequence[str]) -> Path:
    """Return where the machine code of a kernel is kept for a processor, as `kernels.machine.processor` returns it."""
    digest = hashlib.sha256(repr(tuple(processor)).encode()).hexdigest()[:8]
    return cache_folder() / f"{key}-{digest}{SUFFIX}"


def load(path: Path) -> tuple[Kind, bytes] | None:
    """Return the kind of a kernel's answer and its machine code; None if there is nothing, or nothing whole."""
    try:
        data = path.read_bytes()
    except OSError:
        return None
    digest, payload = data[:_DIGEST], data[_DIGEST:]
    if hashlib.sha256(payload).digest() != digest:
        _say_damaged(path)
        path.unlink(missing_ok=True)
        return None
    answer, _, code = payload.partition(b"\n")
    return ast.literal_eval(answer.decode()), code


def save(path: Path, answer: Kind, code: bytes) -> None:
    """Keep machine code under `path`, whole or not at all.

    Raises
    ------
    OSError
        If it can't be written.
    """
    payload = repr(answer).encode() + b"\n" + code
    write_whole(path, hashlib.sha256(payload).digest() + payload)


def write_whole(path: Path, data: bytes) -> None:
    """Write a file, and its folder if that is missing, whole or not at all.

    Raises
    ------
    OSError
        If it can't be written.
    """
    path.parent.mkdir(parents=True, exist_ok=True)
    handle, written = tempfile.mkstemp(dir=path.parent, prefix=f"{path.stem[:64]}.", suffix=".tmp")
    try:
        with os.fdopen(handle, "wb") as file:
            os.fchmod(handle, READABLE)
            file.write(data)
        Path(written).replace(path)
    except BaseException:
        Path(written).unlink(missing_ok=True)
        raise


def _version(name: str) -> str:
    try:
        return version(name)
    except PackageNotFoundError:
        return ""


@cache
def _say_damaged(path: Path) -> None:
    print(
        f"dubins-traffic: the compiled kernel {path.name} in {path.parent} is damaged; it is compiled again",
        file=sys.stderr,
    )
