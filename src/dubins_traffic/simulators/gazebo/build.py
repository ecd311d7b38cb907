"""Compiles the world plugin, whose source is shipped with the package, against the headers of an installation."""

from __future__ import annotations

import hashlib
import os
import shlex
import shutil
import subprocess
from functools import cache
from pathlib import Path
from typing import Final

from dubins_traffic.errors import InputError
from dubins_traffic.simulators.gazebo.link import PROTOCOL

SOURCES: Final = Path(__file__).with_name("plugin")
WORLD: Final = SOURCES / "world.cc"
CONFINE: Final = SOURCES / "confine.cc"
PLUGIN: Final = "libdubins_traffic_world.so"
CONFINEMENT: Final = "libdubins_traffic_confine.so"
OPTIONS: Final = ("-std=c++17", "-O1", "-fPIC", "-shared", "-w", f"-DDUBINS_TRAFFIC_PROTOCOL={PROTOCOL}")
LIMIT: Final = 300.0
"""Seconds after which a compiler is ended."""


@cache
def folder_name() -> str:
    """Return the name of the folder for the libraries built from these sources."""
    digest = hashlib.sha256(" ".join(OPTIONS).encode())
    for source in (WORLD, CONFINE):
        digest.update(source.read_bytes())
    return f"plugin-{PROTOCOL}-{digest.hexdigest()[:12]}"


def compiler() -> str:
    """Return the C++ compiler: that of the variable CXX, else g++.

    Raises
    ------
    InputError
        If there is none.
    """
    name = os.environ.get("CXX") or "g++"
    found = shutil.which(name)
    if found is None:
        raise InputError("no C++ compiler", field="CXX", value=name, expected="g++ 9 or newer (Debian: g++)")
    return found


def build(prefix: Path, root: Path | None) -> None:
    """Compile both libraries into their folder in `prefix`, unless they are there.

    Parameters
    ----------
    prefix : Path
        Of the installation.
    root : Path or None
        Below which the headers are; None for those of the machine's own Gazebo.

    Raises
    ------
    InputError
        If it can't be compiled; says what the compiler said last.
    """
    folder = prefix / folder_name()
    if (folder / PLUGIN).is_file() and (folder / CONFINEMENT).is_file():
        return
    includes = _own_flags() if root is None else _flags(root)
    folder.mkdir(parents=True, exist_ok=True)
    _compile(CONFINE, folder / CONFINEMENT, ["-ldl"])
    _compile(WORLD, folder / PLUGIN, includes)


def _flags(root: Path) -> list[str]:
    include = root / "usr" / "include"
    below = (
        sorted(include.glob("gazebo-*"))
        + sorted(include.glob("sdformat-*"))
        + sorted(include.glob("ignition/*"))
    )
    folders = [include, *below, *(folder / "gazebo" for folder in below if folder.name.startswith("gazebo-"))]
    return [f"-I{folder}" for folder in folders]


def _own_flags() -> list[str]:
    command = ["pkg-config", "--cflags", "gazebo"]
    try:
        done = subprocess.run(command, capture_output=True, text=True, check=True, timeout=30)
    except (OSError, subprocess.SubprocessError) as error:
        raise InputError(
            "the headers of this machine's Gazebo can't be found",
            value=" ".join(command),
            expected="pkg-config and libgazebo-dev, or no gzserver on the path",
        ) from error
    return [flag for flag in shlex.split(done.stdout) if not flag.startswith("-std=")]


def _compile(source: Path, target: Path, flags: list[str]) -> None:
    neighbour = target.with_suffix(f".{os.getpid()}.tmp")
    command = [compiler(), *OPTIONS, str(source), "-o", str(neighbour), *flags]
    try:
        done = subprocess.run(command, capture_output=True, text=True, check=False, timeout=LIMIT)
        if done.returncode != 0:
            said = " | ".join(line.strip() for line in done.stderr.splitlines() if "error" in line)[:600]
            raise InputError(f"can't be compiled ({said or done.stderr[-300:]})", file=str(source))
        neighbour.replace(target)
    except subprocess.TimeoutExpired:
        raise InputError(f"the compiler took more than {LIMIT:g} s", file=str(source)) from None
    finally:
        neighbour.unlink(missing_ok=True)
