"""What a search can ask of both sides: an ego that is kept waiting though nobody has broken a rule, a car provoked."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest

from dubins_traffic.cli.main import main
from dubins_traffic.falsification.archive import Found
from dubins_traffic.falsification.contract import BLOCKED, PROVOKED
from dubins_traffic.falsification.regress import regress
from dubins_traffic.falsification.search import falsify
from dubins_traffic.falsification.shrink import shrink
from dubins_traffic.problem.configuration import Configuration
from dubins_traffic.rules.parameters import RuleParameters
from tests.contract_drivers import AsEgo, Stands

ELBOW = [[0, 0, 1, 0], [1, 0, 1, 1], [1, 1, 2, 1]]
RING = [[0, 0, 1, 0], [0, 0, 0, 1], [1, 0, 1, 1], [0, 1, 1, 1]]
TRIALS = 128


def roads(segments: list[list[int]], agents: list[dict[str, Any]], seconds: float, **more: Any) -> Configuration:
    """Return a configuration whose goals are the first and the last intersection."""
    shape = [1 + max(max(row[1::2]) for row in segments), 1 + max(max(row[::2]) for row in segments)]
    document: dict[str, Any] = {
        "version": 1, "problem_domain": "dubins_traffic", "rules": True, "duration": seconds, "rate": 10,
        "goals": [[0, 0], [shape[1] - 1, shape[0] - 1]], "e-agents": agents,
        "rnd": {"version": 0, "length": 3.5, "transform": [0, 0, 0], "shape": shape, "segments": segments},
    }  # fmt: skip
    return Configuration.from_document(document | more)


def blocked(folder: Path, **rules: float) -> Found:
    """Return what a search finds among three cars that stay where they start, on the only way between two goals."""
    parked = {"type": "parked", "name": "a", "count": 3, "parameters": {"vacates_after": None}}
    own = roads(ELBOW, [parked], 200.0, rules={"gap_rounds": 4.0, **rules})
    return falsify(own, "rules", folder, rules=[BLOCKED], trials=TRIALS, seed=1, duration=None)


def provoked(folder: Path) -> Found:
    """Return what a search finds of an ego that stands, among three long cars that keep the law."""
    own = roads(
        RING, [{"type": "lawful", "name": "a", "count": 3}], 60.0,
        car={"body": {"rectangle": {"length": 0.62, "width": 0.28}}},
    )  # fmt: skip
    return falsify(own, standing, folder, rules=[PROVOKED], trials=TRIALS, seed=1, duration=None)


def standing() -> AsEgo:
    return AsEgo(Stands())


def test_who_blocks_the_ego_is_named_in_time_and_found_where_e5_allows_too_much(tmp_path: Path) -> None:
    assert blocked(tmp_path / "a").cases == {}
    found = blocked(tmp_path / "b", rest_time=1000.0)
    assert found.violated > TRIALS // 2
    for case in found.cases.values():
        assert case.story.rule == BLOCKED
        assert "had visited no goal since" in case.story.sentence
    again = regress(tmp_path / "b", "rules")
    assert {own.broken for own in again} == {(BLOCKED,)}
    small = shrink(next(iter(found.cases.values())))
    assert len(small.instance.e_agents) <= 3
    assert small.story.rule == BLOCKED


def test_what_free_cars_like_to_do_is_searched_and_shrunk(tmp_path: Path) -> None:
    free = [{"type": "free", "name": "a", "count": 2}]
    rules = {"gap_rounds": 4.0, "rest_time": 1000.0}
    own = roads(ELBOW, free, 200.0, rules=rules)
    found = falsify(own, "rules", tmp_path / "a", rules=[BLOCKED], trials=TRIALS, seed=1, duration=None)
    assert found.violated
    case = next(iter(found.cases.values()))
    assert all(agent.parameters["whims"] for agent in case.instance.e_agents)
    again = falsify(own, "rules", tmp_path / "b", rules=[BLOCKED], trials=32, seed=1, duration=None)
    resumed = falsify(own, "rules", tmp_path / "b", rules=[BLOCKED], trials=TRIALS, seed=1, duration=None, resume=True)
    assert again.trials == 32
    assert resumed.cases.keys() == found.cases.keys()
    assert resumed.violated == found.violated
    small = shrink(case)
    whole = sum(len(agent.parameters["whims"]) for agent in case.instance.e_agents)
    assert sum(len(agent.parameters["whims"]) for agent in small.instance.e_agents) < whole


def test_no_time_counts_after_somebody_broke_a_rule(tmp_path: Path) -> None:
    assert blocked(tmp_path / "a").discarded == TRIALS


def test_a_provoked_car_is_found_where_an_exit_without_room_is_free(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    assert provoked(tmp_path / "a").cases == {}

    def room(self: RuleParameters, reach: float, bodies: int) -> float:  # noqa: ARG001  # as edition 2 had it
        return self.exit_gap

    monkeypatch.setattr(RuleParameters, "room_beyond", room)
    found = provoked(tmp_path / "b")
    assert found.violated
    for case in found.cases.values():
        assert case.story.rule == PROVOKED
        assert "which keeps the law, broke E" in case.story.sentence
        assert {agent.kind for agent in case.instance.e_agents} == {"lawful"}
    assert all(own.broken == (PROVOKED,) for own in regress(tmp_path / "b", standing))


def test_what_can_not_be_asked_is_refused(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    arguments = ["--trials", "4", "-o", str(tmp_path / "a"), "--rule"]
    assert main(["falsify", "junction", *arguments, BLOCKED]) == 2
    told = capsys.readouterr().err
    assert "--duration: no gap between visits can be over its limit in trials so short: got 15" in told
    lone = tmp_path / "lone.json"
    own = roads(RING, [{"type": "parked", "name": "a"}], 10.0)
    lone.write_text(json.dumps(own.to_document()))
    assert main(["falsify", str(lone), *arguments, PROVOKED]) == 2
    assert "--rule: has no e-agents that keep the law: got 'provoked'" in capsys.readouterr().err
