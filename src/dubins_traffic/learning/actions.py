"""The discrete actions of learners: pairs of a share of the speeds and a share of the yaw rates that a car has."""

from __future__ import annotations

from typing import Final

import numpy as np

from dubins_traffic.kernels.arrays import Floats

SPEEDS: Final = (0.0, 0.5, 1.0)
"""Speeds of discrete actions: from the middle of the car's range (0 where it may reverse) to its top speed."""
TURNS: Final = (-1.0, -0.25, 0.0, 0.25, 1.0)
"""Yaw rates of discrete actions, as shares of the top yaw rate; action ``5 j + k`` is speed j and turn k."""
CHOICES: Final[Floats] = np.array([(speed, turn) for speed in SPEEDS for turn in TURNS])
"""Both shares of each discrete action, (15, 2)."""
CHOICES.flags.writeable = False
