"""Chooses the lane that a car takes at the end of its own (compiled)."""

from __future__ import annotations

from typing import Any

from dubins_traffic.cars.state import Labels
from dubins_traffic.kernels.compile import jit, jit_inline, jit_rare
from dubins_traffic.kernels.random import DRAW, below, uniform
from dubins_traffic.policies.rules.abilities import turns_within_road
from dubins_traffic.policies.rules.barred import is_shut, leads_nowhere
from dubins_traffic.policies.rules.chosen import choose
from dubins_traffic.policies.rules.tables import KIND, VIOLATION, Driver, Drivers, Scratch, Traffic, Vehicle
from dubins_traffic.roads.lookup import lane_end
from dubins_traffic.roads.table import RoadTable
from dubins_traffic.routing.lane_graph import FAR, aim_for, place_of, spread

BACK = 30.0
"""Cost of turning round at a crossing, metres (for a nemesis STEP)."""
UNREACHABLE = 1e6
BACK_IN_BEND = 2e6
"""Cost of turning round in a bend, metres: more than any way on that is not barred."""
BARRED = 1e7
"""Cost of a lane in which an obstacle can't be passed, metres."""
NO_WAY = 1e9
"""Cost of the way back for a car whose turning radius is too large for it, metres: it is never taken."""
STEP = 3.0
"""Cost of each further lane in choosing between exits, metres."""
BLOCK_TIME = 9.0
"""Time for which a car that blocks stands in an intersection, seconds."""


@jit
def take_lane(b: int, n: int, tick: int, lane: int, traffic: Traffic) -> None:
    """Set the lane of car n to `lane`, and choose its next lane and its violations."""
    roads, drivers, scratch = traffic.roads, traffic.drivers, traffic.scratch
    car = drivers.car[b, n]
    seed = drivers.seed[b]
    trial = drivers.trial[b]
    before = car.lane
    car.lane = lane
    car.turn = 0
    car.kept_out = 0
    car.within = 0
    car.aside = 0.0
    if car.kind == KIND.LOOP:
        following = car.place + 1 if car.place + 1 < car.last else car.first
        if car.place < 0 or before < 0 or drivers.stage[following] != lane:
            following = place_of(lane, car.first, car.last, drivers.stage)
        car.place = following
    v = lane_end(roads, drivers.net[b], lane)
    violations = 0
    car.hold = 0.0
    if car.rolls > 0.0 and uniform(seed, trial, n, tick, DRAW.RULES + 4) < car.rolls:
        violations |= VIOLATION.ROLLING
    if car.lefts > 0.0 and uniform(seed, trial, n, tick, DRAW.RULES + 5) < car.lefts:
        violations |= VIOLATION.LEFT_SIDE
    if car.tailgates > 0.0 and uniform(seed, trial, n, tick, DRAW.RULES + 6) < car.tailgates:
        violations |= VIOLATION.TAILGATING
    if car.blocks > 0.0 and uniform(seed, trial, n, tick, DRAW.RULES + 7) < car.blocks:
        car.hold = BLOCK_TIME
    if car.parks > 0.0 and is_goal(v, car, drivers) and uniform(seed, trial, n, tick, DRAW.RULES + 8) < car.parks:
        car.hold = car.park_time * uniform(seed, trial, n, tick, DRAW.RULES + 9)
    car.violations = violations
    price_exits(b, n, tick, traffic)
    car.next_lane = cheapest(v, roads.vert_off[drivers.net[b]], 15, roads, scratch)
    if car.choices != 0:
        choose(b, n, BARRED, traffic)


@jit_inline
def is_goal(v: int, car: Driver, drivers: Drivers) -> bool:
    """Tell whether v is among the goals that the car knows."""
    if car.kind == KIND.LOOP:
        return False
    goal = False
    for k in range(car.first, car.last):
        goal = goal or drivers.stage[k] == v
    return goal


@jit_inline
def cheapest(v: int, offset: Any, allowed: int, roads: RoadTable, scratch: Scratch) -> int:
    """Return the cheapest exit of v of those with their bit in `allowed` (bits), -1 if there is none.

    `offset` (row) is that of the network's first intersection.
    """
    best = -1
    for k in range(roads.degree[offset + v]):
        if allowed & (1 << k) != 0 and (best < 0 or scratch.cost[k] < scratch.cost[best]):
            best = k
    return roads.arms[offset + v, best] if best >= 0 else -1


@jit
def price_exits(b: int, n: int, tick: int, traffic: Traffic) -> None:
    """Fill `scratch.cost` with the cost of each exit at the end of the car's lane: metres to go, or a random number."""
    roads, obstacles, drivers, scratch = traffic.roads, traffic.obstacles, traffic.drivers, traffic.scratch
    net = drivers.net[b]
    car = drivers.car[b, n]
    lane = car.lane
    v = lane_end(roads, net, lane)
    row = int(roads.vert_off[net]) + v
    kind = car.kind
    on_loop = kind == KIND.LOOP and car.place >= 0
    follow = -1
    if on_loop:
        follow = drivers.stage[car.place + 1 if car.place + 1 < car.last else car.first]
    known = aim(b, n, tick, v, traffic)
    for k in range(roads.degree[row]):
        out = roads.arms[row, k]
        cost = uniform(drivers.seed[b], drivers.trial[b], n, tick, DRAW.RULES + k)
        if kind == KIND.ROUND and car.place >= 0:
            place = car.place
            if drivers.stage[place] == v:
                place = place + 1 if place + 1 < car.last else car.first
            cost = min(drivers.distance[place, out], UNREACHABLE)
        elif on_loop and out == follow:
            cost = -1.0
        elif known:
            cost += STEP * scratch.hops[out] if scratch.hops[out] != FAR else UNREACHABLE
        if out == lane ^ 1 and roads.degree[row] > 1:
            at_crossing = STEP if kind == KIND.NEMESIS else BACK
            cost += at_crossing if roads.degree[row] > 2 else BACK_IN_BEND
            vehicle = drivers.vehicle[b]
            cost += 0.0 if turns_within_road(vehicle.tightest, vehicle.middle) else NO_WAY
        if obstacles.off[b] != obstacles.off[b + 1] and (
            is_shut(b, lane, int(out), traffic) or leads_nowhere(b, int(out), traffic)
        ):
            cost += BARRED
        scratch.cost[k] = cost


