"""Roads to look at: surfaces with a marker along the middle, as those of 2016."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Final
from xml.etree.ElementTree import Element

import numpy as np

from dubins_traffic.kernels.arrays import Floats, Ints
from dubins_traffic.simulators.gazebo.sdf import box, pose, tag, visual

if TYPE_CHECKING:
    from dubins_traffic.roads.network import RoadNetwork

WIDTH: Final = 1.2
"""Of a road, metres: 4w for w = 0.3 m."""
MARKER: Final = 0.12
"""Width of the marker between the lanes, metres."""
THICKNESS: Final = 0.002
SAGITTA: Final = 0.02
"""Largest distance of the shown chords from a curve, metres."""
SURFACE_COLOUR: Final = (0.25, 0.25, 0.27)
MARKER_COLOUR: Final = (0.9, 0.8, 0.2)


def roads(network: RoadNetwork, width: float = WIDTH) -> list[Element]:
    """Return a model per segment, and per chord of those that bend.

    It reaches half its width beyond both ends of the segment, so that corners are paved, and beyond the ends of a
    chord as far as closes the gap to the next on the outer side.

    Parameters
    ----------
    network : RoadNetwork
        Of which roads are made.
    width : float
        Of a road, metres.
    """
    made: list[Element] = []
    owner, first, last = network.surface.bars(SAGITTA)
    step = last - first
    lengths = np.sqrt((step * step).sum(axis=1))
    beyond = _beyond(owner, step / lengths[:, None], width)
    for k, length in enumerate(lengths.tolist()):
        x0, y0 = first[k].tolist()
        dx, dy = step[k].tolist()
        begin, end = beyond[k].tolist()
        where = (x0 + 0.5 * dx, y0 + 0.5 * dy, 0.0)
        height = 0.5 * THICKNESS
        place = pose(0.5 * (end - begin), 0.0, height)
        surface = visual("surface", place, box(length + begin + end, width, THICKNESS), SURFACE_COLOUR)
        marker = visual("marker", pose(0.0, 0.0, 2 * height), box(length, MARKER, THICKNESS), MARKER_COLOUR)
        link = tag("link", surface, marker, name="road")
        yaw = math.atan2(dy, dx)
        made.append(tag("model", tag("static", "true"), pose(*where, yaw=yaw), link, name=f"road_{k}"))
    return made


def _beyond(owner: Ints, along: Floats, width: float) -> Floats:
    """Return how far the bars of segments `owner` with directions `along` (K, 2) reach beyond both ends, (K, 2)."""
    beyond = np.full((len(owner), 2), 0.5 * width)
    on = owner[1:] == owner[:-1]
    cosine = (along[1:] * along[:-1]).sum(axis=1)
    sine = np.abs(along[:-1, 0] * along[1:, 1] - along[:-1, 1] * along[1:, 0])
    gap = 0.5 * width * sine / (1.0 + cosine)
    beyond[1:, 0] = np.where(on, gap, beyond[1:, 0])
    beyond[:-1, 1] = np.where(on, gap, beyond[:-1, 1])
    return beyond
