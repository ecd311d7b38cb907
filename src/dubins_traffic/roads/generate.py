"""Random networks: planar, connected, with room for the rules; and grids from which roads are taken.

They are grown freely where that makes enough roads (`roads.sketch`), else woven from a grid (`roads.weave`); some
roads may swerve.
"""

from __future__ import annotations

from dataclasses import replace
from math import ceil, floor, isfinite, pi, sqrt

import numpy as np

from dubins_traffic.errors import InputError
from dubins_traffic.kernels.angles import sincos
from dubins_traffic.kernels.philox import Draws
from dubins_traffic.roads.chains import Corners
from dubins_traffic.roads.clearance import (
    LEAST_RADIUS,
    ROUNDING,
    SEGMENT_SLACK,
    TIGHTEST,
    Clearances,
    clearance_faults,
    clearances,
)
from dubins_traffic.roads.network import RoadNetwork
from dubins_traffic.roads.sketch import Drawn, sketched
from dubins_traffic.roads.weave import most_segments, span, woven

STREAM = 1
"""The stream of `Draws` from which networks come."""
MOST_INTERSECTIONS = 20_000
UNITS = 8
"""Lattice units in the shortest segment: bearings come in steps of a few degrees."""
GROWN_SHARE = 1.4
"""Freely grown networks have hardly more segments than this for each intersection."""
FARTHEST = 10.0
"""Largest shift of a random rigid motion along each axis, metres."""
ROOM = 3.0
"""Metres by which segments are longer where some are to bend, for w = 0.3 m."""
WIDEST = 2.0
"""Largest radius of an arc, in units of the least."""
STEEPEST = 1.0
"""Tangent of the largest angle at which a road leaves the straight way."""
FARTHEST_ASIDE = 4.0
"""How far a road swerves to the side at most, in units of w."""
SPARE = 1e-6
"""Metres that are straight beyond what has to be."""
FLATTER, SWERVES = 0.7, 8
"""A swerve that does not fit is made so much flatter, and that so often."""


def generate(
    intersections: int,
    segments: int,
    seed: int = 0,
    *,
    trial: int = 0,
    minimum_angle: float = pi / 3,
    w: float = 0.3,
    radius: float | None = None,
    reach: float = 0.177,
    slack: float = SEGMENT_SLACK,
    rigid_motion: bool = False,
    bent: float = 0.0,
) -> RoadNetwork:
    """Return the random network of a seed and trial; see `random_network`."""
    return random_network(
        Draws(seed, trial, STREAM),
        intersections,
        segments,
        minimum_angle=minimum_angle,
        w=w,
        radius=radius,
        reach=reach,
        slack=slack,
        rigid_motion=rigid_motion,
        bent=bent,
    )


