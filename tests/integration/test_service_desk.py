"""The organiser's desk through a season: edits, announcements, asking once, re-opening, baselines, an edited file."""

from __future__ import annotations

import io
import re
import zipfile
from collections.abc import Iterator
from pathlib import Path
from xml.etree import ElementTree

import pytest

from tests.services import CRASHING, STANDING, Person, Service, competition_text, season, serving, wait_until

ATOM = "{http://www.w3.org/2005/Atom}"
DESK, EDIT = "/desk/c/short", "/desk/edit/short"


@pytest.fixture(scope="module")
def service(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Service]:
    folder = tmp_path_factory.mktemp("desk")
    with season(folder, clean=True) as running:
        yield running


@pytest.fixture(scope="module")
def organiser(service: Service) -> Person:
    return service.organiser().with_token()


def form_of(person: Person) -> dict[str, str]:
    """Return the fields of the form that edits, as they are shown."""
    from html import unescape

    shown = person.get(EDIT).text.partition("<h2>By file")[0]
    found = {
        unescape(name): unescape(value)
        for name, value in re.findall(r'<input[^>]* name="([^"]+)"[^>]* value="([^"]*)"', shown)
        if name != "_csrf_token"
    }
    areas = re.findall(r'<textarea[^>]* name="([^"]+)"[^>]*>([^<]*)<', shown)
    return found | {name: unescape(text) for name, text in areas}


def edited(person: Person, **fields: str) -> int:
    given = form_of(person) | {name.replace("__", " "): text for name, text in fields.items()}
    return person.post(EDIT, form=EDIT, **given).status_code


def log(person: Person) -> str:
    return person.get("/desk/log").text


def test_texts_dates_and_quotas_change_with_a_line_each(service: Service, organiser: Person) -> None:
    assert edited(organiser) == 303
    assert "<td>edit</td>" not in log(organiser)
    changes = {"title": "Autumn", "about": "Drive **well** <b>.", "test__closes": "2038-01-01T00:00:00Z"}
    changes |= {
        "test__a_day": "7",
        "test__total": "",
        "new__page": "prizes",
        "new__text": "# A cup\n\n<script>",
    }
    assert edited(organiser, **changes) == 303
    shown = service.person().get("/c/short").text
    assert "<h1>Autumn</h1>" in shown
    assert "<strong>well</strong> &lt;b&gt;." in shown
    assert "2038-01-01T00:00:00Z" in shown
    text = service.person().get("/pages/short/prizes").text
    assert "<h2>A cup</h2>" in text
    assert "<p>&lt;script&gt;</p>" in text
    said = log(organiser)
    for field in ("title", "about", "phases.test.closes", "phases.test.quota.a_day", "pages.prizes"):
        assert f"<td>{field}: " in said, field
    assert "10 -&gt; nothing" in said
    assert edited(organiser, **{"page: prizes": ""}) == 303
    assert service.person().get("/pages/short/prizes").status_code == 404


@pytest.mark.parametrize(
    ("field", "value", "status", "said"),
    [
        ("test__opens", "2030-01-01T00:00:00Z", 409, "has opened already"),
        ("test__closes", "2020-06-01T00:00:00Z", 409, "in the past"),
        ("test__closes", "", 400, "no end"),
        ("test__closes", "soon", 400, "not a time in UTC"),
        ("test__closes", "2037-01-01T00:00:00+01:00", 400, "not a time in UTC"),
        ("test__a_day", "many", 400, "a number"),
        ("test__a_day", "0", 400, "expected a number &gt;= 1"),
        ("title", "", 400, "title"),
        ("new__page", "No Such", 400, "pages"),
        ("was", "0" * 64, 409, "changed it meanwhile"),
    ],
)
def test_what_can_t_be_so_is_refused(organiser: Person, field: str, value: str, status: int, said: str) -> None:
    before = form_of(organiser)
    given = before | {field.replace("__", " "): value} | {"new text": "x"}
    answer = organiser.post(EDIT, form=EDIT, **given)
    assert answer.status_code == status, answer.text
    assert said in answer.text.partition("<main")[2], answer.text
    assert form_of(organiser) == before


@pytest.mark.parametrize(
    ("before", "after"),
    [
        ("trials = 2", "trials = 3"),
        ('shows = "nothing"', 'shows = "aggregates"'),
        ("seed = 1", "seed = 2"),
        ("least_trials = 1", "least_trials = 2"),
        ("[phases.test]", "[phases.final]"),
        ("[phases.practice]", "[ranking]\nties = 'none'\n[phases.practice]"),
        ('"duration_bounds" = [2, 2]', '"duration_bounds" = [3, 3]'),
        ("[phases.practice]", "limits = {memory = 512}\n[phases.practice]"),
    ],
)
def test_what_decides_trials_and_places_is_locked(service: Service, organiser: Person, before: str, after: str) -> None:
    text = (service.folder.parent / "short.toml").read_text()
    assert before in text
    if after.startswith("limits"):
        text, after = text + "limits = {memory = 512}\n", before
    files = {"files": ("competition.toml", text.replace(before, after).encode())}
    answer = organiser.post("/desk/file/short", form=EDIT, files=files)
    assert answer.status_code == 409, answer.text
    assert "locked since the start" in answer.text


