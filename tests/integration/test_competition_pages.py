"""The pages on competitions: their commands can be read, and the first ones of each give what they promise."""

from __future__ import annotations

import re
import shlex
from pathlib import Path
from typing import Any

import pytest
import typer

from dubins_traffic.cli.main import app, main
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


def test_the_first_blocks_work_as_typed(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("HOME", str(tmp_path))
    organiser, participant = blocks("organisers.md")[0], blocks("participants.md")[0]
    for line in [*organiser, *participant]:
        words = [word.replace("~", str(tmp_path)) for word in shlex.split(line)[1:]]
        assert main(words) == 0, f"{line}\n{capsys.readouterr().err}"
    assert capsys.readouterr().out.count("commitment ") == 2
    text = (PAGES / "file.md").read_text(encoding="utf-8")
    (code,) = re.findall(r"```python\n(.*?)```", text, re.DOTALL)
    exec(code, {"__name__": "page"})
    assert capsys.readouterr().out == "1 ours 0.0 (0.0, 0.0) ()\n"
    assert len(list((tmp_path / "records").glob("*.mcap"))) == 4
    (folder,) = (tmp_path / "evaluations").glob("practice-*")
    found = load_evaluation(folder)
    assert {own.owner for own in found.results} == {None}
    assert len(found.results) == 4
