"""Builds the library of machine code: a moment of each kind of trial says which kernels Python calls, and how."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from time import sleep
from typing import NamedTuple

from dubins_traffic.compiling import beside, linking, store
from dubins_traffic.compiling.loading import target
from dubins_traffic.compiling.moments import moments
from dubins_traffic.errors import InputError, MissingExtraError
from dubins_traffic.kernels import library
from dubins_traffic.kernels.compile import Entry, listed, never_compiled
from dubins_traffic.kernels.folders import FOLDER, TIER, base_folder, own_folder
from dubins_traffic.kernels.levels import level

PAUSE = 0.1
"""Seconds between two looks for what has been compiled."""
OURS = "dubins_traffic."
Progress = Callable[[int, int], object]


class Built(NamedTuple):
    """What has been built."""

    library: Path | None
    """The library; None if each kernel is in a file of its own, which llvmlite loads."""
    reason: str
    """Why there is no library."""
    kernels: int
    """Number of kernels."""
    failed: list[str]
    """What could not be compiled, and why."""


def build(folder: Path | None = None, progress: Progress | None = None) -> Built:
    """Compile all kernels of the package in one process, and put them into one library.

    Parameters
    ----------
    folder : Path, optional
        Where to; by default where every process of this user finds it.
    progress : callable, optional
        Told how many kernels are compiled, and how many there are in all, each time.

    Raises
    ------
    InputError
        If kernels are never compiled here, the linker fails, the user's folder for libraries is open to others, or
        none can be made for the folder that is named.
    MissingExtraError
        Without Numba.
    KeyboardInterrupt
        On Ctrl-C; what is compiled by then is kept.
    """
    if never_compiled():
        raise InputError("kernels are never compiled", file=TIER, value="interpreted", expected="auto")
    if not beside.can_build():
        raise MissingExtraError("building machine code", "compile")
    where, reason = _checked_folder(folder), _hindrance()
    if reason and folder is not None:
        raise InputError(reason, file="--folder", value=str(folder), expected="none here")
    files = {entry.kernel.key(entry.kinds): _file_of(entry) for entry in entries()}
    failed = _compiled(progress)
    if failed or reason:
        return Built(None, reason, len(files), failed)
    return Built(linking.link(files, level(), where), "", len(files), failed)


def _hindrance() -> str:
    """Return why no library can be made here; empty if one can."""
    if not level():
        return "libraries are for Linux on x86-64"
    try:
        linking.linker()
    except InputError as error:
        return str(error)
    return ""


def entries() -> list[Entry]:
    """Return all kernels of the package that Python calls, with the kinds of their arguments."""
    with listed() as compiled:
        for run in moments():
            run()
    return [entry for entry in compiled if entry.kernel.__module__.startswith(OURS)]


def _checked_folder(folder: Path | None) -> Path:
    """Return where the library goes; the user's own folder is checked, so that it will be found."""
    if folder is not None:
        return folder
    where = base_folder() / library.BUILT
    try:
        return own_folder(where)
    except OSError as error:
        raise InputError(
            f"can't hold a library: {error.strerror}",
            file=FOLDER,
            value=str(where),
            expected="a folder that only you can write",
        ) from error


def _file_of(entry: Entry) -> Path:
    """Return the file of a kernel's machine code; a builder is told if it is not there yet."""
    path = store.kernel_file(entry.kernel.key(entry.kinds), target())
    if not path.exists():
        _waiting.append(beside.wanted(entry.kernel, entry.kinds, path, waits=True))
    return path


_waiting: list[beside.Waiting] = []
"""What is being compiled."""


def _compiled(progress: Progress | None) -> list[str]:
    """Wait for all that is being compiled; return what could not be, and why."""
    done, whole = -1, len(_waiting)
    try:
        while done < whole:
            now = sum(one.is_there() or bool(one.failure) or one.wish.path.exists() for one in _waiting)
            if now != done and progress is not None:
                progress(now, whole)
            done = now
            if done < whole:
                sleep(PAUSE)
        return [f"{one.wish.name}: {one.failure.splitlines()[-1]}" for one in _waiting if one.failure]
    except BaseException:
        beside.end()
        raise
    finally:
        _waiting.clear()
