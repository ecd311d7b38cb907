"""The shield on roads that bend: bad drivers, drivers that hypothesis makes up, and e-agents under shields."""

from __future__ import annotations

import math
from dataclasses import replace

import pytest
from experiments.shield import KINDS, ruled, trials
from hypothesis import given, settings, target
from hypothesis import strategies as st

from dubins_traffic.cars.state import Pose
from dubins_traffic.controllers.shield import Shield
from dubins_traffic.problem.configuration import load_config
from dubins_traffic.problem.draw import draw
from dubins_traffic.problem.instance import Instance
from dubins_traffic.runs.single import run_trial
from dubins_traffic.shield.tables import Overtakes
from tests.chain_reference import RING, Track
from tests.property.test_car_shields import KEPT, driven, trial
from tests.property.test_shield import NUMBER, PHASES, Phase, Phases

BENT = 0.7
"""About this share of the segments bends."""
ROADS = [s for s in range(len(RING.segments)) if RING.bent[s]]


def test_no_kind_of_bad_driving_breaks_a_rule_on_curves() -> None:
    found = trials(range(len(KINDS)), 20.0, bent=BENT)
    assert [one for one in found if one.own or one.at_fault or one.end != "duration"] == []
    assert all(any(one.reasons for one in found if one.kind == kind) for kind in ("left", "rams", "runs"))


def test_the_shield_leaves_rules_alone_on_curves() -> None:
    found = [ruled(number, 15.0, BENT) for number in range(4)]
    assert [one for one in found if one.own or one.reasons] == []


@pytest.mark.parametrize("keeps_ego", [True, False])
def test_no_e_agent_under_a_shield_breaks_e1_or_e2_on_curves(keeps_ego: bool) -> None:
    first = 300 + 100 * keeps_ego
    found, reasons = driven([trial(first + k, 15.0, bent=BENT) for k in range(8)], first, keeps_ego)
    assert [one for own in found for one in own if one.rule in KEPT and (keeps_ego or one.car > 0)] == []
    assert {"1.collision", "1.road", "2.left", "2.turn", "3.stop"} <= reasons


def _instance(road: int, along: float, left: float, heading: float, agents: int) -> Instance:
    """Return a trial that the ego begins on a road that bends."""
    cars = [{"type": "lawful", "name": "car", "count": agents}] if agents else []
    config = load_config(
        {
            "version": 1, "problem_domain": "dubins_traffic", "rnd": RING.to_document(), "rules": True,
            "duration": 10, "number_goals_bounds": [2, 2], "e-agents": cars,
        }
    )  # fmt: skip
    drawn = draw(config, 5, road)
    track = Track(RING, road)
    place, way = track.point(1.3 + along * (track.length - 2.6))
    place += 1j * left * way
    way *= complex(math.cos(heading), math.sin(heading))
    return replace(drawn, starts=(Pose(place.real, place.imag, way.real, way.imag), *drawn.starts[1:]))


@settings(max_examples=25, deadline=None)
@given(
    PHASES,
    st.sampled_from(ROADS),
    st.tuples(st.floats(0.0, 1.0), st.floats(-0.4, -0.2), NUMBER),
    st.integers(0, 3),
    st.sampled_from(["sure", "law"]),
)
def test_nothing_that_is_asked_breaks_a_rule_on_curves(
    phases: list[Phase], road: int, place: tuple[float, float, float], agents: int, overtakes: Overtakes
) -> None:
    instance = _instance(road, *place, agents)
    verdict = run_trial(instance, Shield(Phases(phases), overtakes=overtakes)).score.verdict
    assert verdict is not None
    margins = [value for value in verdict.robustness.values() if value is not None]
    target(-min(margins), label="least margin")
    assert [one for one in verdict.violations if one.car == "ego"] == []
