"""Which state of the package this is: its version, the commit it was built from, and a hash of its sources."""

from __future__ import annotations

import hashlib
import re
from functools import cache
from importlib.metadata import metadata, version
from pathlib import Path
from typing import NamedTuple

PACKAGE = Path(__file__).parent
BUILT = PACKAGE / "commit.txt"
"""Written into wheels when they are built (`setup.py`)."""


class Release(NamedTuple):
    """What identifies the code that runs.

    Attributes
    ----------
    version : str
        The version of the package.
    commit : str or None
        The commit it was built from, or that is checked out; None where that can't be known.
    sources : str
        SHA-256 over the names and bytes of the package's Python files, hexadecimal: the same code has the same one,
        however it was installed.
    """

    version: str
    commit: str | None
    sources: str


def release() -> Release:
    """Return which state of the package this is."""
    return Release(version("dubins-traffic"), _commit(), sources_hash())


def homepage() -> str:
    """Return the address of the project's site, as the package's metadata have it."""
    named = dict(entry.split(", ", 1) for entry in metadata("dubins-traffic").get_all("Project-URL", []))
    return named["Homepage"]


@cache
def sources_hash() -> str:
    """Return one hash over the sources of this package."""
    digest = hashlib.sha256()
    for path in sorted(PACKAGE.rglob("*.py")):
        digest.update(path.relative_to(PACKAGE).as_posix().encode() + b"\0" + path.read_bytes())
    return digest.hexdigest()


def _commit() -> str | None:
    """Return the commit that a wheel names, or that the checkout which holds the package is at."""
    if BUILT.exists():
        return BUILT.read_text(encoding="ascii").strip() or None
    root = PACKAGE.parents[1]
    return commit_of(root) if (root / "pyproject.toml").exists() else None


def commit_of(checkout: Path) -> str | None:
    """Return the commit that a checkout is at, None if it is none."""
    git = checkout / ".git"
    if not git.exists():
        return None
    folder = git if git.is_dir() else Path(git.read_text(encoding="utf-8").removeprefix("gitdir: ").strip())
    return _resolved(folder, (folder / "HEAD").read_text(encoding="utf-8").strip())


def _resolved(folder: Path, head: str) -> str | None:
    """Return the commit that a HEAD is at."""
    name = head.removeprefix("ref: ")
    if name == head:
        return head
    common = folder / "commondir"
    places = [folder, (folder / common.read_text(encoding="utf-8").strip()).resolve()] if common.exists() else [folder]
    for place in places:
        if (place / name).is_file():
            return (place / name).read_text(encoding="ascii").strip()
        packed = place / "packed-refs"
        match = packed.is_file() and re.search(
            rf"^([0-9a-f]{{40,64}}) {re.escape(name)}$", packed.read_text(encoding="utf-8"), re.MULTILINE
        )
        if match:
            return str(match[1])
    return None
