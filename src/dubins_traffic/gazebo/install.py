"""Installs Gazebo into a folder of the user, and checks step by step whether it can be used."""

from __future__ import annotations

import contextlib
import fcntl
import os
import platform
import shutil
import signal
import subprocess
from collections.abc import Callable, Generator, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Final

import numpy as np

from dubins_traffic.cars.body import Disc
from dubins_traffic.cars.state import Pose
from dubins_traffic.errors import InputError
from dubins_traffic.gazebo import prefix
from dubins_traffic.gazebo.link import LostError, MessageKind
from dubins_traffic.gazebo.prefix import Installation
from dubins_traffic.gazebo.server import Server
from dubins_traffic.gazebo.world import WHEEL_RADIUS, world

STEPS: Final = 200
SPEED: Final = 0.5
SLACK: Final = 0.01
"""Largest error of the car's position after `STEPS` steps of 5 ms at `SPEED` m/s, metres."""


@dataclass(frozen=True, slots=True)
class Finding:
    """One check: whether it passed, and what was observed."""

    what: str
    well: bool
    seen: str


def examine(folder: Path) -> Iterator[Finding]:
    """Yield the checks of the installation in `folder`; after a failure those that depend on it are left out."""
    try:
        yield Finding("compiler", True, prefix.compiler())
    except InputError as error:
        yield Finding("compiler", False, str(error))
    try:
        installation = prefix.find(folder)
    except InputError as error:
        yield Finding("installation", False, str(error))
        return
    manifest = prefix.read_manifest(folder) or {}
    yield Finding("installation", True, str(folder))
    yield Finding("gzserver", True, f"{installation.gzserver}, version {manifest.get('gazebo')}")
    yield Finding("plugin", True, str(installation.plugin))
    try:
        drive_ahead(installation)
        yield Finding("one car drives ahead", True, f"{SPEED} m/s for 1 s")
    except InputError as error:
        yield Finding("one car drives ahead", False, str(error))


def drive_ahead(installation: Installation) -> None:
    """Start a server, let one car drive for a second, and end it.

    InputError if anything of this fails, or the car is not where it should be.
    """
    text = world([Pose(0.0, 0.0, 1.0, 0.0)], Disc(), (), 1.0 / STEPS, str(installation.plugin))
    server = None
    try:
        server = Server(installation, text)
        rate = SPEED / WHEEL_RADIUS
        x, y = server.ask(MessageKind.STEP, np.array([STEPS, rate, rate]))[:2].tolist()
    except LostError as error:
        why = str(error) if server is None else server.explain(error)
        raise InputError(f"Gazebo does not work here ({why})", file=str(installation.gzserver)) from error
    finally:
        if server is not None:
            server.close()
    if abs(x - SPEED) > SLACK or abs(y) > SLACK:
        raise InputError(
            "Gazebo moves a car wrongly",
            file=str(installation.gzserver),
            value=(x, y),
            expected=f"({SPEED}, 0) to within {SLACK} m",
        )


ROOM: Final = 1_350_000_000
"""Bytes that an installation needs on disk while it is made."""
UNPACKED: Final = "unpacked"
"""The file that says that all packages have been unpacked."""
OLDEST_LIBC: Final = (2, 31)
ANNOUNCEMENT: Final = """\
Gazebo 11 goes into {folder}
  about 260 MB to download, 1.1 GB on disk, two minutes; no root needed, nothing outside that folder is touched
  Gazebo is under the Apache License 2.0; the libraries it needs are Debian's packages, each under the licence in the
  copyright file that it carries, below the folder root of the installation"""
SCRIPT: Final = "gazebo-packages.sh"
"""What fetches and unpacks Debian's packages: in `scripts` of the sources, in a wheel beside this module."""
OWN: Final = "This machine's own Gazebo is used: {server}\n  only its plugin is built, in {folder}"


Progress = Callable[[str, float], None]
"""Called with a text on what is being done, and the share of it that is done."""


def announcement(folder: Path) -> str:
    """Return the notice before `install` begins: size, time and licences."""
    server = own_server()
    return ANNOUNCEMENT.format(folder=folder) if server is None else OWN.format(server=server, folder=folder)


def install(folder: Path, progress: Progress) -> None:
    """Complete the installation in `folder`: fetch, unpack, compile, try. It goes on where it stopped before.

    Parameters
    ----------
    folder : Path
        As of `prefix.place`; made if missing.
    progress : callable
        Is told what is being done and which share of it is done.

    Raises
    ------
    InputError
        If it can't be made; what was done so far is kept.
    """
    check_machine()
    try:
        folder.mkdir(parents=True, exist_ok=True)
        with _alone(folder):
            _install(folder, progress)
    except OSError as error:
        where = error.filename or folder
        raise InputError(f"can't be written ({error.strerror})", file=os.fsdecode(where)) from error


