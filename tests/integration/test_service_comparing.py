"""What pages show of submissions over time and beside others, per role: maps, rivals, replays, places, waits; teams."""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import dataclass
from xml.etree import ElementTree

import pytest

from tests.services import (
    CIRCLING,
    CRASHING,
    DRIVING,
    STANDING,
    Person,
    Service,
    season,
    shown_secret,
    wait_until,
)

PHASES = ("practice", "validation", "test")


@dataclass
class World:
    """Two teams' submissions to all phases, each judged: of the Ants two to each, of the Bees one."""

    service: Service
    organiser: Person
    ants: Person
    bees: Person
    numbers: dict[str, tuple[int, int, int]]


@pytest.fixture(scope="module")
def world(tmp_path_factory: pytest.TempPathFactory) -> Iterator[World]:
    folder = tmp_path_factory.mktemp("comparing")
    with season(folder, clean=True) as service:
        organiser = service.organiser()
        ants = service.person().join(organiser.invite(), "Ann", "Ants")
        bees = service.person().join(organiser.invite(), "Bea", "Bees")
        numbers = {
            phase: (
                ants.submit(f"short/{phase}", STANDING),
                ants.submit(f"short/{phase}", DRIVING),
                bees.submit(f"short/{phase}", CRASHING if phase == "practice" else CIRCLING),
            )
            for phase in PHASES
        }
        for phase, (first, second, third) in numbers.items():
            for person, number in ((ants, first), (ants, second), (bees, third)):
                person.ended(number, "finished" if phase == "test" else "done")
        yield World(service, organiser, ants, bees, numbers)


def status(person: Person, path: str) -> int:
    return person.get(path).status_code


def test_before_the_close_a_team_compares_its_own_where_trials_are_shown(world: World) -> None:
    for phase, (first, second, third) in world.numbers.items():
        shows = phase == "practice"
        beside, rival = f"/s/{first}/beside?other={second}", f"/s/{first}/beside?other={third}"
        small = f"/s/{first}/trials/0/map.svg"
        assert status(world.ants, beside) == (200 if shows else 404)
        assert status(world.ants, small) == (200 if shows else 404)
        assert status(world.organiser, beside) == status(world.organiser, small) == 200
        assert status(world.organiser, rival) == 200
        for person in (world.bees, world.service.person()):
            assert status(person, beside) in (302, 404)
            assert status(person, small) == 404
        assert status(world.ants, rival) == 404
        assert status(world.ants, f"/s/{first}/beside?other=99999") == 404
        page = world.ants.get(f"/s/{first}").text
        assert ('<div class="strip">' in page) == shows
        assert (f'<option value="{second}">' in page) == shows
        assert f'<option value="{third}">' not in page
    first, second, _ = world.numbers["practice"]
    other_phase = world.numbers["validation"][0]
    assert status(world.organiser, f"/s/{first}/beside?other={other_phase}") == 404
    shown = world.ants.get(f"/s/{first}/beside?other={second}").text
    assert re.search(r"\d trials better, \d worse, \d equal", shown)
    assert shown.count("/map.svg") == 4


def test_the_page_of_a_competition_shows_what_its_phases_show(world: World) -> None:
    first, second, third = world.numbers["practice"]
    everybody = world.service.person().get("/c/short").text
    assert "Places of practice" in everybody
    assert "Places of validation" in everybody
    assert "Places of test" not in everybody
    assert "/trials/" not in everybody
    assert 'class="interval"' in everybody
    own = world.ants.get("/c/short").text
    assert f'href="/s/{second}/trials/' in own
    assert f"/s/{third}/trials/" not in own
    assert f"/s/{first}/trials/" not in own
    organiser = world.organiser.get("/c/short").text
    assert "Places of test" in organiser
    assert f"/s/{world.numbers['test'][1]}/trials/" in organiser


def test_after_the_close_rivals_and_replays_are_everybody_s(world: World) -> None:
    first, second, third = world.numbers["test"]
    act = "/desk/c/short/test/close"
    assert world.organiser.post(act, form=act).status_code == 303
    everybody = wait_until(lambda: "Places of test" in (text := world.service.person().get("/c/short").text) and text)
    shown = set(re.findall(r"/s/(\d+)/trials/\d+\"", everybody))
    assert shown <= {str(second), str(third)}
    assert len(shown) == 2
    assert status(world.ants, f"/s/{first}/beside?other={third}") == 200
    assert f'<option value="{third}">' in world.ants.get(f"/s/{first}").text
    assert f'<option value="{first}">' not in world.bees.get(f"/s/{third}").text
    assert status(world.service.person(), f"/s/{first}/beside?other={third}") == 302
    assert status(world.service.person(), f"/s/{third}/trials/0/map.svg") == 200


def test_a_map_is_a_picture_that_holds_no_script(world: World) -> None:
    answer = world.ants.get(f"/s/{world.numbers['practice'][1]}/trials/0/map.svg")
    assert answer.headers["content-type"].startswith("image/svg+xml")
    assert answer.headers["content-security-policy"].startswith("default-src 'none'")
    drawn = ElementTree.fromstring(answer.text)
    kinds = {element.tag.partition("}")[2] for element in drawn.iter()}
    assert kinds <= {"svg", "style", "g", "path", "circle"}
    assert len(answer.content) < 30_000
    moving = world.service.person().get("/trial.svg").text
    assert "animateTransform" in moving
    assert "<script" not in moving


def test_a_team_sees_its_progress_and_places_as_far_as_they_are_shown(world: World) -> None:
    first, second, _ = world.numbers["practice"]
    page = world.ants.get("/team").text
    assert "short/practice" in page
    assert re.search(r"Place 1 of \d", page)
    steps = re.search(r"from submission (\d+) with \S+ to submission (\d+) with", page)
    assert steps is not None
    phase = world.ants.get("/c/short/practice").text
    assert f"from submission {first} with" in phase
    assert f"to submission {second} with" in phase
    assert 'class="progress"' not in world.bees.get("/c/short/practice").text


def test_a_team_gets_back_what_it_has_sent(world: World) -> None:
    first, *_, third = world.numbers["test"]
    answer = world.ants.get(f"/s/{first}/file")
    assert answer.text == STANDING
    assert "attachment" in answer.headers["content-disposition"]
    assert status(world.ants, f"/s/{third}/file") == 404
    assert status(world.service.person(), f"/s/{first}/file") == 302


def test_who_leaves_a_team_sees_nothing_of_it_and_its_invitations_end(world: World) -> None:
    code, other = (shown_secret(world.ants.post("/team/invite", form="/team")) for _ in range(2))
    amy = world.service.person().join(code, "Amy")
    (number,) = re.findall(r"/team/members/(\d+)/remove\"><button[^>]*>Leave", amy.get("/team").text)
    asked = f"/team/members/{number}/remove"
    first, *_ = world.numbers["practice"]
    assert status(amy, f"/s/{first}") == 200
    assert status(world.bees, asked) == 404
    assert world.bees.post(asked, form="/team").status_code == 404
    assert "Leave the team?" in amy.get(asked).text
    assert "Remove Amy?" in world.ants.get(asked).text
    assert world.ants.post(asked, form=asked).status_code == 303
    assert status(amy, f"/s/{first}") == 404
    assert "No team yet" in amy.get("/team").text
    answer = world.service.person().post("/join", form="/join", code=other, name="Eve", password="0123456789")
    assert "used or expired" in answer.text
    assert "leave team" in world.organiser.get("/desk/log").text
    assert status(world.ants, "/team") == 200