def test_a_file_changes_what_may_change_and_an_edited_one_is_named_at_the_start(tmp_path: Path) -> None:
    (tmp_path / "short.toml").write_text(competition_text())
    arguments = ("--workers", "0", "--competition", str(tmp_path / "short.toml"))
    with serving(tmp_path / "here", *arguments) as service:
        organiser = service.organiser()
        text = competition_text().replace('"A <b>short</b> season"', '"Spring"\npages = {rules = "Fair."}')
        files = {"files": ("competition.toml", text.encode())}
        assert organiser.post("/desk/file/short", form=EDIT, files=files).status_code == 303
        assert "<td>title: " in log(organiser)
        assert "Fair." in organiser.get("/pages/short/rules").text
    said = (tmp_path / "here.log").read_text()
    assert "differs from the competition" not in said
    (tmp_path / "short.toml").write_text(text.replace('"Spring"', '"Summer"').replace("seed = 1", "seed = 9"))
    with serving(tmp_path / "here", *arguments) as service:
        assert "Spring" in service.person().get("/c/short").text
    said = (tmp_path / "here.log").read_text()
    assert "title: Spring -> Summer" in said
    assert "to change it: /desk/edit/short" in said
    assert re.search(r"phases.practice.seed: 1 -> 9.*locked", said)


def test_an_announcement_stands_on_the_page_and_in_the_feed(service: Service, organiser: Person) -> None:
    given = {"title": "Rain <b>", "text": "Roads are *wet* <script>."}
    assert organiser.post("/desk/news/short", form=DESK, **given).status_code == 303
    shown = service.person().get("/c/short").text
    assert "<h3>Rain &lt;b&gt;</h3>" in shown
    assert "<em>wet</em> &lt;script&gt;" in shown
    feed = ElementTree.fromstring(service.person().get("/c/short/news.atom").content)
    (entry,) = feed.iter(f"{ATOM}entry")
    assert entry.findtext(f"{ATOM}title") == "Rain <b>"
    assert "<em>wet</em> &lt;script&gt;" in (entry.findtext(f"{ATOM}content") or "")
    assert organiser.post("/desk/news/short", form=DESK, title="", text="x").status_code == 400
    number = re.search(r"/desk/retract/(\d+)", organiser.get(DESK).text)
    assert number is not None
    asked = organiser.get(f"/desk/retract/{number[1]}").text
    assert "Retract Rain" in asked
    assert "It goes from the page and from the feed" in asked
    assert organiser.post(f"/desk/retract/{number[1]}", form=DESK).status_code == 303
    assert "Rain" not in service.person().get("/c/short/news.atom").text
    assert "<td>retract</td>" in log(organiser)


def test_baselines_stand_apart_and_a_phase_opens_again_until_its_reveal(
    service: Service, organiser: Person, tmp_path: Path
) -> None:
    ants = service.person().join(organiser.invite(), "Ann", "Ants")
    number = ants.submit("short/test", STANDING)
    act = f"{DESK}/test"
    assert organiser.post(f"{act}/baseline", form=DESK, controller="none").status_code == 400
    assert organiser.post(f"{act}/baseline", form=DESK, controller="lanes").status_code == 303
    assert organiser.post(f"{act}/baseline", form=DESK, controller="lanes").status_code == 409
    ants.ended(number, "finished")
    organiser.ended(number + 1)
    path = "/competitions/short/phases/test/table"
    assert service.person().api("GET", path).json() == []
    assert service.person().get("/c/short/test/table.csv").text.count("\n") == 1
    assert organiser.post(f"{act}/reopen", form=DESK, until="2040-01-01T00:00").status_code == 409
    asked = organiser.get(f"{act}/close").text
    assert "does not count" in asked
    assert organiser.post(f"{act}/close", form=f"{act}/close").status_code == 303
    places = wait_until(
        lambda: len(service.person().api("GET", path).json()) == 2 and service.person().api("GET", path).json()
    )
    assert [(own["place"], own["entry"]) for own in places] == [(1, "Ants"), (None, "built-in lanes")]
    assert places[1]["mean"] >= places[0]["mean"]
    table = service.person().get("/c/short/test/table").text
    assert '<tr class="baseline">' in table
    assert "Ants" in service.person().get("/c/short/test/table.csv").text
    for until, status in (("2020-01-01T00:00", 400), ("soon", 400), ("2040-01-01T00:00", 303)):
        assert organiser.post(f"{act}/reopen", form=f"{act}/reopen", until=until).status_code == status
    assert service.person().api("GET", path).json() == []
    assert service.person().get(f"/s/{number}/trials/0").status_code == 404
    assert ants.get("/c/short/test").text.count('action="/c/short/test/submit"') == 1
    for done in ("close", "reveal"):
        assert organiser.post(f"{act}/{done}", form=f"{act}/{done}").status_code == 303
    assert organiser.post(f"{act}/reopen", form=DESK, until="2040-01-01T00:00").status_code == 409
    assert edited(organiser, test__closes="2041-01-01T00:00:00Z") == 409
    closed = form_of(organiser)["test closes"]
    for title, closes, status in (("By file", closed, 303), ("Late", "2042-01-01T00:00:00Z", 409)):
        text = competition_text(closes="2037-01-01T00:00:00Z").replace("A <b>short</b> season", title)
        before, after = text.split("[phases.test]")
        after = re.sub("closes = .*", f"closes = {closes}", after)
        files = {"files": ("competition.toml", f"{before}[phases.test]{after}".encode())}
        assert organiser.post("/desk/file/short", form=EDIT, files=files).status_code == status
        assert form_of(organiser)["title"] == "By file"
    said = log(organiser)
    assert all(f"<td>{word}</td>" in said for word in ("baseline", "close", "re-open", "reveal"))
    archived(service, organiser, tmp_path)


