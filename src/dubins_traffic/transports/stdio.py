"""A transport over a program's own standard streams: the messages of `lines`, each program driving one car.

A program is begun with each trial. It reads ``{"problem": ...}``, ``{"frame": ...}`` and ``{"end": ...}`` from standard
input and writes ``{"command": [speed, yaw rate], "tick": k}`` to standard output. It prints on standard error.
"""

from __future__ import annotations

import contextlib
import os
import select
import subprocess
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass, field
from typing import TYPE_CHECKING, Any, Protocol

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
from dubins_traffic.transports.lines import BACKLOG, as_line

if TYPE_CHECKING:
    from dubins_traffic.problem.instance import Instance

NO_TICK = -1
TOO_LONG = f"a line longer than {LONGEST} bytes"


class Piped(Protocol):
    """A program with pipes to its standard input and from its standard output, none of which blocks."""

    @property
    def questions(self) -> int:
        """Descriptor of its standard input."""
        ...

    @property
    def answers(self) -> int:
        """Descriptor of its standard output."""
        ...

    def close(self) -> None:
        """End it. May be called twice."""
        ...


class Child:
    """A program of this machine that is trusted (a `Piped`); what it prints goes where ours does."""

    def __init__(self, command: Sequence[str]) -> None:
        try:
            self._process = subprocess.Popen(
                command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, start_new_session=True, bufsize=0
            )
        except OSError as error:
            raise TransportError(f"can't begin {command[0]}: {error.strerror}") from error
        descriptors = [stream.fileno() for stream in (self._process.stdin, self._process.stdout) if stream is not None]
        self.questions, self.answers = descriptors
        for each in descriptors:
            os.set_blocking(each, False)

    def close(self) -> None:
        """End it."""
        self._process.kill()
        self._process.wait()
        for stream in filter(None, (self._process.stdin, self._process.stdout)):
            stream.close()


@dataclass(slots=True, eq=False)
class _Peer:
    program: Piped
    car: str
    index: int
    shown: int = NO_TICK
    unread: bytearray = field(default_factory=bytearray)
    unsent: bytearray = field(default_factory=bytearray)


class Stdio:
    """Lines over standard input and output (a `protocols.Transport`, `Polled`).

    Parameters
    ----------
    begun : callable
        Begins the program that drives a car, given the car's name.
    """

    name = "stdio"
    tagged = True

    def __init__(self, begun: Callable[[str], Piped]) -> None:
        self._begun = begun
        self._peers: dict[int, _Peer] = {}

    def open(self, mailbox: Mailbox) -> None:
        """Note where answers go."""
        self._mailbox = mailbox
        self._poll = select.poll()

    def begin(self, instance: Instance, remote: Sequence[str]) -> None:
        """Begin a program for each car."""
        self.close()
        for car in remote:
            program = self._begun(car)
            peer = _Peer(program, car, instance.names.index(car))
            self._peers[program.answers] = peer
            self._poll.register(program.answers, select.POLLIN)
            self._mailbox.joined(car)

    def announce(self, instance: Instance) -> None:
        """Tell each program the problem."""
        self._put_all({"problem": problem_to_document(instance.problem)})

    def frame(self, view: View) -> None:
        """Send each program its own car's observation, once: nothing is lost on the way."""
        if not view.running:
            return
        for peer in list(self._peers.values()):
            if peer.shown < view.tick:
                peer.shown = view.tick
                seen = observation_to_document(view.observe(peer.index))
                self._put(peer, as_line({"frame": seen}))

    def end(self, ending: Ending) -> None:
        """Say that the trial is over, and end the programs."""
        self._put_all({"end": asdict(ending)})
        self.close()

    def close(self) -> None:
        """End the programs."""
        for peer in list(self._peers.values()):
            self._drop(peer)

    def receive(self, seconds: float) -> None:
        """Wait for an answer, so long at most, and hand all that have come to the mailbox."""
        for descriptor, _ in self._poll.poll(max(0.0, seconds) * 1000.0):
            peer = self._peers.get(descriptor)
            if peer is not None and not self._read(peer):
                self._drop(peer)
        for peer in self._peers.values():
            if peer.unsent:
                self._send(peer)

    def _put_all(self, message: Mapping[str, Any]) -> None:
        for peer in list(self._peers.values()):
            self._put(peer, as_line(message))

    def _put(self, peer: _Peer, message: bytes) -> None:
        """Send what can be sent now and keep the rest, up to a limit."""
        peer.unsent += message
        self._send(peer)
        if len(peer.unsent) > BACKLOG:
            self._drop(peer)

    def _send(self, peer: _Peer) -> None:
        try:
            del peer.unsent[: os.write(peer.program.questions, peer.unsent)]
        except BlockingIOError:
            return
        except OSError:
            peer.unsent.clear()  # it reads no more; that it has gone is seen when it is read

    def _drop(self, peer: _Peer) -> None:
        if self._peers.pop(peer.program.answers, None) is None:
            return
        self._poll.unregister(peer.program.answers)
        peer.program.close()
        self._mailbox.left(peer.car)

    def _read(self, peer: _Peer) -> bool:
        """Take what has come; return whether the program is still there."""
        data = b""
        with contextlib.suppress(BlockingIOError):
            data = os.read(peer.program.answers, LONGEST)
        peer.unread += data
        *lines, rest = peer.unread.split(b"\n")
        peer.unread = bytearray(rest)
        for line in lines:
            self._take(peer, bytes(line))
        whole = len(rest) <= LONGEST
        if not whole:
            self._mailbox.fault(peer.car, End.PEER_GARBAGE, TOO_LONG)
        return whole and bool(data)

    def _take(self, peer: _Peer, line: bytes) -> None:
        """Hand on what a line says; a tick that has not been shown yet is a lie."""
        try:
            message = message_in(line)
            if message == {"join": peer.car}:
                return
            answer = command_of(message)
            if answer is None or not 0 <= answer.tick <= peer.shown:
                raise garbage(line)
        except AnswerError as error:
            self._mailbox.fault(peer.car, error.end, error.detail)
            return
        self._mailbox.command(peer.car, answer.speed, answer.yaw_rate, answer.tick)
