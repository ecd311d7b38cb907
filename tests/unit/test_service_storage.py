"""Where submissions and replays lie: a folder, or a store by its address."""

from __future__ import annotations

from pathlib import Path

import pytest

from dubins_traffic.errors import InputError
from dubins_traffic.service.service import load_settings, secret_in
from dubins_traffic.service.storage import Storage, StorageError


@pytest.mark.parametrize("place", ["folder", "memory://"])
def test_what_is_kept_is_found_by_its_digest(place: str, tmp_path: Path) -> None:
    store = Storage(place if "://" in place else str(tmp_path / place))
    digest = store.put(b"abc", "submissions")
    assert store.put(b"abc", "submissions") == digest
    assert store.get(digest, "submissions") == b"abc"
    with pytest.raises(StorageError, match="not in the store"):
        store.get(digest, "replays")


def test_what_is_damaged_is_not_given(tmp_path: Path) -> None:
    store = Storage(str(tmp_path))
    digest = store.put(b"abc", "submissions")
    (tmp_path / "submissions" / digest[:2] / digest).write_bytes(b"abd")
    with pytest.raises(StorageError, match="damaged"):
        store.get(digest, "submissions")


def test_settings_say_what_is_wrong(tmp_path: Path) -> None:
    assert load_settings(tmp_path).lease == 60.0
    for text in ("lease = 0", "leas = 1", "lease"):
        (tmp_path / "service.toml").write_text(text)
        with pytest.raises(InputError, match=r"service\.toml"):
            load_settings(tmp_path)


def test_a_secret_is_drawn_once_and_its_owner_s_alone(tmp_path: Path) -> None:
    first = secret_in(tmp_path, "k")
    assert secret_in(tmp_path, "k") == first
    assert (tmp_path / "k").stat().st_mode & 0o777 == 0o600
