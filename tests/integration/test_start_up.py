"""Importing the package and asking for help are quick and load nothing heavy."""

from __future__ import annotations

import resource
import subprocess
import sys
from pathlib import Path

import pytest

import dubins_traffic

pytestmark = pytest.mark.path

HEAVY = ("numba", "llvmlite", "matplotlib", "pandas", "pyarrow", "scipy", "mcap")
SMALLEST = """
import sys
import typer

app = typer.Typer()


@app.command()
def one() -> None:
    "Do one thing."


@app.command()
def other() -> None:
    "Do another."


sys.argv = ["app", "--help"]
app()
"""
"""The smallest program of Typer's with two commands, which shows its help."""
COMMAND = str(Path(sys.executable).with_name("dubins-traffic"))


def modules_after(code: str) -> set[str]:
    code = f"import sys\n{code}\nprint(*sys.modules, sep='\\n', file=sys.stderr)"
    ran = subprocess.run([sys.executable, "-c", code], check=True, capture_output=True, text=True)
    return {name.partition(".")[0] for name in ran.stderr.split()}


def processor_times(*programs: list[str], times: int = 7) -> list[float]:
    """Return the least processor time of each of some programs, run by turns, seconds."""
    best = [float("inf")] * len(programs)
    for _ in range(times):
        for k, arguments in enumerate(programs):
            before = resource.getrusage(resource.RUSAGE_CHILDREN)
            subprocess.run(arguments, check=True, stdout=subprocess.DEVNULL)
            after = resource.getrusage(resource.RUSAGE_CHILDREN)
            taken = after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime
            best[k] = min(best[k], taken)
    return best


@pytest.mark.parametrize(
    "code",
    [
        "import dubins_traffic",
        "from dubins_traffic.cli.main import main; main(['--help'])",
        "from dubins_traffic.cli.main import main; main(['run', '--help'])",
        "from dubins_traffic.cli.main import main; main(['list', 'agents'])",
        "from dubins_traffic.cli.main import main; main(['network', '--grid', '3', '4'])",
        pytest.param(
            "from dubins_traffic.cli.main import main; main(['instance', 'demo'])",
            # A kernel places the cars; where nothing links a library, llvmlite loads its machine code.
            marks=pytest.mark.tools("linkers"),
        ),
    ],
)
def test_no_heavy_library_is_loaded(code):
    assert modules_after(code).isdisjoint(HEAVY)


def test_numpy_is_not_loaded_by_the_import_alone():
    assert "numpy" not in modules_after("import dubins_traffic")


def test_start_up_is_quick():
    """Against the interpreter by itself, and against Typer by itself: `make bench` has the time on the clock."""
    python = [sys.executable, "-c"]
    bare, imported = processor_times([*python, "pass"], [*python, "import dubins_traffic"])
    assert imported < 5.0 * bare
    smallest, ours = processor_times([*python, SMALLEST], [COMMAND, "--help"])
    assert ours < 2.5 * smallest


def test_every_public_name_can_be_had():
    for name in dubins_traffic.__all__:
        assert getattr(dubins_traffic, name) is not None
    assert dir(dubins_traffic) == sorted(dubins_traffic.__all__)


def test_dir_shows_the_public_names_and_loads_none_of_them():
    code = (
        "import dubins_traffic as dt; before = dir(dt)\n"
        "assert before == sorted(dt.__all__) and 'plot' in before and 'annotations' not in before\n"
        "assert not {'numpy', 'matplotlib', 'numba'} & set(sys.modules)\n"
        "import dubins_traffic.roads.network; dt.RoadNetwork; assert dir(dt) == before"
    )
    assert "dubins_traffic" in modules_after(code)


def test_an_unknown_name_is_an_attribute_error():
    with pytest.raises(AttributeError, match="no attribute 'nonsense'"):
        _ = dubins_traffic.nonsense