def _install(folder: Path, progress: Progress) -> None:
    server = own_server()
    root = None if server is not None else folder / "root"
    if root is not None:
        server = root / "usr" / "bin" / "gzserver"
        if not ((folder / UNPACKED).exists() and server.exists()):
            _unpack(folder, root, progress)
    assert server is not None
    progress("compile the plugin", 0.0)
    prefix.build(folder, root)
    progress("compile the plugin", 1.0)
    version = server_version(server, root)
    prefix.write_manifest(folder, server, own=root is None, version=version)
    progress("try it", 0.0)
    try:
        drive_ahead(prefix.find(folder))
    except InputError:
        (folder / prefix.MANIFEST).unlink(missing_ok=True)
        raise
    progress("try it", 1.0)


def _unpack(folder: Path, root: Path, progress: Progress) -> None:
    free = shutil.disk_usage(folder).free
    present = _size(root)
    if free + present < ROOM:
        raise InputError(
            "not enough room on the disk",
            file=str(folder),
            value=f"{free / 1e9:.2f} GB free",
            expected=f"{(ROOM - present) / 1e9:.2f} GB",
        )
    fetch_packages(folder, progress)
    shutil.rmtree(folder / "apt")
    (folder / UNPACKED).touch()


def fetch_packages(folder: Path, progress: Progress) -> None:
    """Fetch and unpack Debian's packages of Gazebo below `folder`, by a script that goes on where it stopped.

    InputError if it could not; says what the script said last.
    """
    beside = Path(__file__).with_name(SCRIPT)
    script = beside if beside.is_file() else Path(__file__).parents[3] / "scripts" / SCRIPT
    command = ["bash", str(script), str(folder)]
    pipe = subprocess.PIPE
    with subprocess.Popen(command, stdout=pipe, stderr=pipe, text=True, start_new_session=True) as process:
        try:
            for line in process.stdout or ():
                stage, _, share = line.rpartition(" ")
                progress(stage, int(share) / 100.0)
            said = (process.stderr.read() if process.stderr is not None else "").strip()
        except BaseException:
            os.killpg(process.pid, signal.SIGTERM)
            raise
    if process.returncode != 0:
        why = said.splitlines()[-1] if said else "it said nothing"
        raise InputError(f"Gazebo's packages can't be had ({why})", file=str(folder))


def _size(folder: Path) -> int:
    return sum(file.lstat().st_size for file in folder.rglob("*")) if folder.is_dir() else 0


def check_machine() -> None:
    """Raise InputError unless Gazebo's programs can run here."""
    if platform.system() != "Linux":
        raise InputError("Gazebo runs on Linux", value=platform.system(), expected="Linux")
    library, version = platform.libc_ver()
    numbers = tuple(int(part) for part in version.split(".")[:2] if part.isdigit())
    if library != "glibc" or numbers < OLDEST_LIBC:
        raise InputError("too old a C library", value=f"{library} {version}", expected="glibc 2.31 or newer")
    prefix.compiler()


def own_server() -> Path | None:
    """Return the machine's own gzserver if there is one on the path that runs and is of version 11."""
    server = shutil.which("gzserver")
    try:
        return None if server is None or not server_version(Path(server), None) else Path(server)
    except InputError:
        return None


def server_version(server: Path, root: Path | None) -> str:
    """Return the version that gzserver reports; InputError if it does not run here."""
    around = {} if root is None else prefix.surroundings(root)
    try:
        done = subprocess.run(
            [str(server), "--version"],
            env=os.environ | around,
            capture_output=True,
            text=True,
            check=False,
            timeout=60,
        )
    except (OSError, subprocess.TimeoutExpired) as error:
        raise InputError(f"does not run here ({error})", file=str(server)) from error
    version = done.stdout.strip().partition("version ")[2].split()[:1]  # its status is never 0
    if not version:
        said = done.stderr.strip().splitlines()
        raise InputError(f"does not run here ({said[-1] if said else 'it says nothing'})", file=str(server))
    number = version[0]
    if not number.startswith("11."):
        raise InputError("another Gazebo than 11", file=str(server), value=number, expected="11")
    return number


@contextlib.contextmanager
def _alone(folder: Path) -> Generator[None]:
    """Wait until no other process installs into `folder`."""
    with (folder / ".lock").open("w") as lock:
        fcntl.flock(lock, fcntl.LOCK_EX)
        yield
