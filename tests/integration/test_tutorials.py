"""The tutorials: all that they show runs, in its order, in an empty folder."""

from __future__ import annotations

import os
import re
import signal
import subprocess
import sys
from collections.abc import Mapping
from pathlib import Path

import pytest

from dubins_traffic.sandbox.available import available_layers
from tests.integration.test_readme import FILE_NAME, ROOT, runnable
from tests.ports import kept_port
from tests.ros import finish, need_ros, read_until

TUTORIALS = ROOT / "docs" / "tutorials"
RUN = ("synthesis", "learning")
ELSEWHERE = ("first-controller", "reading-a-verdict", "campaign")
"""Run by `test_stranger`, in an environment of its own."""
ENVIRONMENT = os.environ | {
    "PATH": f"{Path(sys.executable).parent}{os.pathsep}{os.environ['PATH']}",
    "REPOSITORY": str(ROOT),
}


def text(name: str) -> str:
    return (TUTORIALS / f"{name}.md").read_text(encoding="utf-8")


def follow(name: str, folder: Path, around: Mapping[str, str] = ENVIRONMENT) -> None:
    """Do what a tutorial says, and see that the pages which it names are there."""
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
    shown = re.findall(r"`((?:\w+/)*\w+\.html)`", text(name))
    assert [page for page in shown if not (folder / page).exists()] == []


def test_every_tutorial_is_run() -> None:
    assert {path.stem for path in TUTORIALS.glob("*.md")} == {*RUN, *ELSEWHERE, "ros", "competition"}


@pytest.mark.parametrize("name", RUN)
def test_a_tutorial_runs(name: str, tmp_path: Path) -> None:
    follow(name, tmp_path)


def test_the_tutorial_on_competitions_runs(tmp_path: Path) -> None:
    if (lacking := available_layers().missing()) and os.environ.get("CI") != "true":
        pytest.skip(lacking[0])
    follow("competition", tmp_path)
    assert list((tmp_path / "evaluations").rglob("results.jsonl"))


def test_the_tutorial_on_ros_runs(tmp_path: Path) -> None:
    need_ros()
    session, node, looked, checked = re.findall(
        r"^```bash\n(.*?)^```$", text("ros"), re.MULTILINE | re.DOTALL
    )
    port = kept_port()
    node = node.replace("11311", str(port)).replace("examples/", f"{ROOT}/examples/")
    session = session.replace("--master", f"--master --port {port}")

    def start(code: str) -> subprocess.Popen[str]:
        return subprocess.Popen(
            ["bash", "-euc", code],
            cwd=tmp_path,
            env=ENVIRONMENT,
            stderr=subprocess.PIPE,
            text=True,
            start_new_session=True,
        )

    running = [start(session)]
    try:
        read_until(running[0], "READY")
        running.append(start(node))
        finish(running[0])
        assert running[0].returncode == 0
    finally:
        for process in running:
            if process.poll() is None:
                os.killpg(process.pid, signal.SIGKILL)
            if process.stderr and not process.stderr.closed:
                process.communicate()
    subprocess.run(["bash", "-euc", looked], cwd=tmp_path, env=ENVIRONMENT, check=True, capture_output=True)
    assert (tmp_path / "ros.html").exists()
    assert "check-controller" in checked
