"""Which sources decide what a kernel is compiled to: its own file, and all of the package that the file imports."""

from __future__ import annotations

import hashlib
import re
from collections.abc import Sequence
from functools import cache
from pathlib import Path

from dubins_traffic.kernels.kinds import Kind

PACKAGE = Path(__file__).resolve().parents[1]
"""The folder of the package."""

MAKERS = frozenset(
    PACKAGE / name
    for name in (
        "compiling/compiler.py",
        "compiling/frontend.py",
        "compiling/lowering.py",
        "kernels/kinds.py",
    )
)
"""The sources that say how kernels are compiled and called: they count for all kernels."""

KEEPERS = frozenset(
    PACKAGE / "kernels" / f"{name}.py"
    for name in ("calls", "compile", "folders", "levels", "library", "machine", "sources")
)
"""The sources that say when machine code is looked for, and where, which changes none of it."""

_IMPORT = re.compile(rb"^\s*from dubins_traffic\.([\w.]+) import ", re.MULTILINE)


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


def key_of(file: Path, name: str, kinds: Sequence[Kind]) -> str:
    """Return what names a kernel, whatever it is compiled for: a folder of its source and a file.

    Parameters
    ----------
    file : Path
        The source that holds the kernel, of this package or another.
    name : str
        Name of the kernel in it.
    kinds : sequence of Kind
        Those of its arguments.
    """
    module = ".".join(file.relative_to(PACKAGE).with_suffix("").parts) if PACKAGE in file.parents else file.stem
    digest = hashlib.sha256(repr(tuple(kinds)).encode()).hexdigest()[:24]
    return f"{module}-{source_hash(file)}/{name}-{digest}"


def symbol(key: str) -> str:
    """Return the name of the function in a kernel's machine code."""
    return "kernel_" + hashlib.sha256(key.encode()).hexdigest()[:24]


def imported(file: Path) -> set[Path]:
    """Return `file` and all files of the package that it imports, over any number of steps."""
    files = {file}
    waiting = [file]
    while waiting:
        for other in _imports(waiting.pop()):
            if other not in files:
                files.add(other)
                waiting.append(other)
    return files


@cache
def _text_of(file: Path) -> tuple[bytes, tuple[bytes, ...]]:
    """Return a hash of a file, and the names that it imports of the package."""
    data = file.read_bytes()
    return hashlib.sha256(data).digest(), tuple(_IMPORT.findall(data))


@cache
def _imports(file: Path) -> frozenset[Path]:
    """Return the modules that a file imports; of a package from which it imports anything, all modules in it."""
    files: set[Path] = set()
    for name in _text_of(file)[1]:
        place = PACKAGE.joinpath(*name.decode().split("."))
        module = place.with_suffix(".py")
        files.update([module] if module.is_file() else place.glob("*.py"))
    return frozenset(files - KEEPERS)
