"""Strategies played on the road; `experiments.synthesized` shows the bars on 2,000 trials."""

from collections import Counter
from dataclasses import replace
from pathlib import Path

import pytest
from experiments.synthesized import Drive, Events, drive, instance

from dubins_traffic.controllers import registry
from dubins_traffic.errors import InputError
from dubins_traffic.problem.configuration import load_config
from dubins_traffic.problem.draw import draw
from dubins_traffic.problem.instance import Instance
from dubins_traffic.problem.kinds import parameters_of
from dubins_traffic.record.reader import read
from dubins_traffic.runs.single import run_trial
from dubins_traffic.synthesis.answer import answer
from dubins_traffic.synthesis.road_play import UNKNOWN_MOVE
from dubins_traffic.synthesis.strategy import Strategy
from dubins_traffic.synthesis.synthesized import STRATEGY_LEFT, Synthesized

SAMPLE = (1, 3, 5, 7, 11, 13, 55)
"""On small networks, won."""


@pytest.fixture(scope="module")
def sample() -> list[Drive]:
    return [drive(number, 150.0) for number in SAMPLE]


def test_the_strategy_is_played_cleanly_by_moves_that_the_game_knows(sample: list[Drive]) -> None:
    assert [(one.number, one.own, one.unknown) for one in sample if one.own or one.unknown] == []
    assert [one.number for one in sample if STRATEGY_LEFT in one.events] == []


def test_goals_recur(sample: list[Drive]) -> None:
    assert max(one.gap for one in sample) < 4.0
    assert sum(one.rounds for one in sample) > 0.7 * sum(one.free_rounds for one in sample)


def broken(number: int, **habits: float) -> Instance:
    own = instance(number, 150.0)
    agents = tuple(
        replace(agent, kind="lawful", type="lawful", parameters=parameters_of("lawful", habits))
        for agent in own.e_agents
    )
    return replace(own, e_agents=agents)


def test_what_the_game_does_not_know_is_in_the_record(tmp_path: Path) -> None:
    """Cars that enter without waiting their turn, or turn out to be on the left."""
    path = tmp_path / "rolls.mcap"
    controller = Synthesized()
    result = run_trial(broken(1, rolls=1.0), controller, record=path)
    verdict = result.score.verdict
    assert verdict is not None
    assert {one.rule for one in verdict.violations if one.car == "ego"} == set()
    events = [event for block in read(path).blocks for event in block.events]
    unknown = [event for event in events if event.kind == UNKNOWN_MOVE]
    rolled = sum(one.rule.startswith("3") for one in verdict.violations)
    assert 0 < len(unknown) <= rolled
    assert all(event.detail.startswith("car") and " to [" in event.detail for event in unknown)


def test_where_the_strategy_does_not_win_the_ego_keeps_the_rules() -> None:
    own = instance(21, 60.0)
    with pytest.raises(InputError, match="nowhere"):
        Strategy.of(answer(own).solution).first()
    events = Events()
    result = run_trial(own, "synthesized", sinks=[events])
    assert result.score.verdict is not None
    assert [one for one in result.score.verdict.violations if one.car == "ego"] == []
    assert Counter(kind for _, kind, _ in events.found)[STRATEGY_LEFT] == 1


@pytest.mark.path
def test_a_saved_strategy_drives_as_one_that_is_found_at_the_start(tmp_path: Path) -> None:
    own = instance(3, 60.0)
    path = tmp_path / "own.npz"
    Strategy.of(answer(own).solution).save(path)
    found, saved = (run_trial(own, spec).score.to_json() for spec in ("synthesized", str(path)))
    assert {**found, "controller": None, "time_to_begin_s": None} == {
        **saved,
        "controller": None,
        "time_to_begin_s": None,
    }


def test_a_strategy_for_another_problem_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "own.npz"
    Strategy.of(answer(instance(3)).solution).save(path)
    for number, field in ((7, "network"), (5, "network")):
        with pytest.raises(InputError, match=field):
            registry.load(str(path)).start(instance(number).problem)
    problem = replace(instance(3).problem, e_agents=("a", "b"))
    with pytest.raises(InputError, match="cars"):
        registry.load(str(path)).start(problem)


def test_a_file_that_is_no_strategy_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "no.npz"
    path.write_bytes(b"PK")
    with pytest.raises(InputError, match=r"no\.npz"):
        registry.load(str(path))


def test_without_others_or_goals_it_drives_as_rules() -> None:
    own = draw(load_config("demo"), 1, 0)
    alone = replace(own, duration=20.0, e_agents=(), starts=own.starts[:1], problem=replace(own.problem, e_agents=()))
    ours, rules = (run_trial(alone, name).score for name in ("synthesized", "rules"))
    assert ours.driven == rules.driven
