"""Clocks and obstacles of the flat observation."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from dubins_traffic.cars.propositions import FLAG
from dubins_traffic.cars.state import Command, Observation
from dubins_traffic.controllers.registry import load
from dubins_traffic.learning.clocks import LONG
from dubins_traffic.learning.flat import FlatObserver
from dubins_traffic.problem.configuration import load_config
from dubins_traffic.problem.draw import draw
from dubins_traffic.problem.instance import Instance, Problem
from dubins_traffic.runs.single import run_trial
from tests.minute import a_minute


class Watched:
    """Lets another controller drive, and keeps observations beside flat ones."""

    def __init__(self, driver: Any) -> None:
        self.driver, self.seen = driver, []

    def start(self, problem: Problem) -> None:
        self.flat = FlatObserver(problem, 0)
        self.driver.start(problem)

    def act(self, observation: Observation) -> Command:
        self.seen.append((observation, self.flat(observation)))
        return self.driver.act(observation)

    def column(self, name: str) -> np.ndarray:
        return np.array([flat[self.flat.layout.names.index(name)] for _, flat in self.seen])

    def flags(self, flag: int) -> np.ndarray:
        return np.array([observation.propositions.bits & flag == flag for observation, _ in self.seen])


def watched(instance: Instance, driver: Any) -> Watched:
    own = Watched(driver)
    run_trial(instance, own)
    return own


def in_a_row(holds: np.ndarray) -> np.ndarray:
    """Return for how many frames, up to each, something has held."""
    counts, count = [], 0
    for one in holds.tolist():
        count = count + 1 if one else 0
        counts.append(count)
    return np.array(counts)


def test_clocks_count_how_long_a_car_stands_waits_and_is_first() -> None:
    instance = draw(a_minute("junction"), 3, 0)
    rate = instance.problem.rate
    own = watched(instance, load("rules"))
    waits, first = own.flags(FLAG.STOPPED), own.flags(FLAG.FIRST | FLAG.CLEAR)
    seconds = in_a_row(waits) / rate
    assert own.column("clocks.waiting") == pytest.approx(seconds / (seconds + LONG), abs=1e-6)
    turn = in_a_row(first) / rate
    assert own.column("clocks.forfeit") == pytest.approx(np.where(turn > 0.0, 1.0 - turn / 3.0, 0.0), abs=1e-6)
    still = in_a_row(np.array([abs(observation.twist.speed) < 0.05 for observation, _ in own.seen])) / rate
    assert own.column("clocks.standing") == pytest.approx(still / (still + LONG), abs=1e-6)
    assert waits.any()
    assert first.any()


class DrivesLeft:
    """Pulls out to the left and drives on there."""

    def start(self, problem: Problem) -> None:
        self.speed = 0.3 * problem.car.bounds.speed

    def act(self, observation: Observation) -> Command:
        turns = 0.6 if observation.tick < 40 else -0.6 if observation.tick < 80 else 0.0
        return Command(self.speed, turns)


def test_the_clock_of_the_left_side_runs_out_when_the_car_has_to_be_back() -> None:
    config = {**a_minute("junction").to_document(), "e-agents": [], "duration": 12.0}
    own = watched(draw(load_config(config), 1, 0), DrivesLeft())
    left = in_a_row(own.flags(FLAG.LEFT)) / 30.0
    assert left.max() > 5.0
    assert own.column("clocks.left") == pytest.approx(np.minimum(left / 10.0, 1.0), abs=1e-6)


def test_the_nearest_obstacles_are_shown_in_the_cars_frame() -> None:
    where = [(0.9, 0.2), (1.5, -0.2), (2.2, 0.1), (-0.7, -0.7)]
    config = {**a_minute("junction").to_document(), "e-agents": [], "duration": 1.0}
    bare = draw(load_config(config), 1, 0)
    pose = bare.starts[0]
    discs = [
        {"disc": {"x": pose.x + ahead * pose.c - left * pose.s, "y": pose.y + ahead * pose.s + left * pose.c,
                  "radius": 0.05}}
        for ahead, left in where
    ]  # fmt: skip
    far = {"disc": {"x": pose.x + 50.0, "y": pose.y, "radius": 0.05}}
    instance = replace(draw(load_config({**config, "obstacles": [far, *discs]}), 1, 0), starts=bare.starts)
    problem = instance.problem
    flat = FlatObserver(problem, 0)
    seen = watched(instance, load("lanes")).seen[0][0]
    shown = dict(zip(flat.layout.names, flat(seen).tolist(), strict=True))
    nearest = sorted(where, key=lambda one: one[0] ** 2 + one[1] ** 2)[:3]
    sight = problem.sensing_radius
    for k, (ahead, left) in enumerate(nearest):
        found = [shown[f"obstacles[{k}].{name}"] for name in ("seen", "x", "y", "reach")]
        assert found == pytest.approx([1.0, ahead / sight, left / sight, 0.05 / problem.car.lane_width], abs=1e-6)
