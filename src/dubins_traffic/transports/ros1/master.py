"""A ROS master of our own, as a child that dies with its parent (`python -m ...ros1.master PORT`)."""

from __future__ import annotations

import ctypes
import os
import signal
import socket
import subprocess
import sys
from http.client import HTTPConnection
from time import monotonic, sleep
from typing import Any
from xmlrpc.client import ServerProxy, Transport

from dubins_traffic.errors import TransportError
from dubins_traffic.transports.ros1.messages import ros

PR_SET_PDEATHSIG = 1
PATIENCE = 120.0
"""Seconds in which a master must come up; one that ends before is noticed at once."""
ANSWER = 10.0
"""Seconds for an answer on a busy machine; where nobody listens, that is known at once."""


class Master:
    """A rosmaster on the loopback interface.

    Parameters
    ----------
    port : int
        Where it listens; 0 takes a free port.

    Raises
    ------
    TransportError
        If the port is in use or the master does not come up.
    MissingRosError
        If Debian's rosmaster is not installed.
    """

    def __init__(self, port: int = 0) -> None:
        ros("rosmaster")
        port = _free(port)
        self.uri = f"http://127.0.0.1:{port}/"
        environment = {**os.environ, "ROS_MASTER_URI": self.uri, "ROS_IP": "127.0.0.1"}
        command = [sys.executable, "-m", __spec__.name, str(port)]
        self._child = subprocess.Popen(
            command, env=environment, stdin=subprocess.DEVNULL, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE,
            start_new_session=True,
        )  # fmt: skip
        until = monotonic() + PATIENCE
        while not answers(self.uri):
            if self._child.poll() is not None or monotonic() > until:
                self.close()
                raise TransportError(f"the ROS master on port {port} did not come up")
            sleep(0.05)

    @property
    def pid(self) -> int:
        """Its process."""
        return self._child.pid

    def close(self) -> None:
        """End it."""
        self._child.terminate()
        try:
            self._child.communicate(timeout=3.0)
        except subprocess.TimeoutExpired:
            self._child.kill()
            self._child.communicate()


def answers(uri: str, patience: float = ANSWER) -> bool:
    """Tell whether there is a ROS master, or a node, at `uri`."""
    return pid_at(uri, patience) is not None


def pid_at(uri: str, patience: float = ANSWER) -> int | None:
    """Return the process number of the master or node at `uri`, None if nobody answers."""
    try:
        with ServerProxy(uri, transport=_Brief(patience)) as proxy:
            answer: Any = proxy.getPid("/dubins_traffic")
        return int(answer[2])
    except Exception:  # refused, late, or no ROS node: nobody of use is there
        return None


class _Brief(Transport):
    """A way to call that does not wait for ever."""

    def __init__(self, patience: float) -> None:
        super().__init__()
        self._patience = patience

    def make_connection(self, host: Any) -> HTTPConnection:
        """Connect with a time limit on all that follows."""
        connection = super().make_connection(host)
        connection.timeout = self._patience
        return connection


def _free(port: int) -> int:
    with socket.socket(socket.AF_INET, socket.SOCK_STREAM) as probe:
        probe.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        try:
            probe.bind(("127.0.0.1", port))
        except OSError as error:
            raise TransportError(f"can't start a ROS master on port {port}: {error.strerror}") from error
        return int(probe.getsockname()[1])


def _serve(port: int) -> None:
    """Be a master until the parent dies."""
    parent = os.getppid()
    ctypes.CDLL(None).prctl(PR_SET_PDEATHSIG, signal.SIGTERM)
    if os.getppid() != parent:
        return
    master = ros("rosmaster.master").Master(port, 3)
    master.start()
    while master.ok():
        sleep(0.1)


if __name__ == "__main__":
    _serve(int(sys.argv[1]))
