import json
import socket
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

import dubins_traffic as dt
from dubins_traffic.controllers.registry import load
from dubins_traffic.errors import InputError, TransportError
from dubins_traffic.problem.configuration import load_config
from dubins_traffic.problem.draw import draw
from dubins_traffic.problem.public_problem import problem_from_document, problem_to_document
from dubins_traffic.record.sink import End
from dubins_traffic.runs.single import run_trial
from dubins_traffic.sessions.remote import Session, hand_over, run_remote
from dubins_traffic.transports.clocks import Lockstep
from dubins_traffic.transports.inbox import Inbox
from dubins_traffic.transports.line_messages import observation_from_document, observation_to_document
from dubins_traffic.transports.lines import Lines
from dubins_traffic.transports.lines_client import drive
from dubins_traffic.transports.link import Link
from tests.conformance.transport import BRIEF, PATIENT, UntypedConformance, answer, frames
from tests.recordings import make_instance
from tests.unit.test_bad_documents import base


class LinesPeer:
    def __init__(self, address: tuple[str, int], car: str) -> None:
        self.address, self.car = address, car
        self.again()

    def again(self) -> None:
        self.socket = socket.create_connection(self.address, PATIENT)
        self.lines = self.socket.makefile("rb")
        self.answered = -1
        self.put({"join": self.car})

    def put(self, message: Any) -> None:
        self.socket.sendall(json.dumps(message).encode() + b"\n")

    def get(self) -> dict[str, Any]:
        try:
            line = self.lines.readline()
        except (OSError, ValueError):
            line = b""
        return json.loads(line) if line else {"end": None}

    def problem(self) -> None:
        while not {"problem", "end"} & self.get().keys():
            pass

    def frame(self) -> int | None:
        message = self.get()
        return message["frame"]["tick"] if "frame" in message else None

    def send(self, speed: float, yaw_rate: float, tick: int) -> None:
        self.put({"command": [speed, yaw_rate], "tick": tick})

    def garbage(self) -> None:
        self.socket.sendall(b"\xff\x00 no message at all\n")

    def hang_up(self) -> None:
        try:
            self.socket.shutdown(socket.SHUT_RDWR)
        except OSError:
            assert self.socket.fileno() != 0
        self.socket.close()


class TestLines(UntypedConformance):
    def make(self) -> Lines:
        return Lines()

    def connect(self, transport: Lines, car: str) -> LinesPeer:
        return LinesPeer(transport.address, car)


def test_a_port_in_use() -> None:
    first = Lines()
    first.open(Inbox(10))
    with pytest.raises(TransportError, match="in use"):
        Lines(first.address[1]).open(Inbox(10))
    first.close()
    first.close()


def test_a_line_without_end_is_refused_in_bounded_memory() -> None:
    def spill(peer: LinesPeer) -> None:
        peer.problem()
        try:
            for _ in range(64):
                peer.socket.sendall(b"x" * 65536)
        except OSError:
            return

    assert TestLines().run(spill).ending.end is End.PEER_GARBAGE


@pytest.mark.parametrize(
    "line",
    [
        b"[" * 60_000,
        b'{"a":' * 10_000,
        b'{"command": [' + b"9" * 400 + b', 0], "tick": 0}',
        b'{"command": [' + b"9" * 5_000 + b', 0], "tick": 0}',
        b'{"command": [0.1, 0.0], "tick": ' + b"7" * 5_000 + b"}",
        b'{"command": ["\\ud800", 0], "tick": 0}',
        b'{"command": [0.1], "tick": 0}',
        b'{"command": [true, false], "tick": 0}',
        b'{"command": [0.1, 0], "tick": true}',
        b"\x00" * 60_000,
        b"",
    ],
    ids=[
        "deep",
        "deep objects",
        "huge",
        "longer than Python reads",
        "huge tick",
        "text",
        "short",
        "truth values",
        "true tick",
        "zeros",
        "nothing",
    ],
)
def test_a_hostile_line_is_garbage_and_the_next_trial_goes_on(line: bytes) -> None:
    instances = [replace(make_instance(names=(), ticks=10), trial=k) for k in range(2)]

    def drive(peer: LinesPeer) -> None:
        peer.problem()
        peer.frame()
        peer.socket.sendall(line + b"\n")
        while peer.frame() is not None:
            pass
        answer()(peer)

    with TestLines().link(Lockstep(30.0)) as link, ThreadPoolExecutor(1) as pool:
        peer = LinesPeer(link.transport.address, "ego")
        future = pool.submit(drive, peer)
        ends = [result.ending.end for result in run_remote(Session(link, instances.__getitem__, 2))]
        future.result(timeout=600)
        peer.hang_up()
    assert ends == [End.PEER_GARBAGE, End.DURATION]


@pytest.mark.parametrize(
    ("line", "end"),
    [
        (b'{"command": [NaN, 0], "tick": 0}', End.CONTROLLER_FAULT),
        (b'{"command": [1e999, 0], "tick": 0}', End.CONTROLLER_FAULT),
        (b'{"bye": "\\ud800 \\u001b[2J"}', End.GAVE_UP),
    ],
)
def test_a_hostile_message_ends_its_trial_by_name(line: bytes, end: End, tmp_path: Path) -> None:
    def drive(peer: LinesPeer) -> None:
        peer.problem()
        peer.frame()
        peer.socket.sendall(line + b"\n")

    result = TestLines().run(drive, record=tmp_path / "one.mcap")
    assert result.ending.end is end
    assert dt.load_record(tmp_path / "one.mcap").ending == result.ending


def test_a_built_in_controller_gives_the_same_record_from_elsewhere(tmp_path: Path) -> None:
    instance = draw(load_config("demo"), seed=3)
    instance = replace(instance, duration=4.0)
    run_trial(instance, "lanes", record=tmp_path / "here.mcap")
    link = Link(Lines(), Lockstep(), patience=BRIEF)
    with ThreadPoolExecutor(1) as pool:
        future = pool.submit(drive, link.transport.address, load("lanes"))
        result = run_trial(instance, record=tmp_path / "there.mcap", link=link)
        assert future.result(10) == {"end": "duration", "ticks": 120, "detail": ""}
    link.close()
    assert result.ending.end is End.DURATION
    assert result.controller == "lines"
    assert frames(tmp_path / "there.mcap") == frames(tmp_path / "here.mcap")


def test_observations_keep_their_bits() -> None:
    instance = draw(load_config(base(laser=True)), seed=5)
    with dt.Trial(instance) as trial:
        seen = trial.step((0.31, 0.17))
    document = json.loads(json.dumps(observation_to_document(seen)))
    back = observation_from_document(document, instance.problem)
    assert back._replace(scan=None) == seen._replace(scan=None)
    assert back.scan is not None
    assert seen.scan is not None
    assert back.scan.tobytes() == seen.scan.tobytes()


def test_a_problem_as_a_document_holds_no_secret() -> None:
    instance = draw(load_config("demo"), seed=3)
    document = problem_to_document(instance.problem)
    assert not {"starts", "duration", "seed", "trial"} & document.keys()
    assert problem_from_document(json.loads(json.dumps(document))) == instance.problem


def test_a_remote_e_agent_needs_a_link() -> None:
    instance = hand_over(draw(load_config("demo"), seed=3), ["agent0"])
    with pytest.raises(InputError, match="agent0 is driven by a program elsewhere"):
        run_trial(instance, "lanes")
    with pytest.raises(InputError, match="no such e-agent"):
        hand_over(instance, ["nobody"])
