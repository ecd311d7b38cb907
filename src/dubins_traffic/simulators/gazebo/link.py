"""Messages to the world plugin and its answers (docs/gazebo-plugin.md)."""

from __future__ import annotations

import contextlib
import socket
import struct
from enum import IntEnum
from typing import Final

import numpy as np

from dubins_traffic.errors import DubinsTrafficError
from dubins_traffic.kernels.arrays import Floats

PROTOCOL: Final = 1
HEAD: Final = struct.Struct("=II")
BODY: Final = 7
"""Numbers per car in an answer: x, y, cos, sin, velocity along x and y, yaw rate."""
CONTACT: Final = 7 + 2 * BODY
"""Numbers per contact: step, car, other, point x, y, normal x, y; then both bodies before the impact."""


class Kind(IntEnum):
    """Kinds of messages; an answer has the kind of its question."""

    HELLO = 1
    STEP = 2
    STATE = 3
    PLACE = 4
    SCAN = 5
    QUIT = 6
    REFUSED = 0xFFFFFFFF


class LostError(DubinsTrafficError):
    """The plugin has gone, is silent or answers nonsense."""


class Link:
    """One end of the socket whose other end the plugin holds.

    Parameters
    ----------
    line : socket
        Connected; closed with the link.
    patience : float
        Seconds within which an answer must come.
    """

    def __init__(self, line: socket.socket, patience: float) -> None:
        self._line = line
        self.patience = patience

    def ask(self, kind: Kind, values: Floats) -> Floats:
        """Send a message and return the numbers of its answer.

        Raises
        ------
        LostError
            If no answer comes within the patience, the other end has gone, or it does not know the message.
        """
        try:
            self._line.settimeout(self.patience)
            self._line.sendall(HEAD.pack(kind, len(values)) + values.tobytes())
            answer, count = HEAD.unpack(self._take(HEAD.size))
            found = np.frombuffer(self._take(8 * count), dtype=np.float64)
        except TimeoutError:
            raise LostError(f"it has not answered for {self.patience:g} s") from None
        except OSError as error:
            raise LostError(f"its socket is closed ({error.strerror or error})") from None
        if answer != kind:
            raise LostError(f"it refused {kind.name}")
        return found

    def quit(self) -> None:
        """Tell the other end to end, and close this one."""
        with contextlib.suppress(OSError):
            self._line.settimeout(0.0)
            self._line.send(HEAD.pack(Kind.QUIT, 0))
        self._line.close()

    def _take(self, size: int) -> bytes:
        parts: list[bytes] = []
        while size > 0:
            part = self._line.recv(size)
            if not part:
                raise LostError("it has gone")
            parts.append(part)
            size -= len(part)
        return b"".join(parts)
