"""Runs attacks on boxes, with baits that they reach for, and says of each what stopped it."""

from __future__ import annotations

import contextlib
import ctypes
import os
import secrets
import shutil
import signal
import socket
import subprocess
import sys
import tempfile
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Final, Self

from dubins_traffic.protocols import End
from dubins_traffic.sandbox.attacks import ATTACKS, Attack
from dubins_traffic.sandbox.box import Box, BoxOverError
from dubins_traffic.sandbox.layers import Layers
from dubins_traffic.sandbox.limits import MIB, Limits
from dubins_traffic.sandbox.submission import script
from dubins_traffic.transports.line_messages import AnswerError, command_in, message_in
from dubins_traffic.transports.lines import as_line

IPC_PRIVATE, IPC_RMID = 0, 0
VARIABLE: Final = "DUBINS_TRAFFIC_BAIT"


class Baits:
    """A secret in a file, a process, an environment, shared memory and behind sockets; a context manager.

    `document` tells an attack where they are.
    """

    def __init__(self) -> None:
        self.secret = secrets.token_hex(16)
        self.daemon = f"daemon-{secrets.token_hex(8)}"

    def __enter__(self) -> Self:
        self._held = contextlib.ExitStack()
        try:
            self._lay_out()
        except BaseException:
            self._held.close()
            raise
        return self

    def __exit__(self, *_: object) -> None:
        self._held.close()

    def _lay_out(self) -> None:
        self.folder = Path(tempfile.mkdtemp(prefix="dubins-traffic-bait-", dir="/var/tmp"))
        self._held.callback(shutil.rmtree, self.folder, ignore_errors=True)
        self.folder.chmod(0o755)
        self.file, self.open = self.folder / "secret", self.folder / "open"
        self.file.write_text(self.secret)
        (self.folder / "seeds.toml").write_text(f'seeds = "{self.secret}"\n')
        self.open.mkdir()
        self.open.chmod(0o777)
        (self.folder / "seeds.toml").chmod(0o644)
        self._descriptor = os.open(self.file, os.O_RDONLY)
        self._held.callback(os.close, self._descriptor)
        os.set_inheritable(self._descriptor, True)
        self.abstract = f"bait-{self.secret[:8]}"
        self._port = self._listen(socket.AF_INET, ("127.0.0.1", 0)).getsockname()[1]
        self._listen(socket.AF_UNIX, f"\0{self.abstract}")
        self._listen(socket.AF_UNIX, str(self.folder / "socket"))
        (self.folder / "socket").chmod(0o777)
        self.shared = ctypes.CDLL(None).shmget(IPC_PRIVATE, 4096, 0o1600)
        self._held.callback(ctypes.CDLL(None).shmctl, self.shared, IPC_RMID, None)
        self._begin_process()
        os.environ[VARIABLE] = self.secret
        self._held.callback(os.environ.pop, VARIABLE, None)
        path = os.environ.get("PATH", os.defpath)
        os.environ["PATH"] = f"{path}{os.pathsep}/{self.secret}"
        self._held.callback(os.environ.__setitem__, "PATH", path)

    def _begin_process(self) -> None:
        code = "import sys; sys.stdin.read()"
        words = [sys.executable, "-I", "-S", "-c", code, self.secret]
        self.process = subprocess.Popen(words, stdin=subprocess.PIPE, env={**os.environ, VARIABLE: self.secret})
        self._held.callback(self._end_process)

    def _end_process(self) -> None:
        self.process.kill()
        self.process.communicate()

    def _listen(self, family: int, address: Any) -> socket.socket:
        server = self._held.enter_context(socket.socket(family))
        server.bind(address)
        server.listen()
        return server

    def document(self) -> dict[str, Any]:
        """Return what an attack is told of this machine and must not reach: a secret, files, a port, processes."""
        return {
            "secret": self.secret,
            "file": str(self.file),
            "folder": str(self.folder),
            "open": str(self.open),
            "port": self._port,
            "abstract": self.abstract,
            "shared": self.shared,
            "process": self.process.pid,
            "worker": os.getpid(),
            "host": socket.gethostname(),
            "daemon": self.daemon,
        }

    def daemons(self) -> list[int]:
        """Return the processes that an attack has left behind on the host."""
        processes: list[int] = []
        for folder in Path("/proc").iterdir():
            with contextlib.suppress(OSError):
                if folder.name.isdigit() and self.daemon.encode() in (folder / "cmdline").read_bytes():
                    processes.append(int(folder.name))
        return processes


LIMITS: Final = Limits(
    start_seconds=3.0,
    decision_seconds=0.5,
    bank_seconds=0.5,
    wall_seconds=120.0,
    memory=256 * MIB,
    processes=48,
    files=16 * MIB,
    output=MIB,
)
"""What attacks may use; an attack that is stopped by the wall clock waits less."""
PRELUDE: Final = "sandbox/attacks/prelude.py"


@dataclass(frozen=True, slots=True)
class Strike:
    """What came of an attack."""

    attack: Attack
    """The attack."""
    stopped: bool
    """Whether it was stopped."""
    words: str
    """By what, or what it got hold of."""


def strikes(layers: Layers, attacks: Sequence[Attack] = ATTACKS) -> Iterator[Strike]:
    """Run attacks on boxes with these layers, one after another, and yield what came of each.

    BoxOverError if a box can't be made.
    """
    with Baits() as baits:
        for attack in attacks:
            yield strike(attack, layers, baits)


def strike(attack: Attack, layers: Layers, baits: Baits) -> Strike:
    """Run one attack in a box of its own."""
    limits = replace(LIMITS, **dict(attack.limits))
    box = Box(script(PRELUDE), limits, layers)
    try:
        if message_in(box.ask(as_line({"hello": 1}))) != {"ready": "yes"}:
            raise box.fault(End.BOX_FAILED, "the box does not run what it shall")
        stopped, words = (_said if attack.end else _reached)(box, attack, baits)
    finally:
        box.close()
    left = baits.daemons()
    for process in left:
        os.kill(process, signal.SIGKILL)
    if left:
        return Strike(attack, False, f"left process {left[0]} behind")
    return Strike(attack, stopped, words)


def _answer(box: Box, attack: Attack, baits: Baits) -> bytes:
    return box.ask(as_line({"source": attack.source, "bait": baits.document()}))


def _reached(box: Box, attack: Attack, baits: Baits) -> tuple[bool, str]:
    """Return whether an attack that says what it got was stopped, and by what."""
    try:
        message = message_in(_answer(box, attack, baits))
    except BoxOverError as error:
        return _ended(error)
    words = str(message.get("stopped") or message.get("got"))
    return "stopped" in message, words


def _said(box: Box, attack: Attack, baits: Baits) -> tuple[bool, str]:
    """Return whether an attack ended as it must that is asked for a command, and how it ended."""
    ends = attack.end if isinstance(attack.end, tuple) else (attack.end,)
    try:
        line = _answer(box, attack, baits)
        command_in(line, 0)
        return False, "its answer was taken"
    except AnswerError as error:
        return error.end in ends, f"{error.end}: {error.detail}"
    except BoxOverError as error:
        return _ended(error, ends)


def _ended(error: BoxOverError, ends: Sequence[End] = tuple(End)) -> tuple[bool, str]:
    end = End(error.end.name)
    if end is End.BOX_FAILED:
        raise error
    return end in ends, f"{error.end.name}: {error.end.detail}"
