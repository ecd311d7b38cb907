"""A service for tests: its process, people who use its pages as browsers do, controllers that they hand in."""

from __future__ import annotations

import json
import os
import re
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import httpx

COMMAND = (sys.executable, "-m", "dubins_traffic.cli")
PASSWORD = "correct horse battery"
WAIT_S = 600.0
"""How long a test waits for what must happen."""

STANDING = """
class Controller:
    def start(self, problem):
        print("here I stand")

    def act(self, observation):
        return 0.0, 0.0
"""
CIRCLING = STANDING.replace("0.0, 0.0", "0.2, 1.0")
CRASHING = STANDING.replace("return 0.0, 0.0", "raise RuntimeError('no idea what to do')")
DRIVING = """
from dubins_traffic.controllers.lanes import Lanes as Controller
"""


def competition_text(trials: int = 2, closes: str = "2037-01-01T00:00:00Z", duration: int = 2) -> str:
    """Return a competition file of three phases whose trials are short."""
    document = json.dumps({**json.loads(short_configuration(duration))})
    return f"""
version = 0
title = "A <b>short</b> season"
configurations = [{{name = "short", document = {_toml(json.loads(document))}}}]

[phases.practice]
seed = 1
trials = {trials}
shows = "all"

[phases.validation]
seed = "secret"
trials = {trials}
least_trials = 1
opens = 2020-01-01T00:00:00Z
closes = {closes}
shows = "aggregates"
quota = {{a_day = 5}}

[phases.test]
seed = "secret"
trials = {trials}
opens = 2020-01-01T00:00:00Z
closes = {closes}
shows = "nothing"
quota = {{a_day = 3, total = 10}}
"""


def short_configuration(duration: int) -> str:
    """Return the shipped configuration `demo` with another duration, as JSON."""
    from importlib.resources import files

    shipped = files("dubins_traffic.problem") / "configurations" / "demo.json"
    document = json.loads(shipped.read_text(encoding="utf-8"))
    document["duration_bounds"] = [duration, duration]
    return json.dumps(document)


def _toml(value: Any) -> str:
    if isinstance(value, dict):
        return "{" + ", ".join(f"{json.dumps(key)} = {_toml(item)}" for key, item in value.items()) + "}"
    if isinstance(value, list):
        return "[" + ", ".join(map(_toml, value)) + "]"
    return json.dumps(value)


def wait_until(what: Callable[[], Any], seconds: float = WAIT_S, pause: float = 0.2) -> Any:
    """Return what is true as soon as it is; fail if it does not become so."""
    until = time.monotonic() + seconds
    while True:
        found = what()
        if found:
            return found
        assert time.monotonic() < until, f"still not so after {seconds} s: {what}"
        time.sleep(pause)


class Person:
    """Somebody with a browser: cookies, forms with their hidden fields, no redirect taken unseen."""

    def __init__(self, url: str, **options: Any) -> None:
        self.http = httpx.Client(base_url=url, follow_redirects=False, timeout=600, **options)
        self.url, self.token = url, ""

    def get(self, path: str) -> httpx.Response:
        return self.http.get(path)

    def post(self, path: str, form: str = "/login", files: Any = None, **fields: str) -> httpx.Response:
        """Send a form, with the hidden field of the page on which it stands."""
        hidden = re.search(r'name="_csrf_token" value="([^"]+)"', self.get(form).text)
        assert hidden is not None, form
        return self.http.post(path, data={"_csrf_token": hidden[1], **fields}, files=files)

    def join(self, code: str, name: str, team: str = "") -> Person:
        answer = self.post("/join", name=name, code=code, password=PASSWORD, team=team, form="/join")
        assert answer.status_code == 303, answer.text
        return self

    def login(self, name: str, password: str = PASSWORD) -> httpx.Response:
        return self.post("/login", name=name, password=password)

    def invite(self, role: str = "participant", competition: str = "") -> str:
        return shown_secret(self.post("/desk/invite", form="/desk", role=role, competition=competition))

    def with_token(self) -> Person:
        """Make a token, with which `api` asks."""
        self.token = shown_secret(self.post("/team/tokens", form="/team", name="mine"))
        return self

    def api(self, method: str, path: str, **given: Any) -> httpx.Response:
        headers = {"authorization": f"Bearer {self.token}"} if self.token else {}
        return httpx.request(method, f"{self.url}/api{path}", headers=headers, timeout=600, **given)

    def submit(self, phase: str, source: str | bytes, name: str = "controller.py") -> int:
        """Hand in a submission on the page of a phase, as COMPETITION/PHASE; return its number."""
        data = source.encode() if isinstance(source, str) else source
        answer = self.post(f"/c/{phase}/submit", form=f"/c/{phase}", files={"file": (name, data)})
        assert answer.status_code == 303, answer.text
        return int(answer.headers["location"].rpartition("/")[2])

    def state(self, number: int) -> str:
        found = re.search(r'role="status"><span class="tag (\w+)"', self.get(f"/s/{number}").text)
        return found[1] if found else ""

    def ended(self, number: int, state: str = "done") -> None:
        """Wait until a submission has ended, in this state."""
        final = ("done", "finished", "rejected", "failed", "cancelled")
        found = wait_until(lambda: self.state(number) in final and self.state(number))
        assert found == state, self.get(f"/s/{number}").text


