"""The referee against the slow reference, in batches, live and in blocks, under rigid motions, and interpreted."""

from __future__ import annotations

import hashlib
import os
import subprocess
import sys
from collections import Counter
from dataclasses import replace
from pathlib import Path

import pytest

from dubins_traffic.cars.body import Bounds, Car, DiscObstacle, Rectangle
from dubins_traffic.cars.state import State
from dubins_traffic.problem.instance import Instance
from dubins_traffic.roads.network import RoadNetwork
from dubins_traffic.rules.breach_log import RULES
from dubins_traffic.rules.labeller import Labeller
from dubins_traffic.rules.referee import Breach, Referee
from tests.judge_reference import Judge
from tests.judge_trials import CLAUSES, compare
from tests.judging import case, frames_of, judged, said
from tests.rules_scripts import KITE, STAR, TURNED_STAR, fill, moved, on_lane, wander

GRID = RoadNetwork.grid(2, 3, 3.5)
BOX = Car(body=Rectangle(0.5, 0.26), bounds=Bounds(yaw_rate=0.1))
QUICK = {
    "left_time": 2.0,
    "enter_time": 4.0,
    "exit_time": 1.5,
    "rest_time": 2.0,
    "journey_start_time": 2.0,
    "goal_time": 4.0,
}


def trial(roads: RoadNetwork, cars: int, seed: int, car: Car | None = None) -> Instance:
    """Return an instance with two goals, quick rules and now and then an obstacle."""
    found = case(roads, cars, [roads.intersections[0], roads.intersections[2]], **QUICK)
    x, y, _, _ = on_lane(roads, 0, 1.6, -0.4)
    obstacles = (DiscObstacle(x, y, 0.15),) if seed % 2 else ()
    return replace(found, problem=replace(found.problem, car=car or Car(), obstacles=obstacles))


@pytest.mark.parametrize("body", [Car(), BOX], ids=["disc", "rectangle"])
@pytest.mark.parametrize("roads", [TURNED_STAR, KITE, GRID], ids=["star", "kite", "grid"])
def test_the_referee_agrees_with_the_reference(roads: RoadNetwork, body: Car) -> None:
    for seed in range(3):
        instance = trial(roads, 6, seed, body)
        script = wander(roads, 6, 400, 20 + seed)
        found = said(judged(instance, script))
        assert len(found) == len(set(found))
        expected = Judge(instance, script).breaches()
        assert set(found) == expected, (seed, sorted(set(found) ^ expected))


def test_random_trials_with_odd_cars_are_judged_alike_and_every_clause_speaks() -> None:
    """`python -m tests.judge_trials 500` compares as many as wanted."""
    seen = sum((compare(number) for number in range(60)), Counter[str]())
    assert set(seen) >= CLAUSES


def test_the_scripts_break_every_rule() -> None:
    seen: Counter[str] = Counter()
    for roads in (STAR, KITE, GRID):
        for seed in range(4):
            script = wander(roads, 6, 1500, 20 + seed)
            found, _ = Referee([trial(roads, 6, seed)]).judge(frames_of(script))
            seen.update(breach.rule for breach in found)
    assert set(seen) >= set(RULES) - {"1.collision", "E2"}


def test_a_batch_equals_its_trials_alone() -> None:
    """In the batch the labeller is that of the trial, and one of the trials is not judged at all."""
    networks, cars = [STAR, KITE, GRID, STAR], [6, 3, 5, 4]
    cases = [trial(roads, count, b) for b, (roads, count) in enumerate(zip(networks, cars, strict=True))]
    cases[3] = replace(cases[3], problem=replace(cases[3].problem, rules={}))
    scripts = [wander(roads, n, 300, b) for b, (roads, n) in enumerate(zip(networks, cars, strict=True))]
    state = State.zeros(4, max(cars))
    state.count[:] = cars
    labeller = Labeller(cases)
    referee = Referee(cases, labeller)
    together: list[list[Breach]] = [[] for _ in cases]
    for tick in range(300):
        for b, script in enumerate(scripts):
            fill(state, b, script[tick])
        if tick == 0:
            labeller.reset(state)
            found = referee.reset(state)
        else:
            found = referee.update(tick, state, labeller.update(tick, state, [()] * 4))
        for b, own in enumerate(found):
            together[b] += own
    assert together == [judged(one, script) for one, script in zip(cases, scripts, strict=True)]
    assert together[3] == []


@pytest.mark.parametrize("angle", [0.3, 1.5707963267948966, 2.9])
def test_a_rigid_motion_changes_no_verdict(angle: float) -> None:
    script = wander(STAR, 6, 500, 11)
    turned = RoadNetwork(STAR.segments, STAR.length, (5.0, -2.0, angle), STAR.shape)
    found = judged(trial(STAR, 6, 0), script)
    assert len(found) > 20
    assert said(judged(trial(turned, 6, 0), moved(script, 5.0, -2.0, angle))) == said(found)


def test_frames_must_follow_one_another() -> None:
    frames = frames_of(wander(STAR, 2, 30, 1))
    referee = Referee([trial(STAR, 2, 0)])
    with pytest.raises(ValueError, match="must follow"):
        referee.judge(replace(frames, first=30))
    referee.judge(frames)
    with pytest.raises(ValueError, match="must follow"):
        referee.judge(replace(frames, first=31))
    with pytest.raises(ValueError, match="one trial"):
        Referee([trial(STAR, 2, 0)] * 2).judge(frames)


def digest() -> str:
    """Return a hash of the breaches of two scripts, for the comparison of compiled and interpreted kernels."""
    whole = hashlib.sha256()
    for roads, car in ((STAR, None), (KITE, BOX)):
        found, _ = Referee([trial(roads, 5, 1, car)]).judge(frames_of(wander(roads, 5, 150, 21)))
        whole.update(repr(found).encode())
    return whole.hexdigest()


def test_interpreted_kernels_judge_alike() -> None:
    ran = subprocess.run(
        [sys.executable, "-c", "from tests.property.test_judge_reference import digest; print(digest())"],
        env={**os.environ, "NUMBA_DISABLE_JIT": "1"},
        cwd=Path(__file__).parents[2],
        capture_output=True,
        text=True,
        check=True,
    )
    assert ran.stdout.strip() == digest()
