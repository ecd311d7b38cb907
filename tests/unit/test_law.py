"""The law of the road on cases by hand: ways through intersections, passing, breaking rules on request."""

from __future__ import annotations

import hashlib
import math
import os
import subprocess
import sys
from collections.abc import Sequence
from typing import Any

import numpy as np
import pytest

from dubins_traffic.agents.fleet import Fleet
from dubins_traffic.cars.state import Command, Observation
from dubins_traffic.controllers.rules import Rules
from dubins_traffic.policies.rules.turn_arcs import PART, ReferencePath, on_way, way_between
from dubins_traffic.problem.configuration import load_config
from dubins_traffic.problem.draw import draw
from dubins_traffic.problem.instance import Instance
from dubins_traffic.roads.network import RoadNetwork
from dubins_traffic.roads.packing import pack
from dubins_traffic.rules.labeller import Labeller
from dubins_traffic.runs.single import run_trial
from dubins_traffic.scoring.score import Score
from dubins_traffic.simulators.embedded import Embedded

W, R = 0.3, 1.0
TURN = 0.4
LONG = {"version": 0, "length": 6.0, "shape": [3, 3], "transform": [0.0, 0.0, TURN]}
STAR = RoadNetwork(((0, 0, 3, 0), (0, 0, -2, 3), (0, 0, -3, -3), (0, 0, 2, -3)), 1.0, (0.5, -1.0, 0.3), (7, 7))


def turned(x: float, y: float, theta: float = 0.0) -> list[float]:
    """Return a pose on the turned grid."""
    c, s = math.cos(TURN), math.sin(TURN)
    return [c * x - s * y, s * x + c * y, theta + TURN]


def car(kind: str, name: str, start: Sequence[float] | None = None, **given: Any) -> dict[str, Any]:
    """Return an e-agent of a configuration."""
    entry = {"type": kind, "name": name, "parameters": given}
    return entry if start is None else {**entry, "start": list(start)}


def on_grid(agents: Sequence[dict[str, Any]], seconds: float, ego: Sequence[float], **more: Any) -> Instance:
    """Return an instance on the turned grid of long roads, judged by the rules."""
    configuration = {
        "version": 1,
        "problem_domain": "dubins_traffic",
        "rnd": LONG,
        "e-agents": list(agents),
        "ego": {"start": list(ego)},
        "goals": [[1, 0], [2, 1], [0, 1]],
        "number_trials": 1,
        "duration": seconds,
        "rules": True,
        **more,
    }
    return draw(load_config(configuration), 7, 0)


class Slow(Rules):
    """`rules` at half its speed."""

    def act(self, observation: Observation) -> Command:
        """Drive on."""
        speed, yaw_rate = super().act(observation)
        return Command(0.5 * speed, 0.5 * yaw_rate)


def broken(score: Score, name: str) -> set[str]:
    """Return the rules that a car has broken."""
    assert score.verdict is not None
    return {one.rule for one in score.verdict.violations if one.car == name}


def march(way: ReferencePath) -> list[tuple[int, float, float]]:
    """Follow a way from its beginning; return parts and points."""
    x, y = way.x - 1.6 * way.tx + W * way.ty, way.y - 1.6 * way.ty - W * way.tx
    found: list[tuple[int, float, float]] = []
    for _ in range(500):
        part, _, left, px, py = on_way(way, x, y)
        assert abs(left) < 1e-3
        found.append((part, x, y))
        if part == PART.AFTER and math.hypot(x - way.x, y - way.y) > 1.5:
            break
        x, y = x + 0.01 * px + left * py, y + 0.01 * py - left * px
    return found


