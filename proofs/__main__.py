"""Prove the obligations, show that planted flaws are refuted, and write the page that says what is covered."""

from __future__ import annotations

import argparse
import sys
import time
from pathlib import Path
from typing import Final

from dubins_traffic.files import write_text
from proofs.claims import RefutedError
from proofs.obligations import FLAWS, OBLIGATIONS, planted

PAGE: Final = Path(__file__).resolve().parents[1] / "docs" / "proofs.md"
MARK: Final = "<!-- made by python -m proofs --page -->\n"


def table() -> str:
    """Return the table of the obligations."""
    lines = ["| obligation | says | covers | code that is run | stated in |", "|---|---|---|---|---|"]
    for one in OBLIGATIONS.values():
        code = ", ".join(f"`{name}`" for name in one.code)
        page = one.lemma.partition("#")[0]
        lines.append(f"| `{one.name}` | {one.says} | {one.covers} | {code} | [{page}]({one.lemma}) |")
    return "\n".join(lines) + "\n"


def page() -> str:
    """Return the page with the table as it is now."""
    head, _, rest = PAGE.read_text(encoding="utf-8").partition(MARK)
    return head + MARK + table() + MARK + rest.partition(MARK)[2]


def proved(name: str) -> bool:
    """Prove an obligation, and say what came of it."""
    began = time.monotonic()
    try:
        cases = OBLIGATIONS[name].prove()
    except RefutedError as error:
        print(f"{name}: refuted: {error}", flush=True)
        return False
    print(f"{name}: proved, {cases} cases, {time.monotonic() - began:.1f} s", flush=True)
    return cases > 0


def flaws_are_refuted(names: list[str]) -> bool:
    """Plant each flaw, and tell whether its obligation is refuted each time."""
    passed: list[str] = []
    for flaw in FLAWS:
        if flaw.obligation not in names:
            continue
        print(
            f"flaw in {flaw.module.__name__.partition('.')[2]}, {flaw.wrong.strip() or 'a line less'!r}: ",
            end="",
        )
        with planted(flaw):
            if proved(flaw.obligation):
                passed.append(flaw.right)
    if passed:
        print(f"flaws that passed: {passed}", file=sys.stderr)
    return not passed


def main() -> int:
    """Do as the command line says; 1 if something is refuted that should hold, or a flaw passes."""
    parser = argparse.ArgumentParser(prog="python -m proofs")
    parser.add_argument("names", nargs="*", metavar="NAME", help="obligations; all unless named")
    parser.add_argument("--flaws", action="store_true", help="plant flaws, too, each of which must be refuted")
    parser.add_argument("--page", action="store_true", help="write the table of docs/proofs.md anew, and prove nothing")
    asked = parser.parse_args()
    unknown = [name for name in asked.names if name not in OBLIGATIONS]
    if unknown:
        parser.error(f"no such obligation: {unknown[0]}; there are {', '.join(OBLIGATIONS)}")
    if asked.page:
        write_text(PAGE, page())
        return 0
    names = asked.names or list(OBLIGATIONS)
    holds = [proved(name) for name in names]
    return 0 if all(holds) and (not asked.flaws or flaws_are_refuted(names)) else 1


if __name__ == "__main__":
    raise SystemExit(main())
