"""Tools that some tests need and `pip` does not bring, and those that `scripts/crosscheck-tools.sh` installs.

Every test that asks for one carries the mark `tools`: `need` fails another one, also where the tool is there. So what
`make test` runs, tests without the mark, needs nothing but Python.
"""

from __future__ import annotations

import importlib
import json
import os
import shutil
import subprocess
import tempfile
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from functools import cache
from pathlib import Path
from threading import Timer
from typing import Any

import pytest

FOLDER = Path(__file__).resolve().parents[1] / "build" / "crosscheck"
PATIENCE_S = 600.0
MARK = "tools"
_running: list[pytest.Item] = []


@contextmanager
def running(item: pytest.Item) -> Iterator[None]:
    """Say which test runs, until it has ended."""
    _running.append(item)
    try:
        yield
    finally:
        _running.pop()


def need(lacking: str, installed_by: str = "`make tools` installs it") -> None:
    """Go on if nothing is lacking; else skip the test, or fail it under CI. A test without the mark always fails.

    Parameters
    ----------
    lacking : str
        What is not here, or does not work, for a person; empty if all is here.
    installed_by : str
        What would bring it, for a person.
    """
    if _running and _running[-1].get_closest_marker(MARK) is None:
        pytest.fail(f"a test that asks for a tool carries the mark `{MARK}`, and this one does not")
    if not lacking:
        return
    reason = f"{lacking}: not here, or does not start: {installed_by}"
    if os.environ.get("CI") == "true":
        pytest.fail(reason)
    pytest.skip(reason)


def need_programs(*names: str, installed_by: str = "scripts/system-packages.sh installs it") -> None:
    """Go on if all these programs are here."""
    need(", ".join(name for name in names if shutil.which(name) is None), installed_by)


def need_module(name: str) -> None:
    """Go on if a library of Python's can be loaded; one that needs a library of the system's counts as a tool."""
    try:
        importlib.import_module(name)
    except ImportError as error:
        need(f"{name} ({error})", "its extra and scripts/system-packages.sh install it")
    else:
        need("")


def need_marked(item: pytest.Item) -> None:
    """Look for the tools that the marks of a test name, before its fixtures: `pytest.mark.tools("boxes")`.

    A name is that of a module here that has a function `need`.
    """
    for name in {str(name) for mark in item.iter_markers(MARK) for name in mark.args}:
        importlib.import_module(f"tests.{name}").need()


def interpreter_with(tool: str) -> str:
    """Return the Python that has `tool`; skip the test, or fail it under CI, where there is none."""
    return _found(str(FOLDER / tool / "bin" / "python"), tool)


def sumo_program(name: str) -> str:
    """Return the path of one of SUMO's own programs, in its package: it runs wherever the environment stands.

    Where it can't start, for want of a library of the system, it counts as not there.
    """
    environment = Path(interpreter_with("sumo")).parents[1]
    path = str(next(environment.glob("lib/python*/site-packages/sumo/bin")) / name)
    return _found(path if _starts(path) else "", name)


def program(name: str) -> str:
    """Return the path of a program; skip the test, or fail it under CI, where there is none."""
    return _found(shutil.which(name) or "", name)


class Solver:
    """A program that other people's Python runs: it reads requests and writes answers, each a line of JSON.

    One that has begun answers many requests, since to import the tools takes longer than most answers.
    """

    def __init__(self, tool: str, script: Path, errors: Path) -> None:
        self._errors = errors
        with errors.open("w") as stderr:
            self._process = subprocess.Popen(
                [interpreter_with(tool), str(script)],
                stdin=subprocess.PIPE,
                stdout=subprocess.PIPE,
                stderr=stderr,
                text=True,
                bufsize=1,
            )

    def ask(self, request: object) -> Any:
        """Return the answer to a request."""
        given, told = self._process.stdin, self._process.stdout
        assert given is not None
        assert told is not None
        late = Timer(PATIENCE_S, self._process.kill)
        late.start()
        try:
            given.write(f"{json.dumps(request)}\n")
            for line in told:
                if line.startswith(("[", "{")):
                    return json.loads(line)
        except BrokenPipeError:
            pass
        finally:
            late.cancel()
        raise AssertionError(self._errors.read_text()[-2000:])

    def close(self) -> None:
        """End it."""
        self._process.kill()
        self._process.communicate()


class Solvers:
    """Programs of other people's tools, each begun when it is asked for the first time."""

    def __init__(self, folder: Path) -> None:
        self._folder = folder
        self._begun: dict[Path, Solver] = {}

    def ask(self, tool: str, script: Path, request: object) -> Any:
        """Return what a script answers that the Python of a tool runs."""
        if script not in self._begun:
            self._begun[script] = Solver(tool, script, self._folder / f"{script.stem}.txt")
        return self._begun[script].ask(request)

    def close(self) -> None:
        """End all of them."""
        for solver in self._begun.values():
            solver.close()


@contextmanager
def solvers() -> Iterator[Solvers]:
    """Yield programs of other people's tools, which end afterwards."""
    with ExitStack() as stack:
        made = Solvers(Path(stack.enter_context(tempfile.TemporaryDirectory())))
        stack.callback(made.close)
        yield made


@cache
def _starts(path: str) -> bool:
    return subprocess.run([path, "--version"], check=False, capture_output=True, timeout=PATIENCE_S).returncode == 0


def _found(path: str, name: str) -> str:
    need("" if Path(path).is_file() else name)
    return path
