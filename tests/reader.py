"""One who does what a page says: types its commands into one shell, keeps its files, compares what it shows."""

from __future__ import annotations

import json
import os
import re
import signal
import subprocess
import sys
import time
from collections.abc import Mapping
from contextlib import ExitStack
from pathlib import Path
from typing import Any

from dubins_traffic import draw, load_config
from dubins_traffic.campaign.campaign import load_campaign
from tests.shown import ROOT, SHELL, Block, as_shown

PATIENCE_S = 7200.0 if os.environ.get("DUBINS_TRAFFIC_PAGES") == "all" else 600.0
INTERPRETER = """
import json, os, sys, traceback
answers, said = os.fdopen(os.dup(1), "w"), open(sys.argv[1], "w")
os.dup2(said.fileno(), 1), os.dup2(said.fileno(), 2)
sys.path.insert(0, "")
names = {"__name__": "__main__"}
for line in sys.stdin:
    status = 0
    try:
        exec(compile(json.loads(line), "page", "exec"), names)
    except BaseException:
        status = 1
        traceback.print_exc()
    sys.stdout.flush()
    print(status, file=answers, flush=True)
"""
"""A Python that runs block after block in one namespace, as a notebook does."""
CONFIGURATION: dict[str, Any] = {
    "version": 1,
    "problem_domain": "dubins_traffic",
    "network": {"grid": {"rows": 3, "columns": 3, "length": 6}},
    "e-agents": [{"type": "parked", "name": "van"}],
    "duration": 2,
}


