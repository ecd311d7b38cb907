"""Bad input through the command line: exit status 2, one message with file, field, value and what was expected."""

from __future__ import annotations

import contextlib
import copy
import importlib
import json
import math
import os
import subprocess
import sys
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest

from dubins_traffic.cli.main import main

pytestmark = pytest.mark.path

COMMAND = str(Path(sys.executable).with_name("dubins-traffic"))

NETWORK: dict[str, Any] = {"version": 0, "length": 3, "transform": [0, 0, 0], "shape": [2, 2]}
CONFIG: dict[str, Any] = {
    "version": 0,
    "problem_domain": "dubins_traffic",
    "rnd": NETWORK,
    "e-agents": [{"type": "wander/wander", "name": "agent0"}],
    "number_trials": 1,
    "duration_bounds": [1, 1],
    "number_goals_bounds": [1, 2],
}
CONFIG_1 = CONFIG | {"version": 1}
INSTANCE: dict[str, Any] = {"version": 0, "goals": [[1, 1]], "rnd": NETWORK, "intersection_radius": 1.0}
INSTANCE_1 = INSTANCE | {"version": 1, "duration": 1.0, "seed": 3}

IDLE = "class Idle:\n    def start(self, problem): ...\n    def act(self, observation): return (0.0, 0.0)\n"


def changed(document: dict[str, Any], path: str, value: Any) -> str:
    """Return `document` as JSON, with the field at `path` (keys and indices, separated by /) changed."""
    document = copy.deepcopy(document)
    *way, last = [int(part) if part.isdigit() else part for part in path.split("/")]
    place: Any = document
    for part in way:
        place = place[part]
    place[last] = value
    return json.dumps(document)


def without(document: dict[str, Any], key: str) -> str:
    return json.dumps({name: value for name, value in document.items() if name != key})


def segments(*rows: list[Any]) -> str:
    return json.dumps({"version": 0, "length": 3, "transform": [0, 0, 0], "segments": [*rows]})


RUN = ["run", "x.json", "--controller", "idle.py:Idle", "--records", "out", "-f", "data.json"]
PLOT = ["plot", "x.json", "-o", "x.svg"]

