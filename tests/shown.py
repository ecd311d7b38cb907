"""The blocks of code that pages show, and what a comment above a block says of how it is tested.

The comment is ``<!-- test: MARK; MARK -->`` in the line before the fence. Marks:

============================  ==========================================================================================
``not run: REASON``           The block can't run in a test.
``test-all: REASON``          It runs where `DUBINS_TRAFFIC_PAGES` is ``all``, as in ``make test-all``.
``run by FILE``               Another test runs it.
``file NAME``                 It is the content of this file; so is a block whose first line is ``# NAME``.
``output``                    It is what the block before prints, ``...`` for anything; so is what has no language.
``configuration``             It is a part of a configuration, which can be read and drawn from.
``campaign``                  It is the file of a campaign, which can be read.
``excerpt of FILE``           Its lines stand in this file, one after the other.
``status N``                  It ends with this exit status; ``N or M``: with one of these.
``beside``                    It runs beside what follows, as in a shell of its own, and must end by itself.
``until TEXT``                What follows waits until it has said this.
``ended``                     It does not end by itself; it is ended when all others have.
``then all ends``             After this block what runs beside is waited for.
============================  ==========================================================================================
"""

from __future__ import annotations

import re
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
DOCS = ROOT / "docs"
FENCE = re.compile(r"(?:^<!-- test: ([^\n]*) -->\n)?^```([\w-]*)\n(.*?)^```$", re.MULTILINE | re.DOTALL)
NAMED = re.compile(r"# (\w+\.(?:py|toml))\n")
COMMAND = re.compile(r"\n\n    (?:\$ )?(?:dubins-traffic|python3?|pip|import|from|make) \S", re.MULTILINE)
SHELL = {"sh", "bash"}
KEYS = (
    "not run", "test-all", "run by", "file", "output", "configuration", "campaign", "excerpt of", "status", "beside",
    "until", "ended", "then all ends",
)  # fmt: skip


@dataclass(frozen=True)
class Block:
    """A block of a page: its language, its text, the line in which it begins, and its comment."""

    language: str
    code: str
    line: int
    comment: str

    @cached_property
    def marks(self) -> dict[str, str]:
        """What the comment says, by mark."""
        found: dict[str, str] = {}
        for mark in filter(None, (part.strip() for part in self.comment.split(";"))):
            key = next((key for key in KEYS if re.match(rf"{key}(?:$|[ :])", mark)), None)
            assert key is not None, f"line {self.line}: no such mark: {mark}"
            found[key] = mark.removeprefix(key).lstrip(": ")
        return found

    @property
    def runs(self) -> bool:
        return self.language in SHELL | {"python"} and self.file is None and "excerpt of" not in self.marks

    @property
    def file(self) -> str | None:
        """Name of the file whose content it is."""
        named = NAMED.match(self.code)
        return self.marks.get("file") or (named[1] if named else None)

    @property
    def statuses(self) -> list[int]:
        """Exit statuses with which it may end."""
        return [int(word) for word in self.marks.get("status", "0").split(" or ")]

    @property
    def output(self) -> bool:
        return "output" in self.marks or not self.language


def blocks(page: Path) -> list[Block]:
    """Return the blocks of a page, in order."""
    text = page.read_text(encoding="utf-8")
    return [
        Block(found[2], found[3], text.count("\n", 0, found.start(2)) + 1, found[1] or "")
        for found in FENCE.finditer(text)
    ]


def all_pages() -> dict[str, Path]:
    """Return the pages that readers have, by their names: paths from `docs`, README and those of the site."""
    inside = {path.relative_to(DOCS).as_posix(): path for path in sorted(DOCS.rglob("*.md"))}
    return inside | {name: ROOT / name for name in ("README.md", "CONTRIBUTING.md", "website/index.md")}


def as_shown(shown: str, said: str) -> list[str]:
    """Return the lines of a shown output that were not said, in this order; blanks and ``...`` stand for any."""
    missing: list[str] = []
    lines = [bare(line) for line in said.splitlines()]
    for line in filter(None, map(bare, shown.splitlines())):
        pattern = re.compile(re.escape(line).replace(r"\.\.\.", ".*"))
        at = next((k for k, own in enumerate(lines) if pattern.fullmatch(own)), None)
        if at is None:
            missing.append(line)
        else:
            lines = lines[at + 1 :]
    return missing


def bare(line: str) -> str:
    """Return a line without the rules of tables, and with one blank where there are several."""
    return " ".join(re.sub("[\u2500-\u257f]", " ", line).split())
