"""Configurations and controllers for tests of searches, estimates and shrinking."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from dubins_traffic.cars.state import Observation
from dubins_traffic.engine.group import Group
from dubins_traffic.falsification.splitting import Begin, MeasuredGroup
from dubins_traffic.problem.configuration import Configuration
from dubins_traffic.problem.instance import Instance, Problem

NEAR = 0.9
"""The walker at the end of its corridor is nearer to the ego, metres; anywhere else it is farther."""


def corridor(crossings: int) -> Configuration:
    """Return a corridor with crossings of four roads, at whose far end the ego stands.

    A car that wanders begins at the near end. There is time only for the straight way to the ego: one of three exits at
    each crossing.
    """
    along = [[k, 1, k + 1, 1] for k in range(crossings + 1)]
    across = [road for k in range(1, crossings + 1) for road in ([k, 0, k, 1], [k, 1, k, 2])]
    document: dict[str, Any] = {
        "version": 1,
        "problem_domain": "dubins_traffic",
        "rnd": {
            "version": 0, "length": 3, "transform": [0, 0, 0], "shape": [3, crossings + 2], "segments": along + across,
        },
        "e-agents": [{"type": "wander", "name": "walker", "start": [1.2, 2.8, 0.0]}],
        "ego": {"start": [3 * (crossings + 1) - 1.2, 3.2, 3.14159]},
        "duration": 6 * crossings + 6,
        "goals": [],
    }  # fmt: skip
    return Configuration.from_document(document)


def standing(rule: str = "1.collision") -> Begin:
    """Return what begins trials whose egos stand."""

    def begin(instances: Sequence[Instance]) -> MeasuredGroup:
        return MeasuredGroup(Group(instances, keeps_rules=False), rule)

    return begin


class Rolling:
    """Drives straight on at half a metre a second, whatever stands in its way."""

    def start(self, problem: Problem) -> None:
        """Nothing is to be learnt."""

    def act(self, observation: Observation) -> tuple[float, float]:
        """Drive on."""
        del observation
        return 0.5, 0.0
