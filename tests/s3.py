"""A store that speaks S3, on this machine: JuiceFS's gateway, which is MinIO's server before a folder."""

from __future__ import annotations

import os
import shutil
import socket
import subprocess
import sys
import threading
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

import httpx

from tests.ports import kept_port
from tests.services import wait_until
from tests.tools import need

BUCKET = "season"
KEY, SECRET = "a-key-of-a-test", "a-secret-of-a-test"


class Store:
    """A running store: stopped, started again, and asked by an environment."""

    def __init__(self, folder: Path, juicefs: str) -> None:
        self._folder, self._juicefs = folder, juicefs
        self.port: int = kept_port()
        self._meta = f"sqlite3://{folder / 'meta.db'}"
        data = f"{folder / 'data'}/"
        made = [
            juicefs,
            "format",
            "--storage",
            "file",
            "--bucket",
            data,
            "--trash-days",
            "0",
            self._meta,
            BUCKET,
        ]
        subprocess.run(made, check=True, capture_output=True)
        self.start()

    def start(self) -> None:
        command = [self._juicefs, "gateway", "--no-usage-report", "--cache-size", "0", self._meta]
        keys = {"MINIO_ROOT_USER": KEY, "MINIO_ROOT_PASSWORD": SECRET}
        with (self._folder / "gateway.log").open("ab") as log:
            self._process = subprocess.Popen(
                [*command, f"127.0.0.1:{self.port}"], stdout=log, stderr=log, env={**os.environ, **keys}
            )
        wait_until(self._answers, pause=0.05)

    def stop(self) -> None:
        """End it without a warning."""
        self._process.kill()
        self._process.wait()

    def _answers(self) -> bool:
        with suppress(httpx.HTTPError):
            return httpx.get(f"http://127.0.0.1:{self.port}/minio/health/live", timeout=5).status_code < 500
        return False

    def environment(self, port: int | None = None) -> dict[str, str]:
        """Return what who uses the store has in the environment; `port` is that of what stands in between."""
        return {
            "AWS_ENDPOINT_URL": f"http://127.0.0.1:{port or self.port}",
            "AWS_ALLOW_HTTP": "true",
            "AWS_ACCESS_KEY_ID": KEY,
            "AWS_SECRET_ACCESS_KEY": SECRET,
            "AWS_REGION": "us-east-1",
        }


@contextmanager
def store(folder: Path) -> Iterator[Store]:
    """Run a store with one bucket, `BUCKET`."""
    juicefs = shutil.which("juicefs", path=f"{Path(sys.executable).parent}:{os.environ['PATH']}")
    need("" if juicefs else "juicefs", "the extra `dev` installs it")
    assert juicefs is not None
    folder.mkdir(exist_ok=True)
    made = Store(folder, juicefs)
    try:
        yield made
    finally:
        made.stop()


class Wire:
    """What stands between a service and its store, and may cut connections in the middle of what is sent.

    Parameters
    ----------
    port : int
        That of the store.

    Attributes
    ----------
    most : int or None
        So many bytes of a connection go through to the store, then it is cut; None: all.
    cuts : int
        How many connections have been cut.
    """

    def __init__(self, port: int) -> None:
        self._there = port
        self._door = socket.create_server(("127.0.0.1", 0), backlog=64)
        self.port: int = self._door.getsockname()[1]
        self.most: int | None = None
        self.cuts = 0
        threading.Thread(target=self._listen, daemon=True).start()

    def close(self) -> None:
        self._door.close()

    def _listen(self) -> None:
        with suppress(OSError):
            while True:
                self._connect(self._door.accept()[0])

    def _connect(self, here: socket.socket) -> None:
        try:
            there = socket.create_connection(("127.0.0.1", self._there))
        except OSError:
            here.close()
            return
        for ends in ((here, there, True), (there, here, False)):
            threading.Thread(target=self._carry, args=ends, daemon=True).start()

    def _carry(self, source: socket.socket, target: socket.socket, to_store: bool) -> None:
        carried = 0
        with suppress(OSError):
            while data := source.recv(16384):
                carried += len(data)
                if to_store and self.most is not None and carried > self.most:
                    self.cuts += 1
                    break
                target.sendall(data)
        for end in (source, target):
            with suppress(OSError):
                end.shutdown(socket.SHUT_RDWR)
            end.close()
