"""Other people's tools that some tests compare with; `scripts/crosscheck-tools.sh` installs them."""

from __future__ import annotations

import os
import shutil
from pathlib import Path

import pytest

FOLDER = Path(__file__).resolve().parents[1] / "build" / "crosscheck"


def interpreter_with(tool: str) -> str:
    """Return the Python that has `tool`; skip the test, or fail it under CI, where there is none."""
    return _found(str(FOLDER / tool / "bin" / "python"), tool)


def program(name: str) -> str:
    """Return the path of a program; skip the test, or fail it under CI, where there is none."""
    return _found(shutil.which(name) or "", name)


def _found(path: str, name: str) -> str:
    if not Path(path).is_file():
        reason = f"{name} is not here: scripts/crosscheck-tools.sh installs it"
        if os.environ.get("CI") == "true":
            pytest.fail(reason)
        pytest.skip(reason)
    return path
