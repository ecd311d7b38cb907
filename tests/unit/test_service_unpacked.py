"""What a worker keeps of submissions: not more than so many bytes, not longer than so long, and what it uses."""

from __future__ import annotations

import os
from pathlib import Path

import pytest

from dubins_traffic.errors import InputError
from dubins_traffic.service import unpacked as room
from dubins_traffic.service.unpacked import Unpacked

CONTROLLER = b"class Controller:\n    def act(self, observation):\n        return 0.2, 0.1\n"


def source(number: int, size: int = 1000) -> bytes:
    return CONTROLLER + f"# {number:08d}".encode() + b"x" * (size - len(CONTROLLER) - 10)


def kept(folder: Path) -> int:
    return sum(path.stat().st_size for path in folder.rglob("*") if path.is_file())


def test_no_more_is_kept_than_so_many_bytes(tmp_path: Path) -> None:
    """All were kept for ever."""
    unpacked = Unpacked(tmp_path, most=3500)
    places: list[Path] = []
    for number in range(6):
        with unpacked.held(source(number)) as submission:
            places.append(submission.path)
        os.utime(submission.path, (2e9 + number, 2e9 + number))
    unpacked.clear()
    assert [path.is_dir() for path in places] == [False, False, False, True, True, True]
    assert 3000 < kept(tmp_path) <= 3500
    assert not list(tmp_path.glob(".old-*"))


def test_what_is_in_use_is_kept_by_whatever_worker(tmp_path: Path) -> None:
    mine, other = Unpacked(tmp_path, most=0), Unpacked(tmp_path, most=0)
    with mine.held(source(1)) as submission:
        other.clear()
        assert submission.path.is_dir()
    other.clear()
    assert not submission.path.exists()
    with mine.held(source(1)) as again:
        assert again.path == submission.path
        assert kept(tmp_path) > 1000


def test_what_a_killed_worker_left_half_removed_is_removed(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    unpacked = Unpacked(tmp_path, most=0)
    with unpacked.held(source(1)):
        pass
    with monkeypatch.context() as killed:
        killed.setattr(room.shutil, "rmtree", lambda *_, **__: (_ for _ in ()).throw(KeyboardInterrupt))
        with pytest.raises(KeyboardInterrupt):
            unpacked.clear()
    assert [path.name[:5] for path in tmp_path.iterdir()] == [".old-"]
    unpacked.clear()
    assert list(tmp_path.iterdir()) == []


def test_what_was_not_used_for_long_is_removed(tmp_path: Path) -> None:
    unpacked = Unpacked(tmp_path, age=3600.0)
    with unpacked.held(source(1)) as old, unpacked.held(source(2)) as new:
        os.utime(old.path, (1e9, 1e9))
    unpacked.clear()
    assert (old.path.exists(), new.path.exists()) == (False, True)


def test_what_is_no_submission_is_refused(tmp_path: Path) -> None:
    with pytest.raises(InputError), Unpacked(tmp_path).held(b"PK\x03\x04"):
        pass
    assert kept(tmp_path) == 0
