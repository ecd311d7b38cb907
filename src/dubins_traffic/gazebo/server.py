"""One gzserver: started for one world, commanded over a socket that it inherits, and ended without leftovers.

Its files lie in a folder that is removed with it, or by the next server where a process was killed.
"""

from __future__ import annotations

import contextlib
import fcntl
import os
import re
import shutil
import signal
import socket
import subprocess
import tempfile
import threading
import weakref
from pathlib import Path
from time import monotonic
from typing import Final

import numpy as np

from dubins_traffic.errors import InputError
from dubins_traffic.gazebo.link import PROTOCOL, Link, LostError, MessageKind
from dubins_traffic.gazebo.prefix import Installation
from dubins_traffic.kernels.arrays import Floats

PREFIX: Final = "dubins-traffic-gazebo-"


class Folder:
    """A new temporary folder of this process.

    Its lock is held for as long as the process lives, however it ends: a folder whose lock is free is a forgotten one,
    and whoever makes a new folder removes those.

    Raises
    ------
    OSError
        If none can be made.
    """

    def __init__(self) -> None:
        _remove_forgotten()
        while True:
            self.path = Path(tempfile.mkdtemp(prefix=PREFIX))
            with contextlib.suppress(FileNotFoundError):
                self._lock = os.open(self.path, os.O_RDONLY | os.O_DIRECTORY)
                fcntl.flock(self._lock, fcntl.LOCK_EX)
                if self.path.is_dir():
                    return
                os.close(self._lock)  # it was taken for a forgotten one before it was locked

    def cleanup(self) -> None:
        """Remove it."""
        shutil.rmtree(self.path, ignore_errors=True)
        os.close(self._lock)


def _remove_forgotten() -> None:
    """Remove the folders of processes of this user that were killed."""
    for folder in Path(tempfile.gettempdir()).glob(f"{PREFIX}*"):
        with contextlib.suppress(OSError), contextlib.ExitStack() as held:
            lock = os.open(folder, os.O_RDONLY | os.O_DIRECTORY | os.O_NOFOLLOW)
            held.callback(os.close, lock)
            fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
            if os.fstat(lock).st_uid == os.getuid():
                shutil.rmtree(folder, ignore_errors=True)


SOCKET: Final = "DUBINS_TRAFFIC_GAZEBO_SOCKET"
PARENT: Final = "DUBINS_TRAFFIC_GAZEBO_PARENT"
HOST: Final = "127.0.0.1"
TRIES: Final = 5
PAINT: Final = re.compile(r"\x1b\[[0-9;]*m")
GLANCE: Final = 0.2
UNLOADED: Final = b"Failed to load plugin"
GRACE: Final = 1.0
"""Seconds that a server is given to end by itself."""


class PortTakenError(InputError):
    """Another program listens on the port by which Gazebo's programs find each other."""