def random_network(
    draws: Draws,
    intersections: int,
    segments: int,
    *,
    minimum_angle: float = pi / 3,
    w: float = 0.3,
    radius: float | None = None,
    reach: float = 0.177,
    slack: float = SEGMENT_SLACK,
    rigid_motion: bool = False,
    bent: float = 0.0,
) -> RoadNetwork:
    """Return a random planar, connected network that keeps the clearances of docs/rules.md#room.

    Parameters
    ----------
    draws : Draws
        Random numbers.
    intersections, segments : int
        N and M, with N - 1 <= M <= floor(2 N - 2 sqrt(N)).
    minimum_angle : float
        Least angle between two segments at an intersection, radians, in (0, pi]. Where the rules of the road
        need a larger one, that counts (61.3 degrees by default).
    w, radius, reach, slack : float
        Width w of cars, intersection radius R (default 1 m * w / 0.3), reach rho of bodies, and by how much a
        segment must be longer than 2 (R + rho); metres.
    rigid_motion : bool
        Whether the network is turned and moved at random.
    bent : float
        About which share of the segments bend, if there is room; all are longer if that is not 0.

    Raises
    ------
    InputError
        If the request makes no sense, or can't be placed; then it names the largest number that was.
    """
    radius = w / 0.3 if radius is None else radius
    _check_counts(intersections, segments)
    _check_sizes(minimum_angle, w, radius, reach, slack)
    metres = clearances(radius, reach, w, slack + (ROOM * w / 0.3 if bent > 0.0 else 0.0))
    unit = float(f"{metres.length / UNITS:.2g}")
    wider = sincos(minimum_angle)[0] + 2.0 * ROUNDING
    least = metres.in_units(unit)._replace(cosine=min(metres.cosine, wider))
    points, roads = _draw(draws, intersections, segments, least, minimum_angle)
    low_x, low_y = min(x for x, _ in points), min(y for _, y in points)
    moved = [(x - low_x, y - low_y) for x, y in points]
    rows = tuple(sorted((*moved[a], *moved[b]) if moved[a] < moved[b] else (*moved[b], *moved[a]) for a, b in roads))
    made = RoadNetwork.unchecked(rows, unit, _motion(draws, rigid_motion))
    if not bent > 0.0:
        return made
    return bend_some(made, draws, bent, w=w, radius=radius, reach=reach, slack=slack)


def thinned_grid(
    draws: Draws, rows: int, columns: int, removed: float, *, length: float = 3.0, rigid_motion: bool = False
) -> RoadNetwork:
    """Return a grid without a share of its segments, drawn at random; it stays connected.

    Parameters
    ----------
    draws : Draws
        Random numbers.
    rows, columns : int
        Size of the grid.
    removed : float
        Share of the segments to take away, in [0, 1]; rounded down to a number of segments.
    length : float
        Length of the segments, metres.
    rigid_motion : bool
        Whether the network is turned and moved at random.

    Raises
    ------
    InputError
        If so many can't be taken away; it names the largest share that can.
    """
    if not (isfinite(removed) and 0.0 <= removed <= 1.0):
        raise InputError("not a share", field="removed", value=removed, expected="a number in [0, 1]")
    grid = RoadNetwork.grid(rows, columns, length)
    count = len(grid.segments)
    take = floor(removed * count + 1e-9)
    spare = count - (len(grid.intersections) - 1)
    if take > spare:
        expected = f"at most {spare} of {count} segments ({floor(1e4 * spare / count) / 1e4:g}), to stay connected"
        raise InputError("too many segments to remove", field="removed", value=removed, expected=expected)
    order = np.array(draws.shuffled(count), dtype=np.int64)
    joins = np.zeros(count, dtype=np.int64)
    span(grid.ends, order, np.zeros(len(grid.intersections), dtype=np.int64), joins)
    loose = order[joins == 0].tolist()
    gone = set(loose[:take])
    kept = tuple(segment for s, segment in enumerate(grid.segments) if s not in gone)
    return RoadNetwork(kept, length, _motion(draws, rigid_motion), grid.shape)


def _draw(draws: Draws, count: int, roads: int, least: Clearances, minimum_angle: float) -> Drawn:
    """Return points and roads: freely grown if that makes enough roads, else woven from a grid."""
    grid = minimum_angle <= pi / 2
    largest = 0
    if not grid or roads <= ceil(GROWN_SHARE * count):
        sketch, largest = sketched(draws, count, roads, least, minimum_angle)
        if sketch is not None:
            return sketch
    if grid:
        return woven(draws, count, roads, least)
    problem = f"can't be placed at angles of at least {180.0 * minimum_angle / pi:.6g} degrees"
    raise InputError(problem, field="segments", value=roads, expected=f"at most {largest}, the most that were placed")


def _motion(draws: Draws, wanted: bool) -> tuple[float, float, float]:
    if not wanted:
        return 0.0, 0.0, 0.0
    return draws.uniform(-FARTHEST, FARTHEST), draws.uniform(-FARTHEST, FARTHEST), draws.uniform(-pi, pi)


