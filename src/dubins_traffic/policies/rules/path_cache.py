"""The path cache: the way of each car from its lane to the next one, kept until either changes (compiled)."""

from __future__ import annotations

from dubins_traffic.kernels.compile import jit, jit_inline, jit_look
from dubins_traffic.policies.rules.kept import KeptPath
from dubins_traffic.policies.rules.room import queue_lengths
from dubins_traffic.policies.rules.tables import Drivers
from dubins_traffic.policies.rules.turn_arcs import ReferencePath, way_between
from dubins_traffic.roads.lookup import lane_end
from dubins_traffic.roads.table import RoadTable


@jit_inline
def way_of(b: int, n: int, roads: RoadTable, drivers: Drivers) -> ReferencePath:
    """Return the way of car n from its lane to the next one, from the cache if that is valid."""
    car = drivers.car[b, n]
    row = drivers.way[b, n]
    if not _is_of(car.lane, car.next_lane, row):
        keep_way(b, n, roads, drivers)
    return kept_way(row)


@jit_look
def _is_of(lane: int, out: int, row: KeptPath) -> bool:
    """Tell whether the cached way leads from `lane` to lane `out`."""
    return row.lane == lane and row.out == out


@jit_inline
def kept_way(row: KeptPath) -> ReferencePath:
    """Return the way that a row of `Drivers.way` holds."""
    return ReferencePath(
        row.x, row.y, row.tx, row.ty, row.ux, row.uy, row.cx, row.cy, row.radius, row.side, row.middle, row.bend
    )  # fmt: skip


@jit
def keep_way(b: int, n: int, roads: RoadTable, drivers: Drivers) -> None:
    """Compute the way of car n from its lane to the next one and store it in the cache."""
    net = drivers.net[b]
    vehicle = drivers.vehicle[b]
    car = drivers.car[b, n]
    row = drivers.way[b, n]
    way = way_between(roads, net, car.lane, car.next_lane, vehicle.middle, vehicle.disc)
    row.lane = car.lane
    row.out = car.next_lane
    degree = roads.degree[roads.vert_off[net] + lane_end(roads, net, car.lane)]
    row.crossing = 1 if degree >= vehicle.degree else 0
    row.length = roads.segment[int(roads.seg_off[net]) + (car.lane >> 1)].length
    row.out_length = roads.segment[int(roads.seg_off[net]) + (car.next_lane >> 1)].length
    mouth, _ = queue_lengths(vehicle)
    row.roomy = 1 if row.out_length - mouth - mouth >= 0.0 else 0
    row.x, row.y = way.x, way.y
    row.tx, row.ty = way.tx, way.ty
    row.ux, row.uy = way.ux, way.uy
    row.cx, row.cy = way.cx, way.cy
    row.radius, row.side = way.radius, way.side
    row.middle, row.bend = way.middle, way.bend
