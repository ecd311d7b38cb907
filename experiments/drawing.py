"""Random instances for the experiments of drivers."""

from __future__ import annotations

import math
import re
from collections.abc import Mapping, Sequence
from typing import Any

from dubins_traffic.errors import InputError
from dubins_traffic.kernels.philox import Draws
from dubins_traffic.problem.configuration import load_config
from dubins_traffic.problem.draw import draw
from dubins_traffic.problem.instance import Instance

BARRING = re.compile(r"obstacles\[(\d+)\]")
"""The field of which it is said that an obstacle bars a goal."""


def random_roads(draws: Draws, largest: int, density: float, bent: float = 0.0) -> dict[str, Any]:
    """Return the network of a configuration: random, with 6 to `largest` intersections.

    It has anything from a tree to, of the segments that a grid has more than a tree, the share `density`;
    about a share `bent` of them bend.
    """
    intersections = draws.between(6, largest)
    most = math.floor(2 * intersections - 2 * math.sqrt(intersections))
    segments = draws.between(intersections - 1, int(intersections + density * (most - intersections)))
    return {
        "random": {
            "intersections": intersections,
            "segments": segments,
            "rigid_motion": True,
            **({"bent": bent} if bent else {}),
        }
    }


def random_trial(
    network: Mapping[str, Any],
    e_agents: Sequence[Mapping[str, Any]],
    seconds: float,
    seed: int,
    number: int,
    **more: Any,
) -> Instance:
    """Return a trial with 1 to 4 goals on a network; `more` are further entries of the configuration.

    Obstacles among them that would leave a goal without an exit are left out.
    """
    configuration = {
        "version": 1,
        "problem_domain": "dubins_traffic",
        "network": network,
        "e-agents": list(e_agents),
        "number_trials": 1,
        "duration": seconds,
        "number_goals_bounds": [1, 4],
        **more,
    }
    while True:
        try:
            return draw(load_config(configuration), seed, number)
        except InputError as error:
            barring = BARRING.fullmatch(error.field or "")
            if barring is None:
                raise
            obstacles = list(configuration["obstacles"])
            del obstacles[int(barring[1])]
            configuration["obstacles"] = obstacles
