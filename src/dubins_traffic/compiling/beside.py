"""Compiling beside: what has no machine code yet is told to one process, which compiles while this one goes on.

The process is `compiling.builder`. Whoever begins it holds its lock and hands that over, so there is one for a folder
of compiled kernels at a time, and it hears by a pipe what is wanted. Where another process has begun one, its machine
code is waited for; what is still missing when it has ended is told to the next.
"""

from __future__ import annotations

import base64
import contextlib
import json
import os
import subprocess
import sys
import zlib
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from functools import cache
from importlib.util import find_spec
from pathlib import Path
from time import monotonic, sleep
from typing import Any

from dubins_traffic.compiling import loading, store
from dubins_traffic.kernels import levels
from dubins_traffic.kernels.compile import PAUSE, Kernel, say, waits
from dubins_traffic.kernels.folders import KEPT, TIER
from dubins_traffic.kernels.kinds import Kind
from dubins_traffic.kernels.machine import Code
from dubins_traffic.kernels.sources import symbol

LOCK = "builder.lock"
"""The file that a builder holds locked as long as it works; the system frees it however the builder ends."""
FAILED = ".failed"
"""Ending of the file that says why a kernel could not be compiled."""
HURRY = "hurry"
"""The file that asks a builder that stands back, and gets little done, to end."""
LONG = 10.0
"""Seconds of interpreted work after which what is wanted is worth a processor of its own."""
STARTS = 3
"""So often is a kernel told to a builder, at most."""
BESIDE = (
    "kernels are being compiled in the background; until they are there, trials run interpreted, slower and with "
    "the same results"
)
NO_COMPILER = (
    "there is no machine code for some kernels, which run interpreted, slower and with the same results; "
    "pip install 'dubins-traffic[compile]' compiles them"
)


@cache
def can_build() -> bool:
    """Tell whether kernels can be compiled here: with the extra `compile`, where processes can hand over locks."""
    return find_spec("numba") is not None and find_spec("fcntl") is not None


@dataclass(frozen=True, slots=True)
class Wish:
    """A kernel that is wanted: where it stands, for which kinds, and where its machine code is to be kept."""

    module: str
    name: str
    file: str
    kinds: str
    target: str
    paths: tuple[str, ...] = ()

    @property
    def path(self) -> Path:
        """The file with the machine code."""
        return Path(self.target)

    @property
    def failure(self) -> Path:
        """The file that says why it could not be compiled."""
        return self.path.with_suffix(FAILED)

    def line(self) -> bytes:
        """Return the wish as a short line: all that a command wants fits into a pipe that nobody reads yet."""
        return base64.b64encode(zlib.compress(json.dumps(asdict(self)).encode())) + b"\n"


def wish_of(line: bytes) -> Wish | None:
    """Return the wish in a line; None of a line that was not written to its end."""
    try:
        fields: dict[str, Any] = json.loads(zlib.decompress(base64.b64decode(line.strip(), validate=True)))
        paths = tuple(fields.pop("paths"))
        return Wish(**fields, paths=paths)
    except (ValueError, zlib.error, TypeError, KeyError, AttributeError):
        return None


