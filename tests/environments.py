"""Environments for tests: small configurations, and actions that make things happen."""

from __future__ import annotations

from typing import Any

import gymnasium
import numpy as np

import dubins_traffic.envs  # noqa: F401  # makes its environments known
from tests.minute import a_minute

SHORT: dict[str, Any] = {
    **a_minute("junction").to_document(),
    "e-agents": [{"type": "wander", "name": "wanderer", "count": 2}, {"type": "lawful", "name": "car"}],
    "duration": 3.0,
    "end_on_collision": True,
}
"""Episodes of up to three seconds at a junction, cut short by collisions."""


def vector(envs: int, config: Any = None, **given: Any) -> Any:
    """Return a native vector environment."""
    return gymnasium.make_vec(
        "dubins_traffic/Traffic-v0",
        num_envs=envs,
        vectorization_mode="vector_entry_point",
        config=SHORT if config is None else config,
        **given,
    )


def single(config: Any = None, **given: Any) -> Any:
    """Return one environment."""
    return gymnasium.make("dubins_traffic/Traffic-v0", config=SHORT if config is None else config, **given).unwrapped


def weaving(step: int, env: int = 0) -> Any:
    """Return an action that drives on, to and fro across the road, differently for each environment."""
    return np.array([0.9, 0.8 * np.sin(0.07 * step + env)], dtype=np.float32)
