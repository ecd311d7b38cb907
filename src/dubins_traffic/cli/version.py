"""What `--version` prints: the version, the commit, and the hash of the code."""

from __future__ import annotations

import json
from collections.abc import Iterator
from importlib import metadata
from pathlib import Path
from typing import Final

UNKNOWN: Final = "unknown"


def version_text(program: str) -> str:
    """Return three lines: the version, the commit that it was made from if that can be told, the hash of the code."""
    from dubins_traffic.campaign.manifest import hash_of_code

    found = next(_commits(program, Path(__file__).resolve().parents[3]), UNKNOWN)
    return f"{program} {metadata.version(program)}\ncommit {found}\ncode {hash_of_code()}"


def _commits(program: str, root: Path) -> Iterator[str]:
    """Yield the commit of a checkout, and that which pip has noted when it installed from one."""
    yield from commit_of(root)
    noted = metadata.distribution(program).read_text("direct_url.json")
    found = json.loads(noted).get("vcs_info", {}).get("commit_id") if noted else None
    if found:
        yield str(found)


def commit_of(root: Path) -> Iterator[str]:
    """Yield the commit that is checked out in a folder, read from its files; nothing if it is no checkout."""
    git = root / ".git"
    if git.is_file():
        git = root / git.read_text(encoding="utf-8").partition(":")[2].strip()
    head = git / "HEAD"
    if not head.is_file():
        return
    text = head.read_text(encoding="utf-8").strip()
    if not text.startswith("ref: "):
        yield text
        return
    name = text.removeprefix("ref: ")
    shared = git / "commondir"
    common = git / shared.read_text(encoding="utf-8").strip() if shared.is_file() else git
    if (common / name).is_file():
        yield (common / name).read_text(encoding="utf-8").strip()
    elif (common / "packed-refs").is_file():
        for line in (common / "packed-refs").read_text(encoding="utf-8").splitlines():
            if line.endswith(f" {name}"):
                yield line.partition(" ")[0]
