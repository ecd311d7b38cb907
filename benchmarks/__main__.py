"""All benchmarks: `python -m benchmarks [NAME...]`. The exit status is 1 if a bar is missed.

`overview` is the table of all speeds beside those of other simulators, which it installs first where they are missing:
two minutes more. Its parts `queries`, `generation` and `peers` are run by themselves only if they are named, and so is
`million`, which takes some minutes.

`motion`, `single`, `startup`, `judging`, `batch`, `world`, `scale`, `rendering`, `monitors`, `lcm`, `sandbox`: about a
minute; `envs`, which compiles an earlier commit, two and more; `first_use`, with empty caches of kernels, some;
`service`, `ros1`: three; `first_submission`, which installs the package: one; `verify` runs 500 short trials and
verifies their records, in two; `lanes` runs 400 trials and `rules` 1,400, which takes some minutes each, and so do
`odd_egos` for its 2,000 and `towns` for its 200, which installs SUMO first where that is missing; `synthesis` solves
its games in about two minutes; `campaign` runs 300,000 short trials in as many; `competition` judges 1,000 trials of
strangers twice and `shield` runs 24,200 of a minute each, a quarter of an hour both; `adversaries` 10,000 episodes of a
minute, in half an hour, and so does `synthesized` for its 2,000 of 300 s; `estimate` splits some 500,000 trials in a
quarter of an hour; `shrinking` shrinks 40 cases in some minutes; `falsify` searches some million trials, in hours.
"""

from __future__ import annotations

import importlib
import sys

from benchmarks.table import show

NAMES = (
    "motion",
    "single",
    "startup",
    "first_use",
    "judging",
    "batch",
    "envs",
    "world",
    "scale",
    "rendering",
    "monitors",
    "lanes",
    "rules",
    "verify",
    "odd_egos",
    "towns",
    "shield",
    "lcm",
    "ros1",
    "sandbox",
    "synthesis",
    "synthesized",
    "counter",
    "falsify",
    "shrinking",
    "estimate",
    "adversaries",
    "gazebo",
    "campaign",
    "competition",
    "service",
    "first_submission",
    "overview",
)
PARTS = ("queries", "generation", "peers", "million")


def main(names: list[str]) -> int:
    """Run the named benchmarks, or all."""
    unknown = [name for name in names if name not in NAMES + PARTS]
    if unknown:
        print(
            f"benchmarks: unknown: {', '.join(unknown)}; expected some of {', '.join(NAMES + PARTS)}",
            file=sys.stderr,
        )
        return 2
    met = True
    for name in names or NAMES:
        rows = importlib.import_module(f"benchmarks.{name}").measure()
        met = show(name, rows) and met
    return 0 if met else 1


if __name__ == "__main__":
    raise SystemExit(main(sys.argv[1:]))
