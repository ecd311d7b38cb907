"""Environments for reinforcement learning, on the batch engine; importing this room registers them in Gymnasium."""

from __future__ import annotations

from typing import Any, Final, cast

import gymnasium

NAMES: Final[dict[str, dict[str, Any]]] = {
    "dubins_traffic/Traffic-v0": {},
    "dubins_traffic/Demo-v0": {"config": "demo"},
    "dubins_traffic/Town-v0": {"config": "town"},
    "dubins_traffic/Junction-v0": {"config": "junction"},
}
"""Names, each with the arguments of its environments; `Traffic` takes any configuration."""


def register() -> None:
    """Register the environments in Gymnasium, once."""
    for name, given in NAMES.items():
        if name not in gymnasium.registry:
            cast(Any, gymnasium).register(
                id=name,
                entry_point="dubins_traffic.envs.single:TrafficEnv",
                vector_entry_point="dubins_traffic.envs.vector:TrafficVectorEnv",
                kwargs=dict(given),
            )


register()