class Waiting:
    """A kernel that is wanted and not there yet.

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

    def __init__(self, module: str, name: str, file: Path, kinds: Sequence[Kind], target: Path, *, waits: bool) -> None:
        paths = tuple(os.path.abspath(path) for path in sys.path)  # noqa: PTH100  # an empty one is this folder
        self.wish = Wish(module, name, str(file), repr(tuple(kinds)), str(target), paths)
        self.failure = ""
        self.waits = waits
        self._long = monotonic() + (0.0 if waits else LONG)
        self._left = STARTS
        self._next = 0.0
        self._builder: Builder | None = None
        with contextlib.suppress(OSError):
            self.wish.failure.unlink(missing_ok=True)
        self._tell()

    def is_there(self) -> bool:
        """Tell, at most every `PAUSE` seconds, whether the kernel has been compiled; else see that it will be."""
        now = monotonic()
        if now < self._next or self.failure:
            return False
        self._next = now + PAUSE
        self.waits = self.waits or now > self._long
        return self._look()

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
        if self._builder is None or self._builder.has_ended:
            self._tell()
        if self.waits and monotonic() > self._long:
            self._long = monotonic() + LONG
            with contextlib.suppress(OSError):
                (store.cache_folder() / HURRY).touch()
        return False

    def _tell(self) -> None:
        """Tell a builder of this process; while that of another works there is none to tell."""
        try:
            if self.wish.path.exists():
                return
            self._builder = builder(behind=not self.waits)
            if self._builder is None:
                return
            if self._left == 0:
                self.failure = "what compiles ends as soon as it begins"
                return
            self._left -= 1
            self._builder.tell(self.wish)
        except OSError as error:
            self.failure = f"nothing can be kept: {error}"


def sought(kernel: Kernel[..., Any], kinds: tuple[Kind, ...]) -> Code | Waiting | None:
    """Return the machine code of a kernel that no library holds, or what waits for it; None if there will be none."""
    kept_alone = os.environ.get(TIER) == KEPT
    if not can_build():
        if not kept_alone:
            say(NO_COMPILER)
        return None
    key = kernel.key(kinds)
    path = store.kernel_file(key, loading.processor())
    code = store.load(path)
    if code is not None:
        return Code(kinds, code[0], loading.load(code[1], symbol(key)))
    if kept_alone:
        return None
    waiting = kernel.patient or waits()
    if not waiting:
        say(BESIDE)
    return wanted(kernel, kinds, path, waits=waiting)


def wanted(kernel: Kernel[..., Any], kinds: Sequence[Kind], path: Path, *, waits: bool) -> Waiting:
    """Tell a builder that the machine code of a kernel is wanted, in the file `path`."""
    return Waiting(kernel.__module__, kernel.name, kernel.file, kinds, path, waits=waits)


class Builder(subprocess.Popen[bytes]):
    """A process that compiles what this one tells it, and goes on with that when this one ends.

    Parameters
    ----------
    lock : int
        The lock, held; it is the builder's from now on.
    behind : bool
        Whether it stands back behind all other processes.
    """

    def __init__(self, lock: int, *, behind: bool) -> None:
        quiet = subprocess.DEVNULL
        command = [
            sys.executable,
            "-m",
            "dubins_traffic.compiling.builder",
            *(["--behind"] if behind else []),
        ]
        here = str(Path(__file__).resolve().parents[2])
        paths = [here, *filter(None, [os.environ.get("PYTHONPATH")])]
        around = {**os.environ, "PYTHONPATH": os.pathsep.join(paths)}
        if level := levels.level():
            around |= {"NUMBA_CPU_NAME": level, "NUMBA_CPU_FEATURES": ""}
        ear, self._mouth = os.pipe()
        try:
            super().__init__(
                command, stdin=ear, stdout=quiet, stderr=quiet, env=around, cwd="/", pass_fds=(lock,),
                start_new_session=True,
            )  # fmt: skip
        finally:
            os.close(ear)
        self.process = os.getpid()

    @property
    def has_ended(self) -> bool:
        """Whether it has ended."""
        return self.poll() is not None

    def tell(self, wish: Wish) -> None:
        """Tell it what is wanted; nothing is said of a builder that has just ended."""
        with contextlib.suppress(BrokenPipeError):
            os.write(self._mouth, wish.line())

    def hang_up(self) -> None:
        """Close the pipe to the compiling process, which then gets no more requests."""
        os.close(self._mouth)

    def __del__(self) -> None:
        """Say nothing: the process goes on when this one ends, as it should."""


_begun: list[Builder] = []


def builder(*, behind: bool) -> Builder | None:
    """Return the builder that this process has begun, a new one if there is none; None while another has one.

    Raises
    ------
    OSError
        If nothing can be kept.
    """
    import fcntl  # not there on every system on which kernels run interpreted

    if _begun and _begun[-1].process == os.getpid() and not _begun[-1].has_ended:
        return _begun[-1]
    while _begun:
        _begun.pop().hang_up()
    lock = os.open(store.cache_folder() / LOCK, os.O_RDWR | os.O_CREAT, 0o644)
    try:
        fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
        _begun.append(Builder(lock, behind=behind))
    except BlockingIOError:
        return None
    finally:
        os.close(lock)
    return _begun[-1]


def end() -> None:
    """End the builder that this process has begun; what it has compiled is kept."""
    if _begun and _begun[-1].process == os.getpid():
        _begun[-1].kill()
        _begun[-1].wait()
