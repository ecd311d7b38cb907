"""Where the cars of a genome start, and where else in its lane each may."""

from __future__ import annotations

from collections.abc import Mapping
from math import floor, hypot
from typing import TYPE_CHECKING, Final, NamedTuple

import numpy as np

from dubins_traffic.cars.state import Pose
from dubins_traffic.falsification.genome import Genome
from dubins_traffic.problem.starts import Ground, areas_of, gap_radius

if TYPE_CHECKING:
    from dubins_traffic.problem.instance import Instance

SHIFT: Final = 1.5
"""Metres by which a start is shifted at most, standard deviation; the least is a hundredth of it."""
SQUARE: Final = 4.0
"""Metres; places are looked for in squares of this side."""
ON_LANE: Final = 1e-6
"""Metres that a start may lie beside the middle of its lane."""


class Place(NamedTuple):
    """Where cars may start: start (x, y) and direction (c, s) of a lane's middle, from which to which metre, and its
    number.
    """

    x: float
    y: float
    c: float
    s: float
    low: float
    high: float
    lane: int


class Lots(NamedTuple):
    """All places where cars may start, lane by lane.

    `first` and `last` are the numbers of the first and the last place of each lane that has any; `ends` the
    intersections at its beginning and end; `near` the places that are near to each square of side `SQUARE`.
    """

    places: list[Place]
    near: dict[tuple[int, int], list[int]]
    first: dict[int, int]
    last: dict[int, int]
    ends: dict[int, tuple[int, int]]


def far_off(dice: np.random.Generator) -> float:
    """Return metres by which to shift something: small ones as often as large ones."""
    return SHIFT * 10.0 ** (-2.0 * dice.random()) * float(dice.standard_normal())


def starts_of(genome: Genome, base: Instance) -> list[Pose]:
    """Return where the cars of a genome start."""
    return [genome.starts.get(n, pose) for n, pose in enumerate(base.starts)]


def started(genome: Genome, base: Instance, starts: list[Pose], moved: Mapping[int, Pose]) -> Genome:
    """Return a genome with other starts; the same if one that is moved would be too near to another car."""
    apart = gap_radius(base.problem.car)
    for car, own in moved.items():
        for n, pose in enumerate(starts):
            if n != car and hypot(pose.x - own.x, pose.y - own.y) < apart:
                return genome
    return Genome(genome.base, genome.root, {**genome.starts, **moved}, genome.tables, genome.whims)


def span_of(base: Instance, pose: Pose) -> tuple[float, float] | None:
    """Return how many metres back (negative) and ahead a start may be shifted in its lane; None for nowhere."""
    lots = lots_of(base)
    spot = spot_of(lots, pose)
    if spot is None:
        return None
    k, along = spot
    own = lots.places[k]
    return min(own.low - along, 0.0), max(own.high - along, 0.0)


def spot_of(lots: Lots, pose: Pose) -> tuple[int, float] | None:
    """Return in which of the places where cars may start a start is, and after how many metres of its lane."""
    places = lots.places
    for k in lots.near.get(_square(pose.x, pose.y), ()):
        x, y, c, s, low, high, _ = places[k]
        if c * pose.c + s * pose.s > 1.0 - ON_LANE:
            dx, dy = pose.x - x, pose.y - y
            along = dx * c + dy * s
            if abs(dy * c - dx * s) < ON_LANE and low - ON_LANE < along < high + ON_LANE:
                return k, along
    return None


def pose_at(lots: Lots, place: int, along: float) -> Pose:
    """Return the pose in a place where cars may start that is nearest to some metres of its lane."""
    x, y, c, s, low, high, _ = lots.places[place]
    far = min(max(along, low), high)
    return Pose(x + far * c, y + far * s, c, s)


def lots_of(base: Instance) -> Lots:
    """Return where cars may start on the roads of an instance; kept with the network."""
    problem = base.problem
    key = _FREE, problem.car, problem.intersection_radius, problem.obstacles
    found = problem.network.known.get(key)
    if found is None:
        ground = Ground(problem.network, problem.car, problem.intersection_radius, problem.obstacles)
        lines, free = areas_of(ground).outside.tables()
        columns = np.column_stack((lines[free.lane], free.low, free.high)).tolist()
        places = [
            Place(x, y, c, s, low, high, lane)
            for (x, y, c, s, low, high), lane in zip(columns, free.lane.tolist(), strict=True)
        ]
        first: dict[int, int] = {}
        last: dict[int, int] = {}
        for k, own in enumerate(places):
            first.setdefault(own.lane, k)
            last[own.lane] = k
        ends = {lane: problem.network.lane_ends(lane) for lane in first}
        found = problem.network.known[key] = Lots(places, _near(places), first, last, ends)
    return found  # pyright: ignore[reportReturnType]  # what stands under our own key


def _square(x: float, y: float) -> tuple[int, int]:
    return floor(x / SQUARE), floor(y / SQUARE)


def _near(places: list[Place]) -> dict[tuple[int, int], list[int]]:
    """Return the numbers of the places, ascending, that have a part in or beside each square."""
    near: dict[tuple[int, int], list[int]] = {}
    for k, (x, y, c, s, low, high, _) in enumerate(places):
        steps = 1 + floor((high - low) / SQUARE)
        met = {_square(x + far * c, y + far * s) for far in np.linspace(low, high, 1 + steps).tolist()}
        for i, j in {(i + di, j + dj) for i, j in met for di in (-1, 0, 1) for dj in (-1, 0, 1)}:
            near.setdefault((i, j), []).append(k)
    return near


_FREE = "falsify starts"
