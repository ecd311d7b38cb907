"""The script that goes from our game to TuLiP and back on the road."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

from tests.tools import interpreter_with

SCRIPT = Path(__file__).parents[2] / "examples" / "foreign_synthesis.py"


def test_the_script_goes_to_the_tool_and_back() -> None:
    command = [sys.executable, str(SCRIPT), "--tulip", interpreter_with("tulip")]
    ran = subprocess.run(command, capture_output=True, text=True, check=False, timeout=600)
    assert ran.returncode == 0, ran.stderr
    game, found, road = ran.stdout.splitlines()
    assert game.startswith("1 e-agent, 16 cells")
    assert found.startswith("TuLiP finds a strategy of ")
    assert road.startswith("on the road: satisfied, ")
