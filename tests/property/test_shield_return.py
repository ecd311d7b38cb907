"""The way back of an ego under the shield, among obstacles and cars that come as fast as they can to prevent it."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from functools import partial
from typing import Any

import pytest
from hypothesis import given, reject, settings, target
from hypothesis import strategies as st

from dubins_traffic.cars.state import EGO, Command, Labels, Observation, State
from dubins_traffic.controllers.rules import Rules
from dubins_traffic.controllers.shield import Shield
from dubins_traffic.errors import InputError
from dubins_traffic.kernels.arrays import Floats
from dubins_traffic.problem.instance import Instance, Problem
from dubins_traffic.record.sink import Frames
from dubins_traffic.rules.propositions import FLAG
from dubins_traffic.scoring.score import Score, Scorer
from dubins_traffic.shield.tables import Overtakes
from dubins_traffic.simulators.embedded import Embedded
from dubins_traffic.trial.trial import Trial, run
from tests.property.test_shield import PHASES, Phase, Phases
from tests.unit.test_law import TURN, W, broken, car, on_grid, turned

Chooses = Callable[[int, State], tuple[float, float]]
START = turned(1.6, -W)
FASTEST, PERIOD, CLOSE = 0.7, 1.0 / 30.0, 0.36


class Adversary:
    """Drives all e-agents: each stands until the ego is left, and does then what a function says."""

    def __init__(self, chooses: Chooses) -> None:
        self._chooses = chooses

    def reset(self, instances: Sequence[Instance], state: State) -> None:
        """Nothing of the batch matters."""

    def decide(self, _tick: int, state: State, labels: Labels, commands: Floats) -> None:
        """Write the commands."""
        left = int(labels.bits[0, EGO]) & FLAG.LEFT
        for n in range(1, state.x.shape[1]):
            commands[0, n] = self._chooses(n, state) if left else (0.0, 0.0)


def along(state: State, n: int) -> float:
    """Return how far a car is along the ego's road."""
    return float(state.x[0, n] * math.cos(TURN) + state.y[0, n] * math.sin(TURN))


def keeps_beside(n: int, state: State, slowest: float = 0.0) -> tuple[float, float]:
    """Move up beside the ego, a little ahead of it, and stop when it stops; this breaks neither E1 nor E2.

    Or back up with it, too, however far, but not up to it: `slowest` is negative then, m/s.
    """
    ahead = along(state, EGO) + 0.1 - along(state, n)
    near = math.hypot(*(float(own[0, EGO] - own[0, n]) for own in (state.x, state.y))) < CLOSE
    return min(max(ahead / PERIOD, 0.0 if near else slowest), FASTEST), 0.0


def hunts(n: int, state: State) -> tuple[float, float]:
    """Turn toward the ego, and come as fast as possible."""
    dx, dy = float(state.x[0, EGO] - state.x[0, n]), float(state.y[0, EGO] - state.y[0, n])
    c, s = float(state.c[0, n]), float(state.s[0, n])
    far = math.hypot(dx, dy)
    cross, dot = (c * dy - s * dx) / far, (c * dx + s * dy) / far
    if dot < 0.0:
        return -FASTEST, -8.0 * cross
    return FASTEST, 8.0 * cross


class Sides:
    """A sink that keeps for how long the ego was left at a time, ticks."""

    def begin(self, _instance: Instance) -> None:
        self.spans: list[int] = []
        self._left = False

    def frames(self, frames: Frames) -> None:
        for bits in frames.bits[:, EGO]:
            left = int(bits) & FLAG.LEFT != 0
            if left and not self._left:
                self.spans.append(0)
            if left:
                self.spans[-1] += 1
            self._left = left

    def end(self, _ending: object) -> None:
        pass


def opposed(instance: Instance, chooses: Chooses, driver: Shield) -> tuple[Score, list[int]]:
    """Return the score of a trial against an adversary, and for how many ticks the ego was left each time."""
    scorer, sides = Scorer(), Sides()
    agents = [Adversary(chooses)]
    with Trial(instance, simulator=Embedded(), agents=agents, sinks=[scorer, sides]) as trial:
        run(trial, driver)
    return scorer.result(), sides.spans


def disc(x: float, left: float, radius: float) -> dict[str, Any]:
    """Return an obstacle on the ego's road."""
    u, v, _ = turned(x, left)
    return {"disc": {"x": u, "y": v, "radius": radius}}


def standing(x: float, left: float, name: str = "other", heading: float = 0.0) -> dict[str, Any]:
    """Return a car on the ego's road for the adversary to drive."""
    return car("parked", name, turned(x, left, heading), vacates_after=None)


