"""What boxes do where control groups are those of version 2; run under a kernel that has them: tests/guest.py.

`python -m tests.sandbox.second_version NAME...` runs the attacks of these names, `all` every one; an emulated machine
is slow, so they have more time than elsewhere.
"""

from __future__ import annotations

import json
import os
import resource
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

from dubins_traffic.sandbox import cgroups, suite
from dubins_traffic.sandbox.attacks import ATTACKS
from dubins_traffic.sandbox.available import available_layers, held
from dubins_traffic.sandbox.layers import CLOCK, MEMORY, PROCESSES, RLIMITS
from dubins_traffic.sandbox.limits import Limits

SLOW = 20.0
SPIN = "i=0; while [ $i -lt 30000 ]; do i=$((i + 1)); done"


def main(names: list[str]) -> int:
    """Print what was found, a line of JSON each; return 0 if all was as it must be."""
    trees, layers = cgroups.trees(), available_layers()
    print(json.dumps({"version": trees.version, "folders": sorted({str(own) for own in trees.folders.values()})}))
    print(json.dumps(dict(held(layers))))
    good = trees.version == 2 and {MEMORY, PROCESSES, CLOCK} <= layers.names and counts() and left() == []
    usual = suite.LIMITS
    suite.LIMITS = replace(
        usual,
        start_seconds=usual.start_seconds * SLOW,
        decision_seconds=usual.decision_seconds * SLOW,
        bank_seconds=usual.bank_seconds * SLOW,
        wall_seconds=usual.wall_seconds * SLOW,
    )
    alone = layers if names == ["all"] else layers.without(RLIMITS)
    for strike in suite.strikes(alone, [own for own in ATTACKS if names == ["all"] or own.name in names]):
        print(json.dumps({"attack": strike.attack.name, "stopped": strike.stopped, "words": strike.words}))
        good = good and strike.stopped
    return 0 if good and left() == [] else 1


def counts() -> bool:
    """Whether the clock of a group counts what a process in it uses, and its memory is limited."""
    group = cgroups.Group(cgroups.trees(), Limits())
    doors = "".join(f"echo $$ >{door}; " for door in group.doors)
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    subprocess.run(["/bin/sh", "-c", doors + SPIN], check=True)
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    used = after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime
    spent, memory = group.seconds(), (group.folders["memory"] / "memory.max").read_text().strip()
    group.close()
    print(json.dumps({"spent": spent, "used": used, "memory.max": memory}))
    return used > 0.1 and 0.5 < spent / used < 1.5 and int(memory) == Limits().memory


def left() -> list[str]:
    """Return the groups of this process that are left over."""
    folders = set(cgroups.trees().folders.values())
    return [str(own) for folder in folders for own in Path(folder).glob(f"{cgroups.NAME}-{os.getpid()}-*")]


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
