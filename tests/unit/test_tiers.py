"""Kernels interpreted and compiled: the builder, its lock, and going over from one to the other."""

import fcntl
import os
import shutil
import signal
import subprocess
import sys
from contextlib import suppress
from copy import deepcopy
from pathlib import Path
from time import monotonic, sleep

import numpy as np
import pytest

import dubins_traffic
from dubins_traffic.compiling import beside, builder
from dubins_traffic.errors import InputError
from dubins_traffic.kernels import compile
from dubins_traffic.kernels.arrays import Floats, Ints
from dubins_traffic.kernels.calls import bound
from dubins_traffic.kernels.compile import Kernel, jit
from dubins_traffic.kernels.kinds import UnfitError, dtype_of, kind_of
from dubins_traffic.kernels.machine import Code
from dubins_traffic.kernels.records import Rows, record, table
from dubins_traffic.kernels.tables import Tables
from dubins_traffic.kernels.trig import arc_factors, sincos
from dubins_traffic.trial.buffer import all_finite
from tests.builders import builders, hurry

PATIENCE = 600.0


def environment(cache: Path, tier: str) -> dict[str, str]:
    return {**os.environ, "NUMBA_CACHE_DIR": str(cache), "DUBINS_TRAFFIC_KERNELS": tier}


def begin(cache: Path, code: str, tier: str = "auto") -> subprocess.Popen[str]:
    pipe = subprocess.PIPE
    around = environment(cache, tier)
    return subprocess.Popen([sys.executable, "-c", code], env=around, stdout=pipe, stderr=pipe, text=True)


def python(cache: Path, code: str, tier: str = "auto") -> tuple[str, str]:
    process = begin(cache, code, tier)
    told, said = finished(process)
    assert process.returncode == 0, said
    return told, said


def finished(process: subprocess.Popen[str]) -> tuple[str, str]:
    """Return what a program has told and said when it has ended; end it if it does not."""
    with process:
        try:
            return process.communicate(timeout=PATIENCE)
        finally:
            process.kill()


def end_builders(cache: Path) -> None:
    for process in builders(cache):
        with suppress(ProcessLookupError):
            os.kill(process, signal.SIGKILL)
    until(lambda: not builders(cache))


def until(fact) -> None:
    """Wait for something."""
    latest = monotonic() + PATIENCE
    while not fact():
        assert monotonic() < latest
        sleep(0.05)


def kernels(cache: Path) -> list[Path]:
    return sorted(cache.rglob("*.kernel"))


@pytest.fixture
def cache(tmp_path):
    yield tmp_path / "cache"
    end_builders(tmp_path / "cache")


SWITCH = """
from dubins_traffic.kernels.compile import Kernel
from dubins_traffic.kernels.machine import Code
from dubins_traffic.kernels.trig import sincos
from time import sleep
answers = set()
while not any(isinstance(found, Code) for found in sincos._known.values()):
    answers.add(sincos(0.5))
    sleep(0.001)  # for the builder, which nobody waits for
answers.add(sincos(0.5))
print(answers, "numba" in __import__("sys").modules)
"""


def test_calls_go_over_to_machine_code_when_it_is_there(cache) -> None:
    process = begin(cache, SWITCH)
    until(lambda: hurry(cache) or process.poll() is not None)
    told, said = finished(process)
    assert told == f"{ {sincos(0.5)} } False\n"
    assert said.count("\n") == 1
    assert "in the background" in said
    assert len(kernels(cache)) == 1
    assert python(cache, SWITCH) == (told, "")


CALL = "from dubins_traffic.kernels.trig import sincos; print(sincos(0.5))"


def test_what_a_killed_builder_was_told_is_compiled_by_the_next(cache) -> None:
    python(cache, CALL)
    until(lambda: builders(cache) or kernels(cache))
    end_builders(cache)
    for path in kernels(cache):
        path.unlink()  # as if it had been killed earlier
    assert python(cache, CALL, "compiled") == (f"{sincos(0.5)}\n", "")
    assert len(kernels(cache)) == 1


def test_a_builder_killed_while_it_is_waited_for_is_begun_again(cache) -> None:
    waiting = begin(cache, CALL, "compiled")
    until(lambda: builders(cache) or waiting.poll() is not None)
    end_builders(cache)
    assert finished(waiting) == (f"{sincos(0.5)}\n", "")