DOCUMENTS: dict[str, tuple[str, list[str], list[str]]] = {
    # what: (text of x.json, command, what the message must hold)
    "empty file": ("", RUN, ["x.json", "JSON"]),
    "not JSON": ("{'version': 0}", RUN, ["x.json", "line 1"]),
    "cut off JSON": (json.dumps(CONFIG)[:-20], RUN, ["x.json", "JSON"]),
    "a list": ("[1, 2]", RUN, ["x.json", "got [1, 2]", "object"]),
    "of no known kind": ('{"colour": "red"}', RUN, ["x.json", "colour", "expected"]),
    "key twice": ('{"version": 0, "version": 1}', RUN, ["x.json", "version", "twice"]),
    "nested too deep": ("[" * 100_000 + "]" * 100_000, RUN, ["x.json", "deep"]),
    "number with too many digits": ('{"version": ' + "9" * 5000 + "}", RUN, ["x.json", "digits"]),
    "wrong version": (changed(CONFIG, "version", 7), RUN, ["x.json", "version", "got 7", "0"]),
    "version a text": (changed(CONFIG, "version", "0"), RUN, ["x.json", "version", "got '0'"]),
    "no version": (without(CONFIG, "version"), RUN, ["x.json", "version", "expected"]),
    "other domain": (
        changed(CONFIG, "problem_domain", "integrator_chains"),
        RUN,
        ["x.json", "problem_domain", "got 'integrator_chains'", "dubins_traffic"],
    ),
    "no network": (without(CONFIG, "rnd"), RUN, ["x.json", "rnd", "expected"]),
    "network a number": (changed(CONFIG, "rnd", 5), RUN, ["x.json", "rnd", "got 5", "expected"]),
    "network file missing": (changed(CONFIG, "rnd", "no.json"), RUN, ["x.json", "rnd", "got 'no.json'"]),
    "negative length": (
        changed(CONFIG, "rnd/length", -3),
        RUN,
        ["x.json", "rnd.length", "got -3", "expected"],
    ),
    "length NaN": (changed(CONFIG, "rnd/length", math.nan), RUN, ["x.json", "length", "nan", "finite"]),
    "length infinite": (changed(CONFIG, "rnd/length", math.inf), RUN, ["x.json", "length", "inf", "finite"]),
    "huge length": (
        changed(CONFIG, "rnd/length", 1e300),
        RUN,
        ["x.json", "rnd.length", "got 1e+300", "expected"],
    ),
    "length a text": (
        changed(CONFIG, "rnd/length", "3"),
        RUN,
        ["x.json", "rnd.length", "got '3'", "expected"],
    ),
    "transform too short": (
        changed(CONFIG, "rnd/transform", [0, 0]),
        RUN,
        ["x.json", "rnd.transform", "[0, 0]"],
    ),
    "huge grid": (changed(CONFIG, "rnd/shape", [10**9, 10**9]), RUN, ["x.json", "rnd.shape", "1000000000"]),
    "shape of one point": (changed(CONFIG, "rnd/shape", [1, 1]), RUN, ["x.json", "rnd.shape", "[1, 1]"]),
    "e-agents no list": (changed(CONFIG, "e-agents", {}), RUN, ["x.json", "e-agents", "got {}", "list"]),
    "unknown e-agent": (
        changed(CONFIG, "e-agents/0/type", "racer"),
        RUN,
        ["x.json", "e-agents[0].type", "got 'racer'", "wander"],
    ),
    "e-agent called ego": (
        changed(CONFIG, "e-agents/0/name", "ego"),
        RUN,
        ["x.json", "e-agents[0].name", "got 'ego'", "expected"],
    ),
    "two e-agents of one name": (
        changed(CONFIG, "e-agents", [{"type": "wander", "name": "a"}] * 2),
        RUN,
        ["x.json", "e-agents[1].name", "got 'a'", "expected"],
    ),
    "unknown parameter": (
        changed(CONFIG_1, "e-agents/0/parameters", {"sped": 1.0}),
        RUN,
        ["x.json", "e-agents[0].parameters.sped", "speed"],
    ),
    "duration bounds crossed": (
        changed(CONFIG, "duration_bounds", [9, 3]),
        RUN,
        ["x.json", "duration_bounds", "[9, 3]", "expected"],
    ),
    "no trials": (changed(CONFIG, "number_trials", -1), RUN, ["x.json", "number_trials", "got -1", ">="]),
    "trials a fraction": (changed(CONFIG, "number_trials", 1.5), RUN, ["x.json", "number_trials", "got 1.5"]),
    "number of goals a truth value": (
        changed(CONFIG, "number_goals_bounds", [True, 2]),
        RUN,
        ["x.json", "number_goals_bounds", "True", "integer"],
    ),
    "cars don't fit": (
        changed(CONFIG_1, "e-agents", [{"type": "wander", "name": "a", "count": 400}]),
        RUN,
        ["x.json", "fit"],
    ),
    "unknown key of the car": (
        changed(CONFIG_1, "car", {"weight": 1}),
        RUN,
        ["x.json", "car.weight", "got 1", "body"],
    ),
    "too fast for the rate": (
        changed(CONFIG_1, "rate", 1.0),
        RUN,
        ["x.json", "rate", "expected"],
    ),
    "obstacle that is no polygon": (
        changed(CONFIG_1, "obstacles", [{"polygon": {"vertices": [[0, 0], [1, 1], [1, 0], [0, 1]]}}]),
        RUN,
        ["x.json", "obstacles[0]", "simple polygon"],
    ),
    "goal off the network": (
        changed(INSTANCE, "goals", [[1, 1], [5, 5]]),
        RUN[:-2],
        ["x.json", "goals[1]", "[5, 5]", "intersection"],
    ),
    "goal of three numbers": (
        changed(INSTANCE, "goals", [[1, 1, 1]]),
        RUN[:-2],
        ["x.json", "goals[0]", "[1, 1, 1]"],
    ),
    "negative radius": (
        changed(INSTANCE, "intersection_radius", -1),
        RUN[:-2],
        ["x.json", "intersection_radius", "got -1", ">"],
    ),
    "start of nobody": (
        changed(INSTANCE_1, "starts", {"agent7": [0, 0, 0]}),
        RUN[:-2],
        ["x.json", "starts", "agent7", "ego"],
    ),
    "unknown simulator": (
        changed(INSTANCE_1, "simulator", "gazebo9"),
        RUN[:-2],
        ["x.json", "simulator", "got 'gazebo9'", "embedded"],
    ),
    "a network can't be run": (json.dumps(NETWORK), RUN, ["x.json", "configuration"]),
    "a configuration can't be drawn": (json.dumps(CONFIG), PLOT, ["x.json", "network"]),
    "trial data of an instance": (json.dumps(INSTANCE), RUN, ["x.json", "-f", "data.json", "configuration"]),
    "roads that cross": (segments([0, 0, 2, 2], [0, 2, 2, 0]), PLOT, ["x.json", "segments["]),
    "roads that overlap": (segments([0, 0, 2, 0], [1, 0, 3, 0]), PLOT, ["x.json", "segments["]),
    "road of no length": (
        segments([0, 0, 1, 0], [1, 0, 1, 0]),
        PLOT,
        ["x.json", "segments[1]", "[1, 0, 1, 0]"],
    ),
    "degree 5": (
        segments([0, 0, 2, 0], [0, 0, 0, 2], [0, 0, -2, 0], [0, 0, 0, -2], [0, 0, 2, 2]),
        PLOT,
        ["x.json", "segments", "4"],
    ),
    "in two pieces": (segments([0, 0, 1, 0], [5, 5, 6, 5]), PLOT, ["x.json", "segments", "connected"]),
    "points between the lattice": (
        segments([0, 0, 1.5, 0]),
        PLOT,
        ["x.json", "segments[0]", "1.5", "integer"],
    ),
    "shape that does not fit": (
        json.dumps(NETWORK | {"segments": [[0, 0, 1, 0]]}),
        PLOT,
        ["x.json", "shape", "[2, 2]", "[1, 2]"],
    ),
    "text network with a word for a number": (
        "version: 0\nlength: three\nshape: 2 2\n",
        PLOT,
        ["x.json", "length", "three"],
    ),
    "unknown picture": (json.dumps(NETWORK), ["plot", "x.json", "-o", "x.bmp"], ["x.bmp", ".bmp", ".png"]),
    "unknown container": (
        json.dumps(NETWORK),
        ["convert", "x.json", "-o", "x.xyz"],
        ["x.xyz", ".xyz", ".rnd"],
    ),
    "conversion of a configuration": (
        json.dumps(CONFIG),
        ["convert", "x.json", "-o", "y.json"],
        ["x.json", "network"],
    ),
    "score of a document": (json.dumps(CONFIG), ["score", "x.json"], ["x.json", "not a record", "MCAP"]),
    "replay of a document": (json.dumps(CONFIG), ["replay", "x.json"], ["x.json", "not a record", "MCAP"]),
    "binary garbage": ("\x00\x01\udcff\udcfe" * 50, RUN, ["x.json", "UTF-8"]),
    "a shipped name with a slip": ("", ["instance", "dmeo"], ["dmeo", "demo"]),
    "network of another kind for --rnd": (
        json.dumps(INSTANCE),
        ["run", "x.json", "--rnd", "grid.json"],
        ["x.json", "--rnd", "grid.json", "configuration"],
    ),
    "output in a missing folder": (
        json.dumps(CONFIG),
        ["instance", "x.json", "-o", "no/y.json"],
        ["no/y.json"],
    ),
    "picture in a missing folder": (json.dumps(NETWORK), ["plot", "x.json", "-o", "no/y.png"], ["no/y.png"]),
    "trial data in a missing folder": (
        json.dumps(CONFIG),
        [*RUN[:4], "-f", "no/d.json"],
        ["no/d.json", "folder"],
    ),
    "trial data that exist": (
        json.dumps(CONFIG),
        [*RUN[:4], "-f", "grid.json"],
        ["grid.json", "exists", "-F"],
    ),
    "records in a file": (json.dumps(CONFIG), [*RUN[:4], "--records", "grid.json"], ["grid.json", "folder"]),
    "output is a folder": (json.dumps(CONFIG), ["instance", "x.json", "-o", "folder"], ["folder", "file"]),
    "controller that is unknown": (
        json.dumps(CONFIG),
        ["run", "x.json", "--controller", "fast"],
        ["--controller", "fast"],
    ),
    "controller file missing": (
        json.dumps(CONFIG),
        ["run", "x.json", "--controller", "no.py:Idle"],
        ["--controller", "no.py", "file"],
    ),
    "controller class missing": (
        json.dumps(CONFIG),
        ["run", "x.json", "--controller", "idle.py:Busy"],
        ["--controller", "Busy", "Idle"],
    ),
    "controller without methods": (
        json.dumps(CONFIG),
        ["run", "x.json", "--controller", "lame.py:Lame"],
        ["--controller", "Lame", "start"],
    ),
    "controller that does not load": (
        json.dumps(CONFIG),
        ["run", "x.json", "--controller", "broken.py:Idle"],
        ["--controller", "broken.py", "ZeroDivisionError"],
    ),
    "deadline not positive": (
        json.dumps(CONFIG),
        ["run", "x.json", "--deadline", "-1"],
        ["--deadline", "-1", "> 0"],
    ),
    "deadline NaN": (
        json.dumps(CONFIG),
        ["run", "x.json", "--deadline", "nan"],
        ["--deadline", "nan", "> 0"],
    ),
}

