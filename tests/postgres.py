"""A PostgreSQL of the test's own: no root, no network, a folder that goes with it."""

from __future__ import annotations

import os
import shutil
import subprocess
import tempfile
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from tests.ports import kept_port
from tests.tools import need

BINARIES = Path("/usr/lib/postgresql/15/bin")
USER = "nobody"


def is_there() -> bool:
    """Tell whether PostgreSQL is installed, and may be run: it refuses to run as root."""
    return (BINARIES / "initdb").exists() and (os.geteuid() != 0 or shutil.which("setpriv") is not None)


class Cluster:
    """A cluster that can be stopped hard and started again."""

    def __init__(self, folder: Path, port: int, disk: Path) -> None:
        self._folder, self._port = folder, port
        self._data = disk / "data"
        self.log = folder / "postgres.log"

    def command(self, name: str, *arguments: str) -> None:
        drop = ("setpriv", f"--reuid={USER}", "--regid=nogroup", "--clear-groups") if os.geteuid() == 0 else ()
        subprocess.run(
            [*drop, str(BINARIES / name), *arguments],
            check=True,
            capture_output=True,
            timeout=600,
            cwd=self._folder,
            env={"PATH": os.environ["PATH"], "LC_ALL": "C.UTF-8", "HOME": str(self._folder)},
        )

    def make(self) -> None:
        options = ("-U", "service", "-A", "trust", "-E", "UTF8", "--wal-segsize=1")
        self.command("initdb", "-D", str(self._data), *options)

    def start(self) -> None:
        options = f"-c listen_addresses=127.0.0.1 -c port={self._port} -c unix_socket_directories={self._folder}"
        log = str(self.log)
        self.command("pg_ctl", "-D", str(self._data), "-w", "-t", "60", "-l", log, "-o", options, "start")

    def revive(self) -> None:
        """Start it unless it is up, or comes up by itself."""
        while True:
            if self.is_up():
                return
            try:
                self.command("pg_ctl", "-D", str(self._data), "status")
            except subprocess.CalledProcessError:
                self.start()
            time.sleep(0.1)

    def is_up(self) -> bool:
        """Tell whether it takes connections."""
        try:
            self.command("pg_isready", "-h", "127.0.0.1", "-p", str(self._port))
        except subprocess.CalledProcessError:
            return False
        return True

    def stop(self, mode: str = "immediate") -> None:
        self.command("pg_ctl", "-D", str(self._data), "-w", "-m", mode, "stop")

    def url(self, name: str) -> str:
        """Make a database, and return its address."""
        self.command("createdb", "-h", "127.0.0.1", "-p", str(self._port), "-U", "service", name)
        return f"postgresql+psycopg://service@127.0.0.1:{self._port}/{name}"


@contextmanager
def cluster(disk: Path | None = None) -> Iterator[Cluster]:
    """Run a cluster, in a folder of its own: pytest's is closed to other users, whose the cluster is under root.

    Parameters
    ----------
    disk : Path, optional
        Where it keeps its data; the log is elsewhere.
    """
    need("" if is_there() else "postgresql-15", "scripts/system-packages.sh installs it")
    with tempfile.TemporaryDirectory(prefix="postgres-", ignore_cleanup_errors=True) as name:
        folder = Path(name)
        if os.geteuid() == 0:
            shutil.chown(folder, USER, "nogroup")
            shutil.chown(disk or folder, USER, "nogroup")
        made = Cluster(folder, kept_port(), disk or folder)
        made.make()
        made.start()
        try:
            yield made
        finally:
            made.stop()
