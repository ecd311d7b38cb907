"""The one rule for files that users have us write: names say what they hold, inputs stay, nothing is lost unasked."""

from __future__ import annotations

import json
import os
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import typer

import dubins_traffic as dt
from dubins_traffic.cli.commands import app
from dubins_traffic.cli.main import main
from dubins_traffic.errors import InputError
from dubins_traffic.files import require_output
from dubins_traffic.gazebo.world import write_sdf
from dubins_traffic.interchange.bags import write_bag
from dubins_traffic.interchange.export import export
from dubins_traffic.learning.policy import Policy
from dubins_traffic.problem.files import write_document
from dubins_traffic.roads.network import RoadNetwork
from dubins_traffic.runs.single import run_trial
from tests.recordings import make_instance
from tests.ros import need_ros

MINE = "class Mine:\n    'A controller that took a week.'\n"
COMMANDS = {
    "network": (["network", "--grid", "2", "2"], ".json", None),
    "network as text": (["network", "--grid", "2", "2", "--format", "text"], ".rnd", None),
    "network from": (["network", "--from", "grid.json"], ".json", "grid.json"),
    "instance": (["instance", "demo.json"], ".json", "demo.json"),
    "spec": (["spec", "one.json"], ".txt", "one.json"),
    "plot": (["plot", "t.mcap"], ".png", "t.mcap"),
    "replay": (["replay", "t.mcap"], ".html", "t.mcap"),
    "replay as a moving picture": (["replay", "t.mcap", "--size", "64"], ".gif", "t.mcap"),
    "convert a record": (["convert", "t.mcap"], ".csv", "t.mcap"),
    "convert to a bag": (["convert", "t.mcap"], ".bag", "t.mcap"),
    "convert a network": (["convert", "grid.json"], ".rnd", "grid.json"),
    "convert to a world": (["convert", "grid.json"], ".sdf", "grid.json"),
    "messages": (["lcm", "messages"], ".lcm", None),
}
"""Commands that write a file: words, the suffix of what they write, and what they read, if they do."""

FOLDERS = {"campaign run", "suite run", "falsify", "evaluate"}
"""Commands whose output is a folder that they go on with, or refuse."""


