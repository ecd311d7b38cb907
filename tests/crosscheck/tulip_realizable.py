"""Realizability by TuLiP; run by an interpreter that has it.

Reads Python files that define `specification` from the standard input, a JSON list; writes for each whether it is
realizable.
"""

from __future__ import annotations

import json
import sys


def main() -> None:
    """Answer one request."""
    from tulip.interfaces import omega

    answers: list[bool] = []
    for text in json.load(sys.stdin):
        names: dict[str, object] = {}
        exec(text, names)
        answers.append(bool(omega.is_realizable(names["specification"])))
    sys.stdout.write("\n" + json.dumps(answers) + "\n")


if __name__ == "__main__":
    main()