def test_a_builder_for_which_nobody_waits_leaves_processors_to_all_others(cache) -> None:
    assert python(cache, CALL)[0]
    until(lambda: builders(cache))
    until(lambda: [os.sched_getscheduler(process) for process in builders(cache)] in ([], [os.SCHED_IDLE]))
    for process in builders(cache):
        session = Path(f"/proc/{process}/autogroup")
        assert os.getpriority(os.PRIO_PROCESS, process) == builder.NICE
        assert not session.exists() or f"nice {builder.NICE}" in session.read_text()
    end_builders(cache)
    waiting = begin(cache, CALL, "compiled")
    until(lambda: builders(cache))
    assert [os.sched_getscheduler(process) for process in builders(cache)] == [os.SCHED_OTHER]
    finished(waiting)


HEARD_LATER = """
import ctypes, os
from contextlib import suppress
from dubins_traffic.compiling import builder
os.setsid()
if os.getuid() == 0:
    os.setgid(65534)
    os.setuid(65534)
    ctypes.CDLL(None).prctl(4, 1)  # PR_SET_DUMPABLE: who gave up root may write to his own /proc again
with suppress(BlockingIOError):
    builder.SESSION.write_bytes(b"0")  # Linux hears ordinary users once in a tenth of a second: the next has to wait
builder._stand_back_as_session()
print(builder.SESSION.read_bytes().split()[-1].decode())
"""


@pytest.mark.skipif(not builder.SESSION.exists(), reason="this Linux does not share processors among sessions")
def test_a_builder_stands_back_though_linux_hears_it_only_later(cache) -> None:
    assert python(cache, HEARD_LATER) == (f"{builder.NICE}\n", "")


def test_processes_at_once_have_one_builder(cache) -> None:
    several = [begin(cache, CALL, "compiled") for _ in range(4)]
    assert [finished(process)[0] for process in several] == [f"{sincos(0.5)}\n"] * 4
    times = [path.stat().st_mtime_ns for path in kernels(cache)]
    assert len(times) == 1
    until(lambda: len(builders(cache)) <= 1)


def test_the_same_version_elsewhere_compiles_nothing(cache, tmp_path, monkeypatch) -> None:
    there = python(cache, CALL, "compiled")
    made = {path: path.stat().st_mtime_ns for path in kernels(cache)}
    package = Path(dubins_traffic.__file__).parent
    shutil.copytree(package, tmp_path / "src" / package.name, ignore=shutil.ignore_patterns("__pycache__"))
    monkeypatch.setenv("PYTHONPATH", str(tmp_path / "src"))
    assert python(cache, CALL, "auto") == there  # and does not say that anything is compiled
    assert {path: path.stat().st_mtime_ns for path in kernels(cache)} == made


def test_two_installations_with_other_sources_share_a_cache(cache, tmp_path, monkeypatch) -> None:
    python(cache, CALL, "compiled")
    package = Path(dubins_traffic.__file__).parent
    shutil.copytree(package, tmp_path / "src" / package.name, ignore=shutil.ignore_patterns("__pycache__"))
    source = tmp_path / "src" / package.name / "kernels" / "trig.py"
    source.write_text(source.read_text().replace("-d * across", "d * across"))
    monkeypatch.setenv("PYTHONPATH", str(tmp_path / "src"))
    code = "from dubins_traffic.kernels.trig import arc_factors; print(arc_factors(0.5)[1])"
    assert python(cache, code, "compiled") == (f"{-arc_factors(0.5)[1]}\n", "")


def test_one_builder_alone_holds_the_lock(cache) -> None:
    python(cache, CALL, "compiled")
    (lock,) = cache.rglob(beside.LOCK)
    for path in kernels(cache):
        path.unlink()
    with lock.open("r+b") as held:
        fcntl.flock(held, fcntl.LOCK_EX)
        waiting = begin(cache, CALL, "compiled")
        sleep(1.0)
        assert (waiting.poll(), builders(cache), kernels(cache)) == (None, [], [])
    assert finished(waiting) == (f"{sincos(0.5)}\n", "")


