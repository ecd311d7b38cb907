"""The shield in hard cases: those of the benchmark, and those that hypothesis finds on its way to small margins."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

from experiments.shield import KINDS, ruled, trials
from hypothesis import given, settings, target
from hypothesis import strategies as st

from dubins_traffic.cars.state import Command, Observation
from dubins_traffic.controllers.rules import Rules
from dubins_traffic.controllers.shield import Shield
from dubins_traffic.problem.instance import Problem
from dubins_traffic.runs.single import run_trial
from dubins_traffic.shield.tables import Overtakes
from tests.unit.test_law import TURN, W, car, on_grid, turned

Phase = tuple[int, str, float, float]


def test_no_kind_of_bad_driving_breaks_a_rule() -> None:
    found = trials(range(3 * len(KINDS)), 30.0)
    assert [one for one in found if one.own or one.at_fault or one.end != "duration"] == []
    assert all(any(one.reasons for one in found if one.kind == kind) for kind in ("left", "rams", "runs"))


def test_the_shield_leaves_rules_alone() -> None:
    found = [ruled(number, 30.0) for number in range(16)]
    assert [one for one in found if one.own or one.reasons] == []


class Phases:
    """Drives by a list of phases: so many ticks, in a way, with two numbers."""

    def __init__(self, phases: Sequence[Phase]) -> None:
        self._phases = [phase for phase in phases for _ in range(phase[0])]
        self._law = Rules()

    def start(self, problem: Problem) -> None:
        """Start the law."""
        self._law.start(problem)

    def act(self, observation: Observation) -> Command:
        """Do what the present phase says; the law is asked in any case, since it remembers."""
        law = self._law.act(observation)
        _, way, a, b = self._phases[observation.tick % len(self._phases)]
        pose = observation.pose
        if way == "law":
            return Command(law.speed + 0.1 * a, law.yaw_rate + b)
        if way == "command":
            return Command(0.7 * a, math.pi * b)
        bearing = TURN + math.pi * b
        if way == "ram" and observation.others:
            near = min(observation.others, key=lambda one: math.dist((one.pose.x, one.pose.y), (pose.x, pose.y)))
            bearing = math.atan2(near.pose.y - pose.y, near.pose.x - pose.x) + 0.5 * b
        return Command(0.7 * a, 8.0 * math.sin(bearing - pose.theta))


NUMBER = st.floats(-1.0, 1.0)
PHASES = st.lists(
    st.tuples(st.integers(1, 60), st.sampled_from(["law", "command", "bearing", "ram"]), NUMBER, NUMBER),
    min_size=1,
    max_size=12,
)
PLACES = st.tuples(st.floats(1.3, 4.6), st.floats(-0.4, -0.15), st.floats(-1.5, 1.5), st.sampled_from([0.0, 6.0]))
BLOCKS = st.sampled_from(["nothing", "parked", "disc", "beside"])


@settings(max_examples=60, deadline=None)
@given(PHASES, PLACES, BLOCKS, st.integers(0, 4), st.sampled_from(["sure", "law"]))
def test_nothing_that_is_asked_breaks_a_rule(
    phases: list[Phase],
    place: tuple[float, float, float, float],
    block: str,
    agents: int,
    overtakes: Overtakes,
) -> None:
    x, left, heading, along = place
    others: list[dict[str, Any]] = [car("lawful", f"c{k}", goes="wander") for k in range(agents)]
    more: dict[str, Any] = {}
    ahead = x + 1.2
    if block == "parked":
        others.append(car("parked", "parked", turned(along + ahead, -W), vacates_after=None))
    elif block != "nothing":
        u, v, _ = turned(along + ahead, -W if block == "disc" else -1.7 * W)
        more["obstacles"] = [{"disc": {"x": u, "y": v, "radius": 0.12}}]
    instance = on_grid(others, 12.0, turned(along + x, left, heading), **more)
    shield = Shield(Phases(phases), overtakes=overtakes)
    verdict = run_trial(instance, shield).score.verdict
    assert verdict is not None
    margins = [value for value in verdict.robustness.values() if value is not None]
    target(-min(margins), label="least margin")
    assert [one for one in verdict.violations if one.car == "ego"] == []
