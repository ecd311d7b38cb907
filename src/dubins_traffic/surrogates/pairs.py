"""The ego and each other car as a pair of discs: how far apart they are, and how fast they come nearer."""

from __future__ import annotations

from typing import NamedTuple

from dubins_traffic.cars.state import EGO, Frames
from dubins_traffic.cars.tables import pack_cars
from dubins_traffic.kernels.arrays import Floats
from dubins_traffic.problem.instance import Problem


class Others(NamedTuple):
    """Places (m) and velocities (m/s) of the other cars as seen from the ego's place, world axes: each (F, N - 1)."""

    x: Floats
    y: Floats
    vx: Floats
    vy: Floats


def others_of(frames: Frames) -> Others:
    """Return where the other cars are in each frame, and how fast they move, against the ego."""
    vx, vy = frames.speed * frames.c, frames.speed * frames.s
    return Others(*(row[:, EGO + 1 :] - row[:, EGO, None] for row in (frames.x, frames.y, vx, vy)))


def touching_distance(problem: Problem) -> float:
    """Return the distance in metres at which the discs around two bodies touch."""
    return 2.0 * float(pack_cars([problem.car]).reach[0])
