"""What a policy is worth that `examples/learning/clone.py` has taught to drive as `rules` does.

    python -m experiments cloning
    python -m experiments.cloning [TRIALS]

It drives trials of `junction` that it has not learned from, alone and under the shield, as `rules` and `lanes` do.
"""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Final

from benchmarks.table import Row, show

from dubins_traffic.engine.batch import run_batch
from dubins_traffic.problem.configuration import load_config

POLICY: Final = str(Path(__file__).resolve().parents[1] / "examples" / "learning" / "junction.npz")
TRIALS, SEED = 20, 1000


def rounds(controller: str, trials: int) -> tuple[float, float]:
    """Return counted rounds and rounds before the first breach, means a trial."""
    done = run_batch(load_config("junction"), controller, trials=trials, seed=SEED)
    scores = [outcome.score for outcome in done.outcomes]
    counted = sum(score.counted_rounds or 0 for score in scores)
    return counted / trials, sum(score.rounds_before_breach for score in scores) / trials


def measure(trials: int = TRIALS) -> list[Row]:
    """Return the rows of this experiment."""
    found = {who: rounds(who, trials) for who in ("lanes", "rules", POLICY, f"{POLICY}+shield")}
    alone, kept, rules = found[POLICY], found[f"{POLICY}+shield"], found["rules"]
    figures = {who: f"{counted:.2f}; {early:.2f}" for who, (counted, early) in found.items()}
    words = f"counted rounds a trial of {trials}; before the first breach"
    return [
        Row(f"lanes: {words}", figures["lanes"], "", True),
        Row(f"rules: {words}", figures["rules"], "", True),
        Row(f"cloned from rules: {words}", figures[POLICY], "> 0", alone[0] > 0.0),
        Row(
            f"the same under the shield: {words}",
            figures[f"{POLICY}+shield"],
            "0.9 of rules",
            kept[0] >= 0.9 * rules[0],
        ),
    ]


if __name__ == "__main__":
    sys.exit(0 if show("cloning", measure(*map(int, sys.argv[1:]))) else 1)
