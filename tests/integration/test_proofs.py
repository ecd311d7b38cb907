"""The proofs hold, planted flaws are refuted, and the page says what is covered. `make proofs` does all of it."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
QUICK = (
    "road",
    "memory",
    "reach",
    "far",
    "away",
    "heading",
    "straight",
    "listed",
    "obstacle",
    "order",
    "called",
)


def proofs(*words: str) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        [sys.executable, "-m", "proofs", *words], cwd=ROOT, capture_output=True, text=True, check=False
    )


def test_what_is_proved_quickly_is_proved_and_its_flaws_are_refuted() -> None:
    done = proofs(*QUICK, "--flaws")
    assert done.returncode == 0, done.stdout + done.stderr
    lines = done.stdout.splitlines()
    assert [line.partition(":")[0] for line in lines if ": proved, " in line] == list(QUICK)
    assert len([line for line in lines if line.startswith("flaw in ") and ": refuted: " in line]) >= 14


@pytest.mark.long
@pytest.mark.parametrize("names", ["lane crossing standing", "driven"])
def test_what_takes_longer_is_proved_and_its_flaws_are_refuted(names: str) -> None:
    done = proofs(*names.split(), "--flaws")
    assert done.returncode == 0, done.stdout + done.stderr


def test_another_obligation_is_refused_by_name() -> None:
    done = proofs("gravity")
    assert done.returncode == 2
    assert "no such obligation: gravity; there are road, " in done.stderr


def test_the_page_lists_the_obligations() -> None:
    page = ROOT / "docs" / "proofs.md"
    made = subprocess.run(
        [sys.executable, "-c", "from proofs.__main__ import page; print(page(), end='')"],
        cwd=ROOT, capture_output=True, text=True, check=True,
    )  # fmt: skip
    assert made.stdout == page.read_text(encoding="utf-8")
