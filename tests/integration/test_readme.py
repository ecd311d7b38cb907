"""The README's code runs as it stands, in its order."""

from __future__ import annotations

import os
import re
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
README = (ROOT / "README.md").read_text(encoding="utf-8")
BLOCK = re.compile(r"^```(\w+)\n(.*?)^```$", re.MULTILINE | re.DOTALL)
FILE_NAME = re.compile(r"# (\w+\.(?:py|toml))\n")


def blocks(language: str) -> list[str]:
    return [text for found, text in BLOCK.findall(README) if found == language]


def run_block(language: str, text: str, folder: Path) -> None:
    """Run a block of shell or Python in `folder`, or save it if its first line names a file."""
    named = FILE_NAME.match(text)
    if named:
        (folder / named[1]).write_text(text)
        return
    program = ["bash", "-euo", "pipefail", "-c"] if language == "sh" else [sys.executable, "-c"]
    path = f"{Path(sys.executable).parent}{os.pathsep}{os.environ['PATH']}"
    ran = subprocess.run(
        [*program, text],
        cwd=folder,
        env=os.environ | {"PATH": path},
        capture_output=True,
        text=True,
        check=False,
    )
    assert (ran.returncode, ran.stderr) == (0, ""), text


def test_all_code_runs(tmp_path):
    ran = [
        (language, text) for language, text in BLOCK.findall(README) if language in {"sh", "python", "toml"}
    ]
    assert len(ran) >= 6
    for language, text in ran:
        run_block(language, text, tmp_path)
    made = {path.suffix for path in tmp_path.rglob("*")}
    assert {".mcap", ".png", ".svg", ".pdf", ".html", ".csv", ".json", ".rnd"} <= made


def test_a_controller_takes_ten_lines():
    (controller,) = [text for text in blocks("python") if FILE_NAME.match(text)]
    code = [line for line in controller.splitlines() if line.strip() and not line.startswith("#")]
    assert len(code) <= 10


@pytest.mark.parametrize("target", ["demo", "test", "check", "bench"])
def test_make_targets_are_named_and_exist(target):
    assert f"make {target}" in README
    assert re.search(rf"^{target}:.*## ", (ROOT / "Makefile").read_text(), re.MULTILINE)


def test_links_lead_somewhere():
    for target in re.findall(r"\]\(([^)#]+)\)", README):
        assert "://" in target or (ROOT / target).exists(), target
