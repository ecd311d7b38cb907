"""Where a road goes on at a junction, and where one stops before it, for the formats that say so."""

from __future__ import annotations

from math import pi
from typing import Literal

STOP_BEFORE = 1.0
"""Metres from a junction to the lines where one stops: its radius R."""
STRAIGHT_ON = pi / 4
"""Roads that go on within this angle go straight on."""


def turn(into: float, out: float) -> Literal["straight", "left", "right"]:
    """Return where a lane with the bearing `out` leads from one with the bearing `into`, both radians."""
    angle = (out - into + pi) % (2.0 * pi) - pi
    if abs(angle) < STRAIGHT_ON:
        return "straight"
    return "left" if angle > 0.0 else "right"
