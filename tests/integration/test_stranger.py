"""The path of a stranger, by the site alone: install, a controller, its verdict, a campaign, a foreign strategy."""

from __future__ import annotations

import os
import subprocess
import sys
from collections.abc import Mapping, Sequence
from pathlib import Path

import pytest

from tests.integration.test_readme import ROOT
from tests.integration.test_tutorials import follow
from tests.tools import interpreter_with

PATIENCE_S = 1800.0
STEPS = ("first-controller", "lane-keeper", "reading-a-verdict", "campaign")
"""Tutorials on the path."""


def done(words: Sequence[object], folder: Path, around: Mapping[str, str]) -> str:
    ran = subprocess.run(
        [str(word) for word in words],
        cwd=folder,
        env=dict(around),
        capture_output=True,
        text=True,
        check=False,
        timeout=PATIENCE_S,
    )
    assert ran.returncode == 0, f"{words}\n{ran.stdout}{ran.stderr}"
    return ran.stdout


def installed(folder: Path) -> dict[str, str]:
    """Install the package, as the site's first page says, into an environment of its own; return what is set there."""
    around = {name: own for name, own in os.environ.items() if name not in {"PYTHONPATH", "VIRTUAL_ENV"}}
    done([sys.executable, "-m", "build", "--wheel", "--outdir", folder / "dist", ROOT], folder, around)
    (wheel,) = (folder / "dist").iterdir()
    done([sys.executable, "-m", "venv", "--without-pip", folder / "environment"], folder, around)
    programs = folder / "environment" / "bin"
    pip = [sys.executable, "-m", "pip", "--python", programs / "python", "install", "--quiet", "--no-compile"]
    pip += ["--constraint", ROOT / "constraints.txt"]
    done([*pip, f"{wheel}[campaign,compile,pandas]"], folder, around)
    return around | {"PATH": f"{programs}{os.pathsep}{around['PATH']}"}


@pytest.mark.path
def test_the_first_page_leads_there() -> None:
    """It installs what `installed` does, and links to each step; the last one names its program."""
    page = (ROOT / "website" / "index.md").read_text(encoding="utf-8")
    assert "\npip install '.[campaign,compile,pandas]'\n" in page
    places = [page.index(f"(tutorials/{name}.md)") for name in STEPS] + [page.index("(foreign-strategies.md)")]
    assert places == sorted(places)
    last = (ROOT / "docs" / "foreign-strategies.md").read_text(encoding="utf-8")
    assert "python examples/foreign_synthesis.py --tulip " in last


@pytest.mark.tools
def test_the_path_of_a_stranger(tmp_path: Path) -> None:
    around = installed(tmp_path)
    for name in STEPS:
        (tmp_path / name).mkdir()
        follow(name, tmp_path / name, around)
    report = (tmp_path / "campaign" / "first" / "report" / "index.html").read_text(encoding="utf-8")
    assert "Brackets hold 95 % intervals" in report
    where = [
        tmp_path / "environment" / "bin" / "python",
        "-c",
        "import dubins_traffic as dt; print(dt.__file__)",
    ]
    assert done(where, tmp_path, around).startswith(str(tmp_path))
    example = ROOT / "examples" / "foreign_synthesis.py"
    told = done([where[0], example, "--tulip", interpreter_with("tulip")], tmp_path, around)
    game, found, road = told.splitlines()
    assert game.startswith("1 e-agent, 16 cells")
    assert found.startswith("TuLiP finds a strategy of ")
    assert road.startswith("on the road: satisfied, ")
    told = done([where[0], example, "--spot", interpreter_with("spot")], tmp_path, around)
    _, found, road = told.splitlines()
    assert found.startswith("Spot finds a strategy of ")
    assert road.startswith("on the road: satisfied, ")
