"""Every route of the service and who may use it: nobody, another team, the team, an organiser, a worker."""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import httpx
import pytest

from dubins_traffic.service.service import Service as StoredService
from dubins_traffic.service.web.app import create_app
from tests.services import STANDING, Person, Service, competition_text, season, shown_secret

NOBODY, OTHER, TEAM, ORGANISER, WORKER = "nobody", "other team", "team", "organiser", "worker"
ONE, ELSEWHERE = "organiser of this competition", "organiser of another one"
ROLES = (NOBODY, OTHER, TEAM, ORGANISER, ONE, ELSEWHERE, WORKER)
PEOPLE = {OTHER, TEAM, ORGANISER, ONE, ELSEWHERE}
HEADS, ORGANISERS = {ORGANISER, ONE}, {ORGANISER, ONE, ELSEWHERE}
ALL, OWN, NONE = set(ROLES), {TEAM, *HEADS}, set[str]()
REFUSALS = (302, 401, 403, 404)
NO_COMPETITION, NO_SUBMISSION = "/c/short/none", "/s/99999"

ROUTES: dict[tuple[str, str], tuple[str, set[str]]] = {
    ("GET", "/"): ("/", ALL),
    ("GET", "/c/{slug:str}"): ("/c/short", ALL),
    ("GET", "/c/{slug:str}/{name:str}"): ("/c/short/test", ALL),
    ("GET", "/c/{slug:str}/{name:str}/table"): ("/c/short/test/table", ALL),
    ("GET", "/c/{slug:str}/{name:str}/table.csv"): ("/c/short/test/table.csv", ALL),
    ("GET", "/c/{slug:str}/news.atom"): ("/c/short/news.atom", ALL),
    ("GET", "/pages/{slug:str}/{name:str}"): ("/pages/short/none", NONE),
    ("GET", "/c/{slug:str}/{name:str}/commitment.json"): ("/c/short/test/commitment.json", ALL),
    ("GET", "/c/{slug:str}/{name:str}/seeds.txt"): ("/c/short/test/seeds.txt", NONE),
    ("POST", "/c/{slug:str}/{name:str}/submit"): ("/c/short/practice/submit", PEOPLE),
    ("GET", "/s/{number:int}"): ("/s/1", OWN),
    ("GET", "/s/{number:int}/live"): ("/s/1/live", OWN),
    ("POST", "/s/{number:int}/name"): ("/s/1/name", OWN),
    ("POST", "/s/{number:int}/cancel"): ("/s/1/cancel", OWN),
    ("GET", "/s/{number:int}/trials/{trial:int}"): ("/s/1/trials/0", NONE),
    ("GET", "/s/{number:int}/trials/{trial:int}/replay"): ("/s/1/trials/0/replay", NONE),
    ("GET", "/s/{number:int}/trials/{trial:int}/map.svg"): ("/s/1/trials/0/map.svg", NONE),
    ("GET", "/s/{number:int}/file"): ("/s/1/file", OWN),
    ("GET", "/s/{number:int}/beside"): ("/s/1/beside?other=1", HEADS),
    ("GET", "/trial.svg"): ("/trial.svg", ALL),
    ("GET", "/status"): ("/status", ALL),
    ("GET", "/login"): ("/login", ALL),
    ("POST", "/login"): ("/login", ALL),
    ("POST", "/logout"): ("", ALL),
    ("GET", "/join"): ("/join", ALL),
    ("POST", "/join"): ("/join", ALL),
    ("GET", "/reset"): ("/reset", ALL),
    ("POST", "/reset"): ("/reset", ALL),
    ("GET", "/team"): ("/team", PEOPLE),
    ("POST", "/team/found"): ("/team/found", PEOPLE),
    ("GET", "/team/members/{number:int}/remove"): ("/team/members/2/remove", {TEAM}),
    ("POST", "/team/members/{number:int}/remove"): ("/team/members/999/remove", NONE),
    ("POST", "/team/invite"): ("/team/invite", PEOPLE),
    ("POST", "/team/invitations/{number:int}/revoke"): ("/team/invitations/999/revoke", PEOPLE),
    ("POST", "/team/tokens"): ("/team/tokens", PEOPLE),
    ("POST", "/team/tokens/{number:int}/revoke"): ("/team/tokens/999/revoke", PEOPLE),
    ("POST", "/team/password"): ("/team/password", PEOPLE),
    ("POST", "/team/remove"): ("/team/remove", PEOPLE),
    ("GET", "/desk"): ("/desk", ORGANISERS),
    ("POST", "/desk/create"): ("/desk/create", {ORGANISER}),
    ("POST", "/desk/invite"): ("/desk/invite", ORGANISERS),
    ("POST", "/desk/invitations/{number:int}/revoke"): ("/desk/invitations/999/revoke", ORGANISERS),
    ("POST", "/desk/worker"): ("/desk/worker", {ORGANISER}),
    ("POST", "/desk/worker/{number:int}/revoke"): ("/desk/worker/999/revoke", {ORGANISER}),
    ("POST", "/desk/accounts/{number:int}/reset"): ("/desk/accounts/2/reset", {ORGANISER}),
    ("GET", "/desk/accounts/{number:int}/remove"): ("/desk/accounts/2/remove", {ORGANISER}),
    ("POST", "/desk/accounts/{number:int}/remove"): ("", {ORGANISER}),
    ("GET", "/desk/edit/{slug:str}"): ("/desk/edit/short", HEADS),
    ("POST", "/desk/edit/{slug:str}"): ("/desk/edit/short", HEADS),
    ("POST", "/desk/file/{slug:str}"): ("/desk/file/short", HEADS),
    ("POST", "/desk/news/{slug:str}"): ("/desk/news/short", HEADS),
    ("GET", "/desk/retract/{number:int}"): ("/desk/retract/1", HEADS),
    ("POST", "/desk/retract/{number:int}"): ("/desk/retract/999", NONE),
    ("GET", "/desk/c/{slug:str}"): ("/desk/c/short", HEADS),
    ("GET", "/desk/c/{slug:str}/archive.zip"): ("/desk/c/short/archive.zip", HEADS),
    ("GET", "/desk/c/{slug:str}/export.zip"): ("/desk/c/short/export.zip", HEADS),
    ("GET", "/desk/c/{slug:str}/{name:str}/{act:str}"): ("/desk/c/short/practice/close", HEADS),
    ("GET", "/desk/s/{number:int}/{act:str}"): ("/desk/s/1/disqualify", HEADS),
    ("POST", "/desk/c/{slug:str}/{name:str}/{act:str}"): ("/desk/c/short/practice/open", HEADS),
    ("POST", "/desk/s/{number:int}/{act:str}"): ("/desk/s/1/disqualify", HEADS),
    ("GET", "/desk/log"): ("/desk/log", {ORGANISER}),
    ("GET", "/api/status"): ("/api/status", ALL),
    ("GET", "/api/competitions"): ("/api/competitions", ALL),
    ("GET", "/api/competitions/{slug:str}"): ("/api/competitions/short", ALL),
    ("GET", "/api/competitions/{slug:str}/file"): ("/api/competitions/short/file", ALL),
    ("GET", "/api/competitions/{slug:str}/phases/{name:str}/table"): (
        "/api/competitions/short/phases/test/table",
        ALL,
    ),
    ("GET", "/api/competitions/{slug:str}/phases/{name:str}/submissions"): (
        "/api/competitions/short/phases/test/submissions",
        PEOPLE,
    ),
    ("POST", "/api/competitions/{slug:str}/phases/{name:str}/submissions"): (
        "/api/competitions/short/phases/test/submissions",
        PEOPLE,
    ),
    ("GET", "/api/account"): ("/api/account", PEOPLE),
    ("GET", "/api/submissions/{number:int}"): ("/api/submissions/1", OWN),
    ("GET", "/api/submissions/{number:int}/logs"): ("/api/submissions/1/logs", OWN),
    ("POST", "/api/submissions/{number:int}/cancel"): ("/api/submissions/1/cancel", OWN),
    ("POST", "/api/submissions/{number:int}/name"): ("/api/submissions/1/name", OWN),
    ("GET", "/metrics"): ("/metrics", ORGANISERS | {WORKER}),
    ("GET", "/worker/submissions/{digest:str}"): (f"/worker/submissions/{'0' * 64}", {WORKER}),
    ("POST", "/worker/lease"): ("", {WORKER}),
    ("POST", "/worker/chunks/{number:int}/heartbeat"): ("/worker/chunks/999/heartbeat", {WORKER}),
    ("POST", "/worker/chunks/{number:int}/trials/{trial:int}/seed"): (
        "/worker/chunks/999/trials/0/seed",
        {WORKER},
    ),
    ("POST", "/worker/chunks/{number:int}/done"): ("/worker/chunks/999/done", {WORKER}),
    ("POST", "/worker/chunks/{number:int}/release"): ("/worker/chunks/999/release", {WORKER}),
    ("PUT", "/worker/chunks/{number:int}/replays"): ("/worker/chunks/999/replays?token=1", {WORKER}),
}
"""What is asked for on each route, and who is let in; an empty path is asked for elsewhere."""


