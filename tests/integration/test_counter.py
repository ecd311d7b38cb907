"""Counterstrategies played on the road; `experiments.counter` shows them at length."""

from dataclasses import replace
from pathlib import Path

import pytest
from experiments.counter import CASES, Case, Drive, drive, instance

from dubins_traffic.engine.batch import outcomes
from dubins_traffic.errors import InputError
from dubins_traffic.problem.instance import EAgent
from dubins_traffic.problem.kinds import parameters_of
from dubins_traffic.record.reader import from_bytes, read
from dubins_traffic.record.schema import EVENTS
from dubins_traffic.runs.single import run_trial
from dubins_traffic.synthesis.counter_team import COUNTERSTRATEGY
from dubins_traffic.verification.verify import verify
from dubins_traffic.viewer.marks import event_marks
from tests.tampering import Chunks, find, rebuilt

FAIRNESS, NO_E4, NO_E3 = CASES
NO_E5 = Case(3, 3, 3, ("E1", "E2", "E3", "E4", "E6"))
WON = Case(2, 2, 2, ("E1", "E2", "E3", "E4", "E5", "E6"))


@pytest.mark.parametrize("case", [FAIRNESS, NO_E4, NO_E3], ids=["fairness", "no E4", "no E3"])
@pytest.mark.parametrize("controller", ["rules", "synthesized"])
def test_the_ego_is_kept_from_a_goal_and_nothing_assumed_is_broken(case: Case, controller: str) -> None:
    found = drive(case, controller, 1, 200.0)
    assert found.gap >= 120.0
    assert found.own == ()
    assert found.others.isdisjoint(set(case.assumed) - case.falls_too)


def test_cars_that_park_in_their_lanes_keep_the_ego_from_a_goal() -> None:
    """It passes none of them: they stand where it could not be back in its lane in time."""
    found = drive(NO_E5, "rules", 1, 200.0)
    assert found.gap >= 120.0
    assert (found.own, found.others) == ((), {"E5"})


def test_where_the_ego_wins_the_team_keeps_it_from_nothing() -> None:
    found = drive(WON, "synthesized", 1, 200.0)
    assert found == Drive((), frozenset(), found.gap)
    assert found.gap < 60.0


def without_first_event(chunks: Chunks) -> None:
    m, k = find(chunks, EVENTS)
    del chunks[m][k]


def test_the_reason_is_in_the_record_and_in_the_replay(tmp_path: Path) -> None:
    path = tmp_path / "counter.mcap"
    own = instance(FAIRNESS, 1, 20.0)
    run_trial(own, "rules", record=path)
    record = read(path)
    details = [event.detail for event in record.frames.events if event.kind == COUNTERSTRATEGY]
    assert details[0] == "assumed: E2,E6"
    assert details[1].startswith("From here the ego can be kept from goal [")
    assert any("e-agent 1 holds" in detail and "is not assumed" in detail for detail in details)
    assert verify(path).verified
    silent = rebuilt(path.read_bytes(), without_first_event)
    assert "event at tick" in str(verify(from_bytes(silent)))
    shown = [mark.text for mark in event_marks(own, record.frames)]
    assert all(any(detail in text for text in shown) for detail in details)


def test_a_weaker_assumption_than_the_problem_s_may_be_played() -> None:
    own = instance(replace(FAIRNESS, assumed=WON.assumed), 1, 120.0)
    parameters = parameters_of("counter", {"assume": "E1,E2,E3,E5,E6"})
    agents = tuple(replace(agent, parameters=parameters) for agent in own.e_agents)
    verdict = run_trial(replace(own, e_agents=agents), "rules").score.verdict
    assert verdict is not None
    assert {one.rule for one in verdict.violations if one.car != "ego"} == {"E4", "E5"}


@pytest.mark.parametrize(
    ("kinds", "assume", "message"),
    [
        (("counter", "lawful"), None, "no other kind"),
        (("counter",), "E6", "ram nobody"),
        (("counter",), "E7", "not an assumption"),
    ],
)
def test_teams_that_can_not_play_are_refused(kinds: tuple[str, ...], assume: str | None, message: str) -> None:
    own = instance(replace(FAIRNESS, cars=len(kinds)), 1, 5.0)
    agents = tuple(
        EAgent(kind, agent.name, kind, parameters_of(kind, {"assume": assume} if kind == "counter" else {}))
        for kind, agent in zip(kinds, own.e_agents, strict=True)
    )
    with pytest.raises(InputError, match=message):
        run_trial(replace(own, e_agents=agents), "rules")


def test_teams_are_run_by_themselves_in_a_batch() -> None:
    own = [instance(FAIRNESS, seed, 10.0) for seed in (1, 2)]
    found = {outcome.instance.seed: outcome.score for outcome in outcomes(own, "rules", batch=2)}
    assert {seed: score.driven for seed, score in found.items()} == {
        one.seed: run_trial(one, "rules").score.driven for one in own
    }
