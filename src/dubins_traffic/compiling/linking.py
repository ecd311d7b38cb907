"""Linking: object files of kernels become one library, with a manifest beside it, whole or not at all."""

from __future__ import annotations

import hashlib
import json
import os
import shlex
import shutil
import subprocess
import sys
from collections.abc import Iterator, Mapping, Sequence
from importlib.metadata import version
from importlib.util import find_spec
from pathlib import Path
from tempfile import TemporaryDirectory

from dubins_traffic.compiling import store
from dubins_traffic.errors import InputError
from dubins_traffic.kernels.sources import makers_hash, symbol

LINKERS = ("cc", "gcc", "clang")
OPTIONS = ("-shared", "-nostdlib", "-Wl,-s", "-Wl,-z,noexecstack", "-Wl,-z,now")
"""No library is linked in: of what kernels call, filling memory, every process has its own."""


def linker() -> list[str]:
    """Return the command that links: what ``CC`` names, else a compiler of the system or of the wheel `ziglang`.

    Raises
    ------
    InputError
        If there is none.
    """
    if named := os.environ.get("CC"):
        return shlex.split(named)
    for name in LINKERS:
        if shutil.which(name):
            return [name]
    if find_spec("ziglang") is not None:
        return [sys.executable, "-m", "ziglang", "cc"]
    raise InputError("no linker", file="CC", expected=f"{', '.join(LINKERS)} or `pip install ziglang`")


def link(files: Mapping[str, Path], level: str, folder: Path) -> Path:
    """Write a library of compiled kernels and its manifest, in place of an earlier one for the same level.

    Parameters
    ----------
    files : mapping
        The files of compiled kernels (`compiling.store`), by their keys.
    level : str
        The level of processors that they are compiled for.
    folder : Path
        Where to; made if missing.

    Returns
    -------
    Path
        The library.

    Raises
    ------
    InputError
        If there is no linker, or it fails.
    OSError
        If the files can't be read or written.
    """
    kernels: dict[str, dict[str, str]] = {}
    folder.mkdir(parents=True, exist_ok=True)
    with TemporaryDirectory(prefix=".build-", dir=folder) as place:
        objects: list[str] = []
        for key, path in sorted(files.items()):
            held = store.load(path)
            if held is None:
                raise FileNotFoundError(str(path))
            name = symbol(key)
            objects.append(f"{name}.o")
            (Path(place) / objects[-1]).write_bytes(held[1])
            kernels[name] = {"kernel": key, "answer": repr(held[0])}
        _run([*linker(), *OPTIONS, "-o", "library.so", *objects], place)
        digest = hashlib.sha256((Path(place) / "library.so").read_bytes()).hexdigest()
        library = folder / f"{level}-{digest[:12]}.so"
        (Path(place) / "library.so").chmod(store.READABLE)
        (Path(place) / "library.so").replace(library)
    manifest = {
        "version": version("dubins-traffic"),
        "level": level,
        "makers": makers_hash(),
        "file": library.name,
        "sha256": digest,
        "kernels": kernels,
    }
    store.write_whole(folder / f"{level}.json", json.dumps(manifest, indent=1).encode() + b"\n")
    for path in _others(folder, level, library):
        path.unlink(missing_ok=True)
    return library


def _others(folder: Path, level: str, library: Path) -> Iterator[Path]:
    """Return the libraries of a level that no manifest names any more; a process that uses one keeps it."""
    return (path for path in folder.glob(f"{level}-*.so") if path != library)


def _run(command: Sequence[str], folder: str) -> None:
    """Run the linker."""
    try:
        ran = subprocess.run(command, cwd=folder, capture_output=True, text=True, check=False)
    except OSError as error:
        raise InputError(f"the linker can't be run: {error.strerror}", file="CC", value=command[0]) from error
    if ran.returncode:
        lines = ran.stderr.strip().splitlines() or [f"status {ran.returncode}"]
        raise InputError(f"the linker failed: {lines[-1]}", file="CC", value=command[0])
