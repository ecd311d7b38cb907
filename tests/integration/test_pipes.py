"""Commands in pipes: what is read once, what nobody reads, what could act on a terminal, and what has been written."""

from __future__ import annotations

import json
import os
import subprocess
import sys
import threading
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest

from dubins_traffic.cli.main import main
from dubins_traffic.errors import InputError, shown
from dubins_traffic.files import read_bytes
from dubins_traffic.problem.configuration import load_config
from dubins_traffic.problem.document import instance_to_document
from dubins_traffic.problem.draw import draw
from dubins_traffic.problem.files import dumps
from dubins_traffic.roads.network import RoadNetwork
from dubins_traffic.runs.single import run_trial

COMMAND = f"{sys.executable} -m dubins_traffic.cli"
CONFIG: dict[str, Any] = {
    "version": 1,
    "problem_domain": "dubins_traffic",
    "rnd": {"version": 0, "length": 3, "shape": [2, 2]},
    "duration": 0.5,
    "number_trials": 2,
}

GOALS_ALONE = "no rules of the road are in it, so the task is its goals alone (`instance --full` keeps rules)"


@pytest.fixture(autouse=True)
def place(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "small.json").write_text(json.dumps(CONFIG))
    return tmp_path


@pytest.fixture
def pipe(place: Path) -> Iterator[Callable[[bytes], str]]:
    """Return a function that makes a named pipe through which some bytes come once."""
    writers: list[threading.Thread] = []

    def make(data: bytes) -> str:
        name = place / f"pipe{len(writers)}"
        os.mkfifo(name)
        writers.append(threading.Thread(target=lambda: name.write_bytes(data), daemon=True))
        writers[-1].start()
        return str(name)

    yield make
    for writer in writers:
        writer.join(10)


def documents() -> dict[str, tuple[bytes, list[str]]]:
    network = RoadNetwork.grid(2, 2)
    instance = draw(load_config(CONFIG), 0, 0)
    run_trial(instance, "simple", record="x.mcap")
    configuration = json.dumps(CONFIG).encode()
    full = dumps(instance_to_document(instance)).encode()
    return {
        "configuration": (configuration, ["run", "{}", "--controller", "simple"]),
        "configuration of a batch": (configuration, ["batch", "{}", "--controller", "simple"]),
        "configuration to draw": (configuration, ["instance", "{}"]),
        "instance": (full, ["run", "{}", "--controller", "simple"]),
        "network": (network.to_json().encode(), ["plot", "{}", "-o", "x.svg"]),
        "network as text": (network.to_text().encode(), ["convert", "{}", "-o", "y.json"]),
        "network of a configuration": (network.to_json().encode(), ["run", "small.json", "--rnd", "{}"]),
        "record": (Path("x.mcap").read_bytes(), ["score", "{}"]),
        "record to run again": (Path("x.mcap").read_bytes(), ["run", "{}"]),
        "record to draw": (Path("x.mcap").read_bytes(), ["plot", "{}", "-o", "y.svg"]),
    }


KINDS = [
    "configuration", "configuration of a batch", "configuration to draw", "instance", "network", "network as text",
    "network of a configuration", "record", "record to run again", "record to draw",
]  # fmt: skip


@pytest.mark.parametrize("kind", KINDS)
def test_what_comes_through_a_pipe_is_read_once(kind, pipe, capsys):
    data, arguments = documents()[kind]
    name = pipe(data)
    status = main([argument.format(name) for argument in arguments])
    assert status == 0, capsys.readouterr().err


def test_a_campaign_comes_through_a_pipe(pipe, place):
    pytest.importorskip("pyarrow")
    text = f'version = 0\ntrials = 1\ncontrollers = ["simple"]\nconfigurations = ["{place}/small.json"]\n'
    assert main(["campaign", "run", pipe(text.encode()), "-o", "out", "--workers", "1"]) == 0


