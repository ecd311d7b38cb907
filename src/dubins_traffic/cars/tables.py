"""The cars and obstacles of a batch as tables for kernels.

Every body and obstacle part is a *rounded box*: a rectangle (half_length, half_width) grown by `rounding`. A disc
is a rounded point, a polygon the set of its edges, an edge a box without width.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from dubins_traffic.cars.body import Car, Disc, DiscObstacle, Obstacle
from dubins_traffic.cars.state import State
from dubins_traffic.kernels.arrays import Floats, Ints, distinct
from dubins_traffic.kernels.boxes import Box
from dubins_traffic.kernels.compile import jit_inline
from dubins_traffic.kernels.records import Rows, record, table
from dubins_traffic.kernels.tables import Tables


class CarTable(Tables):
    """What the cars of each trial are; all arrays (B,), metres, m/s, rad/s.

    `half_length`, `half_width` and `rounding` are those of its body (`kernels.boxes.Box`).
    """

    reach: Floats
    half_length: Floats
    half_width: Floats
    rounding: Floats
    speed_low: Floats
    speed_high: Floats
    yaw_rate: Floats
    turning_radius: Floats
    w: Floats
    point_speed: Floats


@record
class Part:
    """A part of a static obstacle: a rounded box.

    Centre (`x`, `y`), direction (`c`, `s`), a unit vector, half sizes and `rounding`; `reach` is the distance from its
    centre to its farthest point, and `owner` the number of the obstacle. Lengths are in metres.
    """

    x: float
    y: float
    c: float
    s: float
    half_length: float
    half_width: float
    rounding: float
    reach: float
    owner: int
    """Number of the obstacle in its trial."""


class ObstacleTable(Tables):
    """The parts of the static obstacles of each trial: those of trial b are `parts` off[b] to off[b + 1] - 1.

    `off` (B + 1,); `parts` (P,).
    """

    off: Ints
    parts: Rows[Part]


_SHAPE = ("x", "y", "c", "s", "half_length", "half_width", "rounding", "reach")
"""Fields of a part, in the order in which `_parts` returns them."""


@jit_inline
def box_of(part: Part) -> Box:
    """Return an obstacle's part as a rounded box."""
    return Box(part.x, part.y, part.c, part.s, part.half_length, part.half_width, part.rounding)


@jit_inline
def box_at(b: int, n: int, state: State, cars: CarTable) -> Box:
    """Return the body of car n of trial b at its present pose."""
    return Box(
        state.x[b, n], state.y[b, n], state.c[b, n], state.s[b, n],
        cars.half_length[b], cars.half_width[b], cars.rounding[b],
    )  # fmt: skip


def pack_cars(cars: Sequence[Car]) -> CarTable:
    """Return the table of one car per trial."""
    first, index = distinct([id(car) for car in cars])
    rows = np.array([_car_row(cars[k]) for k in first], dtype=np.float64)
    return CarTable(*np.ascontiguousarray(rows[index].T))


def pack_obstacles(obstacles: Sequence[Sequence[Obstacle]]) -> ObstacleTable:
    """Return the table of one sequence of obstacles per trial."""
    if not any(obstacles):
        return ObstacleTable(np.zeros(len(obstacles) + 1, dtype=np.int64), table(Part, 0))
    off = [0]
    parts: list[tuple[float, ...]] = []
    owners: list[int] = []
    for each in obstacles:
        for number, obstacle in enumerate(each):
            of_obstacle = _parts(obstacle)
            parts += of_obstacle
            owners += [number] * len(of_obstacle)
        off.append(len(parts))
    columns = np.array(parts, dtype=np.float64).reshape(len(parts), 8)
    rows = table(Part, len(parts))
    for name, column in zip(_SHAPE, columns.T, strict=True):
        rows[name] = column
    rows["owner"] = owners
    return ObstacleTable(np.array(off, dtype=np.int64), rows)


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
        car.point_speed,
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
