"""What attacks reach for: things of the host that the suite lays out, and takes away again."""

from __future__ import annotations

import contextlib
import ctypes
import os
import secrets
import shutil
import socket
import subprocess
import sys
import tempfile
from pathlib import Path
from typing import Any, Final, Self

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

    def _begin_process(self) -> None:
        code = "import sys; sys.stdin.read()"
        words = [sys.executable, "-I", "-S", "-c", code, self.secret]
        self.process = subprocess.Popen(
            words, stdin=subprocess.PIPE, env={**os.environ, VARIABLE: self.secret}
        )
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
        """Return what an attack is told."""
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
            "daemon": self.daemon,
        }

    def daemons(self) -> list[int]:
        """Return the processes that an attack has left behind on the host."""
        found: list[int] = []
        for folder in Path("/proc").iterdir():
            with contextlib.suppress(OSError):
                if folder.name.isdigit() and self.daemon.encode() in (folder / "cmdline").read_bytes():
                    found.append(int(folder.name))
        return found
