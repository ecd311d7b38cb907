"""Where the cars of an instance start."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from itertools import chain
from math import floor
from typing import NamedTuple

import numpy as np

from dubins_traffic.cars.body import Car, Obstacle
from dubins_traffic.cars.state import Pose
from dubins_traffic.errors import InputError
from dubins_traffic.kernels.philox import Draws
from dubins_traffic.problem.overlap import Shape, body_shape, obstacle_shape, overlap
from dubins_traffic.problem.places import Places
from dubins_traffic.roads.network import RoadNetwork

ROOMY = 0.5
"""Preferred gap between two bodies, metres for w = 0.3 m: not less than the 0.5 m of free view that the
reference e-agent needs to set off."""
TIGHT = 0.1
"""Gap between two bodies if not all cars fit with `ROOMY`, metres for w = 0.3 m."""


class Wish(NamedTuple):
    """Where a car is to start: the pose, or None to draw it, the lanes it may be drawn on (None: all), and the
    field of the document that says so.
    """

    pose: Pose | None
    lanes: Collection[int] | None
    field: str


class Ground(NamedTuple):
    """What starts depend on: the roads, the car, the intersection radius R (metres), the obstacles."""

    network: RoadNetwork
    car: Car
    intersection_radius: float
    obstacles: tuple[Obstacle, ...]


class Areas(NamedTuple):
    """Where cars may stand: clear of obstacles, and of these places those outside the discs of intersections."""

    free: Places
    outside: Places


def areas_of(ground: Ground) -> Areas:
    """Return the areas of a ground."""
    free = Places(ground.network, ground.car.w)
    for obstacle in ground.obstacles:
        free.block_shape(obstacle_shape(obstacle), ground.car.body.reach)
    outside = free.copy()
    outside.block_intersections(ground.intersection_radius + ground.car.body.reach)
    return Areas(free, outside)


def draw_starts(areas: Areas, ground: Ground, wishes: Sequence[Wish], draws: Draws) -> list[Pose]:
    """Return the start poses of all cars.

    Starts that are not given are drawn uniformly over the right lanes' centre lines, headed with the lane, with bodies
    clear of obstacles, of all discs of intersections and, by a gap, of one another. If the cars don't fit so, they are
    packed; if they still don't, the gap is reduced, and then places inside discs are used.

    Raises
    ------
    InputError
        If the cars don't fit; says how many do.
    """
    poses = {n: wish.pose for n, wish in enumerate(wishes) if wish.pose is not None}
    if len(poses) == len(wishes):
        return [poses[n] for n in range(len(wishes))]
    free, outside = areas
    best = 0
    for some in ((outside,), (outside, free)):
        for gap in (ROOMY, TIGHT) if len(some) == 1 else (TIGHT,):
            for packed in (False, True):
                found = _attempt(some, gap, packed, ground.car, wishes, draws)
                if len(found) == len(wishes):
                    return [found[n] for n in range(len(wishes))]
                best = max(best, len(found))
    raise InputError(
        f"only {best} of {len(wishes)} cars fit on the road network",
        field="e-agents",
        value=len(wishes) - 1,
        expected=f"at most {max(best - 1, 0)} e-agents, or a larger network",
    )


def gap_radius(car: Car, gap: float = ROOMY) -> float:
    """Return the least distance of the centres of two cars, metres, that leaves `gap` between their bodies."""
    return 2.0 * car.body.reach + gap * (car.w / 0.3)


def _attempt(
    areas: Sequence[Places], gap: float, packed: bool, car: Car, wishes: Sequence[Wish], draws: Draws
) -> dict[int, Pose]:
    """Place cars in turn, in the first area that has room for each, until one finds none."""
    own = [area.copy() for area in areas]
    radius = gap_radius(car, gap)
    order = np.array(draws.shuffled(areas[0].count), dtype=np.int64) if packed else None
    found = {n: wish.pose for n, wish in enumerate(wishes) if wish.pose is not None}
    for pose in found.values():
        for area in own:
            area.block(pose.x, pose.y, radius)
    drawn = [n for n, wish in enumerate(wishes) if wish.pose is None]
    for n in sorted(drawn, key=lambda n: wishes[n].lanes is None):
        lanes = wishes[n].lanes
        spots = (a.choose(draws, lanes) if order is None else a.first(order, lanes) for a in own)
        spot = next((spot for spot in spots if spot is not None), None)
        if spot is None:
            break
        pose = found[n] = own[0].pose(*spot)
        for area in own:
            area.block(pose.x, pose.y, radius)
    return found


def check_given(ground: Ground, names: Sequence[str], wishes: Sequence[Wish]) -> None:
    """Refuse given starts in which a body overlaps another or an obstacle."""
    obstacles = [obstacle_shape(obstacle) for obstacle in ground.obstacles]
    side = 2.0 * ground.car.body.reach * (1.0 + 1e-9)
    cells: dict[tuple[int, int], list[tuple[int, Shape]]] = {}
    for n, wish in enumerate(wishes):
        if wish.pose is None:
            continue
        shape = body_shape(ground.car.body, wish.pose)
        column, row = floor(wish.pose.x / side), floor(wish.pose.y / side)
        near = [cells.get((column + i, row + j), ()) for i in (-1, 0, 1) for j in (-1, 0, 1)]
        for other, other_shape in sorted(chain.from_iterable(near)):
            if overlap(shape, other_shape):
                raise _overlap_error(names[n], wish, names[other])
        for number, obstacle in enumerate(obstacles):
            if overlap(shape, obstacle):
                raise _overlap_error(names[n], wish, f"obstacles[{number}]")
        cells.setdefault((column, row), []).append((n, shape))


def _overlap_error(name: str, wish: Wish, other: str) -> InputError:
    pose = wish.pose
    return InputError(
        f"{name} overlaps {other}",
        field=wish.field,
        value=[pose.x, pose.y, pose.theta] if pose else None,
        expected="a start clear of other cars and of obstacles",
    )
