"""What pages of the documentation show as code is run, and for every page it is known where."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest

from dubins_traffic.sandbox.available import available_layers
from tests.integration.test_readme import BLOCK, FILE_NAME, ROOT

DOCS = ROOT / "docs"
HERE = {
    "package.md": "",
    "falsify.md": "",
    "maps.md": "dt.RoadNetwork.grid(3, 3, length=6.0).write('town.net.xml')",
    "records.md": "dt.run_trial(dt.draw(config, seed=1, trial=0), record='out/trial-0000.mcap')",
    "campaigns.md": "Path('gaps.toml').write_text(GAPS)",
    "sandbox.md": "Path('theirs.py').write_text(THEIRS); instance = dt.draw(config, seed=1, trial=0)",
}
"""Page: what its code takes for granted."""
BEFORE = """
import json
from pathlib import Path
import dubins_traffic as dt
Path("out").mkdir(exist_ok=True)
config = dt.load_config("demo")
GAPS = 'version = 0\\ntrials = 2\\ncontrollers = ["lanes", "simple"]\\nconfigurations = ["demo"]\\n'
THEIRS = "class Driver:\\n    def start(self, problem): ...\\n    def act(self, observation): return 0.1, 0.0\\n"
"""
ELSEWHERE = {
    "attach.md": "test_help_examples.py",
    "batches.md": "test_readme.py",
    "python.md": "test_readme.py",
    "learning.md": "test_learning.py",
    "learning-agents.md": "test_parallel_env.py",
    "competitions/file.md": "test_competition_pages.py",
    "competitions/participants.md": "test_competition_pages.py",
}
"""Page: the tests that run its code."""


def pages() -> set[str]:
    found = {
        path.relative_to(DOCS).as_posix(): path.read_text(encoding="utf-8") for path in DOCS.rglob("*.md")
    }
    return {
        name
        for name, text in found.items()
        if any(kind in {"sh", "python"} for kind, _ in BLOCK.findall(text))
    }


def test_for_every_page_it_is_known_where_its_code_is_run() -> None:
    apart = {name for name in pages() if name.startswith(("tutorials/", "extending/"))}
    assert pages() - apart == {*HERE, *ELSEWHERE}


@pytest.mark.parametrize("name", sorted(HERE))
def test_the_code_of_a_page_runs(name: str, tmp_path: Path) -> None:
    if name == "sandbox.md" and (lacking := available_layers().missing()) and os.environ.get("CI") != "true":
        pytest.skip(lacking[0])
    text = (DOCS / name).read_text(encoding="utf-8")
    shown = [(kind, code) for kind, code in BLOCK.findall(text) if kind in {"sh", "python"}]
    assert shown
    environment = os.environ | {"PATH": f"{Path(sys.executable).parent}{os.pathsep}{os.environ['PATH']}"}
    (tmp_path / "before.py").write_text(f"{BEFORE}{HERE[name]}\n")
    programs = [[sys.executable, "before.py"]]
    for kind, code in shown:
        if named := FILE_NAME.match(code):
            (tmp_path / named[1]).write_text(code)
        else:
            before = f"from before import *\n{code}" if name == "sandbox.md" else code
            programs.append(["bash", "-euc", code] if kind == "sh" else [sys.executable, "-c", before])
    for program in programs:
        ran = subprocess.run(
            program, cwd=tmp_path, env=environment, capture_output=True, text=True, check=False
        )
        assert ran.returncode == 0, ran.stderr
