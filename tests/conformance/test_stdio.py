from __future__ import annotations

import socket
import sys
import tempfile
from contextlib import suppress
from pathlib import Path
from typing import Any

import pytest

from dubins_traffic.cli.main import main
from dubins_traffic.protocols import End
from dubins_traffic.transports.clocks import Lockstep
from dubins_traffic.transports.stdio import Child, Piped, Stdio
from tests.boxes import needs_boxes
from tests.conformance.test_lines import LinesPeer
from tests.conformance.transport import PATIENT, UntypedConformance, answer, frames

RELAY = Path(__file__).parents[1] / "relay.py"


class StdioPeer(LinesPeer):
    """Speaks for the program that is begun with each trial, over a relay."""

    def __init__(self, server: socket.socket) -> None:
        self.server = server
        self.connection: socket.socket | None = None

    def put(self, message: Any) -> None:
        """Say something; to nobody, if the program has ended with its trial."""
        with suppress(BrokenPipeError, ConnectionResetError):
            super().put(message)

    def problem(self) -> None:
        self.hang_up()
        self.server.settimeout(PATIENT)
        self.socket, _ = self.server.accept()
        self.lines = self.socket.makefile("rb")
        super().problem()

    def hang_up(self) -> None:
        if hasattr(self, "socket"):
            self.lines.close()
            super().hang_up()


class TestStdio(UntypedConformance):
    @pytest.fixture(autouse=True)
    def _serve(self) -> Any:
        with tempfile.TemporaryDirectory() as folder, socket.socket(socket.AF_UNIX) as self.server:
            self.address = f"{folder}/relay"
            self.server.bind(self.address)
            self.server.listen()
            yield

    def begun(self, _car: str) -> Piped:
        return Child([sys.executable, "-I", "-S", str(RELAY), self.address])

    def make(self) -> Stdio:
        return Stdio(self.begun)

    def connect(self, transport: Stdio, car: str) -> StdioPeer:  # noqa: ARG002
        return StdioPeer(self.server)

    def test_a_peer_that_reconnects(self) -> None:
        """A program that has ended does not come back in its trial."""
        result = self.run(answer(until=20, then=lambda peer: peer.hang_up()))
        assert result.ending.end is End.PEER_LOST

    @pytest.mark.parametrize(
        "line",
        [
            b'{"command": [true, 0], "tick": 3}',
            b'{"command": ["0.1", 0], "tick": 3}',
            b'{"command": [0.1, 0, 0], "tick": 3}',
            b'{"command": [0.1, 0], "tick": true}',
            b'{"command": [0.1, 0], "tick": 3.0}',
            b'{"command": [0.1, 0], "tick": 99}',
            b'{"command": [0.1, 0], "tick": -1}',
            b'{"command": [' + b"9" * 400 + b', 0], "tick": 3}',
            b"[" * 60_000,
            b'{"a":' * 10_000,
            b"\xff\xfe",
            b"[]",
            b"",
        ],
    )
    def test_what_is_no_command_of_two_plain_numbers_and_a_tick_that_was_shown(self, line: bytes) -> None:
        result = self.run(answer(until=2, then=lambda peer: peer.socket.sendall(line + b"\n")), Lockstep(30.0))
        assert result.ending.end is End.PEER_GARBAGE
        assert "not a message" in result.ending.detail

    def test_a_line_without_end(self) -> None:
        def spill(peer: Any) -> None:
            try:
                peer.socket.sendall(b"x" * 4_000_000)
            except OSError:
                return

        assert self.run(answer(until=2, then=spill)).ending.end is End.PEER_GARBAGE


@needs_boxes
def test_a_session_with_a_program_in_a_box(tmp_path: Path) -> None:
    controller = f"{Path(__file__).parents[2] / 'examples' / 'controller.py'}:Homing"
    there, here = tmp_path / "there", tmp_path / "here"
    shared = ["demo", "--trials", "1", "--records"]
    words = ["stdio", "run", *shared, str(there), "--lockstep", "--sandbox", "--program", controller]
    assert main(words) == 0
    assert main(["run", *shared, str(here), "--controller", controller]) == 0
    assert frames(there / "trial-0000.mcap") == frames(here / "trial-0000.mcap")