OPTIONS: dict[str, tuple[list[str], list[str]]] = {
    "silence that is no number": (["lines", "run", "demo", "--silence", "nan"], ["--silence", "nan", "> 0"]),
    "time to begin below zero": (["lines", "run", "demo", "--begin", "-1"], ["--begin", "-1", "> 0"]),
    "no name of a file": (["run", ""], ["dubins-traffic: '': a folder"]),
    "unknown command": (["drive"], ["drive"]),
    "unknown option": (["run", "demo", "--fast"], ["--fast"]),
    "no argument": (["run"], ["CONFIG"]),
    "option without value": (["run", "demo", "--seed"], ["--seed"]),
    "seed a word": (["run", "demo", "--seed", "lucky"], ["--seed", "lucky", "integer"]),
    "seed negative": (["instance", "demo", "--seed", "-1"], ["--seed", "-1", "equal to 0"]),
    "seed huge": (
        ["instance", "demo", "--seed", str(2**64)],
        ["seed", str(2**64), "<"],
    ),
    "seed huge for a network": (
        ["network", "--intersections", "4", "--segments", "3", "--seed", "9" * 40],
        ["seed", "9" * 40, "<"],
    ),
    "trial huge": (["instance", "demo", "--trial", "9" * 40], ["trial", "9" * 40, "<"]),
    "more trials than can be": (
        ["run", "demo", "--trials", "9" * 40],
        ["--trials", "9" * 30, "at most 1000000"],
    ),
    "repeated too often": (
        ["run", "good.mcap", "--repeat", str(10**9)],
        ["--repeat", str(10**9), "at most 1000000"],
    ),
    "trial negative": (["instance", "demo", "--trial", "-1"], ["--trial", "-1"]),
    "no trials asked for": (["run", "demo", "--trials", "0"], ["--trials", "0"]),
    "no jobs": (["run", "demo", "--jobs", "0"], ["--jobs", "0"]),
    "unknown format": (["network", "--format", "xml"], ["--format", "xml", "json"]),
    "unknown subject": (["list", "cars"], ["cars", "agents"]),
    "grid of no rows": (["network", "--grid", "0", "3"], ["shape", "0"]),
    "huge grid asked for": (["network", "--grid", "1000000", "1000000"], ["shape", "1000000"]),
    "too many segments": (["network", "--intersections", "4", "--segments", "9"], ["segments", "9", "4"]),
    "too few segments": (["network", "--intersections", "9", "--segments", "2"], ["segments", "2", "8"]),
    "one number of two": (["network", "--intersections", "9"], ["--segments", "missing"]),
    "grid and random": (
        ["network", "--grid", "2", "2", "--intersections", "4", "--segments", "3"],
        ["--grid"],
    ),
    "both kinds of trial data": (["run", "demo", "-f", "a", "-F", "b"], ["-F", "-f"]),
    "missing file": (["plot", "nowhere.json", "-o", "x.svg"], ["nowhere.json", "no such file"]),
    "missing record": (["score", "nowhere.mcap"], ["nowhere.mcap", "No such file"]),
    "a folder": (["plot", "folder", "-o", "x.svg"], ["folder"]),
    "a folder as record": (["replay", "folder"], ["folder", "directory"]),
    "missing --rnd": (["run", "demo", "--rnd", "nowhere.json"], ["rnd", "nowhere.json"]),
    "trials of a record": (["run", "good.mcap", "--trials", "2"], ["good.mcap", "--trials", "2"]),
    "other seed of a record": (["run", "good.mcap", "--seed", "99"], ["good.mcap", "--seed", "99"]),
    "record cut off in its header": (["score", "head.mcap"], ["head.mcap", "expected"]),
    "record with a torn middle": (["score", "torn.mcap"], ["torn.mcap", "damaged"]),
    "record of noise": (["replay", "noise.mcap"], ["noise.mcap", "expected"]),
    "plot of an empty record": (["plot", "empty.mcap"], ["empty.mcap: not a record; expected an MCAP file"]),
    "plot of noise": (["plot", "noise.mcap"], ["noise.mcap: not a record; expected an MCAP file"]),
    "run of an empty record": (["run", "empty.mcap"], ["empty.mcap: not a record; expected an MCAP file"]),
    "shrink of an empty record": (
        ["shrink", "empty.mcap", "-o", "x.json"],
        ["empty.mcap: not a record; expected an MCAP file"],
    ),
    "shrink of a record": (
        ["shrink", "good.mcap", "-o", "x.json"],
        ["good.mcap: a record", "expected a document in JSON"],
    ),
    "second of two records is none": (["score", "good.mcap", "grid.json"], ["grid.json", "not a record"]),
    "unknown table": (["convert", "good.mcap", "-o", "x.xls"], ["x.xls", ".xls", ".csv"]),
    "replay in a missing folder": (["replay", "good.mcap", "-o", "no/x.html"], ["no/x.html"]),
    "no name for a picture of standard input": (["plot", "-"], ["--output", "expected"]),
}


