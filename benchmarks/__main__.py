"""Speed in one table: `python -m benchmarks [NAME...]`, in ten minutes. The exit status is 1 if a bar is missed.

Others run if they are named: `overview` is the table of benchmarks/README.md, beside other simulators, which it
installs first where they are missing (two minutes more), and `peers` its part about these; `first_use` runs with empty
caches of kernels; `lcm`, `ros1`, `gazebo` and `sandbox` need what they are called after; `service`, an hour, and
`first_submission` run a service, `campaign` 300,000 short trials, also on Ray, and `scale` a world of 10,000 cars.
What trials show of drivers, rules and searches is in `experiments`.
"""

from __future__ import annotations

import importlib
import sys
from dataclasses import replace

from benchmarks.table import Row, machine, show

NAMES = (
    "motion",
    "single",
    "startup",
    "batch",
    "judging",
    "world",
    "envs",
    "rendering",
    "monitors",
    "queries",
    "generation",
)
OTHERS = (
    "campaign",
    "first_submission",
    "first_use",
    "gazebo",
    "lcm",
    "overview",
    "peers",
    "ros1",
    "sandbox",
    "scale",
    "service",
)


def main(names: list[str]) -> int:
    """Run the named benchmarks, or those of the one table."""
    unknown = [name for name in names if name not in NAMES + OTHERS]
    if unknown:
        print(
            f"benchmarks: unknown: {', '.join(unknown)}; expected some of {', '.join(NAMES + OTHERS)}",
            file=sys.stderr,
        )
        return 2
    rows: list[Row] = []
    for name in names or NAMES:
        print(f"benchmarks: {name}", file=sys.stderr)
        measured = importlib.import_module(f"benchmarks.{name}").measure()
        rows += [replace(row, name=f"{name}: {row.name}") for row in measured]
    return 0 if show(machine(), rows) else 1


if __name__ == "__main__":
    raise SystemExit(main(sys.argv[1:]))
