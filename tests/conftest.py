"""What holds for all tests.

Two marks say what `make test` leaves to `make test-tools`: `tools` (tests/tools.py), and `long`, for what takes more
than `LONG_S` seconds of processor time; the summary names the tests that take so long without the mark. Tests outside
the folders in `SHORT` are long but for those with the mark `path`, one path through each part at least.

Kernels are compiled before they run, as on a machine where all has been compiled: tests of other tiers say so. Programs
that tests start keep their bytecode, whatever the surroundings say: else each of them compiles 300 files first. Garbage
is collected seldom: a process of tests holds very many objects that stay. Ctrl-C is heard, by tests and by the programs
that they start, also where tests are begun by one that ignores it, as `nohup make test &` does. No test is measured by
the clock: a machine may be as busy as it likes.
"""

import gc
import os
import signal
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest
from hypothesis import HealthCheck, settings

from tests import tools

LONG_S = 10.0
HERE = Path(__file__).parent
SHORT = {"architecture", "conformance", "golden", "property", "unit"}
SPENT = "processor_s"

os.environ.setdefault("DUBINS_TRAFFIC_KERNELS", "compiled")
os.environ.pop("PYTHONDONTWRITEBYTECODE", None)
sys.dont_write_bytecode = False
gc.set_threshold(50_000)
signal.signal(signal.SIGINT, signal.default_int_handler)  # a program that is started has the default instead
settings.register_profile("busy", deadline=None, suppress_health_check=[HealthCheck.too_slow])
settings.load_profile("busy")
_before = pytest.StashKey[float]()


def _spent() -> float:
    """Return the seconds of processor time of this process and of what it has started and waited for."""
    return sum(os.times()[:4])


@pytest.hookimpl(tryfirst=True)
def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Mark what is long by its folder."""
    for item in items:
        elsewhere = item.path.is_relative_to(HERE) and item.path.relative_to(HERE).parts[0] not in SHORT
        if elsewhere and item.get_closest_marker("path") is None:
            item.add_marker("long")


@pytest.hookimpl(wrapper=True)
def pytest_runtest_protocol(item: pytest.Item) -> Iterator[None]:
    """Say which test runs, and when it began."""
    item.stash[_before] = _spent()
    with tools.running(item):
        return (yield)


@pytest.hookimpl(tryfirst=True)
def pytest_runtest_setup(item: pytest.Item) -> None:
    """Look for the tools that the marks of a test name."""
    tools.need_marked(item)


@pytest.hookimpl(wrapper=True)
def pytest_runtest_makereport(item: pytest.Item, call: pytest.CallInfo[None]) -> Iterator[None]:
    """Note what a test has cost, with its fixtures, unless a mark says that it may cost much."""
    report = yield
    if report.skipped and not hasattr(report, "wasxfail") and os.environ.get("CI") == "true":
        report.outcome, report.longrepr = "failed", f"left out, which CI=true forbids: {report.longrepr}"
    if call.when == "teardown" and not any(item.get_closest_marker(name) for name in ("tools", "long", "path")):
        report.user_properties.append((SPENT, _spent() - item.stash[_before]))
    return report


def pytest_terminal_summary(terminalreporter: pytest.TerminalReporter) -> None:
    """Name the tests that take long without saying so."""
    reports = [one for some in terminalreporter.stats.values() for one in some if hasattr(one, "user_properties")]
    spent = {one.nodeid: value for one in reports for name, value in one.user_properties if name == SPENT}
    for name, seconds in sorted(spent.items(), key=lambda pair: -pair[1]):
        if seconds > LONG_S:
            terminalreporter.write_line(f"without the mark `long`: {seconds:.0f} s of processor time: {name}")
