"""Which sources decide what a kernel is compiled to: its own file, and all of the package that the file imports."""

from __future__ import annotations

import hashlib
import re
import sys
from functools import cache
from pathlib import Path

import llvmlite  # pyright: ignore[reportMissingTypeStubs]
import numba
import numpy as np

PACKAGE = Path(__file__).resolve().parents[1]
"""The folder of the package."""

_IMPORT = re.compile(rb"^\s*from dubins_traffic\.([\w.]+) import ", re.MULTILINE)


@cache
def versions_hash() -> str:
    """Return a hash of the versions of what compiles kernels."""
    digest = hashlib.sha256()
    for part in (sys.version, numba.__version__, llvmlite.__version__, np.__version__):
        digest.update(part.encode())
    return digest.hexdigest()[:16]


@cache
def source_hash(file: Path) -> str:
    """Return a hash of a file that holds kernels, and of all files of the package that it imports, over any steps."""
    digest = hashlib.sha256()
    for source in sorted(imported(file)):
        inside = PACKAGE in source.parents
        digest.update(str(source.relative_to(PACKAGE) if inside else source.name).encode())
        digest.update(source.read_bytes())
    return digest.hexdigest()[:16]


def imported(file: Path) -> set[Path]:
    """Return `file` and all files of the package that it imports, over any number of steps."""
    found = {file}
    waiting = [file]
    while waiting:
        for other in _imports(waiting.pop()):
            if other not in found:
                found.add(other)
                waiting.append(other)
    return found


@cache
def kernel_files() -> list[Path]:
    """Return the files of the package that hold kernels, in order."""
    return sorted(file for file in PACKAGE.rglob("*.py") if b"\n@jit" in file.read_bytes())


@cache
def _imports(file: Path) -> frozenset[Path]:
    """Return the modules that a file imports; of a package from which it imports anything, all modules in it."""
    found: set[Path] = set()
    for name in _IMPORT.findall(file.read_bytes()):
        place = PACKAGE.joinpath(*name.decode().split("."))
        module = place.with_suffix(".py")
        found.update([module] if module.is_file() else place.glob("*.py"))
    return frozenset(found)
