"""Messages to the world plugin and its answers (docs/gazebo-plugin.md); its contacts as those of records."""

from __future__ import annotations

import contextlib
import os
import select
import socket
import struct
from enum import IntEnum
from time import monotonic
from typing import TYPE_CHECKING, Final

import numpy as np

from dubins_traffic.cars.motion import PARTED
from dubins_traffic.cars.state import Contact, State
from dubins_traffic.cars.touching import Bodies
from dubins_traffic.errors import DubinsTrafficError
from dubins_traffic.kernels.arrays import Floats

if TYPE_CHECKING:
    from dubins_traffic.problem.instance import Instance

PROTOCOL: Final = 1
HEAD: Final = struct.Struct("=II")
BODY: Final = 7
"""Numbers per car in an answer: x, y, cos, sin, velocity along x and y, yaw rate."""
CONTACT: Final = 7 + 2 * BODY
"""Numbers per contact: step, car, other, point x, y, normal x, y; then both bodies before the impact."""


LINGER: Final = 0.002
"""Seconds for which the socket is polled before a blocking wait; a tick of a dozen cars takes less."""


class MessageKind(IntEnum):
    """Kinds of messages; an answer has the kind of its question."""

    HELLO = 1
    STEP = 2
    STATE = 3
    PLACE = 4
    SCAN = 5
    QUIT = 6
    REFUSED = 0xFFFFFFFF


class LostError(DubinsTrafficError):
    """The plugin has ended, is silent or answers nonsense."""


class Link:
    """The end of the socket to the plugin that this process holds.

    Parameters
    ----------
    line : socket
        Connected; closed with the link.
    patience : float
        Seconds within which an answer must come.
    """

    def __init__(self, line: socket.socket, patience: float) -> None:
        self._line = line
        self.be_patient(patience)

    def be_patient(self, seconds: float) -> None:
        """Set how long to wait for each answer, seconds."""
        self.patience = seconds
        # The kernel keeps the time: a timeout of Python's own costs further calls for each message.
        limit = struct.pack("ll", int(seconds), int(seconds % 1.0 * 1e6))
        self._line.setsockopt(socket.SOL_SOCKET, socket.SO_RCVTIMEO, limit)
        self._line.setsockopt(socket.SOL_SOCKET, socket.SO_SNDTIMEO, limit)

    def ask(self, kind: MessageKind, values: Floats) -> Floats:
        """Send a message and return the numbers of its answer.

        LostError if no answer comes within the patience, the other end has gone, or it does not know the message.
        """
        self.send(kind, values)
        return self.receive(kind)

    def send(self, kind: MessageKind, values: Floats) -> None:
        """Send a message; LostError if it can't be."""
        try:
            self._line.sendall(HEAD.pack(kind, len(values)) + values.tobytes())
        except OSError as error:
            raise LostError(f"its socket is closed ({error.strerror or error})") from None

    def ready(self, seconds: float) -> bool:
        """Tell whether there is data to receive, or will be within the given time."""
        return bool(select.select([self._line], [], [], seconds)[0])

    def receive(self, kind: MessageKind) -> Floats:
        """Return the numbers of the answer to a message of this kind that has been sent; LostError as `ask`."""
        try:
            data = self._take(b"", HEAD.size)
            answer, count = HEAD.unpack_from(data)
            data = self._take(data, HEAD.size + 8 * count)
        except BlockingIOError:
            raise LostError(f"it has not answered for {self.patience:g} s") from None
        except OSError as error:
            raise LostError(f"its socket is closed ({error.strerror or error})") from None
        if answer != kind:
            raise LostError(f"it refused {kind.name}")
        return np.frombuffer(data, dtype=np.float64, offset=HEAD.size)

    def quit(self) -> None:
        """Tell the other end to end, and close this one."""
        with contextlib.suppress(OSError):
            self._line.send(HEAD.pack(MessageKind.QUIT, 0), socket.MSG_DONTWAIT)
        self._line.close()

    def _look(self) -> bytes:
        """Return data that arrives soon, by polling: faster than being woken up. It yields the processor meanwhile."""
        until = monotonic() + LINGER
        while monotonic() < until:
            with contextlib.suppress(BlockingIOError):
                return self._line.recv(65536, socket.MSG_DONTWAIT)
            os.sched_yield()
        return b""

    def _take(self, data: bytes, size: int) -> bytes:
        """Return `data` with as much after it as makes `size` bytes at least; nothing follows an answer."""
        while len(data) < size:
            part = self._look() or self._line.recv(65536)
            if not part:
                raise LostError("it has gone")
            data += part
        return data


SLOWEST: Final = 0.01
"""Speed below which a body counts as standing, m/s: simulated wheels and contacts always move a little."""


class Contacts:
    """Keeps which bodies have touched and have not parted since."""

    def __init__(self, instance: Instance, step: float) -> None:
        problem = instance.problem
        self._period = 1.0 / problem.rate
        self._step = step
        self._bodies = Bodies(problem.car, problem.obstacles)
        self._touching: set[tuple[int, int]] = set()

    def collect(self, tick: int, rows: Floats, state: State) -> tuple[Contact, ...]:
        """Return the new contacts of the tick that ends in frame `tick`, whose state is given; earliest first."""
        contacts: list[Contact] = []
        for row in sorted(rows.tolist(), key=lambda row: (row[0], row[1], row[2])):
            pair = (int(row[1]), int(row[2]))
            if pair not in self._touching:
                self._touching.add(pair)
                contacts.append(self._contact(tick, row))
        if self._touching:
            self._touching = {pair for pair in self._touching if self._bodies.separation(state, *pair)[0] < PARTED}
        return tuple(contacts)

    def _contact(self, tick: int, row: list[float]) -> Contact:
        point, normal = (row[3], row[4]), (row[5], row[6])
        back = (-normal[0], -normal[1])
        bodies = row[7 : 7 + BODY], row[7 + BODY :]
        return Contact(
            tick=tick,
            time=(tick - 1) * self._period + row[0] * self._step,
            car=int(row[1]),
            other=int(row[2]),
            x=point[0],
            y=point[1],
            nx=normal[0],
            ny=normal[1],
            closing=(self._closing(bodies[0], point, normal), self._closing(bodies[1], point, back)),
            moved=(self._moved(bodies[0]), self._moved(bodies[1])),
        )

    def _closing(self, body: list[float], point: tuple[float, float], normal: tuple[float, float]) -> float:
        """Return the speed of the body's touching point along `normal`, m/s."""
        x, y, _, _, vx, vy, yaw_rate = body
        turn = yaw_rate if self._bodies.turns else 0.0
        return normal[0] * (vx - turn * (point[1] - y)) + normal[1] * (vy + turn * (point[0] - x))

    def _moved(self, body: list[float]) -> bool:
        _, _, _, _, vx, vy, yaw_rate = body
        turning = abs(yaw_rate) * self._bodies.box[0] if self._bodies.turns else 0.0
        return max(abs(vx), abs(vy), turning) > SLOWEST