def shown_secret(answer: httpx.Response) -> str:
    """Return the code or token that a page shows once."""
    found = re.search(r'<code id="secret">([^<]+)</code>', answer.text)
    assert found is not None, answer.text
    return found[1]


class Service:
    """A running service."""

    def __init__(self, process: subprocess.Popen[str], url: str, code: str, folder: Path) -> None:
        self.process, self.url, self.code, self.folder = process, url, code, folder
        self.people: list[Person] = []

    def person(self, **options: Any) -> Person:
        self.people.append(Person(self.url, **options))
        return self.people[-1]

    def organiser(self) -> Person:
        """Return the organiser, Olga: who asks first joins by the code of the start, who asks again logs in."""
        person, code = self.person(), self.code
        if code:
            self.code = ""
            return person.join(code, "Olga")
        assert person.login("Olga").status_code == 303
        return person

    def kill(self) -> None:
        """End it without a warning."""
        self.process.send_signal(signal.SIGKILL)
        self.process.wait()


@contextmanager
def serving(
    folder: Path,
    *arguments: str,
    port: int = 0,
    settings: str = "",
    clean: bool = False,
    behind: bool = False,
) -> Iterator[Service]:
    """Run `dubins-traffic serve` in a folder, its key and its log beside it; `clean`: the log must tell of no fault."""
    folder.mkdir(parents=True, exist_ok=True)
    if settings:
        (folder / "service.toml").write_text(settings)
    key = folder.with_suffix(".key")
    command = [*COMMAND, "serve", str(folder), "--port", str(port), "--key-file", str(key), *arguments]
    log = folder.with_suffix(".log")
    with log.open("a") as errors:
        process = subprocess.Popen(
            command,
            stdout=subprocess.PIPE,
            stderr=errors,
            text=True,
            env={**os.environ, "PYTHONUNBUFFERED": "1"},
        )
    assert process.stdout is not None
    line, people = process.stdout.readline(), []
    try:
        assert " at " in line, log.read_text()
        url = line.strip().rpartition(" ")[2]
        if behind:
            url = process.stdout.readline().strip().rpartition(" ")[2]
        code = ""
        if not (folder / "joined").exists():
            code = process.stdout.readline().strip().rpartition("=")[2]
            (folder / "joined").touch()
        wait_until(lambda: answers(url))
        service = Service(process, url, code, folder)
        people = service.people
        yield service
    finally:
        for person in people:
            person.http.close()
        if process.poll() is None:
            process.terminate()
            process.wait(timeout=600)
        process.stdout.close()
        said = log.read_text()
        assert "Fatal Python error" not in said, said[-5000:]
        assert "Traceback" not in said or not clean, said[-5000:]


@contextmanager
def season(
    folder: Path,
    *arguments: str,
    settings: str = "logins = 10000\n",
    trials: int = 2,
    port: int = 0,
    clean: bool = False,
) -> Iterator[Service]:
    """Run the service of a short competition below a folder, with workers that trust submissions."""
    folder.mkdir(exist_ok=True)
    (folder / "short.toml").write_text(competition_text(trials))
    made = ("--competition", str(folder / "short.toml"), "--trust-submissions", *arguments)
    with serving(folder / "here", *made, settings=settings, port=port, clean=clean) as service:
        yield service


def answers(url: str) -> bool:
    """Tell whether a service answers."""
    try:
        return httpx.get(f"{url}/api/status", timeout=5).status_code == 200
    except httpx.HTTPError:
        return False
