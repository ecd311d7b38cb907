"""`evaluate` at home and a service with one worker or two give the same frames, scores and logs of every trial.

The suite takes a part of the trials; `DUBINS_TRAFFIC_SERVED_TRIALS=1000` takes a thousand, and judges each of them at
home, by a service with one worker and by one with two, which take them in chunks and team after team.
"""

from __future__ import annotations

import json
import os
import subprocess
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import pytest
from experiments.competition import ROADS, RULES, SWERVES

from dubins_traffic.competition.templates import write_template
from dubins_traffic.service.client import packed
from tests.ros import need_compiler
from tests.services import COMMAND, Person, Service, serving, wait_until

pytestmark = pytest.mark.tools("boxes")

TRIALS = int(os.environ.get("DUBINS_TRAFFIC_SERVED_TRIALS", "12"))
LONGEST_S = 600.0 + 60.0 * TRIALS
FINAL = ("done", "rejected", "failed", "cancelled")


@pytest.fixture(scope="module")
def entries(tmp_path_factory: pytest.TempPathFactory) -> Mapping[str, Path]:
    """Return what drives: our templates in two languages, a driver of ours, one that swerves by what it sees."""
    need_compiler()
    folder = tmp_path_factory.mktemp("entries")
    for kind in ("python", "cpp"):
        write_template(kind, folder / kind)
    subprocess.run(["make", "-s"], cwd=folder / "cpp", check=True)
    for name, text in (("rules", RULES), ("swerves", SWERVES)):
        (folder / name).mkdir()
        (folder / name / "controller.py").write_bytes(text)
    return {path.name: path for path in sorted(folder.iterdir())}


@pytest.fixture(scope="module")
def competition(tmp_path_factory: pytest.TempPathFactory, entries: Mapping[str, Path]) -> Path:
    """Return the folder of a competition on several kinds of roads, short trials of each."""
    folder = tmp_path_factory.mktemp("competition") / "roads"
    folder.mkdir()
    for name, document in ROADS.items():
        (folder / f"{name}.json").write_text(json.dumps({**document, "duration": 6}))
    each = -(-TRIALS // (len(entries) * len(ROADS)))
    (folder / "competition.toml").write_text(
        f'version = 0\ntitle = "Roads"\nconfigurations = {[f"{name}.json" for name in ROADS]}\n'
        f'[phases.practice]\nseed = 16\ntrials = {each}\nshows = "all"\n'
    )
    return folder


@pytest.fixture(scope="module")
def at_home(
    tmp_path_factory: pytest.TempPathFactory, entries: Mapping[str, Path], competition: Path
) -> Mapping[str, list[dict[str, Any]]]:
    """Return what `evaluate` says of the trials of each entry."""
    folder = tmp_path_factory.mktemp("home")
    return {name: evaluated(path, str(competition), folder) for name, path in entries.items()}


def evaluated(path: Path, competition: str, folder: Path) -> list[dict[str, Any]]:
    line = [*COMMAND, "evaluate", str(path), "--competition", competition, "--json", "--trust-submissions"]
    ran = subprocess.run(line, cwd=folder, capture_output=True, text=True, timeout=LONGEST_S, check=False)
    assert ran.returncode == 0, ran.stderr
    return json.loads(ran.stdout)["trials"]


@pytest.mark.parametrize("workers", [1, 2])
def test_frames_at_home_are_those_of_the_service(
    workers: int,
    tmp_path: Path,
    entries: Mapping[str, Path],
    competition: Path,
    at_home: Mapping[str, list[dict[str, Any]]],
) -> None:
    arguments = ("--competition", str(competition), "--workers", str(workers), "--trust-submissions")
    order = list(entries) if workers == 1 else list(reversed(entries))
    with serving(tmp_path / "here", *arguments, settings="logins = 10000\n", clean=True) as service:
        found = at_the_service(service, {name: entries[name] for name in order})
    compared = [
        (name, one["number"], one == other)
        for name in entries
        for one, other in zip(at_home[name], found[name], strict=True)
    ]
    assert [one for one in compared if not one[2]] == []
    assert len(compared) >= TRIALS
    assert all(one["frames"] for own in found.values() for one in own)


def at_the_service(service: Service, entries: Mapping[str, Path]) -> Mapping[str, list[dict[str, Any]]]:
    """Hand in all entries, each by a team of its own, before any is done; return the trials as the API tells them."""
    organiser = service.organiser()
    handed: dict[str, tuple[Person, int]] = {}
    for name, path in entries.items():
        person = service.person().join(organiser.invite(), f"of {name}", name).with_token()
        handed[name] = person, person.submit("roads/practice", packed(path)[1], f"{name}.zip")

    def ended(name: str) -> dict[str, Any] | None:
        person, number = handed[name]
        told = person.api("GET", f"/submissions/{number}").json()
        return told if told["state"] in FINAL else None

    found = {name: wait_until(lambda name=name: ended(name), LONGEST_S) for name in handed}
    assert {name: told["state"] for name, told in found.items()} == dict.fromkeys(handed, "done")
    return {name: told["trials"] for name, told in found.items()}
