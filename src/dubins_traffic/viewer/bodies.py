"""Outlines of cars where they stand."""

from __future__ import annotations

import numpy as np

from dubins_traffic.cars.body import Body, Disc
from dubins_traffic.cars.state import Frames, Pose
from dubins_traffic.kernels.arrays import Floats


def poses_at(frames: Frames, frame: int) -> list[Pose]:
    """Return the poses of all cars in a frame of a block."""
    columns = zip(frames.x[frame], frames.y[frame], frames.c[frame], frames.s[frame], strict=True)
    return [Pose(float(x), float(y), float(c), float(s)) for x, y, c, s in columns]


def outline(body: Body, pose: Pose, corners: int = 48) -> Floats:
    """Return the outline of a body in a pose, (P, 2) metres; a disc has so many corners."""
    if isinstance(body, Disc):
        angles = np.linspace(0.0, 2.0 * np.pi, corners + 1)[:-1]
        shape = body.radius * np.stack([np.cos(angles), np.sin(angles)], axis=1)
    else:
        shape = 0.5 * np.array([[1, 1], [-1, 1], [-1, -1], [1, -1]]) * [body.length, body.width]
    return _placed(shape, pose)


def nose(body: Body, pose: Pose) -> Floats:
    """Return the triangle on a body that says where it heads, (3, 2) metres."""
    front = body.radius if isinstance(body, Disc) else 0.5 * body.length
    side = 0.28 * body.width
    return _placed(np.array([[0.82 * front, 0.0], [0.15 * front, side], [0.15 * front, -side]]), pose)


def _placed(shape: Floats, pose: Pose) -> Floats:
    turn = np.array([[pose.c, pose.s], [-pose.s, pose.c]])
    return shape @ turn + np.array([pose.x, pose.y])
