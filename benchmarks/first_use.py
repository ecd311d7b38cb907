"""How soon a first run gives its score, with no kernel compiled, and what compiling takes.

Each command is paired, in the same run: with nothing compiled as it is, and interpreted for ever
(`NUMBA_DISABLE_JIT=1`). `DUBINS_TRAFFIC_BEFORE` names a folder of sources of an older version, `.../src`, to pair with
as well: then a first and a warm run of that version are timed too. What compiling takes is the time on the clock of a
run that waits for its kernels.
"""

from __future__ import annotations

import fcntl
import os
import resource
import shutil
import subprocess
import sys
from collections.abc import Mapping, Sequence
from pathlib import Path
from tempfile import TemporaryDirectory
from time import perf_counter

from benchmarks.table import Row
from dubins_traffic.kernels.sources import PACKAGE

COMMAND = [sys.executable, "-m", "dubins_traffic.cli"]
FIRST = (
    "run demo --controller simple --trials 1",
    "run town --controller rules --trials 1",
    "run town --controller rules --shield --trials 1",
)
COMPILED = (
    *FIRST,
    "run demo --trials 1",
    "run demo --controller lanes --trials 1",
    "batch town --trials 4",
)
MANY = "run town --controller rules --trials 40"
WARM = ("run demo --trials 1", "run town --controller rules --trials 1")
BEFORE = "DUBINS_TRAFFIC_BEFORE"
ROUNDS = 3


def measure() -> list[Row]:
    """Return the rows of this benchmark."""
    rows: list[Row] = []
    for command in FIRST:
        rows += _first(command)
    for command in COMPILED:
        rows.append(_compiling(command))
    rows += [_many(), _workers(COMPILED[0]), _elsewhere(COMPILED[0])]
    for command in WARM:
        rows.append(_warm(command))
    return rows


def _first(command: str) -> list[Row]:
    plain = min(_run(command, {"NUMBA_DISABLE_JIT": "1"})[0] for _ in range(ROUNDS))
    first = min(_in_empty_cache(command) for _ in range(ROUNDS))
    ratio = first / plain
    rows = [Row(f"{command}, empty cache", f"{first:.2f} s, {ratio:.2f} of interpreted", "<= 1.5", ratio <= 1.5)]
    if BEFORE in os.environ:
        before = _in_empty_cache(command, os.environ[BEFORE])
        part = first / before
        rows.append(
            Row(
                f"{command}, empty cache, before",
                f"{before:.1f} s, {part:.2f} of it",
                "<= 1.1",
                part <= 1.1,
            )
        )
    return rows


def _in_empty_cache(command: str, tree: str | None = None) -> float:
    with TemporaryDirectory() as folder:
        variables = {"NUMBA_CACHE_DIR": folder} | ({} if tree is None else {"PYTHONPATH": tree})
        took = _run(command, variables)[0]
        _end(Path(folder))
    return took


def _end(folder: Path) -> None:
    """Wait until nothing is compiled any more for a folder: what is left after a first run takes some seconds."""
    locks = [*folder.glob("*/builder.lock"), *folder.glob("*/asked-*/companion.lock")]
    for path in locks:
        with path.open("r+b") as lock:
            fcntl.flock(lock, fcntl.LOCK_EX)


def _compiling(command: str) -> Row:
    with TemporaryDirectory() as folder:
        took = _compile(command, folder)
        count = len(_kernels(folder))
    figure = f"{took:.1f} s, {count} kernels"
    if BEFORE not in os.environ:
        return Row(f"{command}, waiting for its kernels", figure, "-", count > 0)
    with TemporaryDirectory() as folder:
        before = _compile(command, folder, tree=os.environ[BEFORE])
    part = took / before
    return Row(
        f"{command}, waiting for its kernels",
        f"{figure}, {part:.2f} of {before:.1f} s before",
        "<= 1.1",
        part <= 1.1,
    )