@dataclass
class World:
    """A service with a submission to its test phase, and somebody in each role."""

    service: Service
    people: dict[str, Person]

    def ask(self, role: str, method: str, path: str) -> httpx.Response:
        """Ask as people do on pages, and by token elsewhere."""
        person = self.people[role]
        if path.startswith(("/api/", "/worker/", "/metrics")):
            headers = {"authorization": f"Bearer {person.token}"} if person.token else {}
            given = {"json": {"token": 1}} if path.startswith("/worker/chunks") and method == "POST" else {}
            return person.http.request(method, path, headers=headers, **given)
        if method == "GET":
            return person.get(path)
        return person.post(path, form="/login")


@pytest.fixture(scope="module")
def world(tmp_path_factory: pytest.TempPathFactory) -> Iterator[World]:
    folder = tmp_path_factory.mktemp("permissions")
    with season(folder, "--workers", "0", clean=True) as service:
        organiser = service.organiser().with_token()
        team = service.person().join(organiser.invite(), "Ann", "Ants").with_token()
        other = service.person().join(organiser.invite(), "Bob", "Bees").with_token()
        worker = service.person()
        worker.token = shown_secret(organiser.post("/desk/worker", form="/desk", name="far away"))
        files = {"files": ("competition.toml", competition_text().encode())}
        made = organiser.post("/desk/create", form="/desk", files=files, address="other")
        assert made.status_code == 303
        one, elsewhere = (
            service.person().join(organiser.invite("organiser", competition), name).with_token()
            for competition, name in (("short", "Odo"), ("other", "Ola"))
        )
        news = {"title": "Rain", "text": "Roads are wet."}
        assert organiser.post("/desk/news/short", form="/desk", **news).status_code == 303
        assert team.submit("short/test", STANDING) == 1
        people = {NOBODY: service.person(), OTHER: other, TEAM: team, WORKER: worker}
        people |= {ORGANISER: organiser, ONE: one, ELSEWHERE: elsewhere}
        yield World(service, people)


