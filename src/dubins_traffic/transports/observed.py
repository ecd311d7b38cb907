"""Observations as documents: every number keeps its bits on the way through JSON."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import numpy as np

from dubins_traffic.cars.state import Observation, Pose, Propositions, SensedCar, Twist

if TYPE_CHECKING:
    from dubins_traffic.problem.instance import Problem


def observation_to_document(seen: Observation) -> dict[str, Any]:
    """Return `seen` as lists of numbers; bodies are left out, since all cars of a problem are alike."""
    return {
        "tick": seen.tick,
        "time": seen.time,
        "pose": list(seen.pose),
        "twist": list(seen.twist),
        "propositions": list(seen.propositions),
        "others": [
            [car.name, car.index, list(car.pose), list(car.twist), list(car.propositions)]
            for car in seen.others
        ],
        "scan": None if seen.scan is None else seen.scan.tolist(),
    }


def observation_from_document(document: Mapping[str, Any], problem: Problem) -> Observation:
    """Return the observation, equal to the one that was written."""
    body = problem.car.body
    others = [
        SensedCar(name, index, Pose(*pose), Twist(*twist), body, Propositions(*propositions))
        for name, index, pose, twist, propositions in document["others"]
    ]
    scan = document["scan"]
    return Observation(
        document["tick"],
        document["time"],
        Pose(*document["pose"]),
        Twist(*document["twist"]),
        Propositions(*document["propositions"]),
        tuple(others),
        None if scan is None else np.array(scan, dtype=np.float64),
    )
