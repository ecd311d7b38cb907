"""Levels of processors: one library of machine code runs on every machine of its level, with the same bits on all.

The levels are those of the x86-64 psABI, which compilers and Linux know by these names. On other machines there is no
level: kernels run interpreted there, or are compiled for the machine itself.
"""

from __future__ import annotations

import os
import platform
import sys
from functools import cache
from pathlib import Path

from dubins_traffic.errors import InputError

LEVEL = "DUBINS_TRAFFIC_LEVEL"
"""The environment variable that names a lower level than the machine's, or the one to compile for."""
FEATURES = {
    "x86-64-v2": "cx16 lahf_lm popcnt pni sse4_1 sse4_2 ssse3",
    "x86-64-v3": "abm avx avx2 bmi1 bmi2 f16c fma movbe",
    "x86-64-v4": "avx512bw avx512cd avx512dq avx512f avx512vl",
}
"""Levels from the lowest up, with what each adds to the one below, as Linux calls it."""
LEVELS = tuple(FEATURES)
TOLD = Path("/proc/cpuinfo")


@cache
def levels() -> tuple[str, ...]:
    """Return the levels whose machine code runs here, the best first; none where there are no levels.

    Raises
    ------
    InputError
        If the environment variable names no level.
    """
    named = _machines()
    asked = os.environ.get(LEVEL)
    if not asked:
        return named
    if asked not in LEVELS:
        raise InputError("no such level", file=LEVEL, value=asked, expected=", ".join(LEVELS))
    return tuple(name for name in named if LEVELS.index(name) <= LEVELS.index(asked))


def level() -> str:
    """Return the level that is compiled for: the one that the environment names, else the machine's; empty without one.

    Raises
    ------
    InputError
        If the environment variable names no level.
    """
    named = levels()
    return os.environ.get(LEVEL) or (named[0] if named else "")


def _machines() -> tuple[str, ...]:
    """Return the levels of this machine, the best first."""
    if not sys.platform.startswith("linux") or platform.machine() != "x86_64":
        return ()
    has = _features()
    machines: list[str] = []
    for name, adds in FEATURES.items():
        if not set(adds.split()) <= has:
            break
        machines.insert(0, name)
    return tuple(machines)


def _features() -> set[str]:
    """Return what the first processor can do, as Linux says."""
    try:
        with TOLD.open(encoding="ascii", errors="replace") as lines:
            for line in lines:
                if line.startswith("flags"):
                    return set(line.partition(":")[2].split())
    except OSError:
        return set()
    return set()