def _check_counts(intersections: int, segments: int) -> None:
    if not 2 <= intersections <= MOST_INTERSECTIONS:
        expected = f"an integer in [2, {MOST_INTERSECTIONS}]"
        raise InputError("not a number of intersections", field="intersections", value=intersections, expected=expected)
    low, high = intersections - 1, most_segments(intersections)
    if not low <= segments <= high:
        expected = f"an integer in [{low}, {high}] for {intersections} intersections"
        raise InputError("not a number of segments", field="segments", value=segments, expected=expected)


def _check_sizes(minimum_angle: float, w: float, radius: float, reach: float, slack: float) -> None:
    if not (isfinite(minimum_angle) and 0.0 < minimum_angle <= pi):
        expected = "radians in (0, pi]"
        raise InputError("not an angle", field="minimum_angle", value=minimum_angle, expected=expected)
    for name, value, least in (("w", w, 1e-3), ("reach", reach, 0.0), ("slack", slack, 0.0)):
        if not (isfinite(value) and least <= value <= 1e3):
            raise InputError("not a length", field=name, value=value, expected=f"metres in [{least:g}, 1000]")
    if not (isfinite(radius) and LEAST_RADIUS * w - 1e-9 <= radius <= 1e4):
        expected = f"metres in [{LEAST_RADIUS} w, 10000], w = {w:g}"
        raise InputError("not an intersection radius", field="radius", value=radius, expected=expected)


def bend_some(
    network: RoadNetwork, draws: Draws, share: float, *, w: float, radius: float, reach: float, slack: float
) -> RoadNetwork:
    """Return a straight network in which about a `share` of the segments swerve: those that have the room.

    Parameters
    ----------
    network, draws, share
        The network, random numbers, and a share in [0, 1].
    w, radius, reach, slack
        As of `roads.generate.random_network`, metres.
    """
    straight = radius + reach + slack + SPARE
    corners: list[Corners] = []
    for s in range(len(network.segments)):
        picked = draws.uniform() < share
        bend = draws.uniform(TIGHTEST * w, WIDEST * TIGHTEST * w)
        slope = draws.uniform(0.4, STEEPEST) * (1.0 if draws.uniform() < 0.5 else -1.0)
        corners.append(_swerve(network, s, bend, slope, straight, FARTHEST_ASIDE * w) if picked else ())
    while any(corners):
        try:
            bent = replace(network, corners=tuple(corners))
        except InputError as error:
            faults = [error]
        else:
            faults = clearance_faults(bent, radius, reach, w, slack)
            if not faults:
                return bent
        named = {int(fault.field[len("segments[") : -1]) for fault in faults if fault.field}
        if not any(corners[s] for s in named):
            break
        corners = [() if s in named else bends for s, bends in enumerate(corners)]
    return network


def _swerve(network: RoadNetwork, s: int, bend: float, slope: float, straight: float, farthest: float) -> Corners:
    """Return the corners with which segment s swerves to the side in its middle; none if it is too short."""
    x0, y0, x1, y1 = network.segments[s]
    length = float(network.lengths[s])
    for _ in range(SWERVES):
        steep = abs(slope)
        lean = sqrt(1.0 + steep * steep)
        quarter = (lean - 1.0) / steep
        run = min(0.5 * length - straight - bend * quarter, farthest / steep)
        if run * lean >= bend * (quarter + steep) + SPARE:
            break
        slope *= FLATTER
    else:
        return ()
    begin, aside = (0.5 * length - run) / length, run * slope / length
    dx, dy = x1 - x0, y1 - y0
    radius = bend / network.length
    return (
        (x0 + begin * dx, y0 + begin * dy, radius),
        (x0 + 0.5 * dx - aside * dy, y0 + 0.5 * dy + aside * dx, radius),
        (x1 - begin * dx, y1 - begin * dy, radius),
    )
