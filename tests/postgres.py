"""A PostgreSQL of the test's own: no root, no network, a folder that goes with it."""

from __future__ import annotations

import os
import shutil
import socket
import subprocess
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest

BINARIES = Path("/usr/lib/postgresql/15/bin")
REASON = "needs postgresql-15; scripts/system-packages.sh installs it"
USER = "nobody"


def is_there() -> bool:
    """Tell whether PostgreSQL is installed, and may be run: it refuses to run as root."""
    return (BINARIES / "initdb").exists() and (os.geteuid() != 0 or shutil.which("setpriv") is not None)


class Cluster:
    """A cluster that can be stopped hard and started again."""

    def __init__(self, folder: Path, port: int) -> None:
        self._folder, self._port = folder, port
        self._data = folder / "data"

    def command(self, name: str, *arguments: str) -> None:
        drop = (
            ("setpriv", f"--reuid={USER}", "--regid=nogroup", "--clear-groups") if os.geteuid() == 0 else ()
        )
        subprocess.run(
            [*drop, str(BINARIES / name), *arguments],
            check=True,
            capture_output=True,
            timeout=120,
            cwd=self._folder,
            env={"PATH": os.environ["PATH"], "LC_ALL": "C.UTF-8", "HOME": str(self._folder)},
        )

    def make(self) -> None:
        self.command("initdb", "-D", str(self._data), "-U", "service", "-A", "trust", "-E", "UTF8")

    def start(self) -> None:
        options = (
            f"-c listen_addresses=127.0.0.1 -c port={self._port} -c unix_socket_directories={self._folder}"
        )
        log = str(self._folder / "postgres.log")
        self.command("pg_ctl", "-D", str(self._data), "-w", "-t", "60", "-l", log, "-o", options, "start")

    def stop(self, mode: str = "immediate") -> None:
        self.command("pg_ctl", "-D", str(self._data), "-w", "-m", mode, "stop")

    def url(self, name: str) -> str:
        """Make a database, and return its address."""
        self.command("createdb", "-h", "127.0.0.1", "-p", str(self._port), "-U", "service", name)
        return f"postgresql+psycopg://service@127.0.0.1:{self._port}/{name}"


@contextmanager
def cluster() -> Iterator[Cluster]:
    """Run a cluster, in a folder of its own: pytest's is closed to other users, whose the cluster is under root."""
    if not is_there():
        if os.environ.get("CI") == "true":
            pytest.fail(REASON)
        pytest.skip(REASON)
    with socket.create_server(("127.0.0.1", 0)) as free:
        port = free.getsockname()[1]
    with tempfile.TemporaryDirectory(prefix="postgres-", ignore_cleanup_errors=True) as name:
        folder = Path(name)
        if os.geteuid() == 0:
            shutil.chown(folder, USER, "nogroup")
        made = Cluster(folder, port)
        made.make()
        made.start()
        try:
            yield made
        finally:
            made.stop()
