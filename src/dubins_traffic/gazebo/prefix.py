"""Finds Gazebo, in a folder of this package or on the machine, and the environment that its programs need.

The world plugin, whose source is shipped with the package, is compiled against the headers of an installation.
"""

from __future__ import annotations

import hashlib
import json
import os
import shlex
import shutil
import subprocess
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any, Final, cast

from platformdirs import user_cache_path

from dubins_traffic import files
from dubins_traffic.errors import InputError
from dubins_traffic.gazebo.link import PROTOCOL

VARIABLE: Final = "DUBINS_TRAFFIC_GAZEBO"
"""The environment variable that names another folder than the default."""
MANIFEST: Final = "installed.json"
FORMAT: Final = 1
COMMAND: Final = "dubins-traffic gazebo install"


@dataclass(frozen=True, slots=True)
class Installation:
    """A Gazebo that can be started: `root` is the unpacked installation, or None for the machine's own."""

    prefix: Path
    gzserver: Path
    root: Path | None

    @property
    def plugin(self) -> Path:
        """The compiled world plugin."""
        return self.prefix / folder_name() / PLUGIN

    @property
    def confinement(self) -> Path:
        """The library that is preloaded into the server."""
        return self.prefix / folder_name() / CONFINEMENT

    @property
    def gzclient(self) -> Path:
        """The program that shows what a server does."""
        return self.gzserver.with_name("gzclient")

    def environment(self) -> dict[str, str]:
        """Return the variables that Gazebo's programs need to find their libraries and files."""
        return {} if self.root is None else surroundings(self.root)


def surroundings(root: Path) -> dict[str, str]:
    """Return the variables with which programs below `root` find their libraries and files."""
    system = library_folder(root)
    folders = (
        system / "blas",
        system / "lapack",
        system,
        root / "lib" / system.name,
        root / "usr" / "lib",
        system / "pulseaudio",
        system / "gazebo-11" / "plugins",
    )
    return {
        "LD_LIBRARY_PATH": os.pathsep.join(map(str, folders)),
        "GAZEBO_RESOURCE_PATH": str(root / "usr" / "share" / "gazebo-11"),
        "GAZEBO_PLUGIN_PATH": str(system / "gazebo-11" / "plugins"),
        "OGRE_RESOURCE_PATH": str(system / "OGRE-1.9.0"),
        "LIBGL_DRIVERS_PATH": str(system / "dri"),
        "QT_PLUGIN_PATH": str(system / "qt5" / "plugins"),
    }


def library_folder(root: Path) -> Path:
    """Return the folder of the libraries of this machine's kind below `root`."""
    folders = sorted((root / "usr" / "lib").glob("*-linux-gnu"))
    return folders[0] if folders else root / "usr" / "lib"


def place(prefix: str | os.PathLike[str] | None = None) -> Path:
    """Return the folder of the installation: the one given, else the environment's, else one in the user's cache."""
    chosen = prefix or os.environ.get(VARIABLE)
    return Path(chosen).expanduser().absolute() if chosen else user_cache_path("dubins-traffic") / "gazebo"


def find(prefix: str | os.PathLike[str] | None = None) -> Installation:
    """Return the installation in `prefix` (see `place`), checked as far as can be without starting it.

    InputError if there is none, it was not finished, or what it was finished with has gone or is of another version.
    """
    folder = place(prefix)
    manifest = read_manifest(folder)
    if manifest is None:
        problem = "Gazebo is not installed"
        if folder.is_dir() and any(folder.iterdir()):
            problem = "the installation of Gazebo was not finished; the command goes on where it stopped"
        raise _unfit(problem, folder)
    root = None if manifest.get("own") else folder / "root"
    installation = Installation(folder, Path(str(manifest.get("gzserver"))), root)
    if not os.access(installation.gzserver, os.X_OK):
        raise _unfit(f"{installation.gzserver} has gone", folder)
    for built in (installation.plugin, installation.confinement):
        if not built.is_file():
            other = manifest.get("plugin") != folder_name()
            problem = "is of another version of this package" if other else "has gone"
            raise _unfit(f"Gazebo's plugin {problem} ({built.name})", folder)
    return installation


def read_manifest(folder: Path) -> Mapping[str, Any] | None:
    """Return the marker of the last finished installation, or None."""
    try:
        manifest: Any = json.loads((folder / MANIFEST).read_text(encoding="utf-8"))
    except (OSError, ValueError):
        return None
    usable = isinstance(manifest, dict) and cast("dict[str, Any]", manifest).get("format") == FORMAT
    return cast("dict[str, Any]", manifest) if usable else None


def write_manifest(folder: Path, gzserver: Path, *, own: bool, version: str) -> None:
    """Write the marker of a finished installation."""
    manifest = {
        "format": FORMAT,
        "gazebo": version,
        "gzserver": str(gzserver),
        "own": own,
        "plugin": folder_name(),
    }
    files.write_text(folder / MANIFEST, json.dumps(manifest, indent=1) + "\n")


def _unfit(problem: str, folder: Path) -> InputError:
    command = COMMAND
    if folder != place():
        command += f" --prefix {folder}"
    return InputError(problem, file=str(folder), field="simulator", value="gazebo", expected=f"`{command}` first")


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
    """Return the C++ compiler: that of the variable CXX, else g++; InputError if there is none."""
    name = os.environ.get("CXX") or "g++"
    program = shutil.which(name)
    if program is None:
        raise InputError("no C++ compiler", field="CXX", value=name, expected="g++ 9 or newer (Debian: g++)")
    return program


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
    below = sorted(include.glob("gazebo-*")) + sorted(include.glob("sdformat-*")) + sorted(include.glob("ignition/*"))
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
