"""The tutorials: all that they show runs, in its order, in an empty folder."""

from __future__ import annotations

import os
import re
import subprocess
import sys
from collections.abc import Mapping
from pathlib import Path

import pytest

from tests.integration.test_readme import FILE_NAME, ROOT, runnable
from tests.shown_pictures import assert_made
from tests.shown_scores import Shown, require_progress, tables

TUTORIALS = ROOT / "docs" / "tutorials"
RUN = ("synthesis", "learning")
ELSEWHERE = ("first-controller", "lane-keeper", "reading-a-verdict", "campaign")
"""Run by `test_stranger`, in an environment of its own."""
FOLLOWED = ("ros", "competition")
"""Run by `test_docs_code`, with a ROS master and a service."""
ENVIRONMENT = os.environ | {
    "PATH": f"{Path(sys.executable).parent}{os.pathsep}{os.environ['PATH']}",
    "REPOSITORY": str(ROOT),
}


def text(name: str) -> str:
    return (TUTORIALS / f"{name}.md").read_text(encoding="utf-8")


def follow(name: str, folder: Path, around: Mapping[str, str] = ENVIRONMENT) -> None:
    """Do what a tutorial says, and see that the pages which it names are there."""
    found: list[Shown] = []
    for language, code in runnable(text(name)):
        if named := FILE_NAME.match(code):
            (folder / named[1]).write_text(code)
            continue
        program = ["bash", "-euo", "pipefail", "-c"] if language == "sh" else ["python", "-c"]
        ran = subprocess.run(
            [*program, code],
            cwd=folder,
            env=dict(around),
            capture_output=True,
            text=True,
            check=False,
            timeout=1200,
        )
        assert ran.returncode == 0, f"{code}\n{ran.stdout}{ran.stderr}"
        found += tables(ran.stdout)
    require_progress(found)
    shown = re.findall(r"`((?:\w+/)*\w+\.html)`", text(name))
    assert [page for page in shown if not (folder / page).exists()] == []
    assert_made(text(name), folder)


def test_every_tutorial_is_run() -> None:
    assert {path.stem for path in TUTORIALS.glob("*.md")} == {*RUN, *ELSEWHERE, *FOLLOWED}


@pytest.mark.parametrize("name", RUN)
def test_a_tutorial_runs(name: str, tmp_path: Path) -> None:
    follow(name, tmp_path)
