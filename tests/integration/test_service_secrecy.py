"""What a phase must not show lies in no file and no row of the service, and is there for everybody when it may be."""

from __future__ import annotations

import base64
import contextlib
import gzip
import io
import json
import os
import re
import sqlite3
import struct
import tempfile
import zipfile
import zlib
from collections.abc import Iterator
from pathlib import Path

import httpx
import pytest
import zstandard
from sqlalchemy import select

from dubins_traffic.competition.judging import judge
from dubins_traffic.competition.sealing import make_key_file, read_key, unsealed
from dubins_traffic.competition.submission import check_submission
from dubins_traffic.service import viewing
from dubins_traffic.service.database_tables import Phase, Submission, Trial
from dubins_traffic.service.hiding import HiddenError, hiding_of
from dubins_traffic.service.service import NoKeyError
from dubins_traffic.service.service import Service as StoredService
from tests import postgres, s3
from tests.services import CRASHING, Person, season, wait_until

pytestmark = pytest.mark.tools

SAID = "swordfish"
SAYING = f"""
class Controller:
    def start(self, problem):
        print("{SAID[::-1]}"[::-1])

    def act(self, observation):
        return 0.2, 0.1
"""
SECRET = ("validation", "test")
SOURCE = "no idea what to do"


def forms(seed: int) -> set[bytes]:
    """Return a seed as it may be written: digits, hexadecimal digits, bytes, and Base64 of these at any place."""
    little, big = seed.to_bytes(8, "little"), seed.to_bytes(8, "big")
    plain = {str(seed).encode(), f"{seed:016x}".encode(), f"{seed:016X}".encode(), little, big}
    packed: set[bytes] = set()
    for data in (*plain, little.hex().encode()):
        for before in range(3):
            whole = base64.b64encode(bytes(before) + data)
            packed.add(whole[-(-before * 8 // 6) : (before + len(data)) * 8 // 6])
    return plain | packed | {little.hex().encode()}


def float_forms(value: float) -> set[bytes]:
    """Return a number as it may be written: digits, eight bytes in either order, these as hexadecimal and Base64."""
    found = {repr(value).encode(), f"{value:.9g}".encode()}
    for order in "<>":
        packed = struct.pack(f"{order}d", value)
        found |= {packed, packed.hex().encode(), packed.hex().upper().encode()}
        for before in range(3):
            whole = base64.b64encode(bytes(before) + packed)
            found.add(whole[-(-before * 8 // 6) : (before + 8) * 8 // 6])
    return found


def is_telling(value: object) -> bool:
    """Tell whether a number has so many digits that it stands nowhere by chance."""
    return isinstance(value, float) and len(repr(value)) >= 12


def unpacked(data: bytes) -> Iterator[bytes]:
    """Yield bytes, what is packed by gzip or Zstandard in them, and the members of an archive."""
    yield data
    if zipfile.is_zipfile(io.BytesIO(data)):
        with zipfile.ZipFile(io.BytesIO(data)) as archive:
            yield from (archive.read(name) for name in archive.namelist())
    for found in re.finditer(rb"\x1f\x8b\x08", data):
        try:
            yield zlib.decompressobj(31).decompress(data[found.start() :])
        except zlib.error:
            continue
    for found in re.finditer(rb"\x28\xb5\x2f\xfd", data):
        try:
            yield zstandard.ZstdDecompressor().decompressobj().decompress(data[found.start() :])
        except zstandard.ZstdError:
            continue


def files_below(folder: Path) -> Iterator[Path]:
    """Yield the files below a folder; a folder that a worker has just removed has none."""

    def told(error: OSError) -> None:
        if not isinstance(error, FileNotFoundError | NotADirectoryError):
            raise error

    for where, _, names in os.walk(folder, onerror=told):
        yield from (Path(where) / name for name in names)


def holding(folders: list[Path], wanted: set[bytes]) -> list[str]:
    """Return the files in which something wanted stands."""
    found: list[str] = []
    for path in (each for folder in folders for each in (folder, *sorted(files_below(folder)))):
        try:
            data = path.read_bytes() if path.is_file() else b""
        except FileNotFoundError:  # of a worker that has just removed it
            continue
        found += [str(path) for part in unpacked(data) if any(form in part for form in wanted)][:1]
    return found


@pytest.fixture
def open_folder() -> Iterator[Path]:
    """A folder that other users may enter."""
    with tempfile.TemporaryDirectory(prefix="secrecy-") as name:
        Path(name).chmod(0o755)
        yield Path(name)


def test_nothing_of_a_secret_phase_is_written_in_clear_in_sqlite(tmp_path: Path) -> None:
    a_season(tmp_path, "", [])


def test_nothing_of_a_secret_phase_is_written_in_clear_in_postgresql(tmp_path: Path, open_folder: Path) -> None:
    with postgres.cluster(open_folder) as cluster:
        a_season(tmp_path, f'database = "{cluster.url("secrecy")}"\n', [open_folder])


def test_nothing_of_a_secret_phase_is_written_in_clear_in_a_bucket(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    with s3.store(tmp_path / "s3") as store:
        for name, value in store.environment().items():
            monkeypatch.setenv(name, value)
        a_season(tmp_path, f'storage = "s3://{s3.BUCKET}/here"\n', [tmp_path / "s3"])
        assert not (tmp_path / "here" / "store").exists()


@pytest.mark.parametrize("form", range(12))
def test_a_seed_is_found_however_it_is_written(tmp_path: Path, form: int) -> None:
    seed = 12067423490827346012
    little, big = seed.to_bytes(8, "little"), seed.to_bytes(8, "big")
    plain = [
        str(seed).encode(),
        f"{seed:x}".encode(),
        f"{seed:X}".encode(),
        little,
        big,
        little.hex().encode(),
    ]
    text = [*plain, *(base64.b64encode(b"a" * k + own) for k, own in enumerate(plain))][form]
    for pack in (gzip.compress, zstandard.compress):
        (tmp_path / "page").write_bytes(b"head " + pack(b"before " + text + b" after"))
        assert holding([tmp_path], forms(seed)) == [str(tmp_path / "page")]
        assert holding([tmp_path], forms(seed ^ 1 << 40)) == []


@pytest.mark.parametrize("order", "<>")
def test_a_number_is_found_in_a_member_of_an_archive(tmp_path: Path, order: str) -> None:
    value = 4.830800685677691
    packed = struct.pack(f"{order}d", value)
    for data in (repr(value).encode(), packed, packed.hex().encode(), base64.b64encode(b"a" + packed)):
        with zipfile.ZipFile(tmp_path / "archive", "w", zipfile.ZIP_DEFLATED) as archive:
            archive.writestr("member", b"before " + data + b" after")
        assert holding([tmp_path], float_forms(value)) == [str(tmp_path / "archive")]
        assert holding([tmp_path], float_forms(value + 1.0)) == []


def a_season(tmp_path: Path, settings: str, also: list[Path]) -> None:
    """Judge two submissions in phases that hide their trials, and look at every byte until these may be seen."""
    folder = tmp_path / "here"
    with season(tmp_path, settings=f"logins = 10000\n{settings}") as service:
        organiser = service.organiser().with_token()
        person = service.person().join(organiser.invite(), "Ann", "Ants").with_token()
        seeds = seeds_of(folder)
        assert all(len(own) == 2 for own in seeds.values())
        secret = {form for own in seeds.values() for seed in own for form in forms(seed)}
        secret |= {SAID.encode(), base64.b64encode(SAID.encode()), b"counted_rounds"}
        looked_at = [folder, folder.with_suffix(".log"), *also]
        known = results_at_home(folder, tmp_path / "home")
        secret |= planted_in(folder) | known
        numbers = [person.submit(f"short/{phase}", text) for phase in SECRET for text in (SAYING, CRASHING)]
        assert wait_until(lambda: holding(looked_at, secret) or all_ended(person, numbers)) is True
        assert holding(looked_at, secret) == []
        results = results_of(folder, numbers)
        assert len(known) > 20
        assert known <= results
        copied(folder, tmp_path / "copies", organiser)
        assert holding([*looked_at, tmp_path / "copies"], secret | results) == []
        assert len(kept_replays(folder)) > 4
        shown_to_organisers(organiser, numbers[2])
        unreadable(folder, tmp_path / "other.key", numbers[2])
        for act in ("close", "reveal"):
            assert organiser.post(f"/desk/c/short/test/{act}", form="/desk/c/short").status_code == 303
        assert [Path(one).name for one in holding(looked_at, set(forms(seeds["test"][0])))] == ["test.seeds.txt"]
        shown_to_all(service.person(), seeds["test"], numbers[2:])
        others_see_no_words(service.person().join(organiser.invite(), "Bob", "Bees"), numbers[3])
        told = person.get(f"/s/{numbers[3]}/trials/0").text
        assert SOURCE in told.partition("<h2>Log")[0]
        assert SOURCE in person.get(f"/s/{numbers[3]}/trials/0/replay").text
        exported(organiser, numbers[3])


def seeds_of(folder: Path) -> dict[str, tuple[int, ...]]:
    stored = StoredService(folder, folder.with_suffix(".key"))
    with stored.database.reading() as session:
        rows = session.scalars(select(Phase).where(Phase.name.in_(SECRET))).all()
        found = {row.name: stored.seeds(row) for row in rows}
    stored.close()
    return found


def planted_in(folder: Path) -> set[bytes]:
    """Return the salts of the secret phases, and where the cars of their trials begin, in all forms."""
    stored = StoredService(folder, folder.with_suffix(".key"))
    found: set[bytes] = set()
    with stored.database.reading() as session:
        for row in session.scalars(select(Phase).where(Phase.name.in_(SECRET))).all():
            phase, seeds = stored.phase(row), stored.seeds(row)
            salt = unsealed(phase, stored.needed_key()).salt
            found |= {salt.encode(), bytes.fromhex(salt), base64.b64encode(bytes.fromhex(salt))}
            starts = [start for k, seed in enumerate(seeds) for start in phase.instance(k, seed).starts]
            places = [place for start in starts for place in (start.x, start.y)]
            found |= {form for place in filter(is_telling, places) for form in float_forms(place)}
    stored.close()
    return found


def kept_replays(folder: Path) -> set[str]:
    """Return the replays of which the database knows, after each has been found in the store."""
    stored = StoredService(folder, folder.with_suffix(".key"))
    with stored.database.reading() as session:
        found = {own for own in session.scalars(select(Trial.replay)) if own is not None}
    for digest in found:
        stored.storage.get(digest, "replays")
    stored.close()
    return found


def results_at_home(folder: Path, at: Path) -> set[bytes]:
    """Return what a submission's trials in the secret phases will come to, before they are run there, in all forms."""
    stored = StoredService(folder, folder.with_suffix(".key"))
    at.mkdir()
    (at / "controller.py").write_text(SAYING)
    submission = check_submission(at / "controller.py", at / "store")
    values: set[float] = set()
    with stored.database.reading() as session:
        for row in session.scalars(select(Phase).where(Phase.name.in_(SECRET))).all():
            seeds = dict(enumerate(stored.seeds(row)))
            for judged in judge(stored.phase(row), seeds, submission, seeds=seeds, trust=True):
                values |= set(filter(is_telling, judged.row.values()))
    stored.close()
    return {form for value in values for form in float_forms(value)}


def results_of(folder: Path, numbers: list[int]) -> set[bytes]:
    """Return the numbers in the results of submissions that tell something, in all forms."""
    stored = StoredService(folder, folder.with_suffix(".key"))
    with stored.database.reading() as session:
        submissions = [session.get_one(Submission, number) for number in numbers]
        rows = [viewing.trial_of(stored, session, own, number) for own in submissions for number in range(2)]
        values = [value for row in rows if row is not None for value in row.row.values()]
    stored.close()
    return {form for value in filter(is_telling, values) for form in float_forms(value)}


def copied(folder: Path, to: Path, organiser: Person) -> None:
    """Make a backup of a database that is a file, and keep what the service says to who measures it."""
    to.mkdir()
    metrics = httpx.get(f"{organiser.url}/metrics", headers={"authorization": f"Bearer {organiser.token}"})
    assert metrics.status_code == 200
    (to / "metrics").write_bytes(metrics.content)
    if (folder / "service.db").exists():
        with (
            contextlib.closing(sqlite3.connect(folder / "service.db")) as source,
            contextlib.closing(sqlite3.connect(to / "service.db")) as target,
        ):
            source.backup(target)


def all_ended(person: Person, numbers: list[int]) -> bool:
    return all(person.state(number) in ("done", "finished") for number in numbers)


def shown_to_organisers(organiser: Person, number: int) -> None:
    assert SAID in organiser.get(f"/s/{number}/trials/1").text
    assert organiser.get(f"/s/{number}/trials/1/replay").status_code == 200
    assert len(organiser.api("GET", f"/submissions/{number}").json()["trials"]) == 2


def unreadable(folder: Path, other: Path, number: int) -> None:
    """With another key nothing can be read, and nothing of one trial stands for another."""
    keyless = StoredService(folder, other)
    with keyless.database.reading() as session:
        assert [row.name for row in keyless.waiting_for_key(session)] == list(SECRET)
        with pytest.raises(NoKeyError, match="no key for what is secret"):
            viewing.trial_of(keyless, session, session.get_one(Submission, number), 0)
    keyless.close()
    assert not other.exists()
    make_key_file(other, folder)
    with pytest.raises(NoKeyError, match="not the key of this folder"):
        StoredService(folder, other)
    own = StoredService(folder, folder.with_suffix(".key"))
    with own.database.reading() as session:
        submission = session.get_one(Submission, number)
        first, second = session.scalars(select(Trial).where(Trial.submission_id == number)).all()
        assert viewing.trial_of(own, session, submission, 0) is not None
        with pytest.raises(HiddenError, match="another key"):
            hiding_of(read_key(other, folder), f"short/{submission.phase.name}").shown(first)
        first.hidden, second.hidden = second.hidden, first.hidden
        with session.no_autoflush, pytest.raises(HiddenError, match="changed"):
            own.hiding(submission.phase).shown(first)
        session.rollback()
    own.close()


def shown_to_all(anybody: Person, seeds: tuple[int, ...], numbers: list[int]) -> None:
    revealed = anybody.get("/c/short/test/seeds.txt").text.split()
    assert all(str(seed) in revealed for seed in seeds)
    for number in numbers:
        for trial, seed in enumerate(seeds):
            assert str(seed) in anybody.get(f"/s/{number}/trials/{trial}/replay").text
    table = wait_until(lambda: anybody.api("GET", "/competitions/short/phases/test/table").json())
    assert {place["entry"] for place in table} == {"Ants"}


def others_see_no_words(other: Person, number: int) -> None:
    page = other.get(f"/s/{number}/trials/0").text
    assert "controller_fault" in page
    replay = other.get(f"/s/{number}/trials/0/replay").text
    assert "controller_fault" in replay
    for text in (page, replay):
        assert SOURCE not in text
        assert "raise RuntimeError" not in text
    assert other.get(f"/s/{number}").status_code == 404


def exported(organiser: Person, number: int) -> None:
    with zipfile.ZipFile(io.BytesIO(organiser.get("/desk/c/short/export.zip").content)) as archive:
        rows = json.loads(archive.read(f"test/results-{number}.json"))
        assert [(row["end"], row["reason"]) for row in rows] == [("controller_fault", None)] * 2
        told = [archive.read(name) for name in archive.namelist() if not name.startswith("submissions/")]
    assert not any(SOURCE.encode() in data for data in told)
