"""The modules of the package as the tests of the house read them, and what they still let pass.

python -m tests.architecture.house         take out of tests/architecture/still.json what has been mended
python -m tests.architecture.house --add   and let pass all that is found
"""

from __future__ import annotations

import ast
import json
import sys
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import TypeAlias

ROOT = Path(__file__).parents[2]
SOURCES = ROOT / "src"
PACKAGE = SOURCES / "dubins_traffic"
GENERATED = PACKAGE / "transports" / "lcm" / "dubins_traffic_lcm"
"""What another program has written."""
STILL = Path(__file__).parent / "still.json"
"""What is not mended yet; each list may only shrink."""

Findings: TypeAlias = Mapping[str, str | int]
"""What is not as the house has it, by a key: a number, or a word about it."""
Function: TypeAlias = ast.FunctionDef | ast.AsyncFunctionDef
Definition: TypeAlias = Function | ast.ClassDef


@dataclass(frozen=True)
class Module:
    """A module of the package."""

    path: Path
    text: str
    tree: ast.Module

    @property
    def name(self) -> str:
        """The name below the package, with dots; empty for the package itself."""
        parts = self.path.relative_to(PACKAGE).with_suffix("").parts
        return ".".join(parts[:-1] if parts[-1] == "__init__" else parts)

    def definitions(self) -> Iterator[Definition]:
        """Yield all classes and functions, at whatever depth."""
        for node in ast.walk(self.tree):
            if isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef | ast.ClassDef):
                yield node


@cache
def modules() -> tuple[Module, ...]:
    """Return the modules that people have written, in the order of their paths."""
    paths = [path for path in sorted(PACKAGE.rglob("*.py")) if GENERATED not in path.parents]
    texts = [path.read_text(encoding="utf-8") for path in paths]
    return tuple(Module(path, text, ast.parse(text)) for path, text in zip(paths, texts, strict=True))


def still(what: str) -> dict[str, str | int]:
    """Return what a list of `STILL` lets pass, each with the reason or the number that it may not exceed."""
    return json.loads(STILL.read_text(encoding="utf-8")).get(what, {}) if STILL.exists() else {}


def main() -> int:
    """Take out of `STILL` what has been mended, and let its numbers fall; add what is new only with ``--add``."""
    from tests.architecture import findings

    add = "--add" in sys.argv[1:]
    known = {what: dict(still(what)) for what in findings.CHECKS}
    for what, check in findings.CHECKS.items():
        found = check()
        new = sorted(found.keys() - known[what].keys())
        for key in new:
            print(f"{what}: {key}: {found[key]}{'' if add else ' (to be mended)'}", file=sys.stderr)
        kept = [key for key in found if key in known[what] or add]
        known[what] = {key: _lesser(known[what].get(key, found[key]), found[key], add) for key in sorted(kept)}
        print(f"{what}: {len(known[what])} left")
    STILL.write_text(json.dumps(known, indent=1, sort_keys=True) + "\n", encoding="utf-8")
    return 0


def _lesser(known: str | int, found: str | int, add: bool) -> str | int:
    """Return what to let pass: of two numbers the smaller, unless all that is found is let pass."""
    return found if add or isinstance(found, str) or isinstance(known, str) else min(known, found)


if __name__ == "__main__":
    sys.exit(main())
