"""Which sources decide what a kernel is compiled to: its own file, and all of the package that the file imports."""

from __future__ import annotations

import hashlib
import re
import sys
from functools import cache
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path

PACKAGE = Path(__file__).resolve().parents[1]
"""The folder of the package."""

LIBRARIES = ("numba", "llvmlite", "numpy")
"""What compiles kernels."""

MAKERS = frozenset(
    PACKAGE / "kernels" / f"{name}.py" for name in ("compiler", "frontend", "kinds", "lowering")
)
"""The sources that say how kernels are compiled and called: they count for all kernels."""

KEEPERS = frozenset(
    PACKAGE / "kernels" / f"{name}.py"
    for name in (
        "beside",
        "builder",
        "calls",
        "compile",
        "folders",
        "levels",
        "library",
        "linking",
        "machine",
        "sources",
        "store",
    )
)
"""The sources that say when kernels are compiled and where they are kept, which changes no machine code."""

_IMPORT = re.compile(rb"^\s*from dubins_traffic\.([\w.]+) import ", re.MULTILINE)


@cache
def versions_hash() -> str:
    """Return a hash of the versions of what compiles kernels, and of how it is done here."""
    digest = hashlib.sha256(sys.version.encode())
    for name in LIBRARIES:
        digest.update(_version(name).encode())
    digest.update(makers_hash().encode())
    return digest.hexdigest()[:16]


@cache
def makers_hash() -> str:
    """Return a hash of how kernels are compiled and called here, whichever versions compile them."""
    digest = hashlib.sha256()
    for file in sorted(MAKERS):
        digest.update(_text_of(file)[0])
    return digest.hexdigest()[:16]


@cache
def source_hash(file: Path) -> str:
    """Return a hash of a file that holds kernels, and of all files of the package that it imports, over any steps."""
    digest = hashlib.sha256()
    for source in sorted(imported(file)):
        inside = PACKAGE in source.parents
        digest.update(str(source.relative_to(PACKAGE) if inside else source.name).encode())
        digest.update(_text_of(source)[0])
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


def _version(name: str) -> str:
    try:
        return version(name)
    except PackageNotFoundError:
        return ""


@cache
def _text_of(file: Path) -> tuple[bytes, tuple[bytes, ...]]:
    """Return a hash of a file, and the names that it imports of the package."""
    data = file.read_bytes()
    return hashlib.sha256(data).digest(), tuple(_IMPORT.findall(data))


@cache
def _imports(file: Path) -> frozenset[Path]:
    """Return the modules that a file imports; of a package from which it imports anything, all modules in it."""
    found: set[Path] = set()
    for name in _text_of(file)[1]:
        place = PACKAGE.joinpath(*name.decode().split("."))
        module = place.with_suffix(".py")
        found.update([module] if module.is_file() else place.glob("*.py"))
    return frozenset(found - KEEPERS)
