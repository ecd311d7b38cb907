"""This tree against another one, by turns: `python -m benchmarks.against TREE [NAME...]`.

`TREE` is a checkout of another commit (`git worktree add TREE COMMIT`), measured with its own sources and its own
benchmarks. Each named benchmark (by default `batch`, `world`, `motion`, `monitors` and `synthesis`) runs in both trees
by turns. The first round compiles and is not counted. Of each row that both trees have, the best figure of the other
rounds counts. Ratios are speeds here over speeds there, whatever the row's unit: above 1 this tree is faster.
"""

from __future__ import annotations

import json
import os
import re
import subprocess
import sys
from collections.abc import Mapping
from pathlib import Path

from benchmarks.table import Row, show

HERE = Path(__file__).parents[1]
NAMES = ("batch", "world", "motion", "monitors", "synthesis")
ROUNDS = 3
MEASURE = """
import importlib, json, sys
rows = importlib.import_module("benchmarks." + sys.argv[1]).measure()
print(json.dumps({row.name: row.figure for row in rows}))
"""
FIGURE = re.compile(r"(?P<number>\d+(?:\.\d+)?(?:e[+-]?\d+)?) (?P<unit>[\w-]+/s|trials/s|ms|s)\b")
"""A speed or a time; a row whose figure begins with neither is not compared."""


def measure(other: Path, name: str) -> list[Row]:
    """Return a row for each figure of a benchmark that this tree and another one have."""
    figures = [_figures(tree, name) for _ in range(ROUNDS + 1) for tree in (other, HERE)][2:]
    there, here = _best(figures[0::2]), _best(figures[1::2])
    return [
        Row(
            row,
            f"{here[row][0]:.3g} {here[row][1]}, {_ratio(here[row], there[row]):.3f} times the other's speed",
            "",
            True,
        )
        for row in here
        if row in there and here[row][1] == there[row][1]
    ]


def _figures(tree: Path, name: str) -> dict[str, tuple[float, str]]:
    """Return number and unit of each row that one run of a benchmark of a tree gives."""
    print(f"{name} in {tree}", file=sys.stderr)
    around = os.environ | {
        "PYTHONPATH": f"{tree / 'src'}{os.pathsep}{tree}",
        "DUBINS_TRAFFIC_KERNELS": "compiled",
    }
    ran = subprocess.run(
        [sys.executable, "-c", MEASURE, name],
        cwd=tree,
        env=around,
        check=True,
        stdout=subprocess.PIPE,
        text=True,
    )
    rows: Mapping[str, str] = json.loads(ran.stdout.splitlines()[-1])
    found = {row: FIGURE.match(figure) for row, figure in rows.items()}
    return {row: (float(match["number"]), match["unit"]) for row, match in found.items() if match}


def _best(rounds: list[dict[str, tuple[float, str]]]) -> dict[str, tuple[float, str]]:
    """Return the greatest speed and the least time of each row over some rounds."""
    best: dict[str, tuple[float, str]] = {}
    for row, (number, unit) in (item for figures in rounds for item in figures.items()):
        better = max if unit.endswith("/s") else min
        best[row] = (better(number, best[row][0]) if row in best else number, unit)
    return best


def _ratio(here: tuple[float, str], there: tuple[float, str]) -> float:
    return here[0] / there[0] if here[1].endswith("/s") else there[0] / here[0]


def main(arguments: list[str]) -> int:
    """Compare the named benchmarks with those of another tree."""
    other = Path(arguments[0]).resolve() if arguments else None
    if other is None or not (other / "benchmarks").is_dir():
        print(
            "benchmarks.against: expected TREE [NAME...], TREE a checkout of another commit with its benchmarks",
            file=sys.stderr,
        )
        return 2
    for name in arguments[1:] or NAMES:
        show(f"{name}, against {other}", measure(other, name))
    return 0


if __name__ == "__main__":
    raise SystemExit(main(sys.argv[1:]))
