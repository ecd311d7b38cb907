"""The page of a replay as a document: what it carries, how it is packed and kept safe."""

from __future__ import annotations

import base64
import hashlib
import json
import re
import subprocess
import sys
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from dubins_traffic.cars.state import Contact
from dubins_traffic.errors import InputError
from dubins_traffic.record.sink import End, Ending
from dubins_traffic.roads.network import RoadNetwork
from dubins_traffic.rules.explained import RULE_WORDS
from dubins_traffic.scoring.verdict import ASSUMPTIONS, EGO_RULES, assumption_of
from dubins_traffic.viewer.marks import Mark, goal_numbers, goal_visits, marks_of, verdict_text
from dubins_traffic.viewer.replay import replay_page, write_replay
from tests.synthetic import ROUGH, driven, instance, obstacles_beside, verdict

NASTY = ("</script><script>alert(1)</script>", "<!--<script>", "a&amp;b\u2028'\"\\")


def document(page: str) -> dict[str, Any]:
    found = re.search(r'<script type="application/json" id="data">(.*?)</script>', page, re.DOTALL)
    assert found
    return json.loads(found[1])


def array(text: str, kind: str, cars: int) -> np.ndarray:
    return np.frombuffer(base64.b64decode(text), dtype=kind).reshape(cars, -1).T


def unpacked_runs(text: str, cars: int, frames: int) -> np.ndarray:
    packed = np.frombuffer(base64.b64decode(text), dtype="<i4").tolist()
    columns = []
    for _ in range(cars):
        count = packed.pop(0)
        runs = [(packed.pop(0), packed.pop(0)) for _ in range(count)]
        ends = [first for first, _ in runs[1:]] + [frames]
        columns.append([value for (first, value), end in zip(runs, ends, strict=True) for _ in range(first, end)])
    assert not packed
    return np.array(columns).T


def test_the_page_carries_the_frames() -> None:
    tried, frames = driven(instance(ROUGH, cars=5, seconds=12.0, obstacles=obstacles_beside(ROUGH)))
    data = document(replay_page(tried, frames, None))
    series, cars = data["series"], 5
    assert array(series["x"], "<f4", cars) + data["origin"][0] == pytest.approx(frames.x, abs=1e-5)
    assert array(series["y"], "<f4", cars) + data["origin"][1] == pytest.approx(frames.y, abs=1e-5)
    turn = array(series["heading"], "<i2", cars) * np.pi / 32767 - frames.theta
    assert np.abs((turn + np.pi) % (2 * np.pi) - np.pi).max() < 1e-4
    for name in ("segment", "at", "bits"):
        assert np.array_equal(unpacked_runs(series[name], cars, len(frames)), getattr(frames, name))
    points = np.frombuffer(base64.b64decode(data["roads"]["points"]), "<f4").reshape(-1, 2)
    assert points + data["origin"] == pytest.approx(ROUGH.points, abs=1e-5)
    assert [car["name"] for car in data["cars"]] == list(tried.names)
    assert data["ending"] is None
    assert len(data["obstacles"]) == 2


def test_a_minute_with_nine_cars_stays_small(tmp_path: Path) -> None:
    tried, frames = driven(instance(RoadNetwork.grid(4, 5), cars=9, seconds=60.0))
    chance = np.random.default_rng(1)
    frames = replace(frames, speed=chance.random(frames.x.shape), yaw_rate=chance.random(frames.x.shape))
    write_replay(tmp_path / "page.html", tried, frames, Ending(End.DURATION, 1800))
    assert (tmp_path / "page.html").stat().st_size < 1.0e6
    assert [path.name for path in tmp_path.iterdir()] == ["page.html"]


def test_names_cannot_break_out() -> None:
    tried, frames = driven(instance(RoadNetwork.grid(2, 3), cars=4, seconds=1.0, names=NASTY))
    ending = Ending(End.CONTROLLER_FAULT, 30, NASTY[0])
    marks = [Mark(0.5, NASTY[0], NASTY[1])]
    page = replay_page(tried, frames, ending, {NASTY[0]: NASTY[1]}, marks)
    plain = replay_page(*driven(instance(RoadNetwork.grid(2, 3), cars=4, seconds=1.0)), ending)
    for tag in ("<script", "</script", "<!--", "alert(1)</"):
        assert page.count(tag) == plain.count(tag)
    data = document(page)
    assert [car["name"] for car in data["cars"]][1:] == list(NASTY)
    assert data["summary"] == [[NASTY[0], NASTY[1]]]


def test_the_page_needs_nothing_else_and_says_so() -> None:
    page = replay_page(*driven(instance(RoadNetwork.grid(2, 2), seconds=1.0)), None)
    assert not re.search(r"https?://|\bsrc=|@import|url\(|fetch\(|XMLHttpRequest", page)
    policy = re.search(r'Content-Security-Policy" content="([^"]*)"', page)
    assert policy
    assert "default-src 'none'" in policy[1]
    for tag, source in (("<script>", "script-src"), ("<style>", "style-src")):
        body = page.split(tag, 1)[1].split(tag.replace("<", "</"), 1)[0]
        digest = base64.b64encode(hashlib.sha256(body.encode()).digest()).decode()
        assert f"{source} 'sha256-{digest}'" in policy[1]


def test_equal_trials_give_equal_pages() -> None:
    trial = driven(instance(ROUGH, seconds=2.0))
    assert replay_page(*trial, None, {"rounds": 1}) == replay_page(*trial, None, {"rounds": 1})