@pytest.mark.parametrize("overtakes", ["law", "sure", "never"])
def test_a_car_that_keeps_beside_the_ego(overtakes: Overtakes) -> None:
    """It can keep an ego left for long, and breaks no rule by it; the ego is hemmed in and breaks none either."""
    instance = on_grid([standing(3.0, -W)], 40.0, START)
    score, spans = opposed(instance, keeps_beside, Shield("rules", overtakes=overtakes))
    assert broken(score, "ego") == set()
    assert broken(score, "other") & {"2.left", "2.turn", "1.collision", "E2"} == set()
    assert (spans != []) == (overtakes == "law")
    assert overtakes != "law" or max(spans) * PERIOD > 10.0


def test_a_car_that_goes_back_beside_the_ego_turns() -> None:
    """The ego falls back behind it, where it may not follow for long."""
    instance = on_grid([standing(3.0, -W)], 40.0, START)
    score, _ = opposed(instance, partial(keeps_beside, slowest=-0.05), Shield("rules", overtakes="law"))
    assert broken(score, "ego") == set()
    assert "2.turn" in broken(score, "other")


@pytest.mark.parametrize("x", [0.2, 0.8, 2.2, 4.0, 4.6, 5.2, 5.8, 6.4, 7.0, 7.6])
@pytest.mark.parametrize("left", [-W, W])
def test_nobody_comes_in_time_to_prevent_the_return(x: float, left: float) -> None:
    """A car waits for the ego to cross the line, and hunts it then: it crosses if that is behind or far ahead."""
    instance = on_grid([standing(x, left)], 15.0, START, obstacles=[disc(3.2, -W, 0.15)])
    score, spans = opposed(instance, hunts, Shield("rules"))
    assert broken(score, "ego") == set()
    assert len(spans) == (1 if x < 1.0 or x > 7.5 else 0)
    assert all(ticks * PERIOD < 4.0 for ticks in spans)


class Beyond:
    """`rules`, with the largest numbers that mean the same."""

    def __init__(self) -> None:
        self._law = Rules()

    def start(self, problem: Problem) -> None:
        """Start the law."""
        self._law.start(problem)

    def act(self, observation: Observation) -> Command:
        """Ask for more speed than there is where the law asks for all."""
        speed, yaw_rate = self._law.act(observation)
        return Command(10.0 if speed == FASTEST else speed, yaw_rate)


def test_commands_beyond_the_bounds_are_taken_for_those_at_them() -> None:
    instance = on_grid([standing(0.6, -W)], 15.0, START, obstacles=[disc(3.2, -W, 0.15)])
    found = [opposed(instance, hunts, Shield(driver)) for driver in ("rules", Beyond())]
    assert found[0][1] == found[1][1] != []
    assert found[0][0].driven == found[1][0].driven


BODIES: list[dict[str, Any]] = [
    {},
    {"body": {"rectangle": {"length": 0.4, "width": 0.25}}},
    {"bounds": {"turning_radius": 0.26}},
    {"bounds": {"speed": 1.2, "yaw_rate": 2.5, "speed_min": -0.2}},
    {"body": {"rectangle": {"length": 0.35, "width": 0.2}}, "bounds": {"speed": 0.4, "turning_radius": 0.2}},
]
DISCS = st.lists(st.tuples(st.floats(2.4, 4.4), st.floats(-0.6, 0.6), st.floats(0.03, 0.25)), min_size=1, max_size=4)
HUNTERS = st.lists(st.tuples(st.floats(-3.0, 9.0), st.sampled_from([-W, W])), max_size=2)


@settings(max_examples=60, deadline=None)
@given(DISCS, HUNTERS, st.sampled_from(BODIES), st.one_of(st.just([]), PHASES))
def test_a_crossing_that_is_begun_ends_in_time(
    discs: list[tuple[float, float, float]],
    hunters: list[tuple[float, float]],
    body: dict[str, Any],
    phases: list[Phase],
) -> None:
    agents = [standing(x, left, f"c{k}") for k, (x, left) in enumerate(hunters)]
    obstacles = [disc(*one) for one in discs]
    try:
        instance = on_grid(agents, 15.0, START, obstacles=obstacles, **({"car": body} if body else {}))
    except InputError:
        reject()
    driver = Shield(Phases(phases) if phases else "rules")
    score, spans = opposed(instance, hunts, driver)
    target(float(max(spans, default=0)), label="ticks left")
    assert broken(score, "ego") == set()
