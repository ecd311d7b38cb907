"""Environments with a rule added as docs/extending/rule.md says: whatever its number, each breach is its own cost."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest

from dubins_traffic.rules.breach_log import RULES
from tests.added_rule import NAME, copy_with_rule
from tests.architecture.house import ROOT

PLACES = (0, RULES.index("3.clear") + 1, len(RULES))
"""First, after the ego's last rule, last of all."""


def counted(folder: Path, number: int, tier: str) -> dict[str, Any]:
    copy_with_rule(folder, number)
    around = {
        **os.environ,
        "PYTHONPATH": f"{folder}{os.pathsep}{ROOT}",
        "DUBINS_TRAFFIC_KERNELS": tier,
        "NUMBA_OPT": "1",  # what is counted is the same, and this is compiled in three quarters of the time
    }
    program = [sys.executable, "-m", "tests.added_rule"]
    done = subprocess.run(program, env=around, cwd=folder, check=False, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    return json.loads(done.stdout)


@pytest.mark.parametrize(
    ("number", "tier"), [*((number, "interpreted") for number in PLACES), (PLACES[-1], "compiled")]
)
def test_environments_count_a_rule_that_was_added(tmp_path, number: int, tier: str) -> None:
    found = counted(tmp_path, number, tier)
    breaches = found.pop("verdict")
    assert breaches == {"1.collision": 1, "1.road": 1, "2.left": 2, "2.turn": 2, NAME: breaches[NAME]}
    assert breaches[NAME] >= 2
    assert [own for own in found.pop("sentences") if f"the ego broke {NAME} near (" in own]
    assert set(found.pop("expected")) == {rule for rule in RULES if not rule.startswith("E")}
    for kind, costs in found.items():
        assert costs.pop("at_fault") == 1.0, kind  # the obstacle
        assert {rule: cost for rule, cost in costs.items() if cost} == breaches, kind
