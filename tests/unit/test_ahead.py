"""What kernels have brought ahead of time: rows of tables, wherever they stand, and no number is another for it."""

import os
import platform
import subprocess
import sys
from pathlib import Path

import numpy as np

from dubins_traffic.kernels.arrays import Floats, Ints, fetch
from dubins_traffic.kernels.compile import jit
from dubins_traffic.kernels.records import Rows, record, table

ROOT = Path(__file__).parents[2]
PREFETCH = b"\x0f\x18"
"""How the instruction begins on x86-64."""


@record
class Seat:
    """A row of more than a line."""

    first: float
    more: float


@jit
def add_up(order: Ints, rows: Rows[Seat], deep: Floats) -> float:
    """Return the sum of rows of `rows` (B,) and `deep` (B, N, M), in the order of `order` (K,)."""
    total = 0.0
    for k in range(order.shape[0]):
        if k + 1 < order.shape[0]:
            fetch(rows, (order[k + 1],))
            fetch(deep, (order[k + 1], 1))
        b = order[k]
        total += rows[b].first + rows[b].more + deep[b, 1].sum()
    return total


def test_what_is_fetched_ahead_changes_nothing_and_may_be_anywhere() -> None:
    rows, deep = table(Seat, 5), np.random.default_rng(1).uniform(size=(5, 2, 30))
    rows["first"], rows["more"] = np.arange(5.0), 0.25
    order = np.array([4, 0, 2, 0])
    expected = sum(rows[b].first + 0.25 + deep[b, 1].sum() for b in order.tolist())
    assert np.isclose(add_up(order, rows, deep), expected)


COMPILE = """
import sys
from dubins_traffic.kernels import compile as making
from dubins_traffic.compiling.compiler import Compiler
from dubins_traffic.kernels.kinds import kind_of
compiler = Compiler()
making.builder = compiler.jit
from tests.unit import test_ahead
seats = kind_of(test_ahead.table(test_ahead.Seat, 1))
kinds = ("array", "i8", 1, "C", True), seats, ("array", "f8", 3, "C", True)
code, _ = compiler.machine_code(test_ahead.add_up, kinds, "add_up")
sys.stdout.buffer.write(code)
"""


def test_it_is_compiled_to_the_processors_own_instruction() -> None:
    around = {**os.environ, "PYTHONPATH": os.pathsep.join(sys.path), "NUMBA_DISABLE_JIT": "0"}
    code = subprocess.run([sys.executable, "-c", COMPILE], env=around, check=True, stdout=-1, cwd=ROOT).stdout
    assert platform.machine() != "x86_64" or PREFETCH in code
