"""Submissions and replays in a store that speaks S3, beyond a connection that is cut: nothing is lost or half kept."""

from __future__ import annotations

import hashlib
import io
import zipfile
from collections.abc import Iterator
from pathlib import Path

import pytest

from tests import s3
from tests.seasons import SETTINGS, TRIALS, counted_once, kept_whole, offered, sent
from tests.services import STANDING, Person, season, wait_until

pytestmark = pytest.mark.tools

PLACE = f"s3://{s3.BUCKET}/here"
S3_SETTINGS = f'{SETTINGS}storage = "{PLACE}"\n'
LITTLE = 2000
"""Bytes of a connection into which a question and a controller of these tests fit, but no replay."""
TAKES_NOTHING = "the store takes nothing"


@pytest.fixture
def store(tmp_path: Path) -> Iterator[s3.Store]:
    with s3.store(tmp_path / "s3") as made:
        yield made


@pytest.fixture
def wire(store: s3.Store, monkeypatch: pytest.MonkeyPatch) -> Iterator[s3.Wire]:
    made = s3.Wire(store.port)
    for name, value in store.environment(made.port).items():
        monkeypatch.setenv(name, value)
    yield made
    made.close()


def test_a_season_over_s3(tmp_path: Path, store: s3.Store, wire: s3.Wire) -> None:
    log = tmp_path / "here.log"
    with season(tmp_path, "--workers", "1", settings=S3_SETTINGS, trials=TRIALS) as service:
        organiser = service.organiser()
        person = service.person().join(organiser.invite(), "Ann", "Ants").with_token()
        number = person.submit("short/practice", STANDING)
        person.ended(number)
        judged_again_and_exported(organiser, person, number)
        cut_uploads(person, wire)
        wire.most = LITTLE
        cut = person.submit("short/practice", f"{STANDING}\n# cut\n")
        wait_until(lambda: TAKES_NOTHING in log.read_text(), 60)
        wire.most = None
        person.ended(cut)
        away(store, person)
        assert len(person.api("GET", "/competitions/short/phases/practice/submissions").json()) == 4
        wait_until(lambda: all(person.state(own + 1) == "done" for own in range(4)))
    assert not (tmp_path / "here" / "store").exists()
    counted_once(tmp_path, S3_SETTINGS, 4, runs=5)
    kept_whole(tmp_path, S3_SETTINGS, PLACE)


def judged_again_and_exported(organiser: Person, person: Person, number: int) -> None:
    replay = person.get(f"/s/{number}/trials/0/replay").text
    assert "<canvas" in replay
    answer = organiser.post(f"/desk/s/{number}/rejudge", form="/desk")
    assert answer.status_code == 303, answer.text
    person.ended(number)
    assert person.get(f"/s/{number}/trials/0/replay").text == replay
    made = organiser.get("/desk/c/short/export.zip")
    with zipfile.ZipFile(io.BytesIO(made.content)) as archive:
        digest = hashlib.sha256(STANDING.encode()).hexdigest()
        assert archive.read(f"submissions/{digest}") == STANDING.encode()


def cut_uploads(person: Person, wire: s3.Wire) -> None:
    """What is cut in the middle is refused, however it is sent; nothing of it is there until it is sent anew."""
    for size in (400_000, 12_000_000):
        wire.most = 100_000
        big = f"{STANDING}\n" + "#" * size
        assert offered(person, big).status_code == 503
        assert wire.cuts
        wire.most = None
        if size < 1_000_000:
            assert sent(person, big) == sent(person, big)


def away(store: s3.Store, person: Person) -> None:
    """The store is killed under load, and comes back."""
    number = person.submit("short/practice", f"{STANDING}\n# away\n")
    wait_until(lambda: person.state(number) in ("queued", "running"), pause=0.02)
    store.stop()
    assert person.get(f"/s/{number}").status_code == 200
    store.start()
    person.ended(number)
