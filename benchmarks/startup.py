"""How long one waits at the command line: import, help, a warm run and a first-ever run."""

from __future__ import annotations

import os
import subprocess
import sys
from collections.abc import Mapping, Sequence
from pathlib import Path
from tempfile import TemporaryDirectory
from time import perf_counter

from benchmarks.table import Row

COMMAND = [sys.executable, "-m", "dubins_traffic.cli"]
ONE_TRIAL = [*COMMAND, "run", "demo", "--trials", "1"]


def measure() -> list[Row]:
    """Return the rows of this benchmark: medians of whole processes, and one first-ever run."""
    rows = [
        _row("import dubins_traffic", [sys.executable, "-c", "import dubins_traffic"], 0.4),
        _row("dubins-traffic --help", [*COMMAND, "--help"], 0.4),
    ]
    with TemporaryDirectory() as folder:
        records = ["--records", str(Path(folder) / "records"), "--overwrite"]
        fresh = {"NUMBA_CACHE_DIR": folder}
        name = "dubins-traffic run, one trial of 60 s"
        rows.append(_row(f"{name}, first ever (compiles)", ONE_TRIAL + records, 30.0, fresh, turns=1))
        rows.append(_row(f"{name}, warm", ONE_TRIAL + records, 3.0, fresh))
    return rows


def _row(
    name: str, command: Sequence[str], bar: float, variables: Mapping[str, str] | None = None, turns: int = 7
) -> Row:
    times: list[float] = []
    for _ in range(turns):
        began = perf_counter()
        subprocess.run(command, check=True, stdout=subprocess.DEVNULL, env={**os.environ, **(variables or {})})
        times.append(perf_counter() - began)
    median = sorted(times)[len(times) // 2]
    return Row(name, f"{median:.2f} s", f"< {bar:g} s", median < bar)
