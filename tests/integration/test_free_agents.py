"""E-agents of the kind `free`: they do what no lawful car does, and break nothing against an ego that is clean.

A lawful car among them may: one that stands in a bend before its exit, and came by another road, is no excuse (E4).

``DUBINS_TRAFFIC_CONTRACT=full`` runs 260 trials.
"""

from __future__ import annotations

import os
from typing import Any, NamedTuple

import numpy as np
import pytest

from dubins_traffic.cars.state import Frames
from dubins_traffic.controllers.shield import Shield
from dubins_traffic.problem.configuration import Configuration
from dubins_traffic.problem.draw import draw
from dubins_traffic.problem.instance import Instance
from dubins_traffic.protocols import Controller, Ending
from dubins_traffic.runs.single import run_trial
from dubins_traffic.scoring.verdict import Violation
from tests.contract_drivers import AsEgo, Whims

TRIALS = 260 if os.environ.get("DUBINS_TRAFFIC_CONTRACT") == "full" else 24
OPEN = {230, 232}
"""Trials in which a free car breaks E4 after the law has taken over: another free car closes the exit to which it is on
its way, and it turns to a second one too late, as a lawful car would."""
SECONDS = 120.0 if TRIALS > 24 else 90.0
NETWORKS: tuple[dict[str, Any], ...] = (
    {"grid": {"rows": 2, "columns": 3, "length": 4.0}},
    {"random": {"intersections": 6, "segments": 7, "bent": 0.6}},
    {"grid": {"rows": 2, "columns": 2, "length": 3.5}},
    {"random": {"intersections": 8, "segments": 8}},
)
BODIES: tuple[dict[str, Any], ...] = (
    {"disc": {"radius": 0.177}},
    {"rectangle": {"length": 0.4, "width": 0.25}},
    {"rectangle": {"length": 0.62, "width": 0.28}},
)


class Motion:
    """A sink that notes what the free cars do."""

    def begin(self, instance: Instance) -> None:
        """Note which cars are free."""
        self.free = [n for n, own in enumerate(instance.e_agents, start=1) if own.kind == "free"]
        self.blocks: list[tuple[Any, ...]] = []

    def frames(self, frames: Frames) -> None:
        """Take a block of frames."""
        own = frames.speed[:, self.free], frames.lane[:, self.free], frames.crosses[:, self.free]
        self.blocks.append(tuple(array.copy() for array in own))

    def end(self, ending: Ending) -> None:
        """Nothing is left to do."""

    def done(self) -> tuple[bool, bool, bool]:
        """Tell whether a free car backed up, went to and fro in a lane, and backed into a disc."""
        speed, lane, crosses = (np.concatenate(arrays) for arrays in zip(*self.blocks, strict=True))
        backs = speed < -0.01
        inside = (lane >= 0) & (crosses < 0)
        flips = (speed[1:] > 0.01) & backs[:-1] & inside[1:]
        enters = (crosses[1:] >= 0) & (crosses[:-1] < 0) & backs[1:]
        return bool(backs.any()), bool(flips.any()), bool(enters.any())


class Did(NamedTuple):
    """What came of a trial: its number, the breaches of all, and what the free cars did."""

    number: int
    broken: tuple[Violation, ...]
    done: tuple[bool, bool, bool]


def instance(number: int, seconds: float = SECONDS) -> Instance:
    """Return the trial of a number: two or three free cars and one or two that keep the law."""
    document: dict[str, Any] = {
        "version": 1, "problem_domain": "dubins_traffic", "network": NETWORKS[number % 4], "rules": True,
        "rate": (10, 30)[number // 2 % 2], "car": {"body": BODIES[number // 4 % 3]}, "number_trials": 1,
        "number_goals_bounds": [1, 3], "duration": seconds,
        "e-agents": [
            {"type": "free", "name": "free", "count": 3 - number % 2},
            {"type": "lawful", "name": "lawful", "count": 1 + number % 2},
        ],
    }  # fmt: skip
    return draw(Configuration.from_document(document), 3, number)


def ego(number: int) -> str | Controller:
    """Return who drives: `rules`, or, where bodies are discs, in one trial of three anything under the shield."""
    return "rules" if number % 3 or number // 4 % 3 else Shield(AsEgo(Whims(), seed=number))


def did(number: int) -> Did:
    motion = Motion()
    verdict = run_trial(instance(number), ego(number), sinks=[motion], sketch=False).score.verdict
    assert verdict is not None
    return Did(number, verdict.violations, motion.done())


@pytest.fixture(scope="module")
def trials() -> list[Did]:
    return [did(number) for number in range(TRIALS)]


def test_free_cars_break_nothing_and_neither_does_the_ego(trials: list[Did]) -> None:
    known = [one for one in trials if one.number not in OPEN]
    broken = [(one.number, own) for one in known for own in one.broken if not own.car.startswith("lawful")]
    assert broken == []


def test_they_do_what_no_lawful_car_does(trials: list[Did]) -> None:
    backed, to_and_fro, into_discs = np.array([one.done for one in trials]).sum(axis=0).tolist()
    assert backed > 0.8 * len(trials)
    assert to_and_fro > 0.5 * len(trials)
    assert into_discs > 0


def test_commands_are_played_as_far_as_the_law_allows_and_end_before_e5_does() -> None:
    own = {"commands": [[2.0, 0.3, 0.0], [2.0, -0.3, 0.0]], "repeat": True}
    configuration = Configuration.from_document(
        {
            "version": 1, "problem_domain": "dubins_traffic", "network": NETWORKS[0], "rules": True, "rate": 10,
            "number_trials": 1, "number_goals_bounds": [1, 1], "duration": 150,
            "e-agents": [{"type": "free", "name": "free", "parameters": own}],
        }
    )  # fmt: skip
    motion = Motion()
    verdict = run_trial(draw(configuration, 1, 0), "rules", sinks=[motion], sketch=False).score.verdict
    assert verdict is not None
    assert verdict.violations == ()
    speed = np.concatenate([block[0] for block in motion.blocks])
    assert (speed == -0.3).sum() > 100
    assert (speed > 0.6).any()