@pytest.mark.parametrize("network", [RoadNetwork.grid(3, 3), STAR], ids=["grid", "star"])
def test_ways_lead_into_the_right_lane_within_the_disc_and_on_the_road(network: RoadNetwork) -> None:
    table = pack([network], [2.0 * W])
    for lane in range(network.lanes):
        v = network.lane_ends(lane)[1]
        for out in network.arms(v):
            way = way_between(table, 0, lane, out, W, R)
            points = march(way)
            parts = [part for part, _, _ in points]
            assert parts == sorted(parts)
            assert set(parts) >= {PART.BEFORE, PART.AFTER}
            assert all(bool(network.on_road((x, y), 2.0 * W)) for _, x, y in points)
            turning = [(x, y) for part, x, y in points if part == PART.THROUGH]
            assert all(math.hypot(x - way.x, y - way.y) < R for x, y in turning)
            s, left = network.lane_coordinates(out, points[-1][1:])
            assert (float(left), float(s) > R) == (pytest.approx(-W, abs=1e-3), True)


def test_cars_that_meet_in_a_bend_stay_a_lane_apart() -> None:
    bend = RoadNetwork(((0, 0, 3, 0), (0, 0, -1, 3)), 1.0, (0.0, 0.0, 0.7), (4, 5))
    table = pack([bend], [2.0 * W])
    one, two = (march(way_between(table, 0, lane, out, W, R)) for lane, out in ((1, 2), (3, 0)))
    gaps = [math.hypot(x - p, y - q) for _, x, y in one for _, p, q in two]
    assert min(gaps) > 2.0 * W - 0.01


@pytest.mark.parametrize("place", [2.2, 3.0, 4.0])
def test_passes_what_stands_and_keeps_the_rules(place: float) -> None:
    parked = car("parked", "parked", turned(place, -W), vacates_after=None)
    score = run_trial(on_grid([parked], 40.0, turned(1.3, -W)), "rules").score
    assert (broken(score, "ego"), score.collisions) == (set(), ())
    assert score.driven.distance_m > 18.0


def test_passes_an_obstacle() -> None:
    x, y, _ = turned(3.2, -W)
    disc = {"disc": {"x": x, "y": y, "radius": 0.15}}
    score = run_trial(on_grid([], 40.0, turned(1.3, -W), obstacles=[disc]), "rules").score
    assert (broken(score, "ego"), score.collisions) == (set(), ())
    assert score.driven.distance_m > 18.0


def test_waits_behind_what_stands_until_the_other_lane_is_free() -> None:
    parked = car("parked", "parked", turned(2.6, -W), vacates_after=None)
    coming = [car("lawful", f"c{k}", turned(x, W, math.pi), speed=0.3) for k, x in enumerate((3.4, 4.7))]
    score = run_trial(on_grid([parked, *coming], 40.0, turned(1.3, -W)), "rules").score
    assert (broken(score, "ego"), score.collisions) == (set(), ())
    assert broken(score, "c0") | broken(score, "c1") == set()
    assert score.driven.distance_m > 10.0


def test_does_not_pass_where_it_could_not_return_before_the_disc() -> None:
    parked = car("parked", "parked", turned(4.2, -W), vacates_after=None)
    short = {**LONG, "length": 5.6}
    score = run_trial(on_grid([parked], 30.0, turned(1.3, -W), rnd=short), "rules").score
    assert broken(score, "ego") == set()
    assert score.driven.distance_m < 3.0


@pytest.mark.parametrize(
    ("habit", "rules"),
    [
        ({"rolls": 1.0}, {"3.stop"}),
        ({"left": 1.0}, {"2.left"}),
        ({"blocks": 1.0}, {"E4"}),
        ({"parks": 1.0, "parks_for": 300.0}, {"E4", "E6"}),
    ],
    ids=["rolls", "left", "blocks", "parks"],
)
def test_breaks_the_rules_it_is_told_to(habit: dict[str, float], rules: set[str]) -> None:
    bad = car("lawful", "bad", turned(3.0, -W), **habit)
    score = run_trial(on_grid([bad], 80.0, turned(3.0, 12.0 - W)), "rules").score
    assert broken(score, "bad") >= rules
    assert broken(score, "ego") == set()
    assert not any(one.at_fault for one in score.collisions)


