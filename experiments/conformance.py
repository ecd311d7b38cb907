"""The scenes of the contract at length: who blocks the ego breaks a rule, and no clean ego provokes a lawful car.

    python -m experiments conformance
    python -m experiments.conformance [--trials N] [--jobs J] [--seconds S] [--store]

The scenes of `tests.contract_scenes` are run 300 s each, all of them by turns, on grids, random and bent networks, with
three bodies, at 10 and 30 Hz: 2,240 trials unless said otherwise, of which more than 2,000 count. What came of each is
a line of a file below `build/conformance`, which is of the sources, so an interrupted run goes on; after S seconds no
trial begins. With --store the trials so far are kept as the result of the experiment.
"""

from __future__ import annotations

import argparse
import json
import time
from collections.abc import Sequence
from concurrent.futures import FIRST_COMPLETED, Future, ProcessPoolExecutor, wait
from dataclasses import asdict
from pathlib import Path
from typing import Final

from benchmarks.table import Row, show
from tests.contract_blocking import BLOCKING
from tests.contract_provoking import PROVOKING, UNCLAIMED
from tests.contract_scenes import SCENES, Came, trial

from experiments.stored import code, store, write_page

ROOT: Final = Path(__file__).resolve().parents[1]
FOLDER: Final = ROOT / "build" / "conformance"
SCENE_FILES: Final = tuple(sorted((ROOT / "tests").glob("contract_*.py")))
TRIALS, SECONDS, JOBS = 2240, 300.0, 2


def scene(place: int) -> tuple[str, int]:
    """Return which scene a trial shows, and its variation."""
    names = list(SCENES)
    return names[place % len(names)], place // len(names)


def known(file: Path) -> dict[tuple[str, int], Came]:
    """Return what a file says of trials, by scene and variation."""
    found: dict[tuple[str, int], Came] = {}
    for line in file.read_text().splitlines() if file.exists() else []:
        row = json.loads(line)
        own = Came(**{**row, "own": tuple(row["own"]), "others": tuple(row["others"])})
        found[own.name, own.number] = own
    return found


def came(trials: int = TRIALS, jobs: int = JOBS, seconds: float | None = None) -> list[Came]:
    """Run the trials that no file tells of, in `jobs` processes, for some seconds; return all that are known."""
    file = FOLDER / f"{code(*SCENE_FILES)}.jsonl"
    file.parent.mkdir(parents=True, exist_ok=True)
    places = [scene(place) for place in range(trials)]
    found = known(file)
    left = iter([place for place in places if place not in found])
    end = time.monotonic() + (seconds if seconds is not None else float("inf"))
    under_way: set[Future[Came]] = set()
    with ProcessPoolExecutor(jobs) as pool, file.open("a") as out:
        while True:
            while len(under_way) < 2 * jobs and time.monotonic() < end:
                place = next(left, None)
                if place is None:
                    break
                under_way.add(pool.submit(trial, *place, SECONDS))
            if not under_way:
                break
            done, under_way = wait(under_way, return_when=FIRST_COMPLETED)
            for own in (future.result() for future in done):
                found[own.name, own.number] = own
                out.write(json.dumps(asdict(own)) + "\n")
                out.flush()
                if failed(own):
                    print(own, flush=True)
    return [found[place] for place in places if place in found]


def failed(own: Came) -> bool:
    """Tell whether a trial misses its bar."""
    if own.name in BLOCKING:
        return bool(own.own) or own.waited > own.bound
    return bool(own.others) and not own.own


def bars(found: Sequence[Came]) -> list[Row]:
    """Return the table of the bars."""
    rows: list[Row] = []
    admitted = [own for own in found if own.admitted]
    blocking = [own for own in admitted if own.name in BLOCKING]
    provoking = [own for own in admitted if own.name in PROVOKING and not own.own]
    unclaimed = [own for own in admitted if own.name in UNCLAIMED and not own.own]
    for name, own, says, bar in (
        ("who blocks", blocking, "the ego waits longer than the bound, or breaks a rule first", "0"),
        ("who provokes", provoking, "a lawful car breaks a rule", "0"),
        (
            "who presses against rectangles in a bend, not claimed",
            unclaimed,
            "a lawful car breaks a rule",
            "",
        ),
    ):
        missed = [one for one in own if failed(one)]
        scenes = ", ".join(sorted({one.name for one in missed}))
        told = f"{len(missed)}" + (f" ({scenes})" if scenes and bar else "")
        met = not missed or not bar
        rows.append(Row(f"{name}, {len(own):,} trials of {SECONDS:.0f} s: {says}", told, bar, met))
    waits = [one.waited / one.bound for one in blocking if not failed(one)]
    rows.append(Row("longest wait of the others, share of its bound", f"{max(waits, default=0.0):.2f}", "", True))
    unclean = sum(1 for own in admitted if own.name in PROVOKING and own.own)
    rows.append(Row("trials that do not count: who is to provoke breaks a rule first", f"{unclean:,}", "", True))
    refused = len(found) - len(admitted)
    rows.append(Row("trials that do not count: an obstacle bars a goal, or the way", f"{refused:,}", "", True))
    return rows


def measure() -> list[Row]:
    """Run all trials and return the table of the bars."""
    return bars(came())


def main() -> int:
    """Run what is asked for, and print the table."""
    parser = argparse.ArgumentParser(prog="experiments.conformance")
    parser.add_argument("--trials", type=int, default=TRIALS)
    parser.add_argument("--jobs", type=int, default=JOBS)
    parser.add_argument("--seconds", type=float)
    parser.add_argument("--store", action="store_true")
    asked = parser.parse_args()
    rows = bars(came(asked.trials, asked.jobs, asked.seconds))
    if asked.store:
        store("conformance", rows)
        write_page()
    return 0 if show("conformance", rows) else 1


if __name__ == "__main__":
    raise SystemExit(main())
