"""Splitting against probabilities that have been counted, and what it says where it is of no use."""

import json
import os

import numpy as np
import pytest

from dubins_traffic.cars.state import EGO
from dubins_traffic.cli.main import main
from dubins_traffic.engine.group import Group
from dubins_traffic.falsification.sampling import prepared
from dubins_traffic.falsification.splitting import HASTE, MeasuredGroup, beginner, coming
from dubins_traffic.problem.draw import draw_many
from tests.falsifying import corridor
from tests.minute import a_minute
from tests.splitting_events import Traffic, estimates, probability, traffic, truths

FULL = os.environ.get("DUBINS_TRAFFIC_ESTIMATES") == "full"
"""Whether there are as many estimates as the bar asks for: minutes."""
TOGETHER = 25
EVENTS = [
    pytest.param(own, below, truth, id=f"{own.name}-{below:g}")
    for own in traffic()
    for below in own.below
    if (truth := probability(own, below)) is not None
]


@pytest.mark.parametrize(("own", "below", "truth"), EVENTS)
def test_the_intervals_of_splitting_hold_what_was_counted(own: Traffic, below: float, truth: float) -> None:
    assert 1e-4 <= truth <= 1e-2
    count, bar = (100, 90) if FULL else (4, 3)
    held = 0
    for first in range(0, count, TOGETHER):
        for found in estimates(own, below, range(first, min(first + TOGETHER, count))):
            low, high = found.interval
            held += low <= truth <= high
    assert held >= bar


def test_the_probabilities_are_counted_in_a_million_trials_each() -> None:
    assert len(EVENTS) == len(truths()) == 3
    assert all(found["trials"] >= 1_000_000 for found in truths().values())


def test_runs_that_take_their_steps_together_are_those_that_take_them_alone() -> None:
    own = next(own for own in traffic() if own.name == "corridor")
    both = estimates(own, own.below[0], [1, 2])
    assert both == [*estimates(own, own.below[0], [1]), *estimates(own, own.below[0], [2])]
    assert both[0] != both[1]


def test_a_level_sees_a_collision_before_it_comes() -> None:
    (instance,) = draw_many(corridor(1), 1, range(1))
    group = Group([instance], keeps_rules=False)
    state, reach = group.state, float(group.world.cars.reach[0])

    def level(away: float, speed: float) -> float:
        state.x[0], state.y[0] = [0.0, away + 2.0 * reach], 0.0
        state.c[0], state.s[0], state.speed[0, EGO], state.speed[0, 1] = 1.0, 0.0, 0.0, speed
        return float(coming(group)[0])

    assert level(1.0, -0.5) == pytest.approx(2.0 * HASTE)
    assert level(1.0, -0.25) == pytest.approx(0.25 + 3.0 * HASTE)
    assert level(2.0, 0.5) == pytest.approx(2.125 + 0.25 * HASTE)
    assert level(1.0, -0.5) < level(1.0, -0.25) < level(1.0, 0.0)


def test_a_level_is_never_above_the_margin_and_below_it_only_for_a_collision() -> None:
    own = prepared(a_minute("junction"), 4.0, {})
    instances = list(draw_many(own, 3, range(16)))
    group = Group(instances, keeps_rules=True)
    collision, clear = MeasuredGroup(group, "1.collision"), MeasuredGroup(group, "3.clear")
    lower = 0
    for _ in range(12):
        collision.advance(10)
        assert (collision.levels() <= collision.margins()).all()
        lower += int((collision.levels() < collision.margins()).sum())
        assert clear.levels().tolist() == clear.margins().tolist()
    assert lower > 0


@pytest.mark.parametrize("controller", ["rules", "simple"])
def test_trials_that_go_on_from_other_seeds_meet_other_traffic(controller: str) -> None:
    own = traffic()[1].configuration
    instances = list(draw_many(own, 3, range(1)))
    company = beginner(controller, "1.collision")(instances)
    company.advance(10)
    twins = company.fork([0] * 8)
    same, other = company.fork([0]), company.fork([0] * 8)
    other.reseed(range(8))
    for some in (twins, same, other):
        some.advance(instances[0].ticks - 10)
    assert len(np.unique(np.append(twins.margins(), same.margins()))) == 1
    assert len(np.unique(other.margins())) > 4


def test_where_little_is_left_to_chance_monte_carlo_is_named_as_better() -> None:
    own = next(own for own in traffic() if own.name == "starts")
    (found,) = estimates(own, own.below[0], [1])
    assert found.repeated > 0.5
    assert found.better == "monte-carlo"
    assert any("little is left to chance where they branch off" in sentence for sentence in found.advice)


def test_an_estimate_without_the_event_is_a_bound_and_names_the_better_method(
    capsys: pytest.CaptureFixture[str],
) -> None:
    words = [
        "estimate",
        "junction",
        "--duration",
        "2",
        "--method",
        "splitting",
        "--particles",
        "10",
        "--runs",
        "3",
    ]
    assert main(words) == 0
    first, second, *told = capsys.readouterr().out.splitlines()
    assert first == "1.collision is broken: 0, 95 % interval 0 to 0.116"
    assert second.endswith("in 3 runs of multilevel splitting")
    assert told[0].startswith("no run got there: that does not say that it can't happen")
    assert told[-1].startswith("Monte Carlo is better here")
    assert main([*words, "--json"]) == 0
    found = json.loads(capsys.readouterr().out)
    assert (found["extinct"], found["worth"], found["better"]) == (3, None, "monte-carlo")
    assert found["advice"] == told
