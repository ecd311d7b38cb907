"""Who sends or reads slowly is cut off, and others are answered meanwhile."""

from __future__ import annotations

import contextlib
import socket
import threading
from collections.abc import Callable, Iterator
from typing import Any

import httpx
import pytest
import uvicorn

from dubins_traffic.service.web import patience
from tests.services import wait_until

LARGE = 64 << 20
ATTACKERS = 8
HEAD = b"POST / HTTP/1.1\r\nhost: here\r\ncontent-length: 1000000\r\n\r\n"


async def answering(scope: Any, receive: Any, send: Any) -> None:
    """Answer with how many bytes came; to who asks for `/large`, with many."""
    come, more = 0, True
    while more:
        message = await receive()
        if message["type"] == "http.disconnect":
            return
        come, more = come + len(message["body"]), message.get("more_body", False)
    body = bytes(LARGE) if scope["path"] == "/large" else str(come).encode()
    await send({"type": "http.response.start", "status": 200, "headers": []})
    await send({"type": "http.response.body", "body": body})


@pytest.fixture
def server(monkeypatch: pytest.MonkeyPatch) -> Iterator[uvicorn.Server]:
    monkeypatch.setattr(patience, "LOOK_S", 0.05)
    opened = socket.create_server(("127.0.0.1", 0))
    config = uvicorn.Config(answering, http=patience.PatientProtocol, lifespan="off", log_level="error")
    made = uvicorn.Server(config)
    thread = threading.Thread(target=made.run, kwargs={"sockets": [opened]})
    thread.start()
    wait_until(lambda: made.started, pause=0.01)
    made.url = "http://{}:{}".format(*opened.getsockname())
    yield made
    made.should_exit = True
    thread.join()


def dripping(first: bytes, drop: bytes) -> Callable[[socket.socket, threading.Event], None]:
    """Return who sends some bytes, and then one more again and again."""

    def send(there: socket.socket, ended: threading.Event) -> None:
        there.sendall(first)
        while drop and not ended.wait(0.02):
            there.sendall(drop)

    return send


@pytest.mark.parametrize(
    "attack",
    [
        pytest.param(dripping(b"", b""), id="says nothing"),
        pytest.param(dripping(b"GET / HTTP/1.1\r\nx: ", b"a"), id="sends a head for ever"),
        pytest.param(dripping(HEAD, b""), id="stops in a body"),
        pytest.param(dripping(HEAD, b"a"), id="sends a body for ever"),
        pytest.param(dripping(b"GET /large HTTP/1.1\r\nhost: here\r\n\r\n", b""), id="reads nothing"),
    ],
)
def test_who_is_slow_is_cut_off(
    server: uvicorn.Server, attack: Callable[[socket.socket, threading.Event], None]
) -> None:
    host, port = server.url.removeprefix("http://").split(":")
    ended = threading.Event()

    def strike() -> None:
        with contextlib.suppress(OSError), socket.create_connection((host, int(port))) as there:
            attack(there, ended)
            ended.wait()

    attackers = [threading.Thread(target=strike) for _ in range(ATTACKERS)]
    for attacker in attackers:
        attacker.start()
    connections = server.server_state.connections
    try:
        wait_until(lambda: len(connections) == ATTACKERS, pause=0.005, seconds=60)
        assert httpx.get(server.url, timeout=60.0).text == "0"
        wait_until(lambda: not connections, seconds=60)
    finally:
        ended.set()
        for attacker in attackers:
            attacker.join()


def test_who_is_not_so_slow_is_waited_for(server: uvicorn.Server) -> None:
    """A body that takes longer than a head may, and an answer that is taken in parts."""
    looks = patience.PATIENCE * 2

    def pieces() -> Iterator[bytes]:
        pause = threading.Event()
        for _ in range(looks):
            pause.wait(patience.LOOK_S)
            yield bytes(patience.SLOWEST * 4)

    assert httpx.post(server.url, content=pieces()).text == str(looks * patience.SLOWEST * 4)
    assert len(httpx.get(f"{server.url}/large").content) == LARGE