def test_every_act_that_others_notice_asks_once(service: Service, organiser: Person) -> None:
    urchins = service.person().join(organiser.invite(), "Una", "Urchins")
    number = urchins.submit("short/practice", STANDING + "# by urchins\n")
    given = {"title": "Fog", "text": "Drive slowly."}
    assert organiser.post("/desk/news/short", form=DESK, **given).status_code == 303
    desk = organiser.get(DESK).text + organiser.get("/desk").text
    for path in re.findall(r'<form[^>]* action="([^"]+/(?:open|close|reveal|reopen|disqualify|remove))"', desk):
        asked = organiser.get(path)
        assert asked.status_code == 200
        assert f'<form method="post" action="{path}">' in asked.text
    retract = re.search(r'<form action="(/desk/retract/\d+)"', desk)
    assert retract is not None
    assert f'<form method="post" action="{retract[1]}">' in organiser.get(retract[1]).text
    acts = r'method="post" action="[^"]+/(open|close|reveal|reopen|disqualify|remove|retract/\d+)"'
    assert not re.search(acts, desk)
    assert "its team reads why" in organiser.get(f"/desk/s/{number}/disqualify?why=x").text
    assert "counts again" in organiser.get(f"/desk/s/{number}/disqualify").text


def archived(service: Service, organiser: Person, tmp_path: Path) -> None:
    """A finished competition is a site that needs no server."""
    bees = service.person().join(organiser.invite(), "Bea", "Bees")
    number = bees.submit("short/validation", CRASHING.replace("def start", "said = 'swordfish'\n\n    def start"))
    bees.ended(number)
    place = f"{DESK}/archive.zip"
    refused = organiser.get(place)
    assert refused.status_code == 409
    assert "not over: validation" in refused.text
    act = f"{DESK}/validation/close"
    assert organiser.post(act, form=act).status_code == 303
    path = "/competitions/short/phases/validation/table"
    wait_until(lambda: service.person().api("GET", path).json())
    feathers = service.person()
    seen = {
        path: feathers.get(path)
        for path in (
            "/c/short/validation/table.csv",
            "/c/short/news.atom",
            f"/s/{number}/trials/0",
            f"/s/{number}/trials/0/replay",
        )
    }
    assert [path for path, answer in seen.items() if answer.status_code != 200] == []
    assert "Bees" in seen["/c/short/validation/table.csv"].text
    texts = [answer.text for answer in seen.values()]
    assert not any(said in text for text in texts for said in ("swordfish", "no idea what to do"))
    with zipfile.ZipFile(io.BytesIO(organiser.get(place).content)) as packed:
        packed.extractall(tmp_path)
    site = tmp_path / "short"
    pages = {page.name: page.read_text() for page in site.iterdir()}
    assert {"index.html", "test.html", "test.csv", "test.seeds.txt", "validation.html"} <= pages.keys()
    for name, text in pages.items():
        for link in re.findall(r'(?:href|src)="([^"#:]+)"', text.partition("<script")[0]):
            assert link in pages, (name, link)
        assert "swordfish" not in text
        assert "no idea what to do" not in text
        assert "here I stand" not in text
    replays = [name for name in pages if name.startswith(("best-", "worst-"))]
    assert len(replays) >= 4
    assert "Ants" in pages["test.html"]
    assert '<tr class="baseline">' in pages["test.html"]
    assert all(f'href="{name}"' in pages["test.html"] + pages["validation.html"] for name in replays)
    assert not {"sealed", "submissions"} & {part for file in tmp_path.rglob("*") for part in file.parts}
