"""Realizability by TuLiP; run by an interpreter that has it.

Each line of the standard input is a JSON list of Python files that define `specification`; for each line one is
written that says of each of them whether it is realizable.
"""

from __future__ import annotations

import json
import sys


def main() -> None:
    """Answer requests."""
    from tulip.interfaces import omega

    for line in sys.stdin:
        answers: list[bool] = []
        for text in json.loads(line):
            names: dict[str, object] = {}
            exec(text, names)
            answers.append(bool(omega.is_realizable(names["specification"])))
        sys.stdout.write("\n" + json.dumps(answers) + "\n")
        sys.stdout.flush()


if __name__ == "__main__":
    main()
