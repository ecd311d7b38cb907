"""Asking the companion for a kernel: a file for each that is wanted, and a look now and then for what came of it.

The companion (`kernels.companion`) is the one process that compiles for all that run one installation of the package;
whoever wants a kernel leaves a file in its folder, and begins a companion if none is at work. Two installations may
share a cache folder: they use the same machine code where their sources are the same, and each has a companion of its
own, since a companion compiles what it can import.
"""

from __future__ import annotations

import contextlib
import fcntl
import hashlib
import json
import multiprocessing
import os
import subprocess
import sys
from collections.abc import Generator, Sequence
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from time import monotonic, sleep

from dubins_traffic.kernels import store
from dubins_traffic.kernels.kinds import Kind

ASKED = "asked"
"""How the folder in the cache folder begins with what is to be compiled."""
LOCK = "companion.lock"
"""The file that the companion locks as long as it works; the system frees it however the companion ends."""
FAILED = ".failed"
"""Ending of the file that says why a kernel could not be compiled."""
PAUSE = 0.25
"""Seconds between two looks for a kernel that is wanted."""
HURRY = "hurry"
"""The file in its folder that asks a companion that stands back, and gets little done, to make room."""
LONG = 10.0
"""Seconds of interpreted work after which what is wanted is worth a processor of its own."""
STARTS = 3
"""So often is a companion begun for one kernel, at most."""


def folder() -> Path:
    """Return the folder by which processes of this installation and their companion talk."""
    where = hashlib.sha256(os.fsencode(store.PACKAGE)).hexdigest()[:12]
    return store.cache_folder() / f"{ASKED}-{where}"


@dataclass(frozen=True, slots=True)
class Wish:
    """A kernel that is wanted: where it stands, for which kinds, and where its machine code is to be kept."""

    module: str
    name: str
    file: str
    kinds: str
    target: str
    paths: Sequence[str] = ()

    @property
    def path(self) -> Path:
        """The file with the machine code."""
        return Path(self.target)

    @property
    def note(self) -> Path:
        """The file by which it is asked for."""
        return folder() / f"{store.symbol(self.path)}.json"

    @property
    def failure(self) -> Path:
        """The file that says why it could not be compiled."""
        return self.note.with_suffix(FAILED)


wanted: list[Waiting] = []
"""What this process has asked for."""


class Waiting:
    """A kernel that has been asked for and is not there yet.

    Parameters
    ----------
    module, name : str
        Where Python finds the kernel.
    file : Path
        The source that holds it.
    kinds : sequence of Kind
        Those of its arguments.
    target : Path
        Where its machine code is to be kept.
    waits : bool
        Whether nothing goes on before it is there.
    """

    def __init__(
        self, module: str, name: str, file: Path, kinds: Sequence[Kind], target: Path, *, waits: bool
    ) -> None:
        paths = tuple(os.path.abspath(path) for path in sys.path)  # noqa: PTH100  # an empty one is this folder
        self.wish = Wish(module, name, str(file), repr(tuple(kinds)), str(target), paths)
        self.failure = ""
        self.waits = waits
        self._long = monotonic() + (0.0 if waits else LONG)
        self._left = STARTS
        self._next = 0.0
        with contextlib.suppress(OSError):
            self.wish.failure.unlink(missing_ok=True)
        self._ask()
        wanted.append(self)

    def is_there(self) -> bool:
        """Tell, at most every `PAUSE` seconds, whether the kernel has been compiled; else see that it will be."""
        now = monotonic()
        if now < self._next or self.failure:
            return False
        self._next = now + PAUSE
        self.waits = self.waits or now > self._long
        return self._look()

    def withdraw(self) -> None:
        """Want it no more."""
        with contextlib.suppress(OSError):
            self.wish.note.unlink(missing_ok=True)

    def wait(self) -> bool:
        """Wait for the kernel; return whether it has been compiled."""
        while not self._look():
            if self.failure:
                return False
            sleep(PAUSE / 25)
        return True

    def _look(self) -> bool:
        if self.wish.path.exists():
            return True
        with contextlib.suppress(OSError):
            self.failure = self.wish.failure.read_text(encoding="utf-8")
            return False
        if not is_at_work():
            if self.wish.path.exists():
                return True
            self._ask()
        elif self.waits and monotonic() > self._long:
            self._long = monotonic() + LONG
            self._hurry()
        return False

    def _hurry(self) -> None:
        """Ask a companion that stands back and gets little done to make room for one that does not."""
        with contextlib.suppress(OSError):
            (folder() / HURRY).touch()

    def _ask(self) -> None:
        if self._left == 0:
            self.failure = "the companion ends as soon as it begins"
            return
        own = {field: getattr(self.wish, field) for field in self.wish.__slots__}
        try:
            store.write_whole(self.wish.note, json.dumps(own).encode())
            if not is_at_work():
                self._left -= 1
                begin(behind=not self.waits)
        except OSError as error:
            self.failure = f"nothing can be kept in {store.cache_folder()}: {error.strerror}"


def is_at_work() -> bool:
    """Tell whether a companion works, or has just begun."""
    if _begun and _begun[-1].poll() is None:
        return True
    with locked() as free:
        return not free


@contextlib.contextmanager
def locked() -> Generator[bool]:
    """Hold the companion's lock while the body runs; yields whether it could be had."""
    try:
        folder().mkdir(parents=True, exist_ok=True)
        handle = os.open(folder() / LOCK, os.O_RDWR | os.O_CREAT, 0o644)
    except OSError:
        yield False
        return
    try:
        fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except OSError:
        os.close(handle)
        yield False
        return
    try:
        yield True
    finally:
        os.close(handle)


class _Companion(subprocess.Popen[bytes]):
    def __del__(self) -> None:
        """Say nothing: the process goes on when this one ends, as it should."""


_begun: list[_Companion] = []


def begin(*, behind: bool) -> None:
    """Begin a companion: a process of its own, which goes on when this one ends; `behind` others if nobody waits."""
    quiet = subprocess.DEVNULL
    command = [sys.executable, "-m", "dubins_traffic.kernels.companion", *(["--behind"] if behind else [])]
    here = str(Path(__file__).resolve().parents[2])
    paths = [here, *filter(None, [os.environ.get("PYTHONPATH")])]
    around = {**os.environ, "PYTHONPATH": os.pathsep.join(paths)}
    _begun.append(
        _Companion(
            command, stdin=quiet, stdout=quiet, stderr=quiet, env=around, cwd="/", start_new_session=True
        )
    )


@cache
def say(text: str) -> None:
    """Say something once on standard error, in the first process of a program alone."""
    if multiprocessing.parent_process() is None:
        print(f"dubins-traffic: {text}", file=sys.stderr, flush=True)
