"""The moving pictures that pages show are those that their commands make."""

from __future__ import annotations

import re
from pathlib import Path

from PIL import Image

PICTURES = Path(__file__).parents[1] / "docs" / "pictures"
MOVING = re.compile(r"!\[[^\]]+\]\((?:\.\./)?(?:docs/)?pictures/([\w-]+\.gif)\)")


def assert_made(page: str, folder: Path, every: int = 25) -> list[int]:
    """See that the folder in which a page was followed has each moving picture of the page; return their lengths."""
    return [assert_same_frames(folder / name, PICTURES / name, every) for name in MOVING.findall(page)]


def assert_same_frames(made: Path, kept: Path, every: int) -> int:
    """See that two moving pictures show the same in every so many frames, and that the one kept is small."""
    assert kept.stat().st_size < 1_000_000
    with Image.open(made) as new, Image.open(kept) as old:
        length: int = old.n_frames  # pyright: ignore[reportAttributeAccessIssue]
        assert new.n_frames == length  # pyright: ignore[reportAttributeAccessIssue]
        for number in range(0, length, every):
            new.seek(number)
            old.seek(number)
            assert new.convert("RGB").tobytes() == old.convert("RGB").tobytes(), (kept.name, number)
    return length
