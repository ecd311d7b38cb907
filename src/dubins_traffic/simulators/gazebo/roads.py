"""Roads to look at: surfaces with a marker along the middle, as those of 2016."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Final
from xml.etree.ElementTree import Element

from dubins_traffic.simulators.gazebo.sdf import box, pose, tag, visual

if TYPE_CHECKING:
    from dubins_traffic.roads.network import RoadNetwork

WIDTH: Final = 1.2
"""Of a road, metres: 4w for w = 0.3 m."""
MARKER: Final = 0.12
"""Width of the marker between the lanes, metres."""
THICKNESS: Final = 0.002
SAGITTA: Final = 0.02
"""How far what is shown may be from a bend, metres."""
SURFACE_COLOUR: Final = (0.25, 0.25, 0.27)
MARKER_COLOUR: Final = (0.9, 0.8, 0.2)


def roads(network: RoadNetwork, width: float = WIDTH) -> list[Element]:
    """Return a model per segment, and per chord of those that bend.

    It reaches half its width beyond both ends, so that corners are paved.

    Parameters
    ----------
    network : RoadNetwork
        Of which roads are made.
    width : float
        Of a road, metres.
    """
    made: list[Element] = []
    _, first, last = network.surface.bars(SAGITTA)
    for k, ((x0, y0), (x1, y1)) in enumerate(zip(first.tolist(), last.tolist(), strict=True)):
        length = math.hypot(x1 - x0, y1 - y0)
        where = (0.5 * (x0 + x1), 0.5 * (y0 + y1), 0.0)
        height = 0.5 * THICKNESS
        surface = visual(
            "surface", pose(0.0, 0.0, height), box(length + width, width, THICKNESS), SURFACE_COLOUR
        )
        marker = visual("marker", pose(0.0, 0.0, 2 * height), box(length, MARKER, THICKNESS), MARKER_COLOUR)
        link = tag("link", surface, marker, name="road")
        yaw = math.atan2(y1 - y0, x1 - x0)
        made.append(tag("model", tag("static", "true"), pose(*where, yaw=yaw), link, name=f"road_{k}"))
    return made
