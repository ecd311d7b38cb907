"""From `pip install` to the first place in the table, by the commands of the page for organisers, in a real browser.

A fresh environment is made and installed into from these sources, with pip's own cache and settings; kernels are
compiled anew, since a new machine has none. The bar is one of the clock on a quiet machine with a warm cache of pip;
the processor time beside it says what of it is work.
"""

from __future__ import annotations

import os
import resource
import shutil
import subprocess
import sys
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from tempfile import TemporaryDirectory
from time import perf_counter

from tests.browser import browsing
from tests.first_submission import commands, first_place, served

from benchmarks.table import Row
from dubins_traffic.competition.templates import write_template

MOST_S = 120.0
ROOT = Path(__file__).parents[1]
SOURCES = ("pyproject.toml", "constraints.txt", "LICENSE", "docs/package.md", "src")


class Course:
    """Steps, each with the time on the clock that it took."""

    def __init__(self) -> None:
        self.rows: list[Row] = []
        self.total = 0.0

    @contextmanager
    def step(self, name: str) -> Iterator[None]:
        """Time a step."""
        began = perf_counter()
        yield
        took = perf_counter() - began
        self.total += took
        self.rows.append(Row(name, f"{took:.1f} s", "-", True))


def used() -> float:
    """Return the processor time of all that was run here and has ended; boxes are not among it."""
    found = resource.getrusage(resource.RUSAGE_CHILDREN)
    return found.ru_utime + found.ru_stime


def sources(folder: Path) -> None:
    """Copy what a package is built from."""
    for name in SOURCES:
        if (ROOT / name).is_dir():
            ignored = shutil.ignore_patterns("__pycache__", "*.egg-info")
            shutil.copytree(ROOT / name, folder / name, ignore=ignored)
        else:
            (folder / name).parent.mkdir(parents=True, exist_ok=True)
            shutil.copy(ROOT / name, folder / name)


def install(folder: Path, around: Mapping[str, str]) -> None:
    """Install as the page says, from the sources in `folder` in place of an index, with the tested versions."""
    _, (pip, *words), _ = commands()
    assert (pip, words[0]) == ("pip", "install"), words
    extra = words[1].partition("[")[2].rstrip("]")
    line = [str(folder / "env" / "bin" / "python"), "-m", "pip", "install", "--quiet", "--constraint"]
    line += [
        "constraints.txt",
        f".[{extra},compile]",
    ]  # these sources have no machine code, which a wheel has
    subprocess.run(line, cwd=folder, env=around, check=True, stderr=subprocess.DEVNULL)


def followed(course: Course, folder: Path) -> None:
    """Follow the page from nothing to the table."""
    ours = ("PYTHONPATH", "NUMBA_CACHE_DIR", "VIRTUAL_ENV")
    around = {key: value for key, value in os.environ.items() if key not in ours}
    with course.step("pip install of the package with its extra service"):
        install(folder, around)
    around |= {"XDG_CONFIG_HOME": str(folder / "config"), "XDG_CACHE_HOME": str(folder / "cache")}
    with browsing(folder / "profile") as browser:
        with course.step("dubins-traffic serve, until it says where it is"):
            service = served([str(folder / "env" / "bin" / "dubins-traffic")], folder, around)
        try:
            with course.step("join, invite, hand in, first place in the table"):
                first_place(browser, service, folder / "entry" / "controller.py")
        finally:
            service.end()


def measure() -> list[Row]:
    """Return the rows of this benchmark."""
    course = Course()
    with TemporaryDirectory(ignore_cleanup_errors=True) as name:  # a builder still compiles
        folder = Path(name)
        sources(folder)
        write_template("python", folder / "entry")
        subprocess.run([sys.executable, "-m", "venv", str(folder / "env")], check=True)
        before = used()
        followed(course, folder)
        work = used() - before
    name, bar = (
        "from pip install to the first place in the table",
        f"at most {MOST_S:.0f} s on a quiet machine",
    )
    clock = f"{course.total:.0f} s; load {os.getloadavg()[0]:.1f}"
    return [
        *course.rows,
        Row("processor time of all of it", f"{work:.0f} s", f"at most {MOST_S:.0f} s", work <= MOST_S),
        Row(name, clock, bar, course.total <= MOST_S),
    ]
