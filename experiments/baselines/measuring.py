"""Runs methods on trials of the ranked suites, alone and under the shield, and keeps what came of each trial."""

from __future__ import annotations

import json
from collections.abc import Sequence
from datetime import UTC, datetime
from itertools import chain
from pathlib import Path
from typing import Any, Final

from dubins_traffic.engine.batch import outcomes
from dubins_traffic.engine.group import Outcome
from dubins_traffic.files import write_text
from dubins_traffic.problem.draw import draw
from dubins_traffic.problem.instance import Instance
from dubins_traffic.scoring.verdict import EGO_NAME, EGO_RULES
from dubins_traffic.suites.running import case_instances
from dubins_traffic.suites.suite import load_suite
from experiments.baselines.methods import METHODS
from experiments.stored import code

RESULTS: Final = Path(__file__).parent / "results"


SUITES: Final = {"icra2016": 10, "rules-2026": 2, "adversary-2026": 1}
"""The suites, with how many trials of each of their combinations are run; all cases of one that has cases."""
SHIELD: Final = "+shield"


def instances_of(name: str) -> list[Instance]:
    """Return the trials of a suite that are run, in order."""
    suite, trials = load_suite(name), SUITES[name]
    if suite.model.cases is not None:
        return list(case_instances(suite.model.cases).values())
    cells = suite.campaign(["rules"], trials).cells
    return [draw(cell.settled, cell.seed, trial) for cell in cells for trial in range(trials)]


def columns(found: Sequence[Outcome]) -> dict[str, list[Any]]:
    """Return what is kept of the outcomes of trials, a list each."""
    verdicts = [own.score.verdict for own in found]
    kept: dict[str, list[Any]] = {
        "end": [own.ending.end.value for own in found],
        "counted_rounds": [own.score.counted_rounds for own in found],
        "rounds_before_breach": [round(own.score.rounds_before_breach, 6) for own in found],
        "collisions": [len(own.score.collisions) for own in found],
    }
    for rule in EGO_RULES:
        kept[rule] = [
            None if own is None else sum(one.car == EGO_NAME and one.rule == rule for one in own.violations)
            for own in verdicts
        ]
    return kept


def run(
    method: str, suite: str, *, shield: bool, some: Sequence[int] | None = None
) -> tuple[dict[str, list[Any]], float]:
    """Return the columns of a method on trials of a suite, all or `some`, and its seconds a decision, the mean."""
    instances = instances_of(suite)
    chosen = [instances[k] for k in (range(len(instances)) if some is None else some)]
    places = {id(own): k for k, own in enumerate(chosen)}
    groups: dict[str, list[Instance]] = {}
    for own in chosen:
        groups.setdefault(METHODS[method].drives(own) + (SHIELD if shield else ""), []).append(own)
    each = chain.from_iterable(outcomes(own, spec) for spec, own in groups.items())
    found = sorted(each, key=lambda own: places[id(own.instance)])
    seconds = [own.act_s["mean"] for own in found if own.act_s]
    return columns(found), sum(seconds) / len(seconds) if seconds else 0.0


def measure(method: str, suites: Sequence[str]) -> None:
    """Run a method on suites, alone and under the shield, and keep the results in its file."""
    file = RESULTS / f"{method}.json"
    kept: dict[str, Any] = json.loads(file.read_text(encoding="utf-8")) if file.exists() else {"suites": {}}
    for suite in suites:
        entry: dict[str, Any] = {"hash": load_suite(suite).hash, "code": code()}
        entry["date"] = datetime.now(UTC).date().isoformat()
        for shield in (False, True):
            found, seconds = run(method, suite, shield=shield)
            entry["shield" if shield else "alone"] = {"seconds": round(seconds, 7), "columns": found}
            print(f"{method}{SHIELD if shield else ''} on {suite}: {sum(c or 0 for c in found['counted_rounds'])} "
                  f"counted rounds in {len(found['end'])} trials", flush=True)  # fmt: skip
        kept["suites"][suite] = entry
        file.parent.mkdir(exist_ok=True)
        write_text(file, json.dumps(kept) + "\n")


def stored() -> dict[str, dict[str, Any]]:
    """Return what is stored of each method that has been measured, by suite."""
    found = {name: RESULTS / f"{name}.json" for name in METHODS}
    return {
        name: json.loads(file.read_text(encoding="utf-8"))["suites"] for name, file in found.items() if file.exists()
    }
