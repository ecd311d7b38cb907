"""Measures what PPO has learned from each seed, keeps that in `seeds.json`, and the median policy beside it.

    python -m experiments.baselines.ppo.seeds KIND FILE...

KIND is `ppo`, `shielded` or `lagrangian`; the files are what `train.py` has saved for seeds 1, 2, 3 ... The median is
by counted rounds under the shield, then by rounds before the first breach there.
"""

from __future__ import annotations

import json
import shutil
import sys
from pathlib import Path
from typing import Any, Final

from dubins_traffic.engine.batch import run_batch
from dubins_traffic.files import write_text
from dubins_traffic.scoring.verdict import EGO_RULES
from experiments.baselines.measuring import SHIELD, columns

CONFIG, SEED, TRIALS = "junction", 1000, 20
"""Trials that nobody has learned from."""
FILE: Final = Path(__file__).parent / "seeds.json"


def measured(controller: str) -> dict[str, float]:
    """Return the means over the trials."""
    kept = columns(run_batch(CONFIG, controller, trials=TRIALS, seed=SEED).outcomes)
    return {
        "counted_rounds": sum(kept["counted_rounds"]) / TRIALS,
        "rounds_before_breach": round(sum(kept["rounds_before_breach"]) / TRIALS, 6),
        "breaches": sum(sum(kept[rule]) for rule in EGO_RULES) / TRIALS,
    }


def of_seed(seed: int, file: Path) -> dict[str, Any]:
    """Return what a policy does, alone and under the shield."""
    return {"seed": seed, "alone": measured(str(file)), "shield": measured(f"{file}{SHIELD}")}


def median(known: list[dict[str, Any]]) -> int:
    """Return the place of the median seed."""
    by = [(own["shield"]["counted_rounds"], own["shield"]["rounds_before_breach"], own["seed"]) for own in known]
    return sorted(range(len(by)), key=by.__getitem__)[len(by) // 2]


def main() -> None:
    """Measure the policies of one kind."""
    kind, *files = sys.argv[1:]
    known = json.loads(FILE.read_text(encoding="utf-8"))
    known[kind] = [of_seed(1 + k, Path(file)) for k, file in enumerate(files)]
    shutil.copyfile(files[median(known[kind])], FILE.with_name(f"{kind}.npz"))
    write_text(FILE, json.dumps(known, indent=1) + "\n")


if __name__ == "__main__":
    main()