@pytest.fixture(scope="module")
def record(tmp_path_factory: pytest.TempPathFactory) -> bytes:
    """Return a record of a short trial."""
    folder = tmp_path_factory.mktemp("record")
    (folder / "x.json").write_text(json.dumps(CONFIG))
    (folder / "idle.py").write_text(IDLE)
    controller = f"{folder / 'idle.py'}:Idle"
    assert main(["run", str(folder / "x.json"), "--controller", controller, "--records", str(folder)]) == 0
    return (folder / "trial-0000.mcap").read_bytes()


@pytest.fixture
def place(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, record: bytes) -> Path:
    """Return a folder, made the current one, with some files good and bad."""
    monkeypatch.chdir(tmp_path)
    (tmp_path / "folder").mkdir()
    (tmp_path / "grid.json").write_text(json.dumps(NETWORK))
    (tmp_path / "idle.py").write_text(IDLE)
    (tmp_path / "lame.py").write_text("class Lame:\n    pass\n")
    (tmp_path / "broken.py").write_text("1 / 0\n")
    (tmp_path / "good.mcap").write_bytes(record)
    (tmp_path / "head.mcap").write_bytes(record[:40])
    (tmp_path / "torn.mcap").write_bytes(torn(record))
    (tmp_path / "empty.mcap").touch()
    (tmp_path / "noise.mcap").write_bytes(bytes(range(256)) * 4)
    return tmp_path


