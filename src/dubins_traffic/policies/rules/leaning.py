"""Driving farther right past a body beside the lane, where a tick is long (compiled).

`policies.safety` keeps what another may reach in a tick. At low control rates that is more than lies between a car in
the middle of its lane and one that stands at the centre line, yet the lane is free (docs/rules.md#free-exit).
"""

from __future__ import annotations

import numpy as np

from dubins_traffic.cars.state import EGO
from dubins_traffic.kernels.compile import jit_inline, jit_rare
from dubins_traffic.policies.rules.narrow import EDGE
from dubins_traffic.policies.rules.seeing import SIDE, is_by_disc_behind, way_to_go
from dubins_traffic.policies.rules.tables import Traffic, Vehicle
from dubins_traffic.policies.rules.turn_arcs import ReferencePath, on_way
from dubins_traffic.policies.safety import GUARD, travel_of
from dubins_traffic.roads.lookup import lane_end, lane_start
from dubins_traffic.rules.propositions import FLAG
from dubins_traffic.rules.shape import half_across

BESIDE_LINE = 1.5
"""So near to the disc at the end of its lane, metres, a car leans past an ego that stands beside the line. Farther back
it goes by in the middle of its lane, where it has room to turn straight again."""


@jit_inline
def leans(vehicle: Vehicle) -> bool:
    """Tell whether a car in the middle of its lane can't pass one that reaches over the line as far as it may."""
    beside = vehicle.middle - vehicle.half_width - vehicle.rounding - vehicle.over
    return beside < travel_of(vehicle) + GUARD


@jit_inline
def lean(b: int, n: int, offset: float, way: ReferencePath, near: int, traffic: Traffic) -> float:
    """Return how far left of its way car n drives past the bodies left of it, 0 or less, metres; 0 while it passes.

    `offset` (m) is where it would drive otherwise; `near` (count) cars are listed.
    """
    drivers = traffic.drivers
    free = near == 0 or offset != 0.0 or drivers.car[b, n].aside != 0.0
    free = free or not leans(drivers.vehicle[b]) or not may_lean(b, n, way, traffic)
    return 0.0 if free else away_from(b, way, near, traffic)


@jit_rare
def may_lean(b: int, n: int, way: ReferencePath, traffic: Traffic) -> bool:
    """Tell whether a car may turn aside where it is: in a bend, between two, and toward a crossing past a standing ego.

    Near the crossing out of which it comes it may enter that anew. A rectangle that is tilted at a line may find no
    room to turn, so it does not lean there away from other e-agents, which drive on.
    """
    labels, roads, drivers = traffic.labels, traffic.roads, traffic.drivers
    vehicle, net = drivers.vehicle[b], drivers.net[b]
    first = int(roads.vert_off[net])
    disc, lane = int(labels.crosses[b, n]), int(labels.lane[b, n])
    if disc >= 0 and int(roads.degree[first + disc]) < vehicle.degree:
        return True
    if lane < 0:
        return False
    v = lane_end(roads, net, lane)
    begin, end = int(roads.degree[first + lane_start(roads, net, lane)]), int(roads.degree[first + v])
    if disc < 0 and begin < vehicle.degree and end < vehicle.degree:
        return True
    if disc not in (-1, v) or is_by_disc_behind(b, n, way, traffic):
        return False
    near = way_to_go(way, traffic.state.x[b, n], traffic.state.y[b, n]) > -(vehicle.disc + BESIDE_LINE)
    return near and ego_stands_beside(b, n, traffic)


@jit_rare
def ego_stands_beside(b: int, n: int, traffic: Traffic) -> bool:
    """Tell whether the ego stands on the road of car n, in the other lane state."""
    labels, lane = traffic.labels, int(traffic.labels.lane[b, n])
    return labels.lane[b, EGO] == lane ^ 1 and np.int64(labels.bits[b, EGO]) & FLAG.STANDS != 0


@jit_rare
def away_from(b: int, way: ReferencePath, near: int, traffic: Traffic) -> float:
    """Return how far left of its way a car keeps clear of the listed bodies beside its lane, 0 or less, metres.

    Those have their centres left of the centre line; who is ahead or behind in the lane is not passed by leaning. Its
    centre stays on the road. `near` (count) cars are listed.
    """
    state, scratch, vehicle = traffic.state, traffic.scratch, traffic.drivers.vehicle[b]
    clear = vehicle.half_width + vehicle.rounding + travel_of(vehicle) + GUARD + SIDE
    offset = 0.0
    for k in range(near):
        j = scratch.near[k]
        _, _, left, px, py = on_way(way, state.x[b, j], state.y[b, j])
        half = half_across(b, j, px, py, state, vehicle)
        if vehicle.middle < left < 4.0 * vehicle.middle:
            offset = min(offset, left - half - clear)
    return max(offset, EDGE - vehicle.middle)