@pytest.fixture(scope="module")
def made(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("made")
    run_trial(make_instance(ticks=30), "simple", record=folder / "t.mcap")
    RoadNetwork.grid(2, 2).write(folder / "grid.json")
    write_document(dt.load_config("demo").document, folder / "demo.json")
    assert main(["instance", "demo", "--full", "-o", str(folder / "one.json")]) == 0
    return folder


@pytest.fixture
def place(made: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    for file in made.iterdir():
        (tmp_path / file.name).write_bytes(file.read_bytes())
    (tmp_path / "my.py").write_text(MINE)
    monkeypatch.chdir(tmp_path)
    return tmp_path


def held(folder: Path) -> dict[str, bytes]:
    return {path.name: path.read_bytes() for path in folder.iterdir()}


@pytest.mark.parametrize("name", sorted(COMMANDS))
def test_a_command_replaces_nothing_that_it_was_not_told_to(
    name: str, place: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    words, suffix, read = COMMANDS[name]
    if read is not None:
        os.link(place / read, place / f"twin{suffix}")
    (place / f"way{suffix}").symlink_to("my.py")
    before = held(place)
    wrong = ["my.py", "x.mp3", "t.mcap", f"way{suffix}", *([] if read is None else [read, f"twin{suffix}"])]
    for output in wrong:
        for more in ([], ["--overwrite"]):
            assert main([*words, "-o", output, *more]) == 2, (output, more)
            told = capsys.readouterr().err
            assert output in told
            assert told.count("\n") == 1
            assert held(place) == before
    assert main([*words, "-o", f"new{suffix}"]) == 0
    first = (place / f"new{suffix}").read_bytes()
    (place / f"new{suffix}").write_bytes(b"older")
    before = held(place)
    capsys.readouterr()
    assert main([*words, "-o", f"new{suffix}"]) == 2
    assert "exists already; expected a new name, or --overwrite" in capsys.readouterr().err
    assert held(place) == before
    assert main([*words, "-o", f"new{suffix}", "--overwrite"]) == 0
    assert len((place / f"new{suffix}").read_bytes()) == len(first)


@pytest.mark.parametrize("form", [[], ["--cpp"]])
@pytest.mark.tools
def test_messages_for_ros_replace_nothing_unasked(
    form: list[str], place: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    def files() -> dict[str, bytes]:
        return {str(path): path.read_bytes() for path in Path("ros").rglob("*") if path.is_file()}

    need_ros()
    words = ["ros1", "messages", "ros", *form]
    assert main(words) == 0
    made = files()
    assert len(made) > 5
    mine = max(made)
    Path(mine).write_text(MINE)
    for other in made.keys() - {mine}:
        Path(other).unlink()
    capsys.readouterr()
    assert main(words) == 2
    told = capsys.readouterr().err
    assert told == f"dubins-traffic: {mine}: exists already; expected a new name, or --overwrite\n"
    assert files() == {mine: MINE.encode()}
    assert main([*words, "--overwrite"]) == 0
    assert files().keys() == made.keys()
    assert Path(mine).read_bytes() == made[mine]
    Path(mine).unlink()
    Path(mine).symlink_to(place / "my.py.txt")
    (place / "my.py.txt").write_text(MINE)
    assert main([*words, "--overwrite"]) == 2
    assert (place / "my.py.txt").read_text() == MINE


@pytest.mark.usefixtures("place")
def test_no_default_name_replaces_anything_either() -> None:
    for words in (["replay", "t.mcap"], ["plot", "t.mcap"], ["plot", "grid.json"]):
        assert [main(words), main(words), main([*words, "--overwrite"])] == [0, 2, 0]


@pytest.mark.parametrize(
    "words",
    [
        ["campaign", "run", "c.toml"],
        ["falsify", "demo", "--controller", "simple"],
        ["suite", "run", "rules-2026", "--controller", "simple"],
        ["suite", "run", "adversary-2026", "--controller", "simple"],
        ["suite", "run", "synthesis-2026"],
    ],
    ids=" ".join,
)
def test_a_mistyped_folder_holds_nothing_to_go_on_with(
    words: list[str], place: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (place / "c.toml").write_text('version = 0\ntrials = 1\ncontrollers = ["simple"]\nconfigurations = ["demo"]\n')
    assert main([*words, "-o", "mistyped", "--resume"]) == 2
    (line,) = capsys.readouterr().err.splitlines()
    assert "mistyped: nothing to go on with; expected a folder that holds" in line
    assert not (place / "mistyped").exists()


@pytest.mark.path
def test_two_outputs_are_two_files(place: Path, capsys: pytest.CaptureFixture[str]) -> None:
    before = held(place)
    assert main(["synth", "one.json", "-o", "a.npz", "--graph", "a.npz"]) == 2
    assert main(["run", "demo.json", "-F", "demo.json"]) == 2
    assert main(["run", "demo.json", "-F", "my.py"]) == 2
    assert "my.py: not a name of trial data" in capsys.readouterr().err
    assert held(place) == before


def test_the_road_network_that_a_configuration_names_is_not_replaced(
    place: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    document = json.loads((place / "demo.json").read_text())
    (place / "named.json").write_text(json.dumps({**document, "rnd": "grid.json"}))
    before = held(place)
    for words in (
        ["run", "named.json", "--trials", "1", "-F", "grid.json"],
        ["instance", "named.json", "-o", "grid.json", "--overwrite"],
        ["run", "demo.json", "--trials", "1", "--rnd", "grid.json", "-F", "grid.json"],
    ):
        assert main(words) == 2, words
        assert "grid.json" in capsys.readouterr().err
        assert held(place) == before


def writers() -> dict[str, tuple[str, Callable[..., object]]]:
    network, instance, record = RoadNetwork.grid(2, 2), make_instance(ticks=30), dt.load_record("t.mcap")
    shown = (record.instance, record.frames, record.ending)
    one = Policy(("x",), 0, 1, ((np.zeros((2, 1)), np.zeros(2)),))
    return {
        "replay": (".html", lambda path, **more: dt.write_replay(path, *shown, **more)),
        "plot": (".png", lambda path, **more: dt.write_plot(path, network, **more)),
        "network": (".rnd", network.write),
        "table": (".csv", lambda path, **more: export(record, path, **more)),
        "bag": (".bag", lambda path, **more: write_bag(record, path, **more)),
        "world": (".sdf", lambda path, **more: write_sdf(network, path, **more)),
        "document": (".json", lambda path, **more: write_document({}, path, **more)),
        "record": (".mcap", lambda path, **more: run_trial(instance, "simple", record=path, **more)),
        "policy": (".npz", one.save),
    }


def test_writers_in_python_keep_the_rule(place: Path) -> None:
    for name, (suffix, write) in writers().items():
        (place / f"way{suffix}").symlink_to("my.py")
        before = held(place)
        for wrong in ("my.py", "x.mp4", f"way{suffix}", "no/such/folder" + suffix):
            for more in ({}, {"overwrite": True}):
                with pytest.raises(InputError):
                    write(wrong, **more)
                assert held(place) == before, (name, wrong)
        write(f"w{suffix}")
        before = held(place)
        with pytest.raises(InputError, match="exists already"):
            write(f"w{suffix}")
        assert held(place) == before
        write(f"w{suffix}", overwrite=True)


def test_what_is_read_is_never_written(place: Path) -> None:
    """Whatever it is called: links of both kinds, another way to it, and before it is there."""
    (place / "soft.mcap").symlink_to("t.mcap")
    os.link("t.mcap", "hard.mcap")
    for name in ("t.mcap", "soft.mcap", "hard.mcap", "./t.mcap", str(place / "t.mcap")):
        with pytest.raises(InputError, match="is read or written already"):
            require_output(name, "a record", [".mcap"], overwrite=True, apart_from=[None, "t.mcap"])
    with pytest.raises(InputError, match="is read or written already"):
        require_output("new.mcap", "a record", [".mcap"], apart_from=["./new.mcap"])
    require_output("new.mcap", "a record", [".mcap"], apart_from=["demo", "-", None])
    require_output("/dev/null", "a record", [".mcap"])


@pytest.mark.path
def test_every_command_that_writes_a_file_may_be_told_to_replace_it() -> None:
    """Folders have rules of their own: what was begun in one is gone on with."""
    found = options_of(typer.main.get_command(app))
    writes = {name for name, flags in found.items() if flags & {"--output", "--graph", "--losses"}}
    assert writes >= {"network", "instance", "replay", "plot", "convert", "spec", "synth", "shrink"}
    assert {name for name in writes if "--overwrite" not in found[name]} == FOLDERS


def options_of(command: Any, name: str = "") -> dict[str, set[str]]:
    """The options of a command, or of all commands of a group, by their names."""
    if not hasattr(command, "commands"):
        return {name: {flag for option in command.params for flag in option.opts}}
    found: dict[str, set[str]] = {}
    for own, inner in command.commands.items():
        found |= options_of(inner, f"{name} {own}".strip())
    return found
