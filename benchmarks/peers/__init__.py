"""How fast other simulators take cars through ticks, beside ours: `python -m benchmarks peers`.

Each peer runs in a virtual environment of its own, `build/peers/NAME`, which `scripts/peers.sh` makes with the
versions of `NAME.txt`. Its script here, `NAME_peer.py`, measures and prints one line of JSON. What is measured, and
what can't be compared, stands in `benchmarks/README.md`.
"""

from __future__ import annotations

import json
import math
import os
import subprocess
import sys
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

from benchmarks import ours
from benchmarks.rates import Rate, rows
from benchmarks.table import Row

HERE = Path(__file__).parent
ROOT = HERE.parents[1]
ENVIRONMENTS = ROOT / "build" / "peers"
BUDGET = 2.0
"""Seconds of processor time that a peer is measured for, after it has warmed up."""
PATIENCE = 150.0
ONE_THREAD = {f"{name}_NUM_THREADS": "1" for name in ("OMP", "MKL", "OPENBLAS", "NUMEXPR")}
FIELDS = ("car_steps", "seconds", "speed")


@dataclass(frozen=True, slots=True)
class Peer:
    """A peer: its title, its name among the files here, what it does, and what its script is told more."""

    title: str
    name: str
    does: str
    more: tuple[str, ...] = ()

    @property
    def python(self) -> Path:
        """The interpreter of its environment; our own if it asks for no packages."""
        asks = (HERE / f"{self.name}.txt").is_file()
        return ENVIRONMENTS / self.name / "bin" / "python" if asks else Path(sys.executable)

    @property
    def script(self) -> Path:
        """What measures it."""
        return HERE / f"{self.name}_peer.py"


PEERS = (
    Peer("SUMO", "sumo", "drivers, right of way"),
    Peer("highway-env", "highway", "drivers, observed every tick"),
    Peer("highway-env", "highway", "drivers, observed every second", ("1",)),
    Peer("VMAS", "vmas", "motion and contact, many worlds"),
    Peer("pymunk", "pymunk", "motion and contact"),
    Peer("MuJoCo", "mujoco", "wheels, ground and contact"),
    Peer("plain Python", "plain", "motion, all pairs at the end pose"),
)


def measure() -> list[Row]:
    """Return the rows of this benchmark; `scripts/peers.sh` makes first what environments are missing."""
    subprocess.run([str(ROOT / "scripts" / "peers.sh")], check=True)
    return [row for cars in ours.GRIDS for row in rows(list(_rates(cars)))]


def _rates(cars: int) -> Iterator[Rate]:
    yield from ours.rates(cars)
    for peer in PEERS:
        yield rate(peer, cars)
    yield ours.gazebo(cars)


def rate(peer: Peer, cars: int, budget: float = BUDGET) -> Rate:
    """Return how fast a peer is with so many cars, or why that is not known."""
    what = f"{peer.title}: {peer.does}"
    if not peer.python.is_file():
        return Rate(what, cars, None, f"not installed; scripts/peers.sh {peer.name} says why")
    command = [str(peer.python), str(peer.script), str(cars), str(budget), *peer.more]
    try:
        ran = subprocess.run(
            command,
            capture_output=True,
            text=True,
            env=os.environ | ONE_THREAD,
            timeout=PATIENCE,
            check=False,
        )
    except subprocess.TimeoutExpired:
        return Rate(what, cars, None, f"no figure within {PATIENCE:.0f} s")
    if ran.returncode:
        return Rate(what, cars, None, f"failed: {last_line(ran.stderr)}")
    return parse(peer, cars, ran.stdout)


def parse(peer: Peer, cars: int, printed: str) -> Rate:
    """Return the rate that a peer's script has printed as its last line, or why it is none.

    A figure is taken only if the peer had as many cars as it was told, and they were moving at the end.
    """
    what, line = f"{peer.title}: {peer.does}", last_line(printed)
    try:
        found = json.loads(line)
        steps, seconds, speed = (float(found[field]) for field in FIELDS)
        version, driven = str(found["version"]), int(found["cars"])
    except (ValueError, TypeError, KeyError):
        return Rate(what, cars, None, f"printed no figure: {line[:80]!r}")
    if driven != cars:
        return Rate(what, cars, None, f"had {driven} cars")
    if not all(math.isfinite(value) and value > 0.0 for value in (steps, seconds, speed)):
        return Rate(what, cars, None, f"its cars did not drive: {line[:120]}")
    return Rate(f"{peer.title} {version}: {peer.does}", cars, steps / seconds)


def last_line(text: str) -> str:
    """Return the last line of a text that is not empty, "" if there is none."""
    return next((line for line in reversed(text.splitlines()) if line.strip()), "")
