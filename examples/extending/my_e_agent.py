"""An e-agent of one's own: drives to and fro (docs/extending/e-agent.md).

In a configuration: {"type": "examples/extending/my_e_agent.py:Patrol", "name": "patrol", "parameters": {"leg": 3.0}}
"""

from __future__ import annotations

import math
import random
from collections.abc import Mapping
from typing import Any, ClassVar

import dubins_traffic as dt


class Patrol:
    """Drives straight on for a leg, turns round in place, and back; waits while a car is close before it."""

    parameters: ClassVar = {"speed": 0.4, "leg": 2.0, "gap": 0.8}

    def begin(self, instance: dt.Instance, car: int, parameters: Mapping[str, Any]) -> None:
        """Take the parameters; which way it turns is drawn, and follows from the seed."""
        chance = random.Random(f"{instance.seed} {instance.trial} {car}")
        self._speed, self._leg, self._gap = (parameters[name] for name in ("speed", "leg", "gap"))
        self._turn = chance.choice((-0.8, 0.8))
        self._from: dt.Pose | None = None
        self._turned = math.pi

    def act(self, observation: dt.Observation) -> tuple[float, float]:
        """Choose speed and yaw rate."""
        pose = observation.pose
        if self._from is None:
            self._from, self._time = pose, observation.time
        passed, self._time = observation.time - self._time, observation.time
        if self._turned < math.pi:
            self._turned += abs(observation.twist.yaw_rate) * passed
            return 0.0, self._turn
        if math.hypot(pose.x - self._from.x, pose.y - self._from.y) >= self._leg:
            self._from, self._turned = pose, 0.0
            return 0.0, self._turn
        for other in observation.others:
            x, y = other.pose.x - pose.x, other.pose.y - pose.y
            if x * pose.c + y * pose.s > 0.0 and math.hypot(x, y) < self._gap:
                return 0.0, 0.0
        return self._speed, 0.0
