"""Bends for straight networks: roads swerve to one side between their straight ends, as far as there is room."""

from __future__ import annotations

from dataclasses import replace
from math import sqrt

from dubins_traffic.errors import InputError
from dubins_traffic.kernels.philox import Draws
from dubins_traffic.roads.clearance import clearance_faults
from dubins_traffic.roads.curve_clearance import TIGHTEST
from dubins_traffic.roads.formats.rnd import Corners
from dubins_traffic.roads.network import RoadNetwork

ROOM = 3.0
"""Metres by which segments are longer where some are to bend, for w = 0.3 m."""
WIDEST = 2.0
"""Largest radius of an arc, in units of the least."""
STEEPEST = 1.0
"""Tangent of the largest angle at which a road leaves the straight way."""
FARTHEST = 4.0
"""How far a road swerves to the side at most, in units of w."""
SPARE = 1e-6
"""Metres that are straight beyond what has to be."""
FLATTER, TRIES = 0.7, 8
"""A swerve that does not fit is made so much flatter, and that so often."""


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
        corners.append(_swerve(network, s, bend, slope, straight, FARTHEST * w) if picked else ())
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
        corners = [() if s in named else own for s, own in enumerate(corners)]
    return network


def _swerve(
    network: RoadNetwork, s: int, bend: float, slope: float, straight: float, farthest: float
) -> Corners:
    """Return the corners with which segment s swerves to the side in its middle; none if it is too short."""
    x0, y0, x1, y1 = network.segments[s]
    length = float(network.lengths[s])
    for _ in range(TRIES):
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
