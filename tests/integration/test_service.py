"""The service as its users meet it: a process, pages, a worker that judges."""

from __future__ import annotations

import re
import sqlite3
from collections.abc import Iterator
from contextlib import closing
from pathlib import Path

import pytest

from tests.services import CRASHING, STANDING, Service, season, wait_until


@pytest.fixture(scope="module")
def service(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Service]:
    folder = tmp_path_factory.mktemp("service")
    with season(folder, clean=True) as running:
        yield running


def test_from_the_invitation_to_a_place_in_the_table(service: Service) -> None:
    organiser = service.organiser()
    ann = organiser.invite()
    person = service.person().join(ann, "Ann", "Ants")
    number = person.submit("short/practice", STANDING)
    person.ended(number)
    shown = person.get(f"/s/{number}").text
    assert f'href="/s/{number}/trials/1"' in shown
    assert "here I stand" in person.get(f"/s/{number}/trials/0").text
    replay = person.get(f"/s/{number}/trials/0/replay")
    assert "sandbox allow-scripts" in replay.headers["content-security-policy"]
    assert "<canvas" in replay.text
    wait_until(lambda: "Ants" in person.get("/c/short/practice/table").text)
    crashing = person.submit("short/practice", CRASHING)
    person.ended(crashing)
    assert "controller fault" in person.get(f"/s/{crashing}").text
    assert person.submit("short/practice", CRASHING) == crashing


def test_a_fault_that_nobody_foresaw_is_logged_under_the_number_that_is_told(tmp_path: Path) -> None:
    """Here somebody has written into the table of trials."""
    with season(tmp_path) as service:
        person = service.person().join(service.organiser().invite(), "Ann", "Ants").with_token()
        number = person.submit("short/practice", STANDING)
        person.ended(number)
        with closing(sqlite3.connect(service.folder / "service.db")) as database, database:
            database.execute("UPDATE trial SET row = '7'")
        page, told = person.get(f"/s/{number}"), person.api("GET", f"/submissions/{number}")
        assert page.status_code == told.status_code == 500
        said = (tmp_path / "here.log").read_text()
        for answer in (page.text, told.json()["detail"]):
            (code,) = re.findall(r"its log tells as ([0-9a-f]{8})", answer)
            (line,) = [line for line in said.splitlines() if code in line]
            assert "Traceback" in line
            assert "Error: " in line
            assert "Traceback" not in answer
            assert "Error: " not in answer
