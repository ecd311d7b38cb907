"""The API under a fuzzer that reads its description; the client's commands; what test seeds may change."""

from __future__ import annotations

import json
import re
import subprocess
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
import schemathesis
from hypothesis import HealthCheck, Phase, given, settings

from tests.services import (
    COMMAND,
    CRASHING,
    STANDING,
    Person,
    Service,
    season,
    shown_secret,
)

EXAMPLES = 6


@pytest.fixture(scope="module")
def service(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Service]:
    folder = tmp_path_factory.mktemp("api")
    with season(folder, clean=True) as running:
        yield running


@pytest.fixture(scope="module")
def organiser(service: Service) -> Person:
    return service.organiser().with_token()


@pytest.fixture(scope="module")
def person(service: Service, organiser: Person) -> Person:
    return service.person().join(organiser.invite(), "Ann", "Ants").with_token()


def test_a_fuzzer_finds_no_fault_of_ours(service: Service, organiser: Person, person: Person) -> None:
    worker = shown_secret(organiser.post("/desk/worker", form="/desk", name="fuzzer"))
    person.submit("short/practice", STANDING)
    schema = schemathesis.openapi.from_url(f"{service.url}/api/openapi.json")
    tokens = [
        {},
        *({"authorization": f"Bearer {one}"} for one in (person.token, organiser.token, worker, "x")),
    ]
    met: set[str] = set()
    for found in schema.get_all_operations():
        operation = found.ok()
        met.add(f"{operation.method.upper()} {operation.path}")

        @given(case=operation.as_strategy())
        @settings(
            max_examples=EXAMPLES,
            deadline=None,
            derandomize=True,
            database=None,
            phases=[Phase.explicit, Phase.generate],
            suppress_health_check=list(HealthCheck),
        )
        def no_fault(case: Any) -> None:
            for headers in tokens:
                answer = case.call(headers=headers)
                assert answer.status_code < 500, (case.as_curl_command(), answer.text)
                assert "Traceback" not in answer.text

        no_fault()
    assert len(met) >= 18
    assert "POST /worker/lease" in met


@pytest.mark.path
def test_a_participant_at_a_terminal(service: Service, person: Person, tmp_path: Path) -> None:
    entry = tmp_path / "entry"
    entry.mkdir()
    (entry / "controller.py").write_text(f"{STANDING}# by terminal\n")
    (tmp_path / "token").write_text(person.token)

    def told(*arguments: str, status: int = 0) -> str:
        ran = subprocess.run(
            [*COMMAND, *arguments, "--token-file", str(tmp_path / "token")],
            capture_output=True, text=True, cwd=tmp_path, timeout=600, check=False,
        )  # fmt: skip
        assert ran.returncode == status, ran.stderr
        return ran.stdout if "--json" in arguments else ran.stderr + ran.stdout

    phase = f"{service.url}/c/short/practice"
    handed = json.loads(told("submit", str(entry), "--to", phase, "--wait", "--json"))
    assert handed["state"] == "done"
    again = told("submit", str(entry), "--to", phase)
    address = re.search(rf"{service.url}/s/\d+", again)
    assert address is not None
    assert address[0].endswith(f"/{handed['id']}")
    assert "all trials are judged" in told("status", address[0])
    assert "here I stand" in told("logs", address[0])
    assert "it is done already" in told("cancel", address[0], status=2)
    assert "no such submission" in told("status", f"{service.url}/s/9999", status=2)
    home = subprocess.run(
        [*COMMAND, "evaluate", str(entry), "--competition", phase, "--json", "--trust-submissions"],
        capture_output=True, text=True, cwd=tmp_path, timeout=600, check=True,
    )  # fmt: skip
    assert json.loads(home.stdout)["trials"] == handed["trials"]


def seen(person: Person, numbers: list[int]) -> dict[str, str]:
    """Return all that a participant can see of a test phase, without times, tokens and digests of secrets."""
    paths = [
        "/c/short/test",
        "/c/short/test/table",
        *(f"/s/{n}{tail}" for n in numbers for tail in ("", "/live")),
    ]
    paths += [f"/s/{n}/trials/0{tail}" for n in numbers for tail in ("", "/replay", "/map.svg")]
    paths += ["/team", f"/s/{numbers[0]}/beside?other={numbers[1]}", "/c/short/test/table.csv"]
    pages = {path: person.get(path).text for path in paths}
    for path in (
        *(f"/submissions/{n}{tail}" for n in numbers for tail in ("", "/logs")),
        "/competitions/short/phases/test/submissions",
        "/competitions/short/phases/test/table",
        "/competitions/short/file",
        "/competitions",
    ):
        pages[f"/api{path}"] = person.api("GET", path).text
    times, hidden = r"\d{4}-\d\d-\d\d[T ]\d\d:\d\d:\d\d(Z| UTC)", 'value="[0-9a-f]{128}"'
    varying = f'{times}|{hidden}|"commitment":"[0-9a-f]+"|<code>[0-9a-f]{{16}}…</code>'
    return {path: re.sub(varying, "", text) for path, text in pages.items()}


def test_other_test_seeds_change_nothing_that_a_participant_sees(tmp_path: Path) -> None:
    """Two services, each with seeds of its own, judge the same; before the phase closes no byte differs."""
    views: list[dict[str, str]] = []
    for name in ("one", "other"):
        folder = tmp_path / name
        folder.mkdir()
        with season(folder) as service:
            organiser = service.organiser()
            person = service.person().join(organiser.invite(), "Ann", "Ants").with_token()
            numbers = [person.submit("short/test", text) for text in (STANDING, CRASHING)]
            for number in numbers:
                person.ended(number, "finished")
            views.append(seen(person, numbers))
            assert organiser.get(f"/s/{numbers[0]}/trials/0").status_code == 200
    assert views[0] == views[1]
    assert '"state":"finished"' in views[0]["/api/submissions/1"]
