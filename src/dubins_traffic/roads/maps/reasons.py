"""Why a road of a map is dropped or altered."""

from __future__ import annotations

from enum import StrEnum


class Reason(StrEnum):
    """Reasons, as reports name them."""

    CLOSED = "not for cars"
    ONE_WAY = "one-way"
    LANES = "more lanes than one in a direction"
    WIDTH = "lanes of another width"
    DEGREE = "more than four roads at a junction"
    JUNCTIONS = "junctions too near each other"
    ANGLE = "roads too near each other at a junction"
    CURVATURE = "bends too sharply, or too near a junction"
    LENGTH = "too short"
    CROSSING = "crosses another road, or lies too near it"
    APART = "not joined to the rest"
