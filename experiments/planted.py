"""Does a search find a hole in the norm? Each is planted, and looked for by the targets `blocked` and `provoked`.

    python -m experiments planted
    python -m experiments.planted [--trials N] [--first N] [--holes NAME,...]

For each hole of `experiments.planted_norms` a search runs, in a process of its own, on a copy of the package in which
the hole is open, for as many trials as `--first` says, 512 unless said otherwise, and if it has found no breach of the
contract by then, until it has or N trials are over, 20,000 unless said otherwise. The same first trials are searched on
the same copy with no hole. The copies and the searches are in `build/planted`; what was interrupted goes on. The first
time the copy is compiled: minutes.
"""

from __future__ import annotations

import argparse
import json
import os
import subprocess
import sys
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

from benchmarks.table import Row, show

from dubins_traffic.falsification.search import Search, falsify
from dubins_traffic.problem.configuration import Configuration
from experiments.contract import OBSTACLE, SOON, WAITING
from experiments.planted_norms import EXIT, FLIPS, HOLE, NONE, QUEUE, REST, SAYS, TURNS, digest, plant

ROOT: Final = Path(__file__).resolve().parents[1]
FOLDER: Final = ROOT / "build" / "planted"
TRIALS, FIRST = 20_000, 512
SEED: Final = 1
ELBOW: Final = [[0, 0, 1, 0], [1, 0, 1, 1], [1, 1, 2, 1]]
RING: Final = [[0, 0, 1, 0], [0, 0, 0, 1], [1, 0, 1, 1], [0, 1, 1, 1]]
STANDS: Final = "experiments.free_egos:Stands"


def world(segments: list[list[int]], agents: list[dict[str, Any]], seconds: float, **more: Any) -> dict[str, Any]:
    """Return a configuration whose goals are the first and the last intersection."""
    height, width = (1 + max(max(row[k::2]) for row in segments) for k in (1, 0))
    return {
        "version": 1, "problem_domain": "dubins_traffic", "rules": True, "duration": seconds, "rate": 10,
        "goals": [[0, 0], [width - 1, height - 1]], "e-agents": agents,
        "rnd": {"version": 0, "length": 3.5, "transform": [0, 0, 0], "shape": [height, width], "segments": segments},
    } | more  # fmt: skip


RESTING: Final = WAITING | {"rules": SOON | {"linger_distance": 0.1}}
"""Where a car rests that has not moved a decimetre in ten seconds: it need not go round the ring to keep from that."""
LAWFUL: Final = [{"type": "lawful", "name": "lawful", "count": 3}]


@dataclass(frozen=True, slots=True)
class Hole:
    """A hole, the search that is to find it, and who drives there."""

    number: int
    target: str
    controller: str
    world: dict[str, Any]


HOLES: Final = {
    "rest": Hole(REST, "blocked", "rules", RESTING),
    "exit": Hole(
        EXIT, "provoked", STANDS,
        world(RING, LAWFUL, 60.0, car={"body": {"rectangle": {"length": 0.62, "width": 0.28}}}),
    ),
    "queue": Hole(QUEUE, "provoked", STANDS, world(ELBOW, LAWFUL, 120.0, rules={"crossing_degree": 1})),
    "flips": Hole(FLIPS, "blocked", "rules", OBSTACLE),
    "turns": Hole(TURNS, "blocked", "rules", WAITING),
}  # fmt: skip


class _FoundError(Exception):
    """A search has found what it was to find."""


def search(name: str, first: int, trials: int, folder: Path) -> dict[str, Any]:
    """Search in this process, as it is, for `first` trials, and on to `trials` while nothing has been found.

    Returns after how many trials the first breach was, and how many had one.
    """
    own = HOLES[name]

    def look(search: Search) -> None:
        if search.counts.trials >= first and search.found_in:
            raise _FoundError

    with suppress(_FoundError):
        falsify(
            Configuration.from_document(own.world), own.controller, folder, rules=[own.target], trials=trials,
            seed=SEED, duration=None, resume=folder.exists(), progress=look,
        )  # fmt: skip
    state = json.loads((folder / "search.json").read_text())
    found_in = min(state["found_in"].values(), default=None)
    return {
        "first": None if found_in is None else 1 + found_in, "trials": state["trials"],
        "violated": state["violated"], "discarded": state["discarded"], "cases": state["cases"],
    }  # fmt: skip


def searched(name: str, hole: int, first: int, trials: int) -> dict[str, Any]:
    """Search in a process of its own, on a copy of the package with a hole, or with none; print what came of it."""
    tree = plant(FOLDER / digest())
    folder = tree / f"{name}-{hole}"
    paths = os.pathsep.join([str(tree), str(ROOT)])
    more = {HOLE: str(hole), "PYTHONPATH": paths, "DUBINS_TRAFFIC_KERNELS": "compiled"}
    words = [
        sys.executable,
        "-m",
        "experiments.planted",
        "--child",
        name,
        str(first),
        str(trials),
        str(folder),
    ]
    told = subprocess.run(words, env=os.environ | more, stdout=subprocess.PIPE, text=True, check=True).stdout
    found: dict[str, Any] = json.loads(told.splitlines()[-1])
    print(f"{name}, hole {hole}: {found}", flush=True)
    return found


def measure(trials: int = TRIALS, first: int = FIRST, names: tuple[str, ...] = tuple(HOLES)) -> list[Row]:
    """Return the rows of this experiment."""
    rows: list[Row] = []
    for name in names:
        own = HOLES[name]
        found, without = searched(name, own.number, first, trials), searched(name, NONE, first, first)
        when = "not found" if found["first"] is None else f"in trial {found['first']:,}"
        told = (
            f"{when}; {found['violated']:,} of {found['trials']:,} trials, "
            f"without the hole {without['violated']:,} of {without['trials']:,}"
        )
        more = found["violated"] * without["trials"] > without["violated"] * found["trials"]
        is_bar = own.number != TURNS
        bar = f"<= {TRIALS:,}" if is_bar else ""
        rows.append(Row(f"{SAYS[own.number]}: `{own.target}` found", told, bar, more or not is_bar))
    return rows


def main() -> int:
    """Run what is asked for, and print the table."""
    if sys.argv[1:2] == ["--child"]:
        name, first, trials, folder = sys.argv[2:6]
        print(json.dumps(search(name, int(first), int(trials), Path(folder))))
        return 0
    parser = argparse.ArgumentParser(prog="experiments.planted")
    parser.add_argument("--trials", type=int, default=TRIALS)
    parser.add_argument("--first", type=int, default=FIRST)
    parser.add_argument("--holes", default=",".join(HOLES), metavar="NAME,...")
    asked = parser.parse_args()
    return 0 if show("planted", measure(asked.trials, asked.first, tuple(asked.holes.split(",")))) else 1


if __name__ == "__main__":
    raise SystemExit(main())
