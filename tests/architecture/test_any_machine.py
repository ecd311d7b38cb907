"""Tests run on any processor, however they are begun: children hear Ctrl-C, none runs on without an end."""

from __future__ import annotations

import subprocess
import sys
from importlib.metadata import distributions
from pathlib import Path

import pytest
from packaging.specifiers import SpecifierSet
from packaging.utils import canonicalize_name

from tests import guest
from tests.architecture.house import ROOT

OF_DEBIAN_12 = "3.11.2"
"""The Python of Debian 12."""


def test_a_kernel_of_its_own_runs_on_an_emulated_processor_that_is_always_the_same() -> None:
    words = guest.MACHINE.split()
    assert words[words.index("-accel") + 1] == "tcg"
    assert words[words.index("-cpu") + 1] not in ("host", "max", "base")


def test_programs_that_tests_start_hear_ctrl_c_wherever_the_tests_were_begun() -> None:
    heard = "import signal; print(signal.getsignal(signal.SIGINT) is signal.default_int_handler)"
    tests = f"import subprocess, sys, tests.conftest; subprocess.run([sys.executable, '-c', {heard!r}], check=True)"
    deaf = ["sh", "-c", "trap '' INT; exec \"$@\"", "sh", sys.executable, "-c"]
    for code, found in ((heard, "False\n"), (tests, "True\n")):
        done = subprocess.run([*deaf, code], cwd=ROOT, capture_output=True, text=True, check=True)
        assert done.stdout == found


HANGS = """import ctypes, subprocess, sys

def test_holds_pythons_lock():
    ctypes.PyDLL(None).sleep(3600)

def test_waits_for_a_program():
    with subprocess.Popen([sys.executable, "-c", "import sys; sys.stdin.read()"], stdin=subprocess.PIPE) as program:
        program.wait()
"""


@pytest.mark.parametrize("name", ["test_holds_pythons_lock", "test_waits_for_a_program"])
def test_a_test_that_hangs_is_ended_whatever_it_waits_for(
    name: str, tmp_path: Path, pytestconfig: pytest.Config
) -> None:
    assert 0 < float(pytestconfig.getini("faulthandler_timeout")) <= 1800
    (tmp_path / "test_hangs.py").write_text(HANGS)
    command = [sys.executable, "-m", "pytest", "-c", ROOT / "pyproject.toml", "--rootdir", tmp_path]
    command += ["-o", "faulthandler_timeout=1", f"{tmp_path / 'test_hangs.py'}::{name}"]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert done.returncode == 1
    assert "Timeout" in done.stderr
    assert name in done.stderr


PYTHON = """#!/bin/sh
echo "$@" >>asked
case "$*" in *multiprocessing*) exit {status} ;; esac
"""


@pytest.mark.parametrize(("status", "jobs"), [(0, "-j 0"), (1, "-j 1")])
def test_it_is_installed_where_processes_share_no_lock(status: int, jobs: str, tmp_path: Path) -> None:
    """A chroot has often no /dev/shm: compiling on all processors ended with a traceback there."""
    python = tmp_path / ".venv" / "bin" / "python"
    script = tmp_path / "scripts" / "setup.sh"
    for path, text in (
        (python, PYTHON.format(status=status)),
        (script, (ROOT / "scripts/setup.sh").read_text()),
    ):
        path.parent.mkdir(parents=True)
        path.write_text(text)
        path.chmod(0o755)
    subprocess.run([script, "plot"], check=True, capture_output=True)
    (line,) = [one for one in (tmp_path / "asked").read_text().splitlines() if "compileall" in one]
    assert jobs in line


def test_all_that_is_pinned_installs_with_the_python_of_debian_12() -> None:
    lines = (ROOT / "constraints.txt").read_text().splitlines()
    pinned = {canonicalize_name(line.partition("==")[0]) for line in lines if "==" in line}
    found = {
        own.name: own.metadata.get("Requires-Python") or ""
        for own in distributions()
        if canonicalize_name(own.name) in pinned
    }
    assert len(found) > 100
    assert not {name for name, asked in found.items() if not SpecifierSet(asked).contains(OF_DEBIAN_12)}
