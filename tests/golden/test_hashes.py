"""Every golden case gives what it gave."""

from __future__ import annotations

import os
import subprocess
import sys

import numpy as np
import pytest

from tests.golden.cases import cases
from tests.golden.hashes import differences, golden, hashes

CASES = cases()
GROUPS = sorted({name.rpartition("/")[0] or name for name in CASES})


def test_there_are_enough_cases() -> None:
    assert len(CASES) >= 240
    assert golden().keys() == CASES.keys()


@pytest.mark.parametrize("group", GROUPS)
def test_hashes_are_the_golden_ones(group: str) -> None:
    expected = golden()
    names = [name for name in CASES if (name.rpartition("/")[0] or name) == group]
    assert [line for name in names for line in differences(name, hashes(CASES[name]), expected[name])] == []


def test_hashes_are_the_same_on_a_processor_that_can_less() -> None:
    """NumPy computes some functions in another way on each kind of processor, and rounds the results otherwise."""
    able = np.show_config("dicts")["SIMD Extensions"]["found"]
    around = {**os.environ, "NPY_DISABLE_CPU_FEATURES": " ".join(able)}
    command = [
        sys.executable,
        "-m",
        "tests.golden.hashes",
        "agent/wander/*",
        "controller/lanes/*",
        "controller/simple/*",
    ]
    done = subprocess.run(command, env=around, capture_output=True, text=True, check=False)
    assert done.stdout.endswith(" cases, 0 differences\n"), done.stdout + done.stderr
    assert done.returncode == 0
