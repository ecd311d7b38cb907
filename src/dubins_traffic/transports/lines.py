"""A transport without any third party: JSON lines over a TCP socket on this machine.

A peer connects and names the car that it drives: ``{"join": "ego"}``. It is sent ``{"problem": ...}`` when a trial
begins, ``{"frame": ...}`` (its car's own observation) every tick, and ``{"end": ...}``; it answers each frame with
``{"command": [speed, yaw rate], "tick": k}``, or gives up with ``{"bye": "why"}``. Numbers keep their bits.
"""

from __future__ import annotations

import contextlib
import json
import selectors
import socket
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, field
from threading import Lock, Thread
from typing import TYPE_CHECKING, Any

from dubins_traffic.errors import TransportError
from dubins_traffic.problem.public_problem import problem_to_document
from dubins_traffic.protocols import End, Ending, Mailbox, View
from dubins_traffic.transports.line_messages import (
    LONGEST,
    AnswerError,
    command_of,
    garbage,
    message_in,
    observation_to_document,
)

if TYPE_CHECKING:
    from dubins_traffic.problem.instance import Instance

BACKLOG = 1 << 22
"""Bytes that a peer may leave unread before it is dropped."""
CONNECTIONS = 4096
NAME = 1000
"""Characters of a car's name that is taken for one."""


@dataclass(slots=True, eq=False)
class _Peer:
    socket: socket.socket
    car: str = ""
    unread: bytearray = field(default_factory=bytearray)
    unsent: bytearray = field(default_factory=bytearray)


class Lines:
    """JSON lines over TCP (a `protocols.Transport`).

    Parameters
    ----------
    port : int
        Where to listen on the loopback interface; 0 takes any free port, see `address`.
    """

    name = "lines"
    tagged = True

    def __init__(self, port: int = 0) -> None:
        self._port = port
        self._peers: set[_Peer] = set()
        self._lock = Lock()
        self._cars: Mapping[str, int] = {}
        self._problem: bytes = b""
        self._open = False

    @property
    def address(self) -> tuple[str, int]:
        """Host and port at which it listens."""
        host, port = self._server.getsockname()
        return str(host), int(port)

    def open(self, mailbox: Mailbox) -> None:
        """Listen; TransportError if the port is taken."""
        self._mailbox = mailbox
        self._server = socket.socket(socket.AF_INET, socket.SOCK_STREAM)
        self._server.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)  # a session may follow another at once
        try:
            self._server.bind(("127.0.0.1", self._port))
            self._server.listen()
        except OSError as error:
            self._server.close()
            raise TransportError(f"can't listen on port {self._port}: {error.strerror}") from error
        self._server.setblocking(False)
        self._waker, self._wake = socket.socketpair()
        self._open = True
        self._thread = Thread(target=self._listen, name="lines", daemon=True)
        self._thread.start()

    def begin(self, instance: Instance, remote: Sequence[str]) -> None:
        """Note the cars."""
        self._cars = {name: n for n, name in enumerate(instance.names) if name in remote}
        self._problem = b""

    def announce(self, instance: Instance) -> None:
        """Send the problem to everyone; who comes later is sent it on joining."""
        message = as_line({"problem": problem_to_document(instance.problem)})
        with self._lock:
            self._problem = message
            for peer in self._driving():
                self._put(peer, message)

    def frame(self, view: View) -> None:
        """Send every peer its own observation."""
        if not view.running:
            return
        with self._lock:
            for peer in self._driving():
                seen = observation_to_document(view.observe(self._cars[peer.car]))
                self._put(peer, as_line({"frame": seen}))

    def end(self, ending: Ending) -> None:
        """Say that the trial is over."""
        with self._lock:
            self._problem = b""
            for peer in self._driving():
                self._put(peer, as_line({"end": asdict(ending)}))

    def close(self) -> None:
        """Hang up."""
        if not self._open:
            return
        self._open = False
        self._wake.send(b".")
        self._thread.join()
        with self._lock:
            for peer in self._peers:
                peer.socket.close()
            self._peers.clear()
        for each in (self._server, self._waker, self._wake):
            each.close()

    def _driving(self) -> list[_Peer]:
        return [peer for peer in self._peers if peer.car in self._cars]

    def _put(self, peer: _Peer, message: bytes) -> None:
        """Send what can be sent now and keep the rest, up to a limit."""
        peer.unsent += message
        try:
            sent = peer.socket.send(peer.unsent)
            del peer.unsent[:sent]
        except BlockingIOError:
            pass  # its buffer is full: the rest waits for the next message
        except OSError:
            peer.unsent.clear()  # it has gone, which the listening thread will see
        if len(peer.unsent) > BACKLOG:
            peer.unsent.clear()
            with contextlib.suppress(OSError):  # it may have hung up already
                peer.socket.shutdown(socket.SHUT_RDWR)

    def _listen(self) -> None:
        with selectors.DefaultSelector() as selector:
            selector.register(self._server, selectors.EVENT_READ)
            selector.register(self._waker, selectors.EVENT_READ)
            while self._open:
                for key, _ in selector.select():
                    if key.fileobj is self._server:
                        self._accept(selector)
                    elif key.fileobj is not self._waker and not self._read(key.data):
                        self._drop(key.data, selector)

    def _accept(self, selector: selectors.BaseSelector) -> None:
        try:
            connection, _ = self._server.accept()
        except OSError:
            return  # it hung up before it was answered
        connection.setblocking(False)
        connection.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        if len(self._peers) >= CONNECTIONS:
            connection.close()
            return
        peer = _Peer(connection)
        with self._lock:
            self._peers.add(peer)
        selector.register(connection, selectors.EVENT_READ, peer)

    def _drop(self, peer: _Peer, selector: selectors.BaseSelector) -> None:
        selector.unregister(peer.socket)
        with self._lock:
            self._peers.discard(peer)
        peer.socket.close()
        if peer.car:
            self._mailbox.left(peer.car)

    def _read(self, peer: _Peer) -> bool:
        """Take what has come; return whether the peer is still there."""
        try:
            data = peer.socket.recv(LONGEST)
        except OSError:
            return False
        peer.unread += data
        *lines, rest = peer.unread.split(b"\n")
        peer.unread = bytearray(rest)
        for line in lines:
            self._take(peer, bytes(line))
        if len(peer.unread) > LONGEST:
            self._mailbox.fault(peer.car, End.PEER_GARBAGE, f"a line longer than {LONGEST} bytes")
            return False
        return bool(data)

    def _take(self, peer: _Peer, line: bytes) -> None:
        try:
            message = message_in(line)
            answer = command_of(message)
            if answer is not None:
                self._mailbox.command(peer.car, answer.speed, answer.yaw_rate, answer.tick)
                return
            car: object = message.get("join")
            if type(car) is not str or peer.car or len(car) > NAME:
                raise garbage(line)
            self._join(peer, car)
        except AnswerError as error:
            self._mailbox.fault(peer.car, error.end, error.detail)

    def _join(self, peer: _Peer, car: str) -> None:
        with self._lock:
            peer.car = car
            if self._problem and car in self._cars:
                self._put(peer, self._problem)
        self._mailbox.joined(car)


def as_line(message: Mapping[str, Any]) -> bytes:
    """Return a message as it is sent."""
    return json.dumps(message, separators=(",", ":")).encode() + b"\n"
