"""`rules` of edition 3 beside that of edition 2, on the instances and durations of that: clean, with as many rounds.

    python -m experiments former

Commit f2f6b07 is the last one of edition 2. Its tree is checked out below `build` and runs its shipped configurations
with its own sources and `rules`; this tree runs the same documents, which give the same instances, with its own.
"""

from __future__ import annotations

import json
import os
import subprocess
import sys
from pathlib import Path
from typing import Any, Final

from benchmarks.table import Row

ROOT: Final = Path(__file__).resolve().parents[1]
COMMIT: Final = "f2f6b07"
TREE: Final = ROOT / "build" / COMMIT
NAMES: Final = ("junction", "town", "suburb", "wanderers")
TRIALS: Final = 250
DRIVE: Final = """
import json, sys
from pathlib import Path
from dubins_traffic.engine.batch import run_batch
from dubins_traffic.problem.configuration import load_config
from dubins_traffic.problem.draw import draw
own = load_config(json.loads(Path(sys.argv[1]).read_text()) | {"rules": True, "number_trials": int(sys.argv[2])})
trials = run_batch(own, "rules", trials=int(sys.argv[2]), seed=1).sheet.trials
starts = [[[float(value) for value in pose] for pose in draw(own, 1, number).starts] for number in range(3)]
rows = {"rounds": sum(own.rounds for own in trials), "clean": sum(own.verdict.clean for own in trials)}
print(json.dumps(rows | {"starts": starts}))
"""


def driven(tree: Path, name: str) -> dict[str, Any]:
    """Return what a tree's `rules` makes of a configuration of the former commit."""
    document = TREE / "src" / "dubins_traffic" / "problem" / "configurations" / f"{name}.json"
    command = [sys.executable, "-c", DRIVE, os.fspath(document), str(TRIALS)]
    paths = os.environ | {"PYTHONPATH": os.fspath(tree / "src")}
    told = subprocess.run(command, env=paths, check=True, capture_output=True, text=True)
    return json.loads(told.stdout.splitlines()[-1])


def measure() -> list[Row]:
    """Run both trees and return the table."""
    if not TREE.exists():
        subprocess.run(["git", "worktree", "add", "--detach", os.fspath(TREE), COMMIT], cwd=ROOT, check=True)
    there, here = ({name: driven(tree, name) for name in NAMES} for tree in (TREE, ROOT))
    if any(there[name]["starts"] != here[name]["starts"] for name in NAMES):
        raise SystemExit("experiments: former: the two trees draw different instances")
    count = TRIALS * len(NAMES)
    clean = sum(own["clean"] for own in here.values())
    rounds, before = (sum(own["rounds"] for own in tree.values()) for tree in (here, there))
    share = rounds / before
    return [
        Row(
            f"`rules` in {count:,} trials of the configurations of {COMMIT}: clean",
            f"{clean:,}", f"{count:,}", clean == count,
        ),
        Row("the same: rounds", f"{rounds:,}, {share:.3f} of the {before:,} before", "0.97", share >= 0.97),
    ]  # fmt: skip
