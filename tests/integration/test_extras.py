"""Every command with each extra alone: it does what it is for, or names the extra that it needs and leaves nothing."""

from __future__ import annotations

import json
import re
import shutil
import subprocess
import sys
from pathlib import Path
from typing import NamedTuple

import pytest
import typer

from dubins_traffic.cli.commands import app
from dubins_traffic.transports.ros1.messages import DIST_PACKAGES
from tests.competitions import ROAD
from tests.extras import extras, installed, required

CAMPAIGN = """
version = 0
name = "small"
seed = 1
trials = 2
controllers = ["simple"]
configurations = ["demo"]
factors = {duration = [1.0]}
"""
SUITE = {
    "version": 0,
    "name": "mine",
    "title": "One town",
    "metric": "counted_rounds",
    "campaign": {
        "version": 0,
        "seed": 1,
        "trials": 1,
        "controllers": ["simple"],
        "configurations": [{"name": "road", "document": ROAD}],
    },
}
RUN = """
import contextlib, io, json, os, sys
from dubins_traffic.cli.main import main


def there():
    return sorted(os.path.join(place, name) for place, _, names in os.walk(".") for name in names + [""])


for line in json.load(open(sys.argv[1])):
    out, err, before = io.StringIO(), io.StringIO(), there()
    with contextlib.redirect_stdout(out), contextlib.redirect_stderr(err):
        status = main(line.split())
    print(json.dumps([line, status, err.getvalue(), there() == before]), flush=True)
"""
"""Runs commands one after the other, and says of each how it ended and whether the files are those from before."""


ROS = Path(DIST_PACKAGES, "genpy").is_dir()
"""Whether messages of ROS 1 can be made here."""


class Asked(NamedTuple):
    """A command, the distributions that it needs beside the plain package, and whether it ends here if it has them.

    What takes long and imports no library that some have and some have not is asked `once`, of the plain package. What
    needs programs of the system is asked if they are `here`.
    """

    line: str
    needs: tuple[str, ...] = ()
    ends: bool = True
    once: bool = False
    here: bool = True


ASKED = (
    Asked("list agents"),
    Asked("network --grid 2 2 -o a.json"),
    Asked("instance demo --full -o i.json"),
    Asked("run one.json --controller simple --records ran"),
    Asked("batch demo --controller simple --trials 2"),
    Asked("score out/trial-0000.mcap"),
    Asked("check out/trial-0000.mcap"),
    Asked("explain 3.stop"),
    Asked("verify out/trial-0000.mcap"),
    Asked("check-controller simple", once=True),
    Asked("spec one.json"),
    Asked("synth one.json --cars 1"),
    Asked("replay out/trial-0000.mcap -o r.html"),
    Asked("convert out/trial-0000.mcap -o t.csv"),
    Asked("convert grid.json -o w.sdf"),
    Asked("convert grid.json -o g.net.xml"),
    Asked("falsify junction --controller simple --trials 2 --duration 2 -o found"),
    Asked("estimate junction --controller simple --event 1.collision --trials 4 --duration 2", ("scipy",)),
    Asked("template python entry"),
    Asked("competition new spring"),
    Asked("competition check spring"),
    Asked("evaluate entry --competition spring --trust-submissions -o ev", once=True),
    Asked("competition rank spring --phase practice ev", once=True),
    Asked("competition rehearse spring --controller simple --trials 1 --trust-submissions", once=True),
    Asked("regress cases --controller rules", once=True),
    Asked("shrink cases/one.json --controller lanes -o small.json", once=True),
    Asked("suite list"),
    Asked("suite show icra2016"),
    Asked("ros1 messages packages", here=ROS),
    Asked("lcm messages -o m.lcm"),
    Asked("plot grid.json -o p.png", ("matplotlib",)),
    Asked("convert out/trial-0000.mcap -o t.parquet", ("pyarrow",)),
    Asked("campaign run c.toml -o c --workers 1", ("pyarrow",)),
    Asked("campaign report done", ("pyarrow", "matplotlib", "scipy")),
    Asked("campaign compare done done", ("pyarrow",)),
    Asked("campaign run c.toml -o r --ray local", ("pyarrow", "ray"), ends=False),
    Asked(
        "suite run icra2016 --controller simple --trials 1 -o s",
        ("pyarrow", "matplotlib", "scipy"),
        ends=False,
    ),
    Asked("campaign replay done 0 -o c.html", ("pyarrow",)),
    Asked("suite compare --suite mine.json mine", ("pyarrow", "matplotlib", "scipy")),
    Asked("falsify junction --controller simple --trials 2 --strategy cma --duration 2 -o cma", ("cma",)),
    Asked("convert out/trial-0000.mcap -o t.bag", ("rosbags",)),
    Asked("competition seal spring --phase test --key-file key", ("cryptography",), ends=False),
    Asked("competition reveal spring --phase test --key-file key", ("cryptography",), ends=False),
    Asked("watch one.json --no-browser", ("websockets",), ends=False),
    Asked("run one.json --watch --records shown", ("websockets",), ends=False),
    Asked("play --no-browser", ("websockets",), ends=False),
    Asked("lcm run one.json", ("lcm",), ends=False),
    Asked("ros2 run one.json", ("cyclonedds",), ends=False),
    Asked("status http://127.0.0.1:9/s/1", ("httpx",), ends=False),
    Asked("logs http://127.0.0.1:9/s/1", ("httpx",), ends=False),
    Asked("cancel http://127.0.0.1:9/s/1", ("httpx",), ends=False),
    Asked("submit one.json --to http://127.0.0.1:9/c/spring/test", ("httpx",), ends=False),
    Asked("serve season", ("litestar",), ends=False),
    Asked("worker http://127.0.0.1:9 --token-file one.json", ("litestar",), ends=False),
)
ELSEWHERE = {
    "competition open", "competition verify", "sandbox check", "gazebo install", "gazebo doctor", "build",
    "warm", "ros1 run", "lines run", "stdio run",
}  # fmt: skip
"""Commands that go on from what is sealed, wait for somebody, or change the machine."""