def torn(data: bytes) -> bytes:
    """Return `data` with some bytes in its second fifth turned over."""
    at = len(data) * 2 // 5
    return data[:at] + bytes(255 - byte for byte in data[at : at + 64]) + data[at + 64 :]


def contents(folder: Path) -> dict[str, bytes]:
    found = sorted(path for path in folder.rglob("*") if "__pycache__" not in path.parts)
    return {str(path.relative_to(folder)): b"" if path.is_dir() else path.read_bytes() for path in found}


def assert_refused(
    arguments: list[str], folder: Path, needles: list[str], run: Callable[[list[str]], tuple[int, str, str]]
) -> None:
    before = contents(folder)
    status, out, err = run(arguments)
    assert status == 2, err
    assert out == ""
    assert err.startswith("dubins-traffic: ")
    assert err.count("\n") == 1
    assert err.endswith("\n")
    for needle in needles:
        assert needle in err
    assert contents(folder) == before


@pytest.fixture
def run_here(capsys: pytest.CaptureFixture[str]) -> Callable[[list[str]], tuple[int, str, str]]:
    def run(arguments: list[str]) -> tuple[int, str, str]:
        capsys.readouterr()
        status = main(arguments)
        return (status, *capsys.readouterr())

    return run


def run_outside(arguments: list[str]) -> tuple[int, str, str]:
    ran = subprocess.run([COMMAND, *arguments], capture_output=True, text=True, check=False, stdin=subprocess.DEVNULL)
    return ran.returncode, ran.stdout, ran.stderr


