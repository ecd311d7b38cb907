"""Secret seeds: encrypted on disk, committed to, revealed; nobody can exchange them on the way."""

from __future__ import annotations

import hashlib
import json
from datetime import UTC, datetime
from pathlib import Path

import pytest

from dubins_traffic.competition import sealing
from dubins_traffic.competition.competition import Phase
from dubins_traffic.competition.sealing import Seeds, check_belong, read_seeds
from dubins_traffic.errors import InputError
from tests.competitions import KEY, TEST, competition

LATER = datetime(2026, 3, 1, tzinfo=UTC)
WITHIN = datetime(2026, 1, 15, tzinfo=UTC)


@pytest.fixture
def phase(tmp_path: Path) -> Phase:
    return competition(tmp_path).phase("test")


def test_seeds_are_sealed_committed_to_and_revealed(phase: Phase) -> None:
    commitment = sealing.seal(phase, KEY)
    seeds = phase.seeds(KEY)
    assert len(seeds) == len(set(seeds)) == 6
    assert sealing.publish(phase, "Small").commitment == commitment
    with pytest.raises(InputError, match="has not closed"):
        sealing.reveal(phase, KEY, WITHIN)
    path = sealing.reveal(phase, KEY, LATER)
    assert phase.seeds() == seeds
    assert hashlib.sha256(path.read_bytes()).hexdigest() == commitment
    assert read_seeds(path.read_text()).seeds == seeds


def test_nothing_on_disk_holds_a_seed_before_they_are_revealed(phase: Phase, tmp_path: Path) -> None:
    sealing.seal(phase, KEY)
    sealing.publish(phase, "Small")
    held = "".join(path.read_text() for path in tmp_path.rglob("*") if path.is_file())
    assert held
    assert not [seed for seed in phase.seeds(KEY) if str(seed) in held or f"{seed:x}" in held]


def test_without_the_key_nobody_has_the_seeds(phase: Phase) -> None:
    sealing.seal(phase, KEY)
    with pytest.raises(InputError, match="the seeds are secret"):
        phase.seeds()
    with pytest.raises(InputError, match="can't be decrypted"):
        phase.seeds(b"another passphrase")
    with pytest.raises(InputError, match="too short"):
        phase.seeds(b"short")


@pytest.mark.parametrize("name", ["commitment", "sealed", "nonce", "salt", "phase"])
def test_a_changed_file_is_found_out(phase: Phase, name: str) -> None:
    sealing.seal(phase, KEY)
    path = sealing.sealed_path(phase)
    held = json.loads(path.read_text())
    first = held[name][0]
    held[name] = ("b" if first != "b" else "c") + held[name][1:]
    path.write_text(json.dumps(held))
    with pytest.raises(InputError, match=r"decrypted|another phase"):
        phase.seeds(KEY)


def test_other_seeds_can_neither_be_sealed_nor_revealed_once_committed_to(phase: Phase) -> None:
    sealing.seal(phase, KEY)
    with pytest.raises(InputError, match="holds sealed seeds"):
        sealing.seal(phase, KEY)
    sealing.seal(phase, KEY, overwrite=True)
    sealing.publish(phase, "Small")
    with pytest.raises(InputError, match="has been published"):
        sealing.seal(phase, KEY, overwrite=True)
    kept = sealing.commitment_path(phase).read_text()
    sealing.commitment_path(phase).unlink()
    sealing.seal(phase, KEY, overwrite=True)
    sealing.commitment_path(phase).write_text(kept)
    with pytest.raises(InputError, match="another commitment"):
        sealing.publish(phase, "Small")
    with pytest.raises(InputError, match="not those that were committed to"):
        sealing.reveal(phase, KEY, LATER)
    assert not sealing.revealed_path(phase).exists()


def test_revealed_seeds_that_were_changed_are_refused(phase: Phase) -> None:
    sealing.seal(phase, KEY)
    sealing.publish(phase, "Small")
    path = sealing.reveal(phase, KEY, LATER)
    lines = path.read_text().splitlines()
    path.write_text("\n".join([*lines[:-1], "7", ""]))
    with pytest.raises(InputError, match="not those that were committed to"):
        phase.seeds()


def test_seeds_are_of_one_phase_and_its_rules(phase: Phase, tmp_path: Path) -> None:
    seeds = sealing.draw_seeds(phase)
    check_belong(seeds, phase)
    other = competition(tmp_path, phases={"test": {**TEST, "limits": {"bank": 1.0}}}).phase("test")
    with pytest.raises(InputError, match="drawn for other"):
        check_belong(seeds, other)
    with pytest.raises(InputError, match="another phase"):
        check_belong(Seeds("final", seeds.rules, seeds.salt, seeds.seeds), phase)
    with pytest.raises(InputError, match="a seed for each trial"):
        check_belong(Seeds("test", seeds.rules, seeds.salt, seeds.seeds[1:]), phase)


@pytest.mark.parametrize(
    "change",
    [("seeds 1", "seeds 2"), ("salt ", "salt"), ("\n1\n", "\n01\n"), ("\n1\n", "\n1\r\n"), ("2\n", "2")],
)
def test_a_text_of_seeds_is_read_to_the_byte(change: tuple[str, str]) -> None:
    text = Seeds("test", "0" * 64, "a" * 64, (1, 2)).text
    assert read_seeds(text).text == text
    assert change[0] in text
    with pytest.raises(InputError):
        read_seeds(text.replace(*change))


def test_a_key_lies_elsewhere_and_is_its_owners(phase: Phase, tmp_path: Path) -> None:
    for place in (tmp_path / "key", tmp_path / "sealed" / "key"):
        with pytest.raises(InputError, match="outside"):
            sealing.make_key_file(place, phase.folder)
        with pytest.raises(InputError, match="outside"):
            sealing.read_key(place, phase.folder)
    place = tmp_path.parent / f"{tmp_path.name}.key"
    sealing.make_key_file(place, phase.folder)
    assert place.stat().st_mode & 0o077 == 0
    key = sealing.read_key(place, phase.folder)
    sealing.seal(phase, key)
    assert len(phase.seeds(key)) == 6
    with pytest.raises(InputError, match="can't be written"):
        sealing.make_key_file(place, phase.folder)


def test_only_secret_seeds_are_sealed(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="no secret"):
        sealing.seal(competition(tmp_path).phase("practice"), KEY)
    with pytest.raises(InputError, match="without a folder"):
        sealing.seal(competition().phase("test"), KEY)