def test_scores_are_written_for_people() -> None:
    score = {
        "icra2016": 14.25, "off_road_s": 0.123456, "collisions": [{"time": 1.0}, {"time": 2.0}], "goals_visited": True,
        "time_to_begin_s": None, "longest_gap_s": [1.0, None], "visits": {"1,2": 3}, "end": "duration", "none": [],
    }  # fmt: skip
    page = replay_page(*driven(instance(RoadNetwork.grid(2, 2), seconds=1.0)), None, score)
    assert document(page)["summary"] == [
        ["icra2016", "14.25"],
        ["off road (s)", "0.1235"],
        ["collisions", "2"],
        ["goals visited", "yes"],
        ["time to begin (s)", "\N{EN DASH}"],
        ["longest gap (s)", "1, \N{EN DASH}"],
        ["visits", "1,2: 3"],
        ["end", "duration"],
        ["none", "none"],
    ]


def test_marks_are_contacts_events_visits_and_more_in_order_of_time() -> None:
    tried, frames = driven(instance(RoadNetwork.grid(2, 3), cars=3, seconds=4.0))
    sides = {"closing": (0.5, 0.0), "moved": (True, False)}
    contacts = (
        Contact(30, 0.99, 0, 2, 1.0, 2.0, 1.0, 0.0, **sides, at_fault=(True, False)),
        Contact(60, 1.99, 1, -2, 1.0, 2.0, 1.0, 0.0, **sides),
    )
    frames = replace(frames, contacts=contacts)
    marks = marks_of(tried, frames, [Mark(3.0, "breach", "rule 2", 0, since=2.5)])
    assert [mark.time for mark in marks] == sorted(mark.time for mark in marks)
    texts = [mark.text for mark in marks if mark.kind != "goal"]
    assert texts == [
        "ego touches agent1 (ego at fault)",
        "command lost: ego",
        "agent0 touches obstacle 1",
        "note (half of the time)",
        "rule 2",
    ]


def test_the_verdict_is_told_with_its_breaches_and_what_excused_the_ego() -> None:
    tried, frames = driven(instance(RoadNetwork.grid(2, 3), cars=3, seconds=4.0, names=(NASTY[0], "b")))
    plain = document(replay_page(tried, frames, None))
    assert plain["verdict"] is None
    found = verdict(tried, [(1.0, NASTY[0], "E4"), (2.0, "ego", "2.left")], excuse=0)
    page = replay_page(tried, frames, None, verdict=found)
    data = document(page)
    assert NASTY[0] not in page
    assert data["verdict"]["ruling"] == "excused"
    excuse = data["marks"][data["verdict"]["excuse"]]
    assert (excuse["time"], excuse["car"], excuse["rule"], excuse["kind"]) == (1.0, 1, "E4", "breach")
    assert [mark["rule"] for mark in data["marks"] if mark["kind"] == "breach"] == ["E4", "2.left"]
    assert "E4 at 1.00 s" in data["verdict"]["why"]


@pytest.mark.parametrize(
    ("breaches", "words"),
    [
        ([], "The ego broke nothing and did its task."),
        ([(1.0, "ego", "2.left")], "The ego broke 2.left at 1.00 s, while the others had kept their part."),
    ],
)
def test_a_verdict_is_told_in_words(breaches: list[tuple[float, str, str]], words: str) -> None:
    tried = instance(RoadNetwork.grid(2, 3), cars=3)
    assert verdict_text(verdict(tried, breaches)) == words


def test_every_rule_has_words() -> None:
    assert set(EGO_RULES) <= set(RULE_WORDS)
    assert {assumption_of(rule) for rule in RULE_WORDS} == set(ASSUMPTIONS)


def test_goals_are_numbered_in_their_order_and_once() -> None:
    tried = instance(RoadNetwork.grid(2, 3))
    first, second = tried.problem.goals[:2]
    problem = replace(tried.problem, goals=(second, first, second))
    assert goal_numbers(problem) == dict(zip(problem.goal_vertices[:2], ("1+3", "2"), strict=True))


def test_a_visit_is_an_entry_and_the_first_frame_counts() -> None:
    tried, frames = driven(instance(RoadNetwork.grid(2, 3), cars=2, seconds=0.3))
    goal, other = tried.problem.goal_vertices[:2]
    at = np.full(frames.at.shape, -1)
    at[:, 0] = [goal, goal, -1, goal, other, other, -1, -1, goal, -1]
    assert goal_visits(tried, replace(frames, at=at)) == [(0, goal), (3, goal), (4, other), (8, goal)]


def test_refusals(tmp_path: Path) -> None:
    tried, frames = driven(instance(RoadNetwork.grid(2, 2), seconds=1.0))
    with pytest.raises(InputError, match=r"missing/a\.html"):
        write_replay(tmp_path / "missing" / "a.html", tried, frames, None)
    empty = {
        name: getattr(frames, name)[:0] for name in ("x", "y", "c", "s", "speed", "yaw_rate", "segment", "at", "bits")
    }
    with pytest.raises(InputError, match="at least one frame"):
        write_replay(tmp_path / "a.html", tried, replace(frames, **empty), None)
    assert not list(tmp_path.iterdir())


def test_neither_compiler_nor_matplotlib_is_loaded() -> None:
    code = (
        "import sys, dubins_traffic.viewer.replay, dubins_traffic.animation.plot;"
        "print([name for name in ('numba', 'matplotlib', 'pandas') if name in sys.modules])"
    )
    assert subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True).stdout == "[]\n"
