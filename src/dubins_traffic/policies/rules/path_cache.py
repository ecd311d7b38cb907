"""The way of a car from the lane it drives to the next one, kept from tick to tick (compiled)."""

from __future__ import annotations

from typing import Any

from dubins_traffic.kernels.compile import jit, jit_inline
from dubins_traffic.policies.rules.tables import (
    CROSSING,
    DEGREE,
    DISC,
    IN,
    LANE,
    LENGTH,
    MIDDLE,
    NEXT,
    OUT,
    OUT_LENGTH,
    WAY,
    Drivers,
)
from dubins_traffic.policies.rules.turn_arcs import ReferencePath, way_between
from dubins_traffic.roads.lookup import lane_end
from dubins_traffic.roads.table import RoadTable


@jit_inline
def way_of(b: int, n: int, roads: RoadTable, drivers: Drivers) -> ReferencePath:
    """Return the way from the lane that a car drives to the next one, which is kept until either changes."""
    ints = drivers.ints[b, n]
    row = drivers.way[b, n]
    if row[IN] != ints[LANE] or row[OUT] != ints[NEXT]:
        keep_way(b, n, roads, drivers)
    return kept_way(row)


@jit_inline
def kept_way(row: Any) -> ReferencePath:
    """Return the way that a row of `Drivers.way` holds."""
    return ReferencePath(
        row[WAY], row[WAY + 1], row[WAY + 2], row[WAY + 3], row[WAY + 4], row[WAY + 5], row[WAY + 6],
        row[WAY + 7], row[WAY + 8], row[WAY + 9], row[WAY + 10], row[WAY + 11],
    )  # fmt: skip


@jit
def keep_way(b: int, n: int, roads: RoadTable, drivers: Drivers) -> None:
    """Work out the way from the lane that a car drives to the next one."""
    net = drivers.net[b]
    build = drivers.build[b]
    ints = drivers.ints[b, n]
    row = drivers.way[b, n]
    way = way_between(roads, net, ints[LANE], ints[NEXT], build[MIDDLE], build[DISC])
    row[IN] = ints[LANE]
    row[OUT] = ints[NEXT]
    degree = roads.degree[roads.vert_off[net] + lane_end(roads, net, ints[LANE])]
    row[CROSSING] = 1.0 if degree >= build[DEGREE] else 0.0
    row[LENGTH] = roads.seg[roads.seg_off[net] + (ints[LANE] >> 1), 4]
    row[OUT_LENGTH] = roads.seg[roads.seg_off[net] + (ints[NEXT] >> 1), 4]
    for k, value in enumerate(way):
        row[WAY + k] = value