@pytest.fixture(scope="module")
def made(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("made")
    (folder / "c.toml").write_text(CAMPAIGN)
    (folder / "mine.json").write_text(json.dumps(SUITE))
    (folder / "cases").mkdir()
    shutil.copy(Path(__file__).parents[1] / "cases" / "lanes" / "3.order.json", folder / "cases" / "one.json")
    for line in (
        "network --grid 2 2 -o grid.json",
        "instance demo --full -o one.json",
        "run one.json --controller simple --records out",
        "campaign run c.toml -o done --workers 1",
        "suite run mine.json --controller simple -o mine --workers 1",
    ):
        words = [sys.executable, "-m", "dubins_traffic.cli", *line.split()]
        subprocess.run(words, cwd=folder, check=True, capture_output=True)
    return folder


@pytest.mark.parametrize("extra", extras())
def test_each_command_works_or_names_the_extra(extra: str, made: Path, tmp_path: Path) -> None:
    python, has = installed(tmp_path / "python", extra), required(extra)
    place = tmp_path / "place"
    shutil.copytree(made, place)
    asked = [
        one for one in ASKED if one.here and (one.ends or not has.keys() >= set(one.needs)) and not (one.once and extra)
    ]
    (tmp_path / "asked.json").write_text(json.dumps([one.line for one in asked]))
    words = ["env", "DUBINS_TRAFFIC_TOKEN=none", python, "-c", RUN, tmp_path / "asked.json"]
    done = subprocess.run(words, cwd=place, capture_output=True, text=True, check=False, timeout=1800)
    told = [json.loads(line) for line in done.stdout.splitlines()]
    assert len(told) == len(asked), done.stderr
    wrong = [
        (one.line, status, err)
        for one, (_, status, err, untouched) in zip(asked, told, strict=True)
        if not (
            (status == 0 and "Traceback" not in err)
            if has.keys() >= set(one.needs)
            else status == 2 and untouched and names(err, one.needs)
        )
    ]
    assert wrong == []


def names(told: str, needs: tuple[str, ...]) -> bool:
    """Whether a message names an extra, and one that has all that is needed."""
    named = re.fullmatch(r"dubins-traffic: .* needs the extra '(.*)': install dubins-traffic\[\1\]\n", told)
    return named is not None and required(named[1]).keys() >= set(needs)


def test_every_command_is_asked() -> None:
    def commands(command: object, name: str = "") -> set[str]:
        inner = getattr(command, "commands", None)
        if inner is None:
            return {name}
        return {full for own, one in inner.items() for full in commands(one, f"{name} {own}".strip())}

    known = commands(typer.main.get_command(app))
    asked = {name for name in known for one in ASKED if f"{one.line} ".startswith(f"{name} ")}
    assert known - asked == ELSEWHERE
