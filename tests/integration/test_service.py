"""The service as its users meet it: a process, pages, a worker that judges."""

from __future__ import annotations

from collections.abc import Iterator

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