def _compile(command: str, folder: str, count: int = 1, tree: str | None = None) -> float:
    """Let `count` processes at once wait for the kernels that they need; return the time on the clock, seconds."""
    around = os.environ | {"NUMBA_CACHE_DIR": folder, "DUBINS_TRAFFIC_KERNELS": "compiled"}
    if tree is not None:
        around["PYTHONPATH"] = tree
    words, quiet, began = [*COMMAND, *command.split()], subprocess.DEVNULL, perf_counter()
    running = [subprocess.Popen(words, stdout=quiet, stderr=quiet, env=around) for _ in range(count)]
    if any(process.wait() for process in running):
        raise RuntimeError(command)
    return perf_counter() - began


def _kernels(folder: str) -> dict[Path, int]:
    return {path: path.stat().st_mtime_ns for path in Path(folder).rglob("*.kernel")}


def _many() -> Row:
    """Return whether work that goes over on its way is done as soon as work that waits for its kernels."""
    with TemporaryDirectory() as folder:
        over = _run(MANY, {"NUMBA_CACHE_DIR": folder})[0]
        _end(Path(folder))
    with TemporaryDirectory() as folder:
        waiting = _run(MANY, {"NUMBA_CACHE_DIR": folder, "DUBINS_TRAFFIC_KERNELS": "compiled"})[0]
    part = over / waiting
    return Row(f"{MANY}, empty cache", f"{over:.1f} s, {part:.2f} of compiling first", "<= 1.1", part <= 1.1)


def _workers(command: str) -> Row:
    """Return how long two processes at once wait for their kernels, against one."""
    with TemporaryDirectory() as folder:
        one = _compile(command, folder)
    with TemporaryDirectory() as folder:
        two = _compile(command, folder, 2)
    figure = f"{two:.1f} s, {two / one:.2f} of one"
    return Row(f"{command}, two at once, waiting for their kernels", figure, "<= 1.2", two <= 1.2 * one)


def _elsewhere(command: str) -> Row:
    """Return what the same version in another place compiles, with the cache of the first."""
    with TemporaryDirectory() as folder, TemporaryDirectory() as place:
        _compile(command, folder)
        before = _kernels(folder)
        copy = Path(place) / PACKAGE.name
        shutil.copytree(PACKAGE, copy, ignore=shutil.ignore_patterns("__pycache__"))
        _run(command, {"NUMBA_CACHE_DIR": folder, "PYTHONPATH": place})
        fresh = len(_kernels(folder).items() - before.items())
    return Row(f"{command}, installed again elsewhere", f"{fresh} kernels compiled", "0", fresh == 0)


def _warm(command: str) -> Row:
    _run(command, {"DUBINS_TRAFFIC_KERNELS": "compiled"})
    now = min(_run(command, {})[1] for _ in range(ROUNDS))
    if BEFORE not in os.environ:
        return Row(f"{command}, warm", f"{now:.2f} s of processor time", "-", True)
    older = {"PYTHONPATH": os.environ[BEFORE]}
    _run(command, older)
    before = min(_run(command, older)[1] for _ in range(ROUNDS))
    part = now / before
    return Row(f"{command}, warm", f"{now:.2f} s, {part:.2f} of {before:.2f} s before", "<= 1.1", part <= 1.1)


def _run(command: str, variables: Mapping[str, str], program: Sequence[str] = COMMAND) -> tuple[float, float]:
    """Return the time on the clock and the processor time of a command, seconds."""
    around = {name: value for name, value in os.environ.items() if name != "DUBINS_TRAFFIC_KERNELS"} | variables
    before, began = resource.getrusage(resource.RUSAGE_CHILDREN), perf_counter()
    quiet = subprocess.DEVNULL
    subprocess.run([*program, *command.split()], check=True, stdout=quiet, stderr=quiet, env=around)
    took, after = perf_counter() - began, resource.getrusage(resource.RUSAGE_CHILDREN)
    return took, after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime
