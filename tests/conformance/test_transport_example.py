"""The example of docs/extending/transport.md does what every transport must do, and gets its command from its entry."""

from __future__ import annotations

import importlib.util
import json
import socket
import sys
import threading
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any

import pytest
import typer

import dubins_traffic as dt
from dubins_traffic.cli import session
from dubins_traffic.record.sink import End
from dubins_traffic.sessions.registry import TRANSPORTS
from tests.conformance.transport import PATIENT, UntypedConformance, answer

ROOT = Path(__file__).resolve().parents[2]
EXAMPLE = ROOT / "examples" / "extending" / "transport.py"
CONFIG = {
    "version": 1,
    "problem_domain": "dubins_traffic",
    "rnd": {"version": 0, "length": 3, "shape": [2, 2]},
    "duration": 1.0,
    "number_trials": 2,
}


def load_example() -> Any:
    spec = importlib.util.spec_from_file_location("transport_example", EXAMPLE)
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    sys.modules[spec.name] = module
    spec.loader.exec_module(module)
    return module


example = load_example()


class DatagramPeer:
    """A peer written from the example's first lines alone."""

    def __init__(self, address: tuple[str, int], car: str) -> None:
        self.address, self.car = address, car
        self.again()

    def again(self) -> None:
        self.socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self.socket.settimeout(PATIENT)
        self.answered = -1
        self.put({"join": self.car})

    def put(self, message: Any) -> None:
        self.socket.sendto(json.dumps(message).encode(), self.address)

    def get(self) -> dict[str, Any]:
        return json.loads(self.socket.recv(1 << 16))

    def problem(self) -> None:
        while "problem" not in self.get():
            pass

    def frame(self) -> int | None:
        while "problem" in (message := self.get()):
            pass  # told again, since it joined again
        return message["frame"]["tick"] if "frame" in message else None

    def send(self, speed: float, yaw_rate: float, tick: int) -> None:
        self.put({"command": [speed, yaw_rate], "tick": tick})

    def garbage(self) -> None:
        self.socket.sendto(b"\xff\x00 no message at all", self.address)

    def hang_up(self) -> None:
        self.socket.close()


class TestDatagrams(UntypedConformance):
    detects_loss = False

    def make(self) -> Any:
        return example.Datagrams()

    def connect(self, transport: Any, car: str) -> DatagramPeer:
        return DatagramPeer(transport.address, car)


def test_the_command_is_made_from_the_entry(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(TRANSPORTS, "datagrams", example.ENTRY)
    app, over = typer.Typer(), threading.Event()
    app.add_typer(session.app("datagrams", TRANSPORTS["datagrams"]), name="datagrams")
    (tmp_path / "small.json").write_text(json.dumps(CONFIG))
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
        probe.bind(("127.0.0.1", 0))
        port = probe.getsockname()[1]

    def drive() -> None:
        peer = DatagramPeer(("127.0.0.1", port), "ego")
        peer.socket.settimeout(0.2)
        while not over.is_set():  # the session may not listen yet
            try:
                peer.problem()
                break
            except OSError:
                peer.put({"join": "ego"})
        peer.socket.settimeout(PATIENT)
        while (tick := peer.frame()) is not None:
            peer.send(0.3, 0.0, tick)
        answer()(peer)
        peer.hang_up()

    options = ["--lockstep", "--port", str(port), "--records", str(tmp_path / "out"), "--json"]
    with ThreadPoolExecutor(1) as pool:
        driving = pool.submit(drive)
        try:
            app(["datagrams", "run", str(tmp_path / "small.json"), *options], standalone_mode=False)
        finally:
            over.set()
        driving.result(timeout=PATIENT)
    shown = json.loads(capsys.readouterr().out)["trials"]
    assert [(trial["controller"], trial["end"]) for trial in shown] == [("datagrams", "duration")] * 2
    record = dt.load_record(tmp_path / "out" / "trial-0001.mcap")
    assert record.ending is not None
    assert record.ending.end is End.DURATION


@pytest.mark.parametrize("name", TRANSPORTS)
def test_every_transport_has_its_suite(name: str) -> None:
    suite = (ROOT / "tests" / "conformance" / f"test_{name}.py").read_text()
    assert "Conformance)" in suite
    assert callable(TRANSPORTS[name].runner)