@jit
def aim(b: int, n: int, tick: int, v: int, traffic: Traffic) -> bool:
    """Fill `scratch.hops` with the number of lanes from each lane to the car's target; False if it has none."""
    roads, drivers, scratch = traffic.roads, traffic.drivers, traffic.scratch
    net = drivers.net[b]
    car = drivers.car[b, n]
    kind = car.kind
    if kind == KIND.PLACES and (car.goal < 0 or car.goal == v):
        count = roads.vert_off[net + 1] - roads.vert_off[net]
        car.goal = below(drivers.seed[b], drivers.trial[b], n, tick, DRAW.RULES + 10, min(count, 1 << 16))
    elif kind == KIND.NEMESIS:
        car.goal = foreseen(b, traffic, car)
    seeks_loop = kind == KIND.LOOP and car.place < 0 and car.last > car.first
    if not seeks_loop and (kind not in (KIND.PLACES, KIND.NEMESIS) or car.goal < 0):
        return False
    if seeks_loop:
        forget(net, roads, scratch)
        targets = 0
        for k in range(car.first, car.last):
            targets = aim_for(drivers.stage[k], scratch.hops, scratch.queue, targets)
        spread(roads, net, scratch.hops, scratch.queue, targets)
        return True
    seek(net, car.goal, roads, scratch)
    if kind == KIND.NEMESIS:
        seek_ego(b, net, traffic)
    return True


@jit_rare
def forget(net: int, roads: RoadTable, scratch: Scratch) -> None:
    """Set `scratch.hops` of all lanes of a network to infinitely many."""
    for k in range(2 * (roads.seg_off[net + 1] - roads.seg_off[net])):
        scratch.hops[k] = FAR


@jit_rare
def seek(net: int, v: int, roads: RoadTable, scratch: Scratch) -> None:
    """Fill `scratch.hops` with the number of lanes from each lane to intersection v."""
    forget(net, roads, scratch)
    row = int(roads.vert_off[net]) + v
    targets = 0
    for k in range(roads.degree[row]):
        targets = aim_for(roads.arms[row, k] ^ 1, scratch.hops, scratch.queue, targets)
    spread(roads, net, scratch.hops, scratch.queue, targets)


@jit_rare
def seek_ego(b: int, net: int, traffic: Traffic) -> None:
    """Replace the hops to the ego's goal by hops to the next lanes on the ego's way there."""
    labels, roads, scratch = traffic.labels, traffic.roads, traffic.scratch
    lane = labels.lane[b, 0]
    v = labels.crosses[b, 0] if lane < 0 else lane_end(roads, net, lane)
    count = 0
    while v >= 0 and count < scratch.chain.shape[0]:
        row = int(roads.vert_off[net]) + v
        best = -1
        for k in range(roads.degree[row]):
            out = roads.arms[row, k]
            back = lane >= 0 and out == lane ^ 1 and roads.degree[row] > 1
            if not back and (best < 0 or scratch.hops[out] < scratch.hops[best]):
                best = out
        scratch.chain[count] = best
        count += 1
        if scratch.hops[best] == 0:
            break
        lane = best
        v = lane_end(roads, net, lane)
    if count == 0:
        return
    forget(net, roads, scratch)
    targets = 0
    for k in range(count):
        targets = aim_for(scratch.chain[k], scratch.hops, scratch.queue, targets)
    spread(roads, net, scratch.hops, scratch.queue, targets)


@jit_rare
def foreseen(b: int, traffic: Traffic, car: Driver) -> int:
    """Return the goal nearest to the ego, except the one it is at; -1 without goals."""
    state, labels, roads, drivers = traffic.state, traffic.labels, traffic.roads, traffic.drivers
    net = drivers.net[b]
    best = -1
    least = 1e300
    for k in range(car.first, car.last):
        goal: int = drivers.stage[k]
        if goal == labels.at[b, 0] or (goal == car.place and car.last - car.first > 1):
            continue
        dx = roads.vertex[int(roads.vert_off[net]) + goal].x - state.x[b, 0]
        dy = roads.vertex[int(roads.vert_off[net]) + goal].y - state.y[b, 0]
        if dx * dx + dy * dy < least:
            least = dx * dx + dy * dy
            best = goal
    return best


@jit_inline
def watch_ego(b: int, n: int, labels: Labels, drivers: Drivers) -> None:
    """Let a nemesis remember, in `Driver.place`, the goal at which the ego was last."""
    car = drivers.car[b, n]
    at = labels.at[b, 0]
    if at >= 0 and is_goal(at, car, drivers):
        car.place = at


@jit_inline
def count_visit(b: int, n: int, labels: Labels, drivers: Drivers) -> None:
    """Set the next goal of a car on its round once it is at the present one."""
    car = drivers.car[b, n]
    if car.place >= 0 and labels.at[b, n] == drivers.stage[car.place]:
        car.place = car.place + 1 if car.place + 1 < car.last else car.first


@jit_inline
def ticks_of(seconds: float, vehicle: Vehicle) -> int:
    """Return a duration, `seconds` (s), in whole ticks, rounded down."""
    return int(seconds / vehicle.period + 1e-9)