@pytest.mark.parametrize("case", DOCUMENTS)
def test_bad_documents_and_files(case, place, run_here):
    text, arguments, needles = DOCUMENTS[case]
    (place / "x.json").write_bytes(text.encode("utf-8", "surrogateescape"))
    assert_refused(arguments, place, needles, run_here)


@pytest.mark.parametrize("case", OPTIONS)
def test_bad_options_and_records(case, place, run_here):
    arguments, needles = OPTIONS[case]
    assert_refused(arguments, place, needles, run_here)


@pytest.mark.parametrize("case", ["negative length", "e-agent called ego", "controller without methods"])
def test_the_same_as_a_process_of_its_own(case, place):
    text, arguments, needles = DOCUMENTS[case]
    (place / "x.json").write_text(text)
    assert_refused(arguments, place, needles, run_outside)


@pytest.mark.parametrize(
    ("arguments", "needles"),
    [
        (["plot", "secret.json", "-o", "folder/x.svg"], ["secret.json", "ermission"]),
        (["score", "secret.json"], ["secret.json", "ermission"]),
        (["network", "-o", "locked/x.json"], ["locked/x.json", "ermission"]),
        (["run", "demo", "--records", "locked"], ["locked", "ermission"]),
        (["run", "demo", "--records", "locked/in"], ["locked/in", "ermission"]),
    ],
)
def test_no_permission(arguments, needles, place, run_here):
    # Kernels are loaded as the user whose cache they are in, not as nobody.
    importlib.import_module("dubins_traffic.runs.jobs")
    importlib.import_module("dubins_traffic.controllers.lanes")
    (place / "secret.json").write_text(json.dumps(NETWORK))
    (place / "secret.json").chmod(0)
    (place / "locked").mkdir(mode=0o500)

    def run(arguments: list[str]) -> tuple[int, str, str]:
        with as_nobody(place):
            return run_here(arguments)

    try:
        before = sorted(path.name for path in place.rglob("*"))
        status, out, err = run(arguments)
        assert (status, out) == (2, "")
        assert err.startswith("dubins-traffic: ")
        assert err.count("\n") == 1
        assert all(needle in err for needle in needles)
        assert sorted(path.name for path in place.rglob("*")) == before
    finally:
        (place / "locked").chmod(0o700)


@contextlib.contextmanager
def as_nobody(folder: Path) -> Iterator[None]:
    """Give up the rights of root, who may read and write everything, for a while."""
    if os.geteuid() != 0:
        yield
        return
    nobody = 65534
    for path in (folder, *folder.rglob("*")):
        os.chown(path, nobody, nobody)
    os.seteuid(nobody)
    try:
        yield
    finally:
        os.seteuid(0)


@pytest.mark.usefixtures("place")
@pytest.mark.parametrize("name", ["", ".", "/"])
@pytest.mark.parametrize("command", ["plot", "replay", "shrink"])
def test_what_has_no_name_has_no_output_beside_it(command, name, run_here):
    status, out, err = run_here([command, name])
    assert (status, out) == (2, "")
    assert err.startswith("dubins-traffic: --output: missing; expected a file to write")
    assert err.count("\n") == 1


@pytest.mark.usefixtures("place")
def test_debug_shows_where(run_here):
    status, _, err = run_here(["--debug", "plot", "nowhere.json", "-o", "x.svg"])
    assert status == 2
    assert "Traceback" in err
    assert err.splitlines()[-1].startswith("dubins-traffic: nowhere.json")


def test_what_nobody_expected_is_one_line_too(monkeypatch, run_here):
    def fail(*_: object) -> None:
        raise ValueError("two\nlines")

    monkeypatch.setattr("dubins_traffic.problem.configuration.load_config", fail)
    status, out, err = run_here(["instance", "demo"])
    assert (status, out) == (1, "")
    assert err.startswith("dubins-traffic: unexpected ValueError: two lines (")
    assert "--debug" in err
    assert err.count("\n") == 1
