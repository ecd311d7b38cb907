"""The pages on competitions: their commands can be read, and the first ones of each give what they promise."""

from __future__ import annotations

import os
import re
import shlex
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest
import typer

from dubins_traffic.cli.main import app
from dubins_traffic.competition.evaluating import load_evaluation

ROOT = Path(__file__).parents[2]
PAGES = ROOT / "docs" / "competitions"


def blocks(page: str) -> list[list[str]]:
    """Return the commands of each block of a page, without comments and what installs the package."""
    text = (PAGES / page).read_text(encoding="utf-8")
    found = re.findall(r"```bash\n(.*?)```", text, re.DOTALL)
    lines = [[line.partition(" #")[0].strip() for line in block.splitlines()] for block in found]
    return [[line for line in block if line.startswith("dubins-traffic ")] for block in lines]


TYPED = [line for page in ("participants.md", "organisers.md") for block in blocks(page) for line in block]


@pytest.mark.parametrize("line", TYPED)
def test_a_command_can_be_read(line: str) -> None:
    command: Any = typer.main.get_command(app)
    words = shlex.split(line)[1:]
    context = None
    while hasattr(command, "commands"):
        context = command.make_context(words[0], words, parent=context)
        _, command, words = command.resolve_command(context, words)
    command.make_context(words[0] if words else "", words, parent=context)


def test_the_first_blocks_work_as_typed(tmp_path: Path) -> None:
    organiser, participant = blocks("organisers.md")[0], blocks("participants.md")[0]
    around = {**os.environ, "PYTHONPATH": str(ROOT / "src"), "HOME": str(tmp_path)}
    said = ""
    for line in [*organiser, *participant]:
        words = [word.replace("~", str(tmp_path)) for word in shlex.split(line)[1:]]
        done = subprocess.run(
            [sys.executable, "-m", "dubins_traffic.cli", *words],
            cwd=tmp_path,
            env=around,
            capture_output=True,
            text=True,
            check=False,
        )
        assert done.returncode == 0, f"{line}\n{done.stderr}"
        said += done.stdout
    assert said.count("commitment ") == 2
    text = (PAGES / "file.md").read_text(encoding="utf-8")
    (code,) = re.findall(r"```python\n(.*?)```", text, re.DOTALL)
    done = subprocess.run(
        [sys.executable, "-c", code], cwd=tmp_path, env=around, capture_output=True, text=True, check=True
    )
    assert done.stdout == "1 ours 0.0 (0.0, 0.0) ()\n"
    assert len(list((tmp_path / "records").glob("*.mcap"))) == 4
    (folder,) = (tmp_path / "evaluations").glob("practice-*")
    found = load_evaluation(folder)
    assert {own.owner for own in found.results} == {None}
    assert len(found.results) == 4
