"""Driving farther right past a body beside the lane, where a tick is long, or left past an ego in a disc (compiled).

`policies.safety` keeps what another may reach in a tick. At low control rates that is more than lies between a car in
the middle of its lane and one that stands at the centre line, yet the lane is free (docs/rules.md#free-exit).
"""

from __future__ import annotations

from dubins_traffic.cars.state import EGO
from dubins_traffic.kernels.compile import jit_inline, jit_rare
from dubins_traffic.policies.rules.narrow import EDGE
from dubins_traffic.policies.rules.seeing import (
    Beside,
    farthest_left,
    farthest_right,
    is_by_disc_behind,
    is_in_bend,
    kept_beside,
    leans,
    leans_from,
    leans_past,
    one_is_ego,
    way_to_go,
)
from dubins_traffic.policies.rules.steering import HURRY
from dubins_traffic.policies.rules.tables import Traffic
from dubins_traffic.policies.rules.turn_arcs import PART, ReferencePath, on_lane, on_way
from dubins_traffic.roads.lookup import lane_end, lane_start
from dubins_traffic.rules.shape import half_across

BESIDE_LINE = 1.5
"""So near to the disc at the end of its lane, metres, a car leans past an ego alone. Farther back it leans past whoever
is beside it, and has room to turn straight again."""


@jit_inline
def lean(b: int, n: int, offset: float, part: int, way: ReferencePath, near: int, traffic: Traffic) -> float:
    """Return how far left of its way car n drives past the bodies beside it, metres; 0 while it passes.

    `offset` (m) is where it would drive otherwise, `part` of the way; `near` (count) cars are listed.
    """
    drivers = traffic.drivers
    free = near == 0 or offset != 0.0 or drivers.car[b, n].aside != 0.0
    free = free or not (leans(drivers.vehicle[b]) or is_by_disc(b, n, near, traffic))
    free = free or not may_lean(b, n, way, traffic)
    return 0.0 if free else away_from(b, n, part, way, near, traffic)


@jit_inline
def is_by_disc(b: int, n: int, near: int, traffic: Traffic) -> bool:
    """Tell whether the ego is near an e-agent and in a disc, where no centre line keeps it from reaching far over.

    Or an e-agent near the ego; `near` (count) cars are listed.
    """
    state, far = traffic.state, leans_from(traffic.drivers.vehicle[b])
    for k in range(near):
        j = traffic.scratch.near[k]
        dx, dy = state.x[b, j] - state.x[b, n], state.y[b, j] - state.y[b, n]
        if one_is_ego(j, n) and traffic.labels.lane[b, j] < 0 and dx * dx + dy * dy <= far * far:
            return True
    return False


@jit_rare
def may_lean(b: int, n: int, way: ReferencePath, traffic: Traffic) -> bool:
    """Tell whether a car may turn aside where it is: in bends and on roads, and in and near crossings past the ego.

    Near the crossing out of which it comes a car may enter that anew, and a rectangle that is tilted at a line may find
    no room to turn. So it leans there past the ego, and not past other e-agents, which drive on.
    """
    labels, roads, drivers = traffic.labels, traffic.roads, traffic.drivers
    vehicle, net = drivers.vehicle[b], drivers.net[b]
    first = int(roads.vert_off[net])
    disc, lane = int(labels.crosses[b, n]), int(labels.lane[b, n])
    if is_in_bend(b, n, traffic):
        return True
    if lane < 0:
        beside = int(labels.lane[b, EGO]) ^ 1
        return disc >= 0 and beside in (drivers.car[b, n].lane, drivers.car[b, n].next_lane)
    v = lane_end(roads, net, lane)
    begin, end = int(roads.degree[first + lane_start(roads, net, lane)]), int(roads.degree[first + v])
    near = way_to_go(way, traffic.state.x[b, n], traffic.state.y[b, n]) > -(vehicle.disc + BESIDE_LINE)
    left_disc = begin < vehicle.degree or not is_by_disc_behind(b, n, way, traffic)
    if disc < 0 and left_disc and (end < vehicle.degree or not near):
        return True
    return (near or not left_disc) and labels.lane[b, EGO] == lane ^ 1


@jit_rare
def away_from(b: int, n: int, part: int, way: ReferencePath, near: int, traffic: Traffic) -> float:
    """Return how far left of its way a car keeps clear of the listed bodies beside its lane, metres.

    Those have their centres left of the centre line; who is ahead or behind in the lane is not passed by leaning. Its
    centre stays on the road. Only an ego in a disc is passed on its left as well, and an e-agent by the ego. `near`
    (count) cars are listed.
    """
    state, scratch, vehicle = traffic.state, traffic.scratch, traffic.drivers.vehicle[b]
    clear, far = kept_beside(vehicle), leans_from(vehicle)
    offset = 0.0
    for k in range(near):
        j = scratch.near[k]
        dx, dy = state.x[b, j] - state.x[b, n], state.y[b, j] - state.y[b, n]
        if dx * dx + dy * dy > far * far:
            continue
        # A way that turns round would find who is beside the lane beside the lane back.
        if part == PART.BEFORE:
            _, _, left, px, py = on_lane(way, state.x[b, j], state.y[b, j])
        else:
            _, _, left, px, py = on_way(way, state.x[b, j], state.y[b, j])
        half = half_across(b, j, px, py, state, vehicle)
        if vehicle.middle < left < 4.0 * vehicle.middle:
            edge = left - half
            # While they pass each other who is beside it may come as far over the line as it may at all.
            if leans(vehicle):
                edge = min(edge, vehicle.middle - vehicle.over)
            offset = min(offset, edge - clear)
        elif one_is_ego(j, n) and leans_past(b, n, j, Beside(left, px, py), way, traffic):
            if left >= 0.0:
                offset = min(offset, left - half - clear)
            elif part == PART.THROUGH and dx * px + dy * py > -2.0 * vehicle.reach:
                offset = min(left + half + clear, farthest_left(vehicle))
    if part != PART.THROUGH:
        return max(offset, EDGE - vehicle.middle)
    around = vehicle.tightest == 0.0 and is_in_bend(b, n, traffic)
    x, y = state.x[b, n], state.y[b, n]
    most = farthest_right(way, x, y, around)
    if around and way.side > 0.0:
        # Where the road's edge comes nearer, who drives along it turns away in time.
        _, _, _, px, py = on_way(way, x, y)
        most = max(most, farthest_right(way, x + HURRY * px, y + HURRY * py, around))
    return max(offset, most)
