"""Plans that documents give as numbers: cycles of lattice points, scripts of commands."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING

from dubins_traffic.errors import InputError

if TYPE_CHECKING:
    from dubins_traffic.roads.network import RoadNetwork


def cycle_lanes(network: RoadNetwork, points: Sequence[Sequence[int]] | None) -> list[int]:
    """Return the lanes from each lattice point to the next, the last joined to the first.

    Raises
    ------
    InputError
        If two points that follow one another are not joined by a segment.
    """
    if not points:
        raise InputError("no cycle", field="cycle", value=points, expected="at least two lattice points")
    lane_from = {}
    for s, (x0, y0, x1, y1) in enumerate(network.segments):
        lane_from[(x0, y0), (x1, y1)] = 2 * s
        lane_from[(x1, y1), (x0, y0)] = 2 * s + 1
    corners = [(int(x), int(y)) for x, y in points]
    if len(corners) > 1 and corners[0] == corners[-1]:
        corners.pop()
    lanes: list[int] = []
    for k, (here, there) in enumerate(zip(corners, corners[1:] + corners[:1], strict=True)):
        if (here, there) not in lane_from:
            raise InputError(
                f"no segment joins {list(here)} to {list(there)}",
                field=f"cycle[{k}]",
                value=list(here),
                expected="lattice points joined by segments, the last to the first",
            )
        lanes.append(lane_from[here, there])
    return lanes


def script_rows(commands: Sequence[Sequence[float]], rate: float) -> list[tuple[float, float, float]]:
    """Return (tick at which it ends, speed, yaw rate) of commands given as [seconds, speed, yaw rate].

    A time t, counted from the beginning of the script, is reached with tick ceil(t * rate - 1e-9).
    """
    rows: list[tuple[float, float, float]] = []
    time = 0.0
    for seconds, speed, yaw_rate in commands:
        time += seconds
        rows.append((float(math.ceil(time * rate - 1e-9)), float(speed), float(yaw_rate)))
    return rows
