"""Unpacked images: kept while they are used, and removed when another is unpacked long after."""

from __future__ import annotations

import os
import time
from pathlib import Path

import pytest

from dubins_traffic.sandbox import images


def test_images_that_nobody_uses_are_removed(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Podman's part is left out: what it makes of an archive is a folder with a description."""

    def unpack(_archive: Path, _store: Path, place: Path) -> None:
        (place / "root").mkdir(parents=True)
        (place / "image.json").write_text('{"command": [], "environment": {}, "folder": "/"}')

    monkeypatch.setattr(images, "_unpack", unpack)
    store, roots = tmp_path / "store", list[Path]()
    for name in ("unused", "used", "new"):
        (tmp_path / name).write_text(name)
    for name in ("unused", "used"):
        roots.append(Path(images.unpacked(tmp_path / name, store).root))
    long_ago = time.time() - images.KEPT_S - 60.0
    for root in roots:
        os.utime(root.parent, (long_ago, long_ago))
    images.unpacked(tmp_path / "used", store)
    assert all(root.is_dir() for root in roots)
    images.unpacked(tmp_path / "new", store)
    assert [root.is_dir() for root in roots] == [False, True]
    assert len(list(store.iterdir())) == 2
