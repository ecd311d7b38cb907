"""Tests run on any processor: none starts a kernel that has to know its registers, and none reads its model."""

from __future__ import annotations

import re
from pathlib import Path

from tests import guest
from tests.architecture.house import ROOT

PLACES = ("tests", "scripts", "docs", ".ci", ".github", "Makefile", "pyproject.toml")
OF_A_MODEL = re.compile(
    r"linux\.uml|user-mode-linux|cpuinfo|lscpu|platform\.processor|cpu_(?:model|flags|name)|\b(?:avx|amx)\w*\b",
    re.I,
)
"""What starts user-mode Linux, whose frame is too small for the registers of some models, or asks for the model."""
WRITTEN = {".py", ".sh", ".md", ".toml", ".yml", ".cpp", ".c", ".hpp", ""}


def written() -> list[Path]:
    found = [path for place in PLACES for path in [ROOT / place, *(ROOT / place).rglob("*")]]
    return [path for path in found if path.suffix in WRITTEN and path.is_file() and path != Path(__file__)]


def test_nothing_starts_user_mode_linux_or_reads_the_model_of_the_processor() -> None:
    assert len(written()) > 300
    assert [str(path) for path in written() if OF_A_MODEL.search(path.read_text(encoding="utf-8"))] == []


def test_a_kernel_of_its_own_runs_on_an_emulated_processor_that_is_always_the_same() -> None:
    words = guest.MACHINE.split()
    assert words[words.index("-accel") + 1] == "tcg"
    assert words[words.index("-cpu") + 1] not in ("host", "max", "base")
