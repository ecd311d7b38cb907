"""Stable-Baselines3 learns in our environments by the adapter that is shipped. `make test-all` runs this.

It is no part of `make test-tools`, since it brings gigabytes (`scripts/crosscheck-tools.sh learners`).
"""

from __future__ import annotations

import json
import os
import subprocess

import pytest

from tests.architecture.house import ROOT
from tests.shown import blocks

pytestmark = pytest.mark.tools


def test_it_learns_and_what_it_sees_is_what_the_environment_shows() -> None:
    """The program checks each step against an environment that nobody has adapted."""
    told = json.loads(ran("-m", "tests.crosscheck.learning"))
    assert told["checked"] >= 2_000
    assert told["truncated"] > 0
    assert told["outcomes"] == told["over"] > 0
    assert told["learned"] == 8_192
    assert told["episodes"] > 0


def test_the_code_of_the_page_runs() -> None:
    (code,) = [own.code for own in blocks(ROOT / "docs" / "learning.md") if "import vec_env" in own.code]
    ran("-c", code)


def ran(*arguments: str) -> str:
    """Return what the Python that has Stable-Baselines3 prints."""
    program = ROOT / "build" / "crosscheck" / "learners" / "bin" / "python"
    around = {**os.environ, "PYTHONPATH": f"{ROOT / 'src'}{os.pathsep}{ROOT}"}
    done = subprocess.run([program, *arguments], env=around, cwd=ROOT, check=False, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    return done.stdout
