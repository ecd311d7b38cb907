"""What both plots and replays draw of a road network: centre lines, hints of the lanes' directions, extents."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from dubins_traffic.cars.body import DiscObstacle, Obstacle
from dubins_traffic.kernels.arrays import Floats
from dubins_traffic.roads.network import RoadNetwork

HINT_SPACING = 4.0
SAGITTA = 0.005
"""How far what is drawn may be from a curve, metres."""


class Extent(NamedTuple):
    """A box in the world frame, metres."""

    left: float
    bottom: float
    right: float
    top: float

    @property
    def width(self) -> float:
        """Width in metres."""
        return self.right - self.left

    @property
    def height(self) -> float:
        """Height in metres."""
        return self.top - self.bottom


def road_lines(network: RoadNetwork) -> Floats:
    """Return lines that stand for the segments, (K, 2, 2) metres: one for each that is straight, chords of curves."""
    _, start, end = network.bars(SAGITTA)
    return np.stack([start, end], axis=1)


def centre_lines(network: RoadNetwork, half_width: float) -> Floats:
    """Return the stretches of the segments' centre lines outside junctions, (K, 2, 2) metres.

    An end at which other segments meet is drawn back by `half_width`, by at most 35 % of the segment.
    """
    ends = network.ends
    trim = np.where(network.degrees[ends] > 1, half_width, 0.0)
    trim = np.minimum(trim, 0.35 * network.lengths[:, None])
    owner, start, stop = network.bars(SAGITTA)
    first = np.flatnonzero(np.diff(owner, prepend=-1))
    last = np.flatnonzero(np.diff(owner, append=-1))
    s = owner[first]
    lines = np.stack([start, stop], axis=1)
    lines[first, 0] += trim[s, :1] * network.tangents[s]
    lines[last, 1] -= trim[s, 1:] * network.end_tangents[s]
    return lines


def centre_paths(network: RoadNetwork, half_width: float) -> list[Floats]:
    """Return `centre_lines` with the chords of a curve as one line (N, 2), along which strokes go on evenly."""
    lines = centre_lines(network, half_width)
    cuts = np.flatnonzero((lines[1:, 0] != lines[:-1, 1]).any(axis=1)) + 1
    return [np.concatenate([run[:1, 0], run[:, 1]]) for run in np.split(lines, cuts)]


def short(number: float) -> str:
    """Return a lattice coordinate as pictures show it, with two digits after the point at most."""
    return f"{round(number, 2) + 0.0:.12g}"


def lane_hints(network: RoadNetwork, w: float) -> Floats:
    """Return chevrons on the right lanes that point the way one drives there, (H, 3, 2) metres.

    Each lane bears one in its middle, long ones more, about `HINT_SPACING` lane lengths of 2w * 5 apart.
    """
    hints: list[Floats] = []
    for s, length in enumerate(network.lengths.tolist()):
        count = max(1, round(length / (HINT_SPACING * max(3.0 * w, 1e-9))))
        places = (np.arange(count) + 0.5) / count * length
        for lane in (2 * s, 2 * s + 1):
            middle, t = network.lane_places(lane, places)
            right = np.stack([t[:, 1], -t[:, 0]], axis=-1)
            tips = middle + w * right + 0.22 * w * t
            back = 0.44 * w * t
            side = 0.32 * w * right
            hints.append(np.stack([tips - back - side, tips, tips - back + side], axis=1))
    return np.concatenate(hints) if hints else np.zeros((0, 3, 2))


def obstacle_points(obstacle: Obstacle) -> Floats:
    """Return points that span the box of an obstacle, (P, 2) metres."""
    if isinstance(obstacle, DiscObstacle):
        centre, radius = np.array([obstacle.x, obstacle.y]), obstacle.radius
        return np.stack([centre - radius, centre + radius])
    return np.asarray(obstacle.vertices, dtype=np.float64).reshape(-1, 2)


def extent(network: RoadNetwork, half_width: float, *others: Floats) -> Extent:
    """Return the box that holds the roads and, of `others` (each (..., 2)), all finite points."""
    points = network.points if network.is_straight else road_lines(network).reshape(-1, 2)
    low, high = points.min(axis=0) - half_width, points.max(axis=0) + half_width
    for other in others:
        flat = other.reshape(-1, 2)
        flat = flat[np.isfinite(flat).all(axis=1)]
        if len(flat):
            low, high = np.minimum(low, flat.min(axis=0)), np.maximum(high, flat.max(axis=0))
    return Extent(float(low[0]), float(low[1]), float(high[0]), float(high[1]))
