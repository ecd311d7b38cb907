"""Makes the cases of the suite `adversary-2026`: trials in which searches found a breach, a minute each.

    python -m experiments.adversary_cases FOLDER [TRIALS]
    python -m dubins_traffic.suites.gather adversary-2026 TITLE FOLDER FILE

`lanes` and `simple` are searched on the shipped configurations `junction` and `town`, TRIALS trials each, 4,096 unless
said otherwise, and the mutants of `rules` in the town of `tests.mutant_searches`, until each has broken something. Each
case goes on for a minute. It is kept if its driver breaks a rule in that minute, and nobody else does among any of the
drivers of the site's page of results: the assumption holds in each of these trials.
"""

from __future__ import annotations

import json
import sys
import tempfile
from collections.abc import Iterator, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any, Final

from tests.mutant_searches import first_found
from tests.mutants import MUTANTS

from dubins_traffic.controllers import registry as controllers
from dubins_traffic.engine.controlled import Maker
from dubins_traffic.falsification.case import KEY, Case
from dubins_traffic.falsification.search import falsify
from dubins_traffic.files import write_text
from dubins_traffic.problem.document import instance_to_document
from dubins_traffic.problem.instance import Instance
from dubins_traffic.runs.single import run_trial
from dubins_traffic.scoring.verdict import EGO_NAME

WORLDS: Final = ("junction", "town")
DRIVERS: Final = ("lanes", "simple")
EGOS: Final = ("lanes", "lanes+shield", "rules", "rules+shield", "simple", "simple+shield")
"""Among all of these the e-agents keep the assumption."""
TRIALS, SEED = 4096, 1
MUTANT_SEED, MUTANT_TRIALS = 100, 20_000
SECONDS: Final = 60.0


def found(trials: int) -> Iterator[tuple[str, str | Maker, Case]]:
    """Yield the cases that searches find: a name, who drives, and the case."""
    for world in WORLDS:
        for driver in DRIVERS:
            with tempfile.TemporaryDirectory() as folder:
                own = falsify(world, driver, Path(folder) / "found", trials=trials, seed=SEED)
                for name, case in own.cases.items():
                    yield f"{world}/{driver}/{name}", driver, case
    for mutant, planted in MUTANTS.items():
        came = first_found(mutant, "evolution", MUTANT_SEED, MUTANT_TRIALS)
        for case in [] if came is None else came[1]:
            yield f"rules/{mutant}/{case.story.cell.name}", planted.kind, case


def minute_of(case: Case) -> Instance:
    """Return a case that goes on for a minute, without what is known of it."""
    extra = {key: value for key, value in case.instance.extra.items() if key != KEY}
    return replace(case.instance, duration=SECONDS, extra=extra)


def breaks(instance: Instance, driver: str | Maker) -> set[str]:
    """Return which cars break a rule in a trial."""
    made = controllers.load(driver) if isinstance(driver, str) else driver()
    verdict = run_trial(instance, made, sketch=False).score.verdict
    assert verdict is not None
    return {own.car for own in verdict.violations}


def is_kept(instance: Instance, driver: str | Maker, egos: Sequence[str] = EGOS) -> bool:
    """Tell whether the driver breaks a rule in a trial, and nobody else does whoever drives."""
    return breaks(instance, driver) == {EGO_NAME} and all(breaks(instance, ego) <= {EGO_NAME} for ego in egos)


def write(folder: Path, trials: int = TRIALS) -> tuple[int, int]:
    """Write the cases into a folder; return how many are kept, and how many are left out."""
    kept = out = 0
    seen: set[str] = set()
    for name, driver, case in found(trials):
        own = minute_of(case)
        document: dict[str, Any] = instance_to_document(own)
        text = json.dumps(document)
        if text in seen or not is_kept(own, driver):
            out += 1
            print(f"{name}: left out", flush=True)
            continue
        seen.add(text)
        kept += 1
        path = folder / f"{name}.json"
        path.parent.mkdir(parents=True, exist_ok=True)
        write_text(path, text + "\n")
    return kept, out


if __name__ == "__main__":
    kept, out = write(Path(sys.argv[1]), int((sys.argv[2:] or [str(TRIALS)])[0]))
    print(f"{kept} cases, {out} left out")
