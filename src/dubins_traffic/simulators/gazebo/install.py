"""Installs Gazebo into a folder of the user, and checks it."""

from __future__ import annotations

import contextlib
import fcntl
import os
import platform
import shutil
import signal
import subprocess
from collections.abc import Callable, Generator
from pathlib import Path
from typing import Final

from dubins_traffic.errors import InputError
from dubins_traffic.simulators.gazebo import build, prefix
from dubins_traffic.simulators.gazebo.doctor import drive_ahead

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
    build.build(folder, root)
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

    Raises
    ------
    InputError
        If it could not; says what the script said last.
    """
    beside = Path(__file__).with_name(SCRIPT)
    script = beside if beside.is_file() else Path(__file__).parents[4] / "scripts" / SCRIPT
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
    build.compiler()


def own_server() -> Path | None:
    """Return the machine's own gzserver if there is one on the path that runs and is of version 11."""
    found = shutil.which("gzserver")
    try:
        return None if found is None or not server_version(Path(found), None) else Path(found)
    except InputError:
        return None


def server_version(server: Path, root: Path | None) -> str:
    """Return the version that gzserver reports.

    Raises
    ------
    InputError
        If it does not run here.
    """
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
    found = version[0]
    if not found.startswith("11."):
        raise InputError("another Gazebo than 11", file=str(server), value=found, expected="11")
    return found


@contextlib.contextmanager
def _alone(folder: Path) -> Generator[None]:
    """Wait until no other process installs into `folder`."""
    with (folder / ".lock").open("w") as lock:
        fcntl.flock(lock, fcntl.LOCK_EX)
        yield
