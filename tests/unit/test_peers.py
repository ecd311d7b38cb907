"""Peers of the benchmarks: what their scripts print, and what is said where there is none."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from pathlib import Path

import pytest
from benchmarks import ours, overview, peers
from benchmarks.peers import Peer
from benchmarks.rates import BATCH, MOTION, WORLD, Rate, rows
from benchmarks.table import Row

ROOT = Path(__file__).resolve().parents[2]
PLAIN = Peer("plain Python", "plain", "motion")
GOOD = {"version": "1.2", "cars": 8, "car_steps": 800, "seconds": 0.5, "speed": 0.4}


def test_a_script_is_run_and_its_figure_taken():
    found = peers.rate(PLAIN, 8, budget=0.01)
    assert found.what.startswith("plain Python 3.")
    assert found.cars == 8
    assert found.per_second is not None
    assert found.per_second > 1e3


def test_cars_of_plain_python_drive_as_commanded():
    command = [sys.executable, str(PLAIN.script), "3", "0.01"]
    printed = subprocess.run(command, capture_output=True, text=True, check=True).stdout
    assert json.loads(printed)["speed"] == pytest.approx(0.4, abs=1e-4)


def test_the_last_line_counts():
    found = peers.parse(PLAIN, 8, f"a warning\n{json.dumps(GOOD)}\n\n")
    assert found == Rate("plain Python 1.2: motion", 8, 1600.0)


@pytest.mark.parametrize(
    ("printed", "why"),
    [
        ("", "printed no figure: ''"),
        ("Traceback", "printed no figure: 'Traceback'"),
        ("[1, 2]", "printed no figure: '[1, 2]'"),
        (json.dumps(GOOD | {"seconds": "soon"}), "printed no figure"),
        (json.dumps({key: GOOD[key] for key in GOOD if key != "speed"}), "printed no figure"),
        (json.dumps(GOOD | {"cars": 7}), "had 7 cars"),
        (json.dumps(GOOD | {"speed": 0.0}), "its cars did not drive"),
        (json.dumps(GOOD | {"seconds": float("nan")}), "its cars did not drive"),
    ],
)
def test_what_is_no_figure_is_one_line(printed, why):
    found = peers.parse(PLAIN, 8, printed)
    assert found.per_second is None
    assert found.why.startswith(why)
    assert "\n" not in found.why


def test_a_peer_that_is_not_installed_is_one_line(tmp_path, monkeypatch):
    monkeypatch.setattr(peers, "ENVIRONMENTS", tmp_path)
    assert {peer.name for peer in peers.PEERS if not peer.python.is_file()} == {
        path.stem for path in peers.HERE.glob("*.txt")
    }
    found = peers.rate(Peer("SUMO", "sumo", "drivers"), 8)
    assert (found.per_second, found.why) == (None, "not installed; scripts/peers.sh sumo says why")


def test_gazebo_that_is_not_installed_is_one_line(tmp_path, monkeypatch):
    monkeypatch.setenv("DUBINS_TRAFFIC_GAZEBO", str(tmp_path))
    found = ours.gazebo(8)
    assert found.per_second is None
    assert found.why
    assert "\n" not in found.why


def test_a_peer_that_fails_or_hangs_is_one_line(tmp_path, monkeypatch):
    (tmp_path / "sad_peer.py").write_text("print('{}')\nraise SystemExit('no wheels\\nno road')\n")
    (tmp_path / "slow_peer.py").write_text("import time\ntime.sleep(60)\n")
    monkeypatch.setattr(peers, "HERE", tmp_path)
    assert peers.rate(Peer("sad", "sad", ""), 8).why == "failed: no road"
    monkeypatch.setattr(peers, "PATIENCE", 0.5)
    assert peers.rate(Peer("slow", "slow", ""), 8).why == "no figure within 0 s"


def test_each_peer_has_its_script_and_fixed_versions():
    for peer in peers.PEERS:
        assert peer.script.is_file()
    for path in peers.HERE.glob("*.txt"):
        lines = path.read_text().split()
        assert lines
        assert all(len(line.split("==")) == 2 for line in lines), path


def test_what_cannot_be_installed_is_one_line_and_leaves_nothing(tmp_path):
    surroundings = os.environ | {"PEERS": str(tmp_path), "PIP_NO_INDEX": "1", "PIP_FIND_LINKS": str(tmp_path)}
    command = [str(ROOT / "scripts" / "peers.sh"), "pymunk", "unicycle"]
    ran = subprocess.run(command, env=surroundings, capture_output=True, text=True, check=True)
    first, second = ran.stdout.splitlines()
    assert first.startswith("peers: could not install pymunk: ")
    assert second == "peers: unicycle is unknown: there is no benchmarks/peers/unicycle.txt"
    assert list(tmp_path.iterdir()) == []


def test_ratios_are_to_ours_with_as_many_cars():
    own = [Rate(BATCH, 8, 2e6), Rate(MOTION, 8, 4e7), Rate(WORLD, 8, 1234.0), Rate(BATCH, 64, 3e6)]
    found = rows([*own, Rate("A", 8, 1e4), Rate("A", 64, 1e4), Rate("B", 8, None, "not installed")])
    assert [row.figure for row in found[3:]] == [
        "3.00e+06 car-steps/s",
        "1.00e+04 car-steps/s; ours in times: batch 200, motion 4,000, world 0.12",
        "1.00e+04 car-steps/s; ours in times: batch 300",
        "not measured: not installed",
    ]
    assert found[4].name == "8 cars, A"


def test_the_table_takes_the_place_of_the_one_before():
    text = overview.README.read_text(encoding="utf-8")
    once = overview.put(text, overview.markdown([Row("speed", "1 m/s", ">= 2", False)]))
    assert "| speed | 1 m/s (bar: >= 2, missed) |\n" in once
    assert overview.put(once, overview.markdown([])).count("\n| ") < once.count("\n| ")
    assert overview.put(overview.put(once, "x\n"), "x\n") == overview.put(text, "x\n")