def test_process_substitution():
    done = subprocess.run(
        ["bash", "-c", f"{COMMAND} run <(cat small.json) --controller simple --json"],
        check=False, capture_output=True, text=True, timeout=600,
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    assert len(json.loads(done.stdout)["trials"]) == 2


@pytest.mark.parametrize(
    "command",
    [
        "network --grid 150 150",
        "list agents",
        "run --help",
        "run small.json --controller simple",
        "score x.mcap --json",
    ],
)
@pytest.mark.path
def test_a_reader_that_has_had_enough_is_no_error(command):
    run_trial(draw(load_config(CONFIG), 0, 0), "simple", record="x.mcap")
    for reader in ("true", "head -1"):
        script = f"set -o pipefail; {COMMAND} {command} | {reader}"
        done = subprocess.run(["bash", "-c", script], check=False, capture_output=True, text=True, timeout=600)
        assert done.returncode == 0, done.stderr
        assert done.stderr == ""


@pytest.mark.parametrize(
    ("command", "status"),
    [("network --grid 3 3 >&-", 0), ("network nowhere 2>&-", 2), ("instance small.json <&- >&- 2>&-", 0)],
)
def test_streams_that_are_closed_lead_nowhere(command, status):
    done = subprocess.run(
        ["bash", "-c", f"{COMMAND} {command}"], check=False, capture_output=True, text=True, timeout=600
    )
    assert (done.stdout, done.stderr, done.returncode) == ("", "", status)


def test_a_reader_of_messages_that_has_had_enough_is_no_traceback():
    script = f"{COMMAND} plot nowhere.json -o x.svg 2>&1 >/dev/null | true; echo ${{PIPESTATUS[0]}}"
    done = subprocess.run(["bash", "-c", script], check=False, capture_output=True, text=True, timeout=600)
    assert done.stdout == "2\n"


EVIL = "\x1b]0;owned\x07\x1b[2Jx"


@pytest.mark.parametrize(
    "arguments",
    [
        ["run", EVIL],
        ["plot", f"{EVIL}.json"],
        ["run", "demo", "--controller", f"{EVIL}.py:Any"],
        ["run", "demo", "--controller", EVIL],
        ["score", f"{EVIL}.mcap"],
        ["network", "-o", f"no/{EVIL}"],
        ["run", "demo", f"--{EVIL}"],
        [EVIL],
        ["run", "evil.json"],
        ["run", "type.json"],
        ["run", "deep.json"],
    ],
)
def test_names_and_values_can_do_nothing_to_a_terminal(arguments, capsys, place):
    (place / "evil.json").write_text(json.dumps(CONFIG | {f"sensing_radiu{EVIL}s": 1, "rate": EVIL}))
    (place / "type.json").write_text(json.dumps(CONFIG | {"e-agents": [{"type": EVIL * 300}]}))
    (place / "deep.json").write_text(json.dumps({EVIL * 300: 1}))
    assert main(arguments) == 2
    err = capsys.readouterr().err
    assert err.startswith("dubins-traffic: ")
    assert err.count("\n") == 1
    assert err.rstrip("\n").isprintable()
    assert len(err) < 1500


@pytest.mark.parametrize("command", [["score"], ["check"], ["score", "other.mcap"]])
def test_names_in_records_can_do_nothing_to_a_terminal(command, capsys):
    class Evil:
        def start(self, problem: object) -> None: ...

        def act(self, _observation: object) -> tuple[float, float]:
            return (0.0, 0.0)

    instance = draw(load_config(CONFIG), 0, 0)
    name = f"{EVIL}[red].mcap"
    run_trial(instance, Evil(), record=name, name=f"{EVIL}[red]")
    run_trial(instance, "simple", record="other.mcap")
    assert main([*command, name]) == 0
    out = capsys.readouterr().out
    assert "\x1b]" not in out
    assert "\x1b[2J" not in out
    assert "\x07" not in out
    assert len(command) > 1 or "[red]" in out


def test_what_is_shown_is_one_line():
    assert shown("a\tb\r\nc") == "a b c"
    assert shown("\x1b[0m\x9b\u202e\ud800") == "\\x1b[0m\\x9b\\u202e\\ud800"
    assert shown("größe → 3") == "größe → 3"
    assert shown("x" * 100, 10) == "xxxxxxx..."
    assert len(str(InputError("p" * 9999, file="f" * 9999, field="g" * 9999, value="v" * 9999))) < 1100
    assert "too long to print" in str(InputError("p", value=10**5000))


@pytest.mark.parametrize("command", ["run", "batch", "instance", "plot", "score", "replay", "campaign run -o out"])
def test_a_file_that_never_ends_is_refused(command, capsys):
    name, *rest = command.split(" ", 1)
    more = rest[0].split() if rest else []
    where = [more[0], "/dev/zero", *more[1:]] if more else ["/dev/zero"]
    extra = {"plot": ["-o", "x.png"], "replay": ["-o", "x.html"]}.get(name, [])
    assert main([name, *where, *extra]) == 2
    err = capsys.readouterr().err
    assert "/dev/zero" in err
    assert err.count("\n") == 1


def test_reading_is_bounded(place):
    (place / "x").write_bytes(b"12345")
    assert read_bytes("x", most=5) == b"12345"
    assert read_bytes("x", magic=b"12") == b"12345"
    assert read_bytes("x", magic=b"21") == b"12"
    with pytest.raises(InputError, match="x: too large, or without an end; expected at most 0 MiB"):
        read_bytes("x", most=4)


def test_commands_say_what_they_have_written(capsys):
    run_trial(draw(load_config(CONFIG), 0, 0), "simple", record="x.mcap")
    cases: list[tuple[list[str], str]] = [
        (["network", "-o", "n.json"], "n.json"),
        (["instance", "small.json", "-o", "i.json"], "i.json"),
        (["spec", "i.json", "-o", "s.txt"], f"dubins-traffic: i.json: {GOALS_ALONE}\ns.txt"),
        (["convert", "n.json", "-o", "n.rnd"], "n.rnd"),
        (["convert", "x.mcap", "-o", "x.csv"], "x.csv"),
        (["replay", "x.mcap"], "x.html"),
        (["plot", "n.json", "-o", "n.svg"], "n.svg"),
        (["run", "small.json", "--controller", "simple", "--records", "out", "-f", "d.json"], "out\nd.json"),
        (["batch", "small.json", "--controller", "simple", "--keep", "all", "--records", "out2"], "out2"),
    ]
    for arguments, wanted in cases:
        assert main(arguments) == 0
        out, err = capsys.readouterr()
        assert err == wanted + "\n", arguments
        assert "run" in arguments or "batch" in arguments or out == ""
