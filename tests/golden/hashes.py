"""The golden hashes: what trials, batches, campaigns and games give, and that it stays.

    python -m tests.golden.hashes            compare with tests/golden/hashes.json; status 1 if anything differs
    python -m tests.golden.hashes --write    write the file anew
    python -m tests.golden.hashes PATTERN... only cases whose name matches one of them, as agent/*

A hash that changes on purpose is listed with its reason in tests/golden/EXCEPTIONS.md.
"""

from __future__ import annotations

import argparse
import hashlib
import json
import sys
import tempfile
from fnmatch import fnmatch
from pathlib import Path

from tests.golden.cases import Case, cases

FILE = Path(__file__).parent / "hashes.json"


def hashes(case: Case) -> dict[str, str]:
    """Return the hash of each part of a case."""
    with tempfile.TemporaryDirectory() as folder:
        return {part: hashlib.sha256(data).hexdigest()[:20] for part, data in case(Path(folder))}


def golden() -> dict[str, dict[str, str]]:
    """Return the golden hashes by case and part."""
    return json.loads(FILE.read_text(encoding="utf-8"))


def differences(name: str, found: dict[str, str], expected: dict[str, str] | None) -> list[str]:
    """Return a line for each part in which a case differs from what is expected of it."""
    if expected is None:
        return [f"{name}: new"]
    parts = sorted(found.keys() | expected.keys())
    return [f"{name}: {part} differs" for part in parts if found.get(part) != expected.get(part)]


def main() -> int:
    """Compare or write the hashes; return the exit status."""
    reader = argparse.ArgumentParser(prog="python -m tests.golden.hashes")
    reader.add_argument("patterns", nargs="*", default=["*"])
    reader.add_argument("--write", action="store_true")
    given = reader.parse_args()
    expected = golden() if FILE.exists() else {}
    some = {name: case for name, case in cases().items() if any(fnmatch(name, own) for own in given.patterns)}
    found: dict[str, dict[str, str]] = {}
    lines: list[str] = []
    for k, (name, case) in enumerate(some.items(), 1):
        print(f"\r{k} of {len(some)}", end="", file=sys.stderr)
        found[name] = hashes(case)
        lines += differences(name, found[name], expected.get(name))
    print(file=sys.stderr)
    print("\n".join([*lines, f"{len(some)} cases, {len(lines)} differences"]))
    if given.write:
        kept = {name: expected[name] for name in expected if name in cases()} | found
        FILE.write_text(json.dumps(kept, indent=0, sort_keys=True) + "\n", encoding="utf-8")
        return 0
    return 1 if lines else 0


if __name__ == "__main__":
    sys.exit(main())