def test_the_table_names_every_route(tmp_path: Path) -> None:
    stored = StoredService(tmp_path / "here")
    app = create_app(stored)
    found = {
        (method, route.path_format.replace("//", "/"))
        for route in app.routes
        for method in getattr(route, "methods", ())
        if method not in ("OPTIONS", "HEAD") and not route.path.startswith(("/static", "/api/openapi", "/api:"))
    }
    stored.close()
    named = {(method, re.sub(r":\w+}", "}", path)) for method, path in ROUTES}
    assert {one for one in found if one[1] not in ("/api", "/api/{path}")} == named


@pytest.mark.parametrize(("route", "role"), [(route, role) for route in ROUTES for role in ROLES])
def test_who_may_use_a_route(world: World, route: tuple[str, str], role: str) -> None:
    path, allowed = ROUTES[route]
    if not path:
        return
    answer = world.ask(role, route[0], path)
    assert answer.status_code < 500
    refused = answer.status_code in REFUSALS and not (
        answer.status_code == 404 and role in allowed and path.endswith("0" * 64)
    )
    assert refused == (role not in allowed), (answer.status_code, answer.text[-600:])


def test_an_organiser_of_one_competition_makes_organisers_of_that_alone(world: World) -> None:
    one = world.people[ONE]
    desk = one.get("/desk").text
    assert "/desk/c/short" in desk
    assert all(word not in desk for word in ("/desk/c/other", "Workers", "People", "Log of acts", "/desk/create"))
    second = world.service.person().join(one.invite("organiser", "other"), "Oda")
    assert second.get("/desk/c/short").status_code == 200
    assert second.get("/desk/c/other").status_code == second.get("/desk/log").status_code == 403
    assert "organiser of short" in world.people[ORGANISER].get("/desk").text
    wrong = world.people[ORGANISER].post("/desk/invite", form="/desk", role="organiser", competition="none")
    assert wrong.status_code == 404


def test_an_organiser_elsewhere_does_not_disqualify_what_his_team_has_handed_in(world: World) -> None:
    elsewhere = world.people[ELSEWHERE]
    assert elsewhere.post("/team/found", form="/team", name="Eels").status_code == 303
    number = elsewhere.submit("short/practice", STANDING)
    act = f"/desk/s/{number}/disqualify"
    assert elsewhere.get(f"/s/{number}").status_code == 200
    assert elsewhere.get(act).status_code == elsewhere.post(act, form="/team", why="x").status_code == 404


