"""How small do cases get: fresh ones of the built-in drivers and of all mutants, from small crossings and from a town.

    python -m experiments shrinking
    python -m experiments.shrinking [CASES] [--rows FILE] [--worlds NAME...]

CASES cases of `lanes`, as many of `simple` and one of each mutant that tests plant are taken from searches of the
crossing of `junction`, and as many from a town of nine intersections with eight cars (`CITY`), the first that each
search finds. Each is judged afresh, shrunk, and then everything that could still be taken away is tried once more. A
case is a line of FILE as soon as it is shrunk, and is not shrunk again as long as the search and the mutants are the
same.
"""

from __future__ import annotations

import argparse
import json
import time
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

from benchmarks.table import Row, show
from tests.cases_again import driver_of, judged_afresh, still_broken
from tests.mutant_searches import TOWN, found_cases
from tests.mutants import MUTANTS

import dubins_traffic as dt
from dubins_traffic.falsification.case import Case
from dubins_traffic.problem.configuration import Configuration
from experiments.falsify import code_of_searches

CASES = 4
"""Of each built-in driver in each world."""
SEED, TRIALS = 100, 20_000
ROWS = Path("build/shrinking-rows.jsonl")
CITY: dict[str, Any] = {
    **TOWN, "network": {"grid": {"rows": 3, "columns": 3, "length": 6.0}},
    "e-agents": [{"type": "lawful", "name": "car", "count": 7}],
}  # fmt: skip
"""Nine intersections and seven other cars."""
WORLDS = {"junction": dt.load_config("junction"), "city": Configuration.from_document(CITY)}
MOST, SHARE = 3, 0.8
"""So many cars, the ego among them, has at least this share of the cases when they are shrunk."""


def measure(cases: int = CASES, file: Path = ROWS, worlds: Sequence[str] = tuple(WORLDS)) -> list[Row]:
    """Return the rows of this experiment."""
    rows: list[Row] = []
    for world in worlds:
        found = list(shrunk(world, cases, file))
        small = sum(own["cars"] <= MOST for own in found)
        least = [own for own in found if not own["more"]]
        before = sum(own["before"] for own in found) / max(1, len(found))
        told = f"{small} of {len(found)} ({small / max(1, len(found)):.0%}), of {before:.1f} cars on average"
        bar = f">= {SHARE:.0%}"
        rows.append(Row(f"{world}: shrunk cases of at most {MOST} cars", told, bar, small >= SHARE * len(found)))
        told = f"{len(least)} of {len(found)}"
        rows.append(
            Row(
                f"{world}: shrunk cases that lose the breach with any one thing less",
                told,
                "all",
                least == found,
            )
        )
    return rows


def shrunk(world: str, cases: int, file: Path) -> Iterator[dict[str, Any]]:
    """Yield what comes of the cases of a world, one after another."""
    code = code_of_searches()
    known: dict[tuple[str, str, int], dict[str, Any]] = {}
    for line in file.read_text().splitlines() if file.exists() else []:
        row = json.loads(line)
        if row["code"] == code:
            known[row["world"], row["driver"], row["number"]] = row
    wanted = {"lanes": cases, "simple": cases, **dict.fromkeys(MUTANTS, 1)}
    for driver, count in wanted.items():
        if all((world, driver, number) in known for number in range(count)):
            yield from (known[world, driver, number] for number in range(count))
            continue
        kind = MUTANTS[driver].kind if driver in MUTANTS else driver
        for number, case in enumerate(found_cases(WORLDS[world], kind, count, SEED, TRIALS)):
            if (world, driver, number) not in known:
                own = {"world": world, "driver": driver, "number": number, "code": code, **_made_small(case)}
                known[world, driver, number] = own
                file.parent.mkdir(parents=True, exist_ok=True)
                with file.open("a") as lines:
                    lines.write(json.dumps(own) + "\n")
                told = f"{own['before']} cars, now {own['cars']}, {own['seconds']} s of a processor"
                print(f"{world}, {driver}: {own['case']}: {told}", flush=True)
            yield known[world, driver, number]


def _made_small(case: Case) -> dict[str, Any]:
    """Return what comes of a case that is judged and shrunk, and what could still be taken away from it."""
    began = time.process_time()
    driver = driver_of(case)
    judged_afresh(case, driver)
    small = dt.shrink(case, driver)
    return {
        "case": case.story.rule, "before": len(case.instance.starts), "cars": len(small.instance.starts),
        "more": still_broken(small, driver), "seconds": round(time.process_time() - began, 1),
    }  # fmt: skip


def _arguments() -> argparse.Namespace:
    parser = argparse.ArgumentParser(prog="experiments.shrinking")
    parser.add_argument("cases", type=int, nargs="?", default=CASES)
    parser.add_argument("--rows", type=Path, default=ROWS)
    parser.add_argument("--worlds", nargs="+", choices=list(WORLDS), default=list(WORLDS))
    return parser.parse_args()


if __name__ == "__main__":
    given = _arguments()
    raise SystemExit(not show("shrinking", measure(given.cases, given.rows, given.worlds)))