class Server:
    """A running gzserver with the world plugin.

    Parameters
    ----------
    installation : Installation
        What is started.
    world : str
        The world, SDF.
    port : int, optional
        On the loopback interface, by which gzclient finds the server; by default a free one.
    startup, patience : float
        Seconds within which the server must be up, and within which it must answer.

    Raises
    ------
    InputError
        If it can't be started; nothing is left running then.
    LostError
        If it was killed, or did not answer in time, while it started; nothing is left running then.
    """

    def __init__(
        self,
        installation: Installation,
        world: str,
        *,
        port: int | None = None,
        startup: float = 60.0,
        patience: float = 10.0,
    ) -> None:
        for attempt in range(TRIES):
            try:
                self._start(installation, world, port or _free_port(), startup)
                break
            except PortTakenError:
                if port is not None or attempt == TRIES - 1:
                    raise
        self._link.be_patient(patience)

    def _start(self, installation: Installation, world: str, port: int, startup: float) -> None:
        folder = _folder()
        self.log = folder.path / "gzserver.log"
        here, there = socket.socketpair()
        for end in (here, there):
            end.setblocking(True)  # libraries such as rospy set a default timeout now and then
        try:
            path = folder.path / "trial.world"
            path.write_text(world, encoding="utf-8")
            self._environment = self._surroundings(installation, port, str(folder.path))
            private = {
                SOCKET: str(there.fileno()),
                PARENT: _guardian(),
                "LD_PRELOAD": str(installation.confinement),
            }
            with self.log.open("wb") as log:
                self.process = subprocess.Popen(
                    [str(installation.gzserver), "--verbose", "--minimal_comms", "--seed", "1", str(path)],
                    env=self._environment | private,
                    stdin=subprocess.DEVNULL,
                    stdout=log,
                    stderr=subprocess.STDOUT,
                    pass_fds=[there.fileno()],
                    process_group=0,
                )
        except OSError as error:
            here.close()
            folder.cleanup()
            raise _not_started(f"{error.strerror or error}", installation) from error
        finally:
            there.close()
        self._link = Link(here, startup)
        self._finish = weakref.finalize(self, _end, self.process, self._link, folder)
        self._greet(installation, port, startup)

    def _greet(self, installation: Installation, port: int, startup: float) -> None:
        try:
            self._link.send(MessageKind.HELLO, np.zeros(0))
            self._await(startup)
            version = self._link.receive(MessageKind.HELLO)[0]
        except LostError as error:
            why, status = self.explain(error), self.process.poll()
            unloaded = UNLOADED in self.log.read_bytes()
            self.close()
            if _in_use(port):
                raise PortTakenError(
                    "Gazebo can't listen: the port is in use", field="port", value=port, expected="a free one"
                ) from None
            if unloaded or (status or 0) > 0:
                raise _not_started(why, installation) from None
            raise LostError(f"{why}, while it started") from None
        if version != PROTOCOL:
            self.close()
            raise _not_started(f"its plugin speaks version {version:g}, not {PROTOCOL}", installation)

    def _await(self, startup: float) -> None:
        """Wait until the plugin answers; a gzserver that can't load a plugin goes on without it."""
        until = monotonic() + startup
        while not self._link.ready(GLANCE):
            if UNLOADED in self.log.read_bytes():
                raise LostError(f"its plugin could not be loaded{self._last_words()}")
            if monotonic() > until:
                raise LostError(f"it was not up within {startup:g} s")

    @staticmethod
    def _surroundings(installation: Installation, port: int, folder: str) -> dict[str, str]:
        kept = {key: value for key, value in os.environ.items() if not key.startswith(("GAZEBO_", "LD_PRELOAD"))}
        return kept | installation.environment() | {
            "HOME": folder,
            "GAZEBO_MASTER_URI": f"http://{HOST}:{port}",
            "GAZEBO_IP": HOST,
            "GAZEBO_MODEL_DATABASE_URI": "",
            "IGN_IP": HOST,
            "IGN_PARTITION": f"dubins-traffic-{os.getpid()}-{port}",
            "ALSOFT_DRIVERS": "null",
        }  # fmt: skip

    def show(self, installation: Installation) -> None:
        """Start a gzclient that shows this server; it ends with it."""
        client = subprocess.Popen(
            [str(installation.gzclient)],
            env=self._environment | {"HOME": str(Path.home())},
            stdin=subprocess.DEVNULL,
            stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL,
            process_group=0,
        )
        weakref.finalize(self, _kill, client)
        self._client = client

    def ask(self, kind: MessageKind, values: Floats | None = None) -> Floats:
        """Send a message to the plugin and return its answer; LostError if there is none."""
        return self._link.ask(kind, np.zeros(0) if values is None else values)

    def explain(self, error: LostError) -> str:
        """Return why the server does not answer, in a line for people."""
        with contextlib.suppress(subprocess.TimeoutExpired):
            status = self.process.wait(GRACE if self._link.patience > GRACE else 0.1)
            if status < 0:
                return f"gzserver was ended by {signal.Signals(-status).name}"
            return f"gzserver ended by itself with status {status}{self._last_words()}"
        return f"gzserver: {error}"

    def close(self) -> None:
        """End the server and whatever it started, and remove its files. May be called twice."""
        client = getattr(self, "_client", None)
        if client is not None:
            _kill(client)
        self._finish()

    def _last_words(self) -> str:
        lines = PAINT.sub("", self.log.read_text(errors="replace")).split("\n")
        said = [line for line in lines if "[Err]" in line or "error" in line.lower()]
        return f": {said[-1].strip()[-300:]}" if said else ""


def _end(process: subprocess.Popen[bytes], link: Link, folder: Folder) -> None:
    link.quit()
    with contextlib.suppress(subprocess.TimeoutExpired):
        process.wait(GRACE)
    _kill(process)
    folder.cleanup()


def _kill(process: subprocess.Popen[bytes]) -> None:
    """End a process and its group, unless it has ended."""
    if process.poll() is None:
        os.killpg(process.pid, signal.SIGKILL)
        process.wait()


def _folder() -> Folder:
    try:
        return Folder()
    except OSError as error:
        raise InputError(
            f"no folder for Gazebo's files can be made ({error.strerror})",
            file=tempfile.gettempdir(),
            expected="room to write",
        ) from error


def _guardian() -> str:
    """Return the process with which the server has to end, empty if this thread might end before the process."""
    return str(os.getpid()) if threading.current_thread() is threading.main_thread() else ""


def _free_port() -> int:
    with socket.socket() as probe:
        probe.bind((HOST, 0))
        return int(probe.getsockname()[1])


def _in_use(port: int) -> bool:
    with socket.socket() as probe:
        probe.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        try:
            probe.bind((HOST, port))
        except OSError:
            return True
    return False


def _not_started(why: str, installation: Installation) -> InputError:
    return InputError(
        f"can't be started ({why})",
        file=str(installation.gzserver),
        field="simulator",
        value="gazebo",
        expected="a sound installation: `dubins-traffic gazebo doctor` looks",
    )