class Reader:
    """Does what blocks say, one after the other, in a folder; `close` ends what is left.

    Parameters
    ----------
    folder : Path
        Where the reader is.
    replaced : Mapping of str to str, optional
        What is typed in the place of what stands on the page: ports that are this test's own, say.
    environment : Mapping of str to str, optional
        Further variables.
    """

    def __init__(
        self,
        folder: Path,
        replaced: Mapping[str, str] | None = None,
        environment: Mapping[str, str] | None = None,
    ) -> None:
        self.folder, self.replaced = folder, dict(replaced or {})
        self.around = {**os.environ, "PYTHONUNBUFFERED": "1", "COLUMNS": "160", **(environment or {})}
        self.around["PATH"] = f"{Path(sys.executable).parent}{os.pathsep}{os.environ['PATH']}"
        self.around["PIP_DRY_RUN"] = self.around["PIP_NO_INDEX"] = "1"
        self.around["PIP_DISABLE_PIP_VERSION_CHECK"] = "1"
        self.said = ""
        self.beside: list[tuple[subprocess.Popen[bytes], Block, Path]] = []
        self.python: subprocess.Popen[str] | None = None
        self.notes = folder.parent / f"{folder.name}-notes"
        self.notes.mkdir()
        self.count = 0
        self.stack = ExitStack()

    def follow(self, block: Block) -> None:
        """Do what a block says; fail if it does not end or print as it should."""
        code = block.code
        for shown, typed in self.replaced.items():
            code = code.replace(shown, typed)
        if "configuration" in block.marks:
            read_part(code)
        elif "campaign" in block.marks:
            (self.folder / "campaign.toml").write_text(code)
            assert load_campaign(self.folder / "campaign.toml").cells
        elif where := block.marks.get("excerpt of"):
            assert code in (ROOT / where).read_text(encoding="utf-8"), f"line {block.line}: not in {where}"
        elif block.file is not None:
            (self.folder / block.file).write_text(code)
        elif block.output:
            assert as_shown(block.code, self.said) == [], f"line {block.line}: shown, and not said:\n{self.said}"
        elif block.runs:
            self.run(block, code)
        if "then all ends" in block.marks:
            self.wait()

    def run(self, block: Block, code: str) -> None:
        if "beside" in block.marks:
            self.start(block, code)
            return
        status = self.shell(code) if block.language in SHELL else self.asked(code)
        said = "\n".join([self.said, *(path.read_text() for _, _, path in self.beside)])
        assert status in block.statuses, f"line {block.line}: status {status}\n{code}\n{said}"
        for told in re.findall(r"print\(.*#\s*(.*)$", code, re.MULTILINE):
            assert as_shown(told, self.said) == [], f"line {block.line}: {told}\n{self.said}"

    def shell(self, code: str) -> int:
        """Type something into the shell; what it exports stays."""
        log, state = self.log(), self.notes / "environment"
        typed = f"{code}\nenv -0 > {state}"
        with log.open("wb") as said:
            ran = subprocess.run(
                ["bash", "-euo", "pipefail", "-c", typed],
                cwd=self.folder, env=self.around, stdin=subprocess.DEVNULL, stdout=said, stderr=said, check=False,
                timeout=PATIENCE_S,
            )  # fmt: skip
        self.said = log.read_text()
        assert "does not provide the extra" not in self.said, self.said
        if ran.returncode == 0:
            self.around = dict(pair.split("=", 1) for pair in state.read_text().split("\0") if pair)
        return ran.returncode

    def asked(self, code: str) -> int:
        """Give a block to the page's Python."""
        log = self.notes / "python"
        if self.python is None:
            self.python = subprocess.Popen(
                [sys.executable, "-c", INTERPRETER, str(log)],
                cwd=self.folder, env=self.around, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True,
            )  # fmt: skip
        assert self.python.stdin is not None
        assert self.python.stdout is not None
        before = len(log.read_text()) if log.exists() else 0
        self.python.stdin.write(json.dumps(code) + "\n")
        self.python.stdin.flush()
        status = int(self.python.stdout.readline())
        self.said = log.read_text()[before:]
        return status

    def start(self, block: Block, code: str) -> None:
        """Begin what runs beside, and wait until it has said what it should."""
        program = ["bash", "-euc", code] if block.language in SHELL else [sys.executable, "-c", code]
        log = self.log()
        with log.open("wb") as said:
            process = subprocess.Popen(
                program, cwd=self.folder, env=self.around, stdin=subprocess.DEVNULL, stdout=said, stderr=said,
                start_new_session=True,
            )  # fmt: skip
        self.beside.append((process, block, log))
        until = time.monotonic() + PATIENCE_S
        while block.marks.get("until", "") not in log.read_text():
            assert process.poll() is None, f"line {block.line}: it ended\n{log.read_text()}"
            assert time.monotonic() < until, f"line {block.line}: never said\n{log.read_text()}"
            time.sleep(0.05)

    def wait(self) -> None:
        """Wait for what runs beside and ends by itself, then end the rest."""
        for process, block, log in self.beside:
            if "ended" not in block.marks:
                process.wait(timeout=PATIENCE_S)
                self.said = log.read_text()
                told = f"line {block.line}\n" + "\n".join(own.read_text() for _, _, own in self.beside)
                assert process.returncode in block.statuses, told
        self.end()

    def end(self) -> None:
        """End what does not end by itself; fail if it has done so already, and badly."""
        ended, self.beside = self.beside, []
        found = [(process.poll(), block, log) for process, block, log in ended]
        for process, _, _ in ended:
            if process.poll() is None:
                os.killpg(process.pid, signal.SIGINT)
        for process, _, _ in ended:
            try:
                process.wait(timeout=30)
            except subprocess.TimeoutExpired:
                os.killpg(process.pid, signal.SIGKILL)
                process.wait()
        for status, block, log in found:
            assert status is None or status in block.statuses, log.read_text()

    def close(self) -> None:
        """End what is left."""
        try:
            self.end()
        finally:
            self.stack.close()
            if self.python is not None:
                self.python.communicate()

    def log(self) -> Path:
        self.count += 1
        return self.notes / f"{self.count}.log"


def read_part(code: str) -> None:
    """Read a part of a configuration: fields, or an e-agent, in the place of those of a small one; draw from it."""
    part = json.loads(code if code.startswith("{") else f"{{{code}}}")
    if "type" in part:
        part = {"e-agents": [part]}
    here = Path.cwd()
    os.chdir(ROOT)
    try:
        draw(load_config(CONFIGURATION | part), 1, 0)
    finally:
        os.chdir(here)