def test_a_builder_takes_no_notice_of_lines_it_cannot_use(cache) -> None:
    python(cache, CALL, "compiled")
    (kernel,) = kernels(cache)
    kernel.unlink()
    wish = beside.Wish("dubins_traffic.kernels.trig", "sincos", "/gone", "()", str(kernel.with_name("x.kernel")))
    lines = wish.line()[:-9] + b"\n" + b"[]\n" + wish.line()
    command = [sys.executable, "-m", "dubins_traffic.compiling.builder"]
    around = environment(cache, "auto")
    assert subprocess.run(command, input=lines, env=around, check=False, timeout=PATIENCE).returncode == 0
    assert "is another" in wish.failure.read_text() or "/gone" in wish.failure.read_text()
    python(cache, CALL, "compiled")
    assert kernels(cache) == [kernel]


INTERRUPTED = """
import _thread, os, pathlib, threading, time
from dubins_traffic.kernels.trig import sincos
from tests.builders import builders

def interrupt():
    while not builders(pathlib.Path(os.environ["NUMBA_CACHE_DIR"])):
        time.sleep(0.2)
    time.sleep(0.2)  # the builder is there before it is told what is wanted
    _thread.interrupt_main()

threading.Thread(target=interrupt, daemon=True).start()
try:
    print(sincos(0.5))
    while True:
        time.sleep(0.05)
except KeyboardInterrupt:
    print("interrupted")
"""


def test_waiting_can_be_interrupted_and_what_is_compiled_is_kept(cache) -> None:
    told, _ = python(cache, INTERRUPTED, "compiled")
    assert told.endswith("interrupted\n")
    until(lambda: hurry(cache) or kernels(cache))


@pytest.mark.parametrize("tier", ["auto", "compiled"])
def test_where_nothing_can_be_kept_kernels_run_interpreted(tmp_path, tier) -> None:
    code = (
        "import dubins_traffic.compiling.store as store, pathlib\n"
        "store.cache_folder = lambda: pathlib.Path('/proc/nowhere')\n" + CALL
    )
    assert python(tmp_path, code, tier)[0] == f"{sincos(0.5)}\n"
    assert not builders(tmp_path)


def test_kernels_that_are_never_compiled_are_plain_functions(tmp_path) -> None:
    code = "from dubins_traffic.kernels.trig import sincos; print(type(sincos).__name__, sincos(0.5))"
    assert python(tmp_path, code, "interpreted") == (f"function {sincos(0.5)}\n", "")
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize("asked", [compile.waits, compile.never_compiled])
def test_another_tier_is_refused_by_name(asked, monkeypatch) -> None:
    """Also where nobody would have to wait, since all kernels are compiled."""
    monkeypatch.setenv("DUBINS_TRAFFIC_KERNELS", "compield")
    with pytest.raises(InputError, match=r"DUBINS_TRAFFIC_KERNELS: .*'compield'.*auto or compiled"):
        asked()
    run = [sys.executable, "-m", "dubins_traffic.cli", "verify", "nothing.mcap"]
    done = subprocess.run(run, capture_output=True, text=True, check=False)
    assert (done.returncode, done.stdout, done.stderr.count("\n")) == (2, "", 1)
    assert "compield" in done.stderr


def test_kinds_can_be_read_back() -> None:
    rows = np.dtype([("x", "f8"), ("lane", "i4", (3,)), ("bits", "u1")], align=True)
    for dtype in (np.dtype("f8"), np.dtype("u4"), np.dtype("b1"), rows):
        kind = kind_of(np.zeros((2, 3), dtype))
        assert dtype_of(kind[1]) == dtype
        assert dtype_of(kind[1]).isalignedstruct == dtype.isalignedstruct
        assert kind[2:] == (2, "C", True)
    assert kind_of(np.zeros((2, 3)).T)[3] == "F"
    assert kind_of(np.zeros((4, 4))[::2, ::2])[3] == "A"
    assert kind_of(2**63) == kind_of(np.uint64(1)) != kind_of(1) == kind_of(np.int64(1))
    assert kind_of((1, (2.0, None))) == ("tuple", (kind_of(1), ("tuple", (kind_of(1.0), ("none",)))))
    for unfit in ("text", [1], np.zeros(2, object), np.zeros(2, ">f8")):
        with pytest.raises(UnfitError):
            kind_of(unfit)


