"""What nobody can do at the door: come in by a session of their own choice, or keep others waiting by large forms."""

from __future__ import annotations

import socket
import threading
from collections.abc import Iterator
from contextlib import closing, suppress

import httpx
import pytest

from tests.services import PASSWORD, STANDING, Person, Service, season, wait_until

LARGE = 32 << 20
SENDERS = 4


@pytest.fixture(scope="module")
def service(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Service]:
    folder = tmp_path_factory.mktemp("doors")
    with season(folder, "--workers", "0", clean=True) as running:
        yield running


@pytest.fixture(scope="module")
def organiser(service: Service) -> Person:
    return service.organiser()


def session_of(person: Person) -> str:
    return person.http.cookies.get("session") or ""


def holding(service: Service, session: str) -> Person:
    """Return somebody whose browser holds a session's cookie."""
    person = service.person()
    person.http.cookies.set("session", session, domain="127.0.0.1")
    return person


def test_a_session_has_an_id_of_its_own(service: Service, organiser: Person) -> None:
    service.person().join(organiser.invite(), "Gil", "Gulls")
    planted = "a" * 64
    person = holding(service, planted)
    assert person.get("/team").status_code == 302
    assert person.login("Gil").status_code == 303
    first = session_of(person)
    assert first not in ("", planted)
    assert person.get("/team").status_code == 200
    assert holding(service, planted).get("/team").status_code == 302

    assert person.login("Gil").status_code == 303
    second = session_of(person)
    assert second not in ("", planted, first)
    assert holding(service, first).get("/team").status_code == 302

    changed = person.post("/team/password", form="/team", password=PASSWORD, new="another secret")
    assert changed.status_code == 303
    third = session_of(person)
    assert holding(service, second).get("/team").status_code == 302
    assert holding(service, third).get("/team").status_code == 200

    assert person.post("/logout", form="/team").status_code == 302
    assert session_of(person) in ("", "null")
    assert holding(service, third).get("/team").status_code == 302
    assert not list((service.folder / "sessions").glob(f"*{third}*"))


def test_of_who_has_not_logged_in_no_session_is_kept(service: Service, organiser: Person) -> None:
    before = set((service.folder / "sessions").iterdir())
    person = service.person()
    assert {person.get(path).status_code for path in ("/", "/login", "/c/short")} == {200}
    assert person.login("nobody").status_code == 200
    assert set((service.folder / "sessions").iterdir()) == before
    assert organiser.get("/desk").status_code == 200


@pytest.mark.parametrize("path", ["/logout", "/login", "/c/short/practice/submit", "/"])
@pytest.mark.parametrize("kind", ["application/x-www-form-urlencoded", "multipart/form-data; boundary=b"])
def test_a_large_form_is_refused_before_it_has_come(service: Service, path: str, kind: str) -> None:
    """By what it says of its length, and if it says nothing by what has come of it."""
    method = "GET" if path == "/" else "POST"
    said = head(service, method, path, kind, f"content-length: {LARGE}")
    assert said.startswith(b"HTTP/1.1 413 ")
    said = head(service, method, path, kind, "transfer-encoding: chunked", b"11000\r\n" + b"a" * 0x11000)
    assert said.startswith(b"HTTP/1.1 413 ")


def head(service: Service, method: str, path: str, kind: str, length: str, body: bytes = b"") -> bytes:
    """Return the beginning of the answer to a request of which no more comes than this."""
    lines = f"{method} {path} HTTP/1.1\r\nhost: here\r\ncontent-type: {kind}\r\n{length}\r\n\r\n"
    host, port = service.url.removeprefix("http://").split(":")
    with closing(socket.create_connection((host, int(port)), timeout=60)) as there:
        with suppress(OSError):  # it may have been refused in between
            there.sendall(lines.encode() + body)
        return there.recv(4096)


def test_others_are_answered_while_large_forms_come(service: Service) -> None:
    form = b"a=&" * (LARGE // 3)
    refused: list[str] = []

    def send() -> None:
        try:
            answer = httpx.post(
                f"{service.url}/logout",
                content=form,
                headers={"content-type": "application/x-www-form-urlencoded"},
                timeout=240,
            )
            refused.append(str(answer.status_code))
        except httpx.HTTPError as error:
            refused.append(type(error).__name__)

    senders = [threading.Thread(target=send) for _ in range(SENDERS)]
    for sender in senders:
        sender.start()
    try:
        answered = httpx.get(f"{service.url}/api/status", timeout=240)
    finally:
        for sender in senders:
            sender.join()
    assert answered.status_code == 200
    assert len(refused) == SENDERS
    assert set(refused) <= {"413", "WriteError", "ReadError", "RemoteProtocolError"}
    assert wait_until(lambda: httpx.get(f"{service.url}/api/status", timeout=60).status_code == 200)


def test_who_is_known_sends_files_and_nobody_else_does(service: Service, organiser: Person) -> None:
    person = service.person().join(organiser.invite(), "Hal", "Hawks").with_token()
    large = STANDING.encode() + b"#" * (1 << 20)
    assert person.submit("short/practice", large) > 0
    path = "/competitions/short/phases/practice/submissions"
    files = {"file": ("controller.py", large + b"#")}
    assert person.api("POST", path, files=files).status_code == 201
    anybody = service.person()
    assert anybody.api("POST", path, files={"file": ("controller.py", STANDING)}).status_code == 401
    with suppress(httpx.HTTPError):
        assert anybody.api("POST", path, files=files).status_code == 413