def test_a_form_without_its_hidden_field_is_refused(world: World) -> None:
    answer = world.people[ORGANISER].http.post("/desk/invite", data={"role": "organiser"})
    assert answer.status_code == 403


@pytest.mark.parametrize("role", [TEAM, ORGANISER])
def test_an_invitation_ends_when_it_is_revoked(world: World, role: str) -> None:
    team, page = world.people[TEAM], "/team" if role == TEAM else "/desk"
    code = shown_secret(team.post("/team/invite", form="/team"))
    number = max(map(int, re.findall(rf'"{page}/invitations/(\d+)/revoke"', world.people[role].get(page).text)))
    other = world.people[OTHER].post(f"/team/invitations/{number}/revoke", form="/team")
    assert other.status_code == 400
    assert world.people[role].post(f"{page}/invitations/{number}/revoke", form=page).status_code == 303
    assert f"/invitations/{number}/" not in team.get("/team").text
    entry = {"code": code, "name": "Eve", "password": "correct horse"}
    assert "used" in world.service.person().post("/join", form="/join", **entry).text


def test_a_worker_s_token_ends_when_it_is_revoked(world: World) -> None:
    organiser, stolen = world.people[ORGANISER], world.service.person()
    stolen.token = shown_secret(organiser.post("/desk/worker", form="/desk", name="a laptop"))

    def status() -> int:
        headers = {"authorization": f"Bearer {stolen.token}"}
        return stolen.http.get("/metrics", headers=headers).status_code

    assert status() == 200
    number = re.search(
        r'worker/(\d+)/revoke"[^>]*>\s*<input[^>]*>\s*<button[^>]*of a laptop', organiser.get("/desk").text
    )
    assert number is not None
    assert organiser.post(f"/desk/worker/{number[1]}/revoke", form="/desk").status_code == 303
    assert status() == 401
    assert "revoke worker" in organiser.get("/desk/log").text
    own = organiser.post("/desk/worker", form="/desk", name="workers  beside the server")
    assert own.status_code == 400


def test_a_session_ends_with_its_password(world: World) -> None:
    organiser = world.people[ORGANISER]
    first = world.service.person().join(organiser.invite(), "Cid", "Cats").with_token()
    second = world.service.person()
    assert second.login("Cid").status_code == 303
    assert second.post("/team/password", form="/team", password="wrong wrong", new="another secret").status_code == 400
    answer = second.post("/team/password", form="/team", password="correct horse battery", new="another secret")
    assert answer.status_code == 303
    assert second.get("/team").status_code == 200
    assert first.get("/team").status_code == 302
    assert first.api("GET", "/account").status_code == 401
    removed = second.post("/team/remove", form="/team", password="another secret")
    assert removed.status_code == 303
    assert second.get("/team").status_code == 302
    assert "Cid" not in organiser.get("/desk").text


def test_a_lost_password_is_reset_by_the_organiser(world: World) -> None:
    organiser = world.people[ORGANISER]
    person = world.service.person().join(organiser.invite(), "Dan", "Dogs")
    number = re.search(
        r'accounts/(\d+)/reset"[^>]*>\s*<input[^>]*>\s*<button aria-label="Lost password of Dan"',
        organiser.get("/desk").text,
    )
    assert number is not None
    code = shown_secret(organiser.post(f"/desk/accounts/{number[1]}/reset", form="/desk"))
    assert person.post("/reset", form="/reset", code=code, password="a new secret").status_code == 303
    assert person.post("/reset", form="/reset", code=code, password="a new secret").status_code == 200
    assert service_login(world, "Dan", "a new secret") == 303
    assert service_login(world, "Dan", "correct horse battery") == 200


def service_login(world: World, name: str, password: str) -> int:
    return world.service.person().login(name, password).status_code


def test_an_invitation_is_good_once_and_a_member_invites_to_the_team(world: World) -> None:
    team = world.people[TEAM]
    code = shown_secret(team.post("/team/invite", form="/team"))
    world.service.person().join(code, "Eve")
    assert "Eve" in team.get("/team").text
    used = world.service.person().post("/join", form="/join", code=code, name="Fay", password="0123456789", team="")
    assert used.status_code == 200
    assert "used or expired" in used.text
    name = world.service.person().post(
        "/join",
        form="/join",
        code=world.people[ORGANISER].invite(),
        name="ANN",
        password="0123456789",
        team="",
    )
    assert "taken" in name.text