def test_machine_code_takes_and_returns_what_the_function_does() -> None:
    assert isinstance(all_finite, Kernel)
    for commands in (np.zeros((1, 3, 2)), np.full((1, 1, 2), np.inf), np.zeros((1, 2, 4))[:, :, ::2]):
        assert all_finite(commands) is bool(all_finite.interpreted(commands))
    assert {type(found) for found in all_finite._known.values()} == {Code}


def test_bound_calls_see_other_arrays_and_arrays_of_other_kinds() -> None:
    call = bound(add)
    terms = np.array([1.0, 2.0, 10.0])
    first, second = np.zeros(2), np.zeros(2)
    assert call(1, first, terms) == 13.0
    assert call(2, second, terms) == 26.0
    assert call(1, first, np.array([1, 2, 10])) == 13.0
    assert call(1, first, terms[::2]) == 11.0
    assert first.tolist() == [3.0, 0.0]
    assert second.tolist() == [2.0, 0.0]


def test_a_copy_of_bound_calls_writes_its_arguments_elsewhere() -> None:
    call = bound(add)
    terms = np.array([1.0, 2.0, 10.0])
    assert call(1, np.zeros(1), terms) == 13.0
    other = deepcopy(call)
    assert other is not call
    assert other._call is None
    assert other(2, np.zeros(1), terms) == 26.0
    assert other._call is not call._call


@record
class Car:
    """A car of these tests."""

    lane: int = -1
    speed: float
    seed: np.uint64


class Traffic(Tables):
    """Tables of these tests."""

    car: Rows[Car]
    limit: Floats


class Scene(Tables):
    """Tables that hold others."""

    traffic: Traffic
    count: Ints


def test_rows_and_tables_are_handed_over_by_their_place() -> None:
    cars = table(Car, (2, 3))
    cars[1, 2].speed, cars[1, 2].seed = 0.5, 2**64 - 1
    scene = Scene(Traffic(cars, np.array([0.25])), np.array([7]))
    assert kind_of(scene) is kind_of(scene)
    assert kind_of(scene) == kind_of(Scene(Traffic(table(Car, (1, 1)), np.zeros(5)), np.array([1, 2])))
    assert hash(kind_of(scene)) == hash(tuple(kind_of(scene)))
    for call in (drive, drive.interpreted, bound(drive)):
        cars[1, 2].lane = -1
        assert call(scene, 1, 2) == (7, 0.25)
        assert cars["lane"].tolist() == [[-1, -1, -1], [-1, -1, 6]]
    assert stop(cars[1, 2]) == 0.5
    assert cars["speed"].max() == 0.0
    assert {type(found) for own in (drive, stop) for found in own._known.values()} == {Code}


@jit
def drive(scene: Scene, b: int, n: int) -> tuple[int, float]:
    """Drive a car into another lane."""
    car = scene.traffic.car[b, n]
    car.lane += scene.count[0]
    return scene.count[0], min(car.speed, scene.traffic.limit[0])


@jit
def stop(car: Car) -> float:
    """Stop a car; return its speed before."""
    speed = car.speed
    car.speed = 0.0
    return speed


@jit
def add(times, into, terms):
    """Add up an array and count calls."""
    total = 0.0
    for k in range(terms.shape[0]):
        total += terms[k]
    into[0] += times
    return total * times


def test_a_kernel_of_a_users_module_is_compiled_where_it_stands(cache, tmp_path) -> None:
    (tmp_path / "mine.py").write_text(
        "from dubins_traffic.kernels.compile import jit\n@jit\ndef double(x):\n    return 2 * x\n"
    )
    code = f"import sys; sys.path.insert(0, {str(tmp_path)!r})\nfrom mine import double\nprint(double(3), double(0.25))"
    assert python(cache, code, "compiled") == ("6 0.5\n", "")
    assert [path.parent.name.partition("-")[0] for path in kernels(cache)] == ["mine", "mine"]


def test_a_kernel_that_cannot_be_compiled_stays_interpreted_and_says_so(cache, tmp_path) -> None:
    (tmp_path / "mine.py").write_text(
        "from dubins_traffic.kernels.compile import jit\n@jit\ndef listed(x):\n    return [x, open]\n"
    )
    code = f"import sys; sys.path.insert(0, {str(tmp_path)!r})\nfrom mine import listed\nprint(len(listed(3)))"
    told, said = python(cache, code, "compiled")
    assert told == "2\n"
    assert "listed stays interpreted: " in said
