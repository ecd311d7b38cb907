"""`watch`, `run --watch` and `play` without a browser: the socket, who is refused there, and how commands end."""

from __future__ import annotations

import json
import os
import re
import signal
import socket
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager, nullcontext, suppress
from pathlib import Path
from typing import Any
from urllib.parse import urlsplit

import numpy as np
import pytest
from websockets.exceptions import ConnectionClosed, InvalidStatus
from websockets.sync.client import ClientConnection, connect

from dubins_traffic.cli.main import main
from dubins_traffic.live.server import BURST, MOST_BYTES
from dubins_traffic.problem.configuration import load_config
from dubins_traffic.problem.document import instance_to_document
from dubins_traffic.problem.draw import draw
from dubins_traffic.record import reader

pytestmark = pytest.mark.path

CARS = 3
SHORT = {**load_config("demo").to_document(), "number_trials": 2, "duration_bounds": [2, 2]}
WAIT_S = 300


class Program:
    """`dubins-traffic` with some arguments, and the address that it prints."""

    def __init__(self, folder: Path, *arguments: str) -> None:
        command = [sys.executable, "-m", "dubins_traffic.cli", *arguments]
        self.process = subprocess.Popen(command, cwd=folder, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
        self.told = ""
        assert self.process.stderr is not None
        for line in self.process.stderr:
            self.told += line
            if " at http://" in line:
                break
        found = re.search(r"http://\S+", self.told)
        assert found is not None, self.told
        self.url = urlsplit(found[0])
        self.cookie = ""

    def get(self, target: str, **headers: str) -> tuple[int, dict[str, str], str]:
        """Send a request byte by byte as it is written here, and return status, headers and body."""
        lines = {"Host": self.url.netloc, **({"Cookie": self.cookie} if self.cookie else {}), **headers}
        return exchange(self.url, f"GET {target} HTTP/1.1\r\n" + "".join(f"{k}: {v}\r\n" for k, v in lines.items()))

    def enter(self) -> str:
        """Exchange the token and return the page."""
        status, headers, body = self.get(f"/?{self.url.query}")
        assert (status, headers["location"], body) == (303, "/", "")
        self.cookie = headers["set-cookie"].partition(";")[0]
        status, _, page = self.get("/")
        assert status == 200
        return page

    def open(self, show: int = 1, **headers: str) -> ClientConnection:
        """Open the socket as the page does."""
        more = {"Cookie": self.cookie, "Origin": f"http://{self.url.netloc}", **headers}
        origin = more.pop("Origin")
        return connect(
            f"ws://{self.url.netloc}/socket?show={show}",
            additional_headers=more,
            origin=origin,  # pyright: ignore[reportArgumentType]
            proxy=None,
            max_size=None,
        )

    def end(self) -> tuple[int, str, str]:
        """Return status, output and what stands on standard error."""
        out, err = self.process.communicate(timeout=WAIT_S)
        return self.process.returncode, out, self.told + err


def exchange(url: Any, head: str) -> tuple[int, dict[str, str], str]:
    with socket.create_connection((url.hostname, url.port), timeout=WAIT_S) as to:
        to.sendall(head.encode() + b"\r\n")
        answer = b""
        while part := to.recv(1 << 16):
            answer += part
    top, _, body = answer.decode().partition("\r\n\r\n")
    first, *lines = top.split("\r\n")
    headers = {name.lower(): value for name, _, value in (line.partition(": ") for line in lines)}
    return int(first.split()[1]), headers, body


@contextmanager
def running(folder: Path, *arguments: str) -> Iterator[Program]:
    (folder / "short.json").write_text(json.dumps(SHORT))
    program = Program(folder, *arguments, "--no-browser")
    try:
        yield program
    finally:
        if program.process.poll() is None:
            program.process.kill()
        program.process.communicate(timeout=WAIT_S)


def heard(connection: ClientConnection) -> tuple[list[int], list[dict[str, Any]]]:
    """Return all ticks and messages until the connection ends."""
    ticks: list[int] = []
    messages: list[dict[str, Any]] = []
    try:
        for message in connection:
            if isinstance(message, str):
                messages.append(json.loads(message))
            else:
                ticks += np.frombuffer(message, "<u4").reshape(-1, 1 + 8 * CARS)[:, 0].tolist()
            if messages and messages[-1]["kind"] == "next":
                break
    except ConnectionClosed:
        pass
    return ticks, messages


def until_a_tick(connection: ClientConnection) -> None:
    while not isinstance(connection.recv(WAIT_S), bytes):
        pass


def test_all_ticks_of_all_trials_come_and_the_records_are_those_of_run(tmp_path: Path) -> None:
    with running(
        tmp_path, "watch", "short.json", "--controller", "simple", "--records", "out", "--pace", "2"
    ) as program:
        page = program.enter()
        assert f"connect-src ws://{program.url.netloc}" in page
        assert program.url.query.partition("=")[2] not in page
        for show in (1, 2):
            with program.open(show) as connection:
                connection.send('{"who": "me"}')
                ticks, messages = heard(connection)
            assert ticks == list(range(1, 61))
            assert {"kind": "role", "drives": False} in messages
            (ending,) = [own for own in messages if own["kind"] == "end"]
            assert ending["ending"]["end"] == "duration"
            assert ending["verdict"] is None
            assert [name for name, _ in ending["summary"]][:2] == ["controller", "counted rounds"]
        status, out, _ = program.end()
    assert status == 0
    assert "sum" in out
    assert (
        main(
            [
                "run",
                str(tmp_path / "short.json"),
                "--controller",
                "simple",
                "--records",
                str(tmp_path / "again"),
            ]
        )
        == 0
    )
    for name in ("trial-0000.mcap", "trial-0001.mcap"):
        assert (tmp_path / "out" / name).read_bytes() == (tmp_path / "again" / name).read_bytes()


def test_strangers_are_refused_at_page_and_socket(tmp_path: Path) -> None:
    with running(tmp_path, "run", "short.json", "--watch") as program:
        assert program.get("/")[0] == 403
        program.enter()
        assert program.get("/", Host="evil.example")[0] == 421
        assert program.get("/", Host=f"evil.example:{program.url.port}")[0] == 421
        assert program.get("/", Origin="http://evil.example")[0] == 403
        assert program.get("/other")[0] == 404
        head = f"POST / HTTP/1.1\r\nHost: {program.url.netloc}\r\nCookie: {program.cookie}\r\n"
        assert exchange(program.url, head)[0] == 405
        for headers in ({"Origin": "http://evil.example"}, {"Cookie": "x=y"}, {"Origin": "null"}):
            with pytest.raises(InvalidStatus) as told:
                program.open(**headers)
            assert told.value.response.status_code == 403
        status, headers, _ = program.get("/")
        assert status == 200
        for name, value in (
            ("cache-control", "no-store"), ("referrer-policy", "no-referrer"), ("x-frame-options", "DENY"),
        ):  # fmt: skip
            assert headers[name] == value


def test_what_no_page_sends_ends_the_connection_and_not_the_trial(tmp_path: Path) -> None:
    with running(tmp_path, "watch", "short.json", "--trials", "1", "--pace", "0.5") as program:
        program.enter()
        big = json.dumps({"who": "x" * MOST_BYTES})
        for messages in (
            [big],
            ["no"],
            ["[]"],
            ['{"drive": [0, 0]}'],
            [b"\0"],
            ['{"who": "a"}'] * 2,
            ["{" * 250],
        ):
            with program.open() as connection:
                for message in messages:
                    connection.send(message)
                heard(connection)
            assert connection.close_code in (1008, 1009)
        with program.open() as connection:
            ticks, messages = heard(connection)
        assert ticks == list(range(1, 61))
        assert program.end()[0] == 0


def test_a_player_who_sends_too_much_is_closed(tmp_path: Path) -> None:
    with running(tmp_path, "play", "short.json", "-o", "mine.mcap") as program:
        program.enter()
        with program.open() as connection:
            connection.send('{"who": "a"}')
            with suppress(ConnectionClosed):
                for _ in range(20 * int(BURST)):
                    connection.send('{"drive": [0, 0]}')
            heard(connection)
            assert connection.close_code == 1008


def test_a_page_that_reads_nothing_holds_nobody_up_and_gets_every_tick(tmp_path: Path) -> None:
    long = {**SHORT, "duration_bounds": [400, 400], "number_trials": 1}
    (tmp_path / "long.json").write_text(json.dumps(long))
    arguments = ("watch", "long.json", "--controller", "simple", "--records", "out", "--pace", "1000")
    with running(tmp_path, *arguments) as program:
        program.enter()
        with program.open() as connection:
            until = time.monotonic() + WAIT_S
            while not _has_ended(tmp_path / "out" / "trial-0000.mcap"):  # though nobody reads what it sends
                assert time.monotonic() < until
                time.sleep(0.1)
            ticks, messages = heard(connection)
        assert ticks == list(range(1, 12001))
        assert messages[-1]["kind"] == "end"
        assert program.end()[0] == 0


def _has_ended(path: Path) -> bool:
    try:
        return reader.read(path).ending is not None
    except Exception:
        return False


def test_one_plays_the_others_look_on_and_who_gives_up_is_told_his_place(tmp_path: Path) -> None:
    with running(tmp_path, "play", "short.json", "-o", "mine.mcap", "--pace", "0.5") as program:
        program.enter()
        with program.open() as first, program.open() as second:
            for connection, who in ((first, "a"), (second, "b")):
                connection.send(json.dumps({"who": who}))
                while (told := json.loads(connection.recv(WAIT_S)))["kind"] != "role":
                    pass
                assert told["drives"] == (who == "a")
            first.send('{"drive": [1, 0]}')
            until_a_tick(first)
            first.send('{"give_up": true}')
            for connection in (first, second):
                ticks, messages = heard(connection)
                assert ticks or connection is first  # of which some ticks have been read above
                assert messages[-1]["sentence"].startswith("You came ")
                assert [row["you"] for row in messages[-1]["rows"]].count(True) == 1
        status, out, told = program.end()
    assert status == 0
    assert told.splitlines()[-1] == "mine.mcap"
    assert "You came " in told
    for name in ("play", "simple", "lanes", "rules"):
        assert name in out
    record = reader.read(tmp_path / "mine.mcap")
    assert (record.controller, record.ending and record.ending.end.value) == ("play", "gave_up")
    assert record.frames.speed[:, 0].max() > 0.0


def test_a_page_that_is_closed_ends_play_as_interrupted_and_keeps_the_record(tmp_path: Path) -> None:
    with running(tmp_path, "play", "short.json", "-o", "mine.mcap", "--pace", "0.05") as program:
        program.enter()
        with program.open() as connection:
            connection.send('{"who": "a"}')
            connection.send('{"drive": [1, 0]}')
            until_a_tick(connection)
        status, out, told = program.end()
    assert (status, out) == (1, "")
    assert told.splitlines()[-2:] == [
        "dubins-traffic: the page was closed: the trial is interrupted",
        "mine.mcap",
    ]
    record = reader.read(tmp_path / "mine.mcap")
    assert record.ending is not None
    assert record.ending.end.value == "interrupted"


@pytest.mark.parametrize("command", ["watch", "play", "record"])
@pytest.mark.parametrize("begun", [False, True])
def test_ctrl_c_ends_it_with_a_line(command: str, begun: bool, tmp_path: Path) -> None:
    source = "short.json"
    if command == "record":
        main(["run", "demo", "--trials", "1", "--controller", "simple", "--records", str(tmp_path / "old")])
        command, source = "watch", "old/trial-0000.mcap"
    with running(tmp_path, command, source, "--pace", "0.1") as program:
        program.enter()
        with program.open() if begun else nullcontext() as connection:
            if connection is not None:
                connection.send('{"who": "a"}')
                if command == "play":
                    connection.send('{"drive": [1, 0]}')
                until_a_tick(connection)
            program.process.send_signal(signal.SIGINT)
            status, _, told = program.end()
    assert status == 1
    assert "interrupted" in told.splitlines()[-1]
    assert "Traceback" not in told


def test_a_record_is_shown_as_it_is_and_as_it_grows(tmp_path: Path) -> None:
    (tmp_path / "short.json").write_text(json.dumps(SHORT))
    main(
        [
            "run",
            str(tmp_path / "short.json"),
            "--trials",
            "1",
            "--controller",
            "simple",
            "--records",
            str(tmp_path / "old"),
        ]
    )
    whole = (tmp_path / "old" / "trial-0000.mcap").read_bytes()
    growing = tmp_path / "growing.mcap"
    growing.write_bytes(whole[: len(whole) * 2 // 3])
    with running(tmp_path, "watch", "growing.mcap", "--pace", "10") as program:
        program.enter()
        with program.open() as connection:
            until_a_tick(connection)
            time.sleep(1.0)
            growing.write_bytes(whole)
            ticks, messages = heard(connection)
        assert ticks[-1] == 60
        assert messages[-1]["ending"]["end"] == "duration"
        assert program.end()[0] == 0


@pytest.mark.parametrize(
    ("words", "told"),
    [
        (["watch", "no.mcap", "--no-browser"], "no.mcap"),
        (["watch", "cut.mcap", "--no-browser"], "cut.mcap"),
        (["watch", "passwd", "--no-browser"], "passwd: of no known kind"),
        (["play", "nowhere", "--no-browser"], "nowhere"),
        (["play", "-o", "x.txt", "--no-browser"], "x.txt: "),
        (["watch", "demo", "--jobs", "2", "--no-browser"], "--jobs: trials are watched one at a time"),
        (["watch", "demo", "--pace", "0", "--no-browser"], "--pace: not a pace"),
        (["run", "demo", "--port", "9"], "--port: is for a page"),
        (["run", "demo", "--no-browser"], "--no-browser: is for a page"),
        (["watch", "demo"], "there is no browser here"),
        (["play"], "there is no browser here"),
    ],
)
def test_wrong_input_is_a_line_and_status_2(words: list[str], told: str, tmp_path: Path) -> None:
    (tmp_path / "cut.mcap").write_bytes(b"\x89MCAP0\r\n" + b"\0" * 20)
    (tmp_path / "passwd").write_text("root:x:0:0:root:/root:/bin/sh\n")
    (tmp_path / "empty").mkdir()
    # With neither a display nor a path to programs no browser is found.
    alone = {k: v for k, v in os.environ.items() if k not in ("DISPLAY", "WAYLAND_DISPLAY", "BROWSER")}
    done = subprocess.run(
        [sys.executable, "-m", "dubins_traffic.cli", *words],
        cwd=tmp_path, env=alone | {"PATH": str(tmp_path / "empty")}, capture_output=True, text=True, check=False,
    )  # fmt: skip
    assert done.returncode == 2, done.stderr
    assert told in done.stderr
    assert "Traceback" not in done.stderr
    assert sorted(path.name for path in tmp_path.iterdir()) == ["cut.mcap", "empty", "passwd"]


def test_a_port_that_is_taken_is_wrong_input(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    with socket.create_server(("127.0.0.1", 0)) as taken:
        port = str(taken.getsockname()[1])
        for words in (
            ["watch", "demo"],
            ["run", "demo", "--watch", "--records", str(tmp_path / "out")],
            ["play"],
        ):
            assert main([*words, "--port", port, "--no-browser"]) == 2
            assert "--port: can't listen" in capsys.readouterr().err
    assert not (tmp_path / "out").exists()


def test_an_instance_can_be_played_and_only_this_machine_is_listened_to(tmp_path: Path) -> None:
    (tmp_path / "one.json").write_text(json.dumps(instance_to_document(draw(load_config("junction"), 1, 2))))
    with running(tmp_path, "play", "one.json") as program:
        assert "Trial 2 of seed 1" in program.enter()
        listening = Path("/proc/net/tcp").read_text(encoding="ascii")
        assert f"0100007F:{program.url.port:04X} 00000000:0000 0A" in listening
