"""The simulator of docs/extending/simulator.md, from one file outside the package."""

from __future__ import annotations

import importlib.util
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from dubins_traffic.problem.draw import draw
from dubins_traffic.protocols import Simulator
from dubins_traffic.runs.single import run_trial
from tests.batches import pose, scene
from tests.conformance.simulator import SimulatorConformance
from tests.property.test_batch import SEED, configuration

EXAMPLE = Path(__file__).parents[2] / "examples" / "extending" / "my_simulator.py"


def example() -> Any:
    spec = importlib.util.spec_from_file_location("my_simulator", EXAMPLE)
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


class TestStepping(SimulatorConformance):
    position = 0.02
    heading = 0.02

    def make(self) -> Simulator:
        return example().Stepping()


def test_its_motors_turn_in_steps() -> None:
    own = example().Stepping()
    own.reset([scene([pose(0, 0)])])
    commands = np.array([[[0.3011, -0.2513]]])
    own.step(commands)
    assert commands[0, 0].tolist() == [0.302, -0.252]


def test_a_trial_runs_on_it() -> None:
    instance = draw(configuration(), SEED, 0)
    ran = [
        replace(run_trial(instance, "simple", simulator=one).score, time_to_begin_s=None)
        for one in (example().Stepping(), None, example().Stepping())
    ]
    assert ran[0] == ran[2] != ran[1]
