"""Cars and obstacles of a batch as arrays for kernels.

Every body and obstacle part is a *rounded box*: a rectangle (half_length, half_width) grown by `rounding`. A disc
is a rounded point, a polygon the set of its edges, an edge a box without width.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from dubins_traffic.cars.body import Car, Disc, DiscObstacle, Obstacle
from dubins_traffic.kernels.arrays import Floats, Ints, distinct
from dubins_traffic.kernels.tables import Tables


class CarTable(Tables):
    """The car of each trial; all arrays (B,), metres, m/s, rad/s."""

    reach: Floats
    half_length: Floats
    half_width: Floats
    rounding: Floats
    speed_low: Floats
    speed_high: Floats
    yaw_rate: Floats
    turning_radius: Floats
    w: Floats


class ObstacleTable(Tables):
    """The static obstacles of each trial: those of trial b are the parts off[b] to off[b + 1] - 1.

    `off` (B + 1,); `part` (P, 8): x, y, cos, sin, half_length, half_width, rounding, reach; `owner` (P,): number
    of the obstacle to which the part belongs.
    """

    off: Ints
    part: Floats
    owner: Ints


def pack_cars(cars: Sequence[Car]) -> CarTable:
    """Return the table of one car per trial."""
    first, index = distinct([id(car) for car in cars])
    rows = np.array([_car_row(cars[k]) for k in first], dtype=np.float64)
    return CarTable(*np.ascontiguousarray(rows[index].T))


def pack_obstacles(obstacles: Sequence[Sequence[Obstacle]]) -> ObstacleTable:
    """Return the table of one sequence of obstacles per trial."""
    if not any(obstacles):
        nothing = np.zeros(len(obstacles) + 1, dtype=np.int64)
        return ObstacleTable(nothing, np.zeros((0, 8)), np.zeros(0, dtype=np.int64))
    off = [0]
    parts: list[tuple[float, ...]] = []
    owners: list[int] = []
    for own in obstacles:
        for number, obstacle in enumerate(own):
            rows = _parts(obstacle)
            parts += rows
            owners += [number] * len(rows)
        off.append(len(parts))
    part = np.array(parts, dtype=np.float64).reshape(len(parts), 8)
    return ObstacleTable(np.array(off, dtype=np.int64), part, np.array(owners, dtype=np.int64))


def _car_row(car: Car) -> tuple[float, ...]:
    body, bounds = car.body, car.bounds
    disc = isinstance(body, Disc)
    box = (0.0, 0.0, body.radius) if disc else (0.5 * body.length, 0.5 * body.width, 0.0)
    return (
        body.reach,
        *box,
        bounds.speed_low,
        bounds.speed,
        bounds.yaw_rate,
        bounds.turning_radius,
        car.w,
    )


def _parts(obstacle: Obstacle) -> list[tuple[float, ...]]:
    if isinstance(obstacle, DiscObstacle):
        return [(obstacle.x, obstacle.y, 1.0, 0.0, 0.0, 0.0, obstacle.radius, obstacle.radius)]
    rows: list[tuple[float, ...]] = []
    corners = obstacle.vertices
    for (x0, y0), (x1, y1) in zip(corners, corners[1:] + corners[:1], strict=True):
        length = math.sqrt((x1 - x0) * (x1 - x0) + (y1 - y0) * (y1 - y0))
        middle = (0.5 * (x0 + x1), 0.5 * (y0 + y1))
        half = 0.5 * length
        rows.append((*middle, (x1 - x0) / length, (y1 - y0) / length, half, 0.0, 0.0, half))
    return rows
