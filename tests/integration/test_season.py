"""A whole season: an organiser, teams with good, crashing and hostile entries, and a stranger who runs it again."""

from __future__ import annotations

import io
import json
import subprocess
import zipfile
from pathlib import Path

from tests.services import (
    COMMAND,
    CRASHING,
    DRIVING,
    Person,
    Service,
    competition_text,
    serving,
    wait_until,
)

PHASES = ("practice", "validation", "test")
HOSTILE = """
import os, socket, subprocess, sys


class Controller:
    def start(self, problem):
        found = []
        for attempt in (
            lambda: open("/etc/shadow").read(),
            lambda: os.environ["DUBINS_TRAFFIC_TOKEN"],
            lambda: socket.create_connection(("127.0.0.1", 8000), timeout=1),
        ):
            try:
                attempt()
                found.append("in")
            except BaseException as error:
                found.append(type(error).__name__)
        print("<script>window.broken = true</script>", found, file=sys.stderr)

    def act(self, observation):
        return float("nan"), 0.0
"""
ENTRIES = {"Ants": DRIVING, "Bees": CRASHING, "Wasps": HOSTILE}


def test_a_season(tmp_path: Path) -> None:
    with serving(tmp_path / "here", "--trust-submissions") as service:
        organiser = service.organiser()
        created(organiser)
        teams = {name: service.person().join(organiser.invite(), f"of {name}", name) for name in ENTRIES}
        numbers = {
            (name, phase): person.submit(f"season/{phase}", ENTRIES[name])
            for phase in PHASES
            for name, person in teams.items()
        }
        for (name, phase), number in numbers.items():
            teams[name].ended(number, "finished" if phase == "test" else "done")
        nothing_leaks(teams, numbers)
        closed(organiser, numbers)
        assert [place["entry"] for place in table(organiser)] == ["Ants", "Bees"]
        export = organiser.get("/desk/c/season/export.zip")
        assert export.status_code == 200
        everybody_sees(service, numbers)
    again(tmp_path / "stranger", export.content, numbers["Ants", "test"])


def created(organiser: Person) -> None:
    files = {"files": ("competition.toml", competition_text().encode())}
    answer = organiser.post("/desk/create", form="/desk", files=files, address="season")
    assert answer.status_code == 303, answer.text
    shown = organiser.get("/c/season").text
    assert "A &lt;b&gt;short&lt;/b&gt; season" in shown
    assert json.loads(organiser.get("/c/season/test/commitment.json").text)["commitment"]


def nothing_leaks(teams: dict[str, Person], numbers: dict[tuple[str, str], int]) -> None:
    """Practice shows all, validation aggregates, the test phase nothing; nobody sees another team's."""
    wasps, bees = teams["Wasps"], teams["Bees"]
    log = wasps.get(f"/s/{numbers['Wasps', 'practice']}/trials/0").text
    assert "window.broken" in log
    assert "<script>window.broken" not in log
    assert "&#39;in&#39;" not in log
    validation = bees.get(f"/s/{numbers['Bees', 'validation']}").text
    assert "controller_fault" in validation or "controller fault" in validation
    assert "/trials/" not in validation
    secret = bees.get(f"/s/{numbers['Bees', 'test']}").text
    assert "fault" not in secret.partition("<main")[2].partition("<form")[0].lower()
    assert bees.get(f"/s/{numbers['Bees', 'test']}/trials/0").status_code == 404
    assert bees.get(f"/s/{numbers['Ants', 'test']}").status_code == 404
    assert "when the phase has closed" in bees.get("/c/season/test/table").text


def closed(organiser: Person, numbers: dict[tuple[str, str], int]) -> None:
    """Close and reveal; disqualify who was hostile."""
    desk = "/desk/c/season"
    why = "it tried to get out"
    assert organiser.post(f"/desk/s/{numbers['Wasps', 'test']}/disqualify", form=desk, why=why).status_code == 303
    assert organiser.post(f"{desk}/test/reveal", form=desk).status_code == 409
    for act in ("close", "reveal"):
        assert organiser.post(f"{desk}/test/{act}", form=desk).status_code == 303
    wait_until(lambda: [place["entry"] for place in table(organiser)] and len(table(organiser)) == 2)
    log = organiser.get("/desk/log").text
    assert all(word in log for word in ("create", "disqualify", why, "close", "reveal"))


def table(person: Person) -> list[dict[str, object]]:
    return person.api("GET", "/competitions/season/phases/test/table").json()


def everybody_sees(service: Service, numbers: dict[tuple[str, str], int]) -> None:
    anybody = service.person()
    assert "Ants" in anybody.get("/c/season/test/table").text
    assert anybody.get("/c/season/test/seeds.txt").status_code == 200
    number = numbers["Ants", "test"]
    assert anybody.get(f"/s/{number}/trials/0/replay").status_code == 200
    assert anybody.get(f"/s/{number}/trials/0").status_code == 200


def again(folder: Path, export: bytes, number: int) -> None:
    """Run the first entry again from the export alone: the same rows, the same frames, the same place."""
    with zipfile.ZipFile(io.BytesIO(export)) as archive:
        archive.extractall(folder)
        assert not any("sealed" in name for name in archive.namelist())
    entries = json.loads((folder / "test/submissions.json").read_text())
    entry = next(own for own in entries if own["submission"] == number)
    assert entry["counted"]
    command = [
        "evaluate",
        f"submissions/{entry['digest']}",
        "--competition",
        ".",
        "--phase",
        "test",
        "--json",
    ]
    ran = subprocess.run(
        [*COMMAND, *command, "--trust-submissions"],
        cwd=folder,
        capture_output=True,
        text=True,
        timeout=600,
        check=False,
    )
    assert ran.returncode == 0, ran.stderr
    expected = json.loads((folder / f"test/results-{number}.json").read_text())
    found = [{**own["row"], "frames": own["frames"]} for own in json.loads(ran.stdout)["trials"]]
    assert [own["frames"] for own in found] == [own["frames"] for own in expected]
    assert found == expected