@pytest.mark.parametrize("ahead", ["ego", "agent"])
def test_who_tailgates_runs_into_who_is_ahead(ahead: str) -> None:
    """Who is ahead and stops at the line, the ego too, is never at fault."""
    bad = car("lawful", "bad", turned(2.2, -W), tailgates=1.0)
    ego = turned(3.0, -W) if ahead == "ego" else turned(3.0, 12.0 - W)
    others = [] if ahead == "ego" else [car("lawful", "slow", turned(3.0, -W), speed=0.4)]
    instance = on_grid([bad, *others], 60.0, ego)
    score = run_trial(instance, Slow() if ahead == "ego" else "rules").score
    assert "E2" in broken(score, "bad")
    assert not any(one.at_fault for one in score.collisions)
    assert broken(score, "slow") == set()
    assert broken(score, "ego") <= {"1.collision"}


def test_breaks_no_rule_that_it_is_not_told_to() -> None:
    cars = [car("lawful", f"c{k}", goes=goes) for k, goes in enumerate(("wander", "loop", "places"))]
    score = run_trial(on_grid(cars, 60.0, turned(3.0, 12.0 - W)), "rules").score
    assert score.verdict is not None
    assert score.verdict.violations == ()


def test_a_nemesis_holds_the_ego_up_within_the_assumption() -> None:
    alone = run_trial(on_grid([], 120.0, turned(1.3, -W)), "rules").score
    nemesis = car("nemesis", "nemesis", turned(3.0, -W))
    score = run_trial(on_grid([nemesis], 120.0, turned(1.3, -W)), "rules").score
    assert score.verdict is not None
    assert (score.verdict.violations, score.verdict.clean) == ((), True)
    assert score.driven.distance_m < 0.9 * alone.driven.distance_m


def medley() -> list[Instance]:
    """Return instances in which cars of all sorts keep the rules or break them."""
    habits = {"rolls": 0.3, "left": 0.3, "blocks": 0.3, "tailgates": 0.3, "parks": 0.5}
    agents = [
        car("lawful", "a", goes="wander"),
        car("lawful", "b", goes="loop", **habits),
        car("lawful", "c", goes="places", **habits),
        car("nemesis", "d"),
        car("wander", "e"),
        car("parked", "f", vacates_after=None),
    ]
    return [on_grid(agents[:count], 20.0, turned(1.3, -W)) for count in (6, 4)]


def digest(instances: Sequence[Instance], ticks: int) -> str:
    """Return a hash of the commands of the e-agents; the ego drives straight on."""
    simulator, fleet, labeller = Embedded(), Fleet(), Labeller(instances)
    state = simulator.reset(instances)
    labels = labeller.reset(state)
    fleet.reset(instances, state)
    commands = np.zeros((*state.x.shape, 2))
    total = [hashlib.sha256() for _ in instances]
    for tick in range(ticks):
        commands[:, 0] = 0.4, 0.0
        fleet.decide(tick, state, labels, commands)
        for b, instance in enumerate(instances):
            total[b].update(commands[b, : len(instance.starts)].tobytes())
        labeller.update(tick + 1, state, simulator.step(commands))
    return " ".join(one.hexdigest() for one in total)


def test_a_batch_drives_as_its_trials_do_alone() -> None:
    together = digest(medley(), 300)
    assert together == " ".join(digest([one], 300) for one in medley())


def test_compiled_and_interpreted_cars_drive_alike() -> None:
    ran = subprocess.run(
        [sys.executable, "-c", "from tests.unit.test_law import digest, medley; print(digest(medley(), 90))"],
        env={**os.environ, "NUMBA_DISABLE_JIT": "1"},
        capture_output=True,
        text=True,
        check=True,
    )
    assert ran.stdout.strip() == digest(medley(), 90)
