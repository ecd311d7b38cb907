"""Whether a car may enter the disc at the end of its lane: its turn at a crossing, and room behind it (compiled)."""

from __future__ import annotations

from math import sqrt
from typing import Any

import numpy as np

from dubins_traffic.cars.state import EGO, Labels, State
from dubins_traffic.cars.tables import ObstacleTable
from dubins_traffic.driving.exits import BARRED, cheapest, price_exits, ticks_of
from dubins_traffic.driving.law_tables import (
    APPROACHES,
    BACKS_UP,
    CROSSING,
    DEGREE,
    DISC,
    EXIT_GAP,
    FORFEIT,
    HALF_WIDTH,
    KIND,
    LANE,
    LEFT_SIDE,
    MIDDLE,
    MOOD,
    NEMESIS,
    NEXT,
    OWED,
    PERIOD,
    REACH,
    ROLLING,
    ROUND,
    ROUNDING,
    TURN,
    WAITED,
    Desk,
    Drivers,
)
from dubins_traffic.driving.seeing import QUEUE_GAP, SIDE, way_to_go
from dubins_traffic.driving.turn_arcs import BEFORE, Way, on_way
from dubins_traffic.kernels.compile import jit, jit_inline
from dubins_traffic.roads.lookup import INFINITE, lane_coordinates, lane_direction, lane_end, lane_start
from dubins_traffic.roads.table import RoadTable
from dubins_traffic.spec.propositions import CLEAR, FIRST, FORFEITED, LEFT, STANDS, STOPPED

MARGIN = 0.02
"""What a car keeps from a disc that it may not enter, metres."""
BRISK = 0.3
"""A car that leaves the crossing at this speed will make room, m/s."""
CHOOSY = 1.0
"""Seconds for which a car whose turn it is waits for room in the lane it wants."""
BUDGET = 4.0
"""Metres of detour that a car on its round accepts for each second it has waited for room."""
SOON = 0.5
"""Who is this near to a bend comes into it before one who turns round there, metres."""
DUTY = 0.8
"""An e-agent that has lost its place once enters after this share of the time in which it would lose it again, though
there is room nowhere: else it breaks E3."""
PATIENT = 0.5
"""An e-agent that has stood for this share of the time that E5 allows before a bend or dead end enters as soon as an exit
is free, though those in it may stop."""
LINGER = 0.8
"""For this share of the time in which it would lose its place a nemesis makes the ego wait before it enters."""
TRAIL = 3.5
"""A nemesis minds the ego within this, metres."""
GOES_NOW = STOPPED | FIRST | CLEAR


@jit_inline
def mind_gate(
    b: int, n: int, tick: int, speed: float, part: int, left: float, x: float, y: float, way: Way,
    near: int, state: State, labels: Labels, roads: RoadTable, obstacles: ObstacleTable, drivers: Drivers, desk: Desk,
) -> float:  # fmt: skip
    """Return the speed at which the car does not enter the disc at the end of its lane unless it may."""
    net = drivers.net[b]
    build = drivers.build[b]
    ints = drivers.ints[b, n]
    if not faces_gate(b, n, part, labels, roads, drivers):
        return speed
    bits = np.int64(labels.bits[b, n])
    its_turn = count_turn(bits, drivers.way[b, n], ints)
    line = to_line(left, x, y, way, build)
    behind = n != EGO and is_behind_ego(b, n, x, y, way, state, labels, drivers)
    if behind and drivers.way[b, n, CROSSING] != 0.0:
        line -= build[APPROACHES]
        its_turn = False
    if line >= speed * build[PERIOD]:
        return speed
    v = lane_end(roads, net, ints[LANE])
    row = roads.vert_off[net] + v
    if drivers.way[b, n, CROSSING] != 0.0:
        free = its_turn and may_go(b, n, tick, state, labels, roads, obstacles, drivers, desk)
        free = free or ints[MOOD] & ROLLING != 0
    else:
        inside = 0
        held = False
        for k in range(near):
            j = desk.near[k]
            if labels.crosses[b, j] == v:
                inside += 1 if turns_round(ints) else shares_way(b, j, way, roads.degree[row], state, build)
                held = held or (j == EGO and n != EGO) or (j != EGO and turns_round(drivers.ints[b, j]))
            elif turns_round(ints):
                held = held or comes_first(b, n, j, v, state, labels, roads, drivers)
        held = held or (turns_round(ints) and inside > 0)
        free = (
            not held
            and (roads.degree[row] == 2 or inside == 0)
            and has_room(b, n, ints[NEXT], inside, state, labels, roads, obstacles, drivers, desk)
        )
    if bits & LEFT != 0 and ints[MOOD] & LEFT_SIDE == 0:
        free = False
    return speed if free else max(0.0, line) / build[PERIOD]


@jit_inline
def faces_gate(b: int, n: int, part: int, labels: Labels, roads: RoadTable, drivers: Drivers) -> bool:
    """Tell whether a car is before the disc at the end of its lane."""
    return part == BEFORE and labels.crosses[b, n] != lane_end(
        roads, drivers.net[b], drivers.ints[b, n, LANE]
    )


@jit_inline
def count_turn(bits: Any, way: Any, ints: Any) -> bool:
    """Tell whether it is the turn of a car before a disc, and count for how long; `way` is its row of `Drivers.way`."""
    its_turn = way[CROSSING] != 0.0 and bits & GOES_NOW == GOES_NOW
    ints[TURN] = ints[TURN] + 1 if its_turn else 0
    ints[OWED] = 0 if bits & STOPPED == 0 else ints[OWED] + (1 if its_turn else 0)
    return its_turn


@jit_inline
def to_line(left: float, x: float, y: float, way: Way, build: Any) -> float:
    """Return metres to the line before which the car stays if it may not enter the disc at the end of its lane."""
    edge = build[DISC] + build[REACH] + MARGIN
    aside = left - build[MIDDLE]
    return -way_to_go(way, x, y) - sqrt(max(edge * edge - aside * aside, 0.0))


@jit_inline
def shares_way(b: int, j: int, way: Way, degree: Any, state: State, build: Any) -> int:
    """Return 1 if a car in the disc is on this way, or in a disc that is no bend."""
    if degree != 2:
        return 1
    _, _, left, _, _ = on_way(way, state.x[b, j], state.y[b, j])
    return 1 if abs(left) < 2.0 * (build[HALF_WIDTH] + build[ROUNDING]) + SIDE else 0


@jit_inline
def is_behind_ego(
    b: int, n: int, x: float, y: float, way: Way, state: State, labels: Labels, drivers: Drivers
) -> bool:
    """Tell whether the ego is ahead in a car's lane.

    Such a car takes no place in the order of the crossing while the ego's nose is in the disc: the ego may back out
    again, and then bars the way of who would be first.
    """
    if labels.lane[b, EGO] != drivers.ints[b, n, LANE]:
        return False
    return way_to_go(way, state.x[b, EGO], state.y[b, EGO]) > way_to_go(way, x, y)


@jit_inline
def turns_round(ints: Any) -> bool:
    """Tell whether a car that the law drives is about to turn round at the end of its lane, or does it."""
    return ints[NEXT] >= 0 and ints[NEXT] == ints[LANE] ^ 1


@jit_inline
def comes_first(
    b: int, n: int, j: int, v: int, state: State, labels: Labels, roads: RoadTable, drivers: Drivers
) -> bool:
    """Tell whether car j comes into a bend or dead end by another lane before car n, which turns round there."""
    lane, net = labels.lane[b, j], drivers.net[b]
    if lane < 0 or lane == drivers.ints[b, n, LANE] or lane_end(roads, net, int(lane)) != v:
        return False
    row = roads.vert_off[net] + v
    dx = state.x[b, j] - roads.vert[row, 0]
    dy = state.y[b, j] - roads.vert[row, 1]
    near = drivers.build[b, DISC] + drivers.build[b, REACH] + SOON
    return dx * dx + dy * dy < near * near and (j < n or not turns_round(drivers.ints[b, j]))


@jit
def may_go(
    b: int, n: int, tick: int, state: State, labels: Labels, roads: RoadTable, obstacles: ObstacleTable,
    drivers: Drivers, desk: Desk,
) -> bool:  # fmt: skip
    """Tell whether a car whose turn it is may enter: there is room behind the crossing. It may choose another exit."""
    ints = drivers.ints[b, n]
    build = drivers.build[b]
    bits = np.int64(labels.bits[b, n])
    due = ints[KIND] != ROUND and is_due(ints[TURN], bits, build)
    if (
        ints[KIND] == NEMESIS
        and bits & FORFEITED == 0
        and ints[TURN] < ticks_of(LINGER * build[FORFEIT], build)
    ):
        dx = state.x[b, 0] - state.x[b, n]
        dy = state.y[b, 0] - state.y[b, n]
        if dx * dx + dy * dy < TRAIL * TRAIL:
            return False
    if has_room(b, n, ints[NEXT], 0, state, labels, roads, obstacles, drivers, desk):
        return True
    waited = ints[OWED] - ticks_of(CHOOSY, build)
    if not due and (waited < 0 or waited % 8 != 0):
        return False
    budget = BUDGET * ints[OWED] * build[PERIOD] if ints[KIND] == ROUND else INFINITE
    if take_another(b, n, tick, budget, state, labels, roads, obstacles, drivers, desk):
        return True
    if due:
        take_widest(b, n, state, labels, roads, obstacles, drivers, desk)
    return due


@jit
def take_another(
    b: int, n: int, tick: int, budget: float, state: State, labels: Labels, roads: RoadTable,
    obstacles: ObstacleTable, drivers: Drivers, desk: Desk,
) -> bool:  # fmt: skip
    """Choose the best exit in which there is room; tell whether there is one.

    An exit that counts more than the present one by `budget` metres does not come into question, and neither does one
    in which an obstacle can't be passed, unless all are such.
    """
    net = drivers.net[b]
    ints = drivers.ints[b, n]
    v = lane_end(roads, net, ints[LANE])
    row = roads.vert_off[net] + v
    price_exits(b, n, tick, state, labels, roads, obstacles, drivers, desk)
    wanted = 0.0
    least = INFINITE
    for k in range(roads.degree[row]):
        least = min(least, desk.cost[k])
        if roads.arms[row, k] == ints[NEXT]:
            wanted = desk.cost[k]
    allowed = 0
    for k in range(roads.degree[row]):
        out = int(roads.arms[row, k])
        cheap = desk.cost[k] - wanted < budget and (desk.cost[k] < BARRED or least >= BARRED)
        if (
            cheap
            and out != ints[NEXT]
            and has_room(b, n, out, 0, state, labels, roads, obstacles, drivers, desk)
        ):
            allowed |= 1 << k
    best = cheapest(v, roads.vert_off[net], allowed, roads, desk)
    if best >= 0:
        ints[NEXT] = best
    return best >= 0


@jit
def take_widest(
    b: int, n: int, state: State, labels: Labels, roads: RoadTable, obstacles: ObstacleTable,
    drivers: Drivers, desk: Desk,
) -> None:  # fmt: skip
    """Choose the exit in which there is most room, though it is not enough; `desk.cost` has what they count."""
    net = drivers.net[b]
    ints = drivers.ints[b, n]
    row = roads.vert_off[net] + lane_end(roads, net, ints[LANE])
    most = -INFINITE
    for k in range(roads.degree[row]):
        out = int(roads.arms[row, k])
        room = room_in(b, n, out, 0, state, labels, roads, obstacles, drivers, desk)
        room -= INFINITE * 0.5 if desk.cost[k] >= BARRED else 0.0
        if room > most:
            most = room
            ints[NEXT] = out


@jit_inline
def is_due(turn: int, bits: Any, build: Any) -> bool:
    """Tell whether an e-agent whose turn it is has to enter now, or it loses its place a second time."""
    if bits & FORFEITED == 0:
        return False
    forfeit = ticks_of(build[FORFEIT], build)
    since = turn - forfeit if turn >= forfeit else turn
    return since > ticks_of(DUTY * build[FORFEIT], build)


@jit
def has_room(
    b: int, n: int, out: int, inside: int, state: State, labels: Labels, roads: RoadTable,
    obstacles: ObstacleTable, drivers: Drivers, desk: Desk,
) -> bool:  # fmt: skip
    """Tell whether a car that takes the lane `out` can leave the disc at its beginning altogether.

    `inside` cars are still in the disc and will be before it.
    """
    return room_in(b, n, out, inside, state, labels, roads, obstacles, drivers, desk) >= 0.0


@jit
def room_in(
    b: int, n: int, out: int, inside: int, state: State, labels: Labels, roads: RoadTable,
    obstacles: ObstacleTable, drivers: Drivers, desk: Desk,
) -> float:  # fmt: skip
    """Return how far beyond the disc at its beginning a car can drive on the lane `out`, metres; negative: not out of it.

    All that are in the lane drive on until they stand close behind one another: behind what stands there now, behind
    an obstacle or before the next disc. Of the ego nobody knows whether it drives on; at a crossing, where who finds one
    exit barred has to take another in time, it may back up as well. `inside` cars are still in the disc and will be
    before this one.
    """
    net = drivers.net[b]
    build = drivers.build[b]
    edge = build[DISC] + build[REACH] + MARGIN
    mouth = sqrt(max(edge * edge - build[MIDDLE] * build[MIDDLE], 0.0))
    pitch = 2.0 * build[REACH] + QUEUE_GAP
    start = lane_start(roads, net, out)
    crossing = roads.degree[roads.vert_off[net] + start] >= build[DEGREE]
    tx, ty = lane_direction(roads, net, out)
    last = roads.seg[roads.seg_off[net] + (out >> 1), 4] - mouth
    last = min(last, before_obstacles(b, out, roads, obstacles, drivers))
    wall = INFINITE
    for look in range(2):
        j = desk.head[out >> 1]
        while j >= 0:
            along, aside = lane_coordinates(roads, net, out, float(state.x[b, j]), float(state.y[b, j]))
            there = aside < build[HALF_WIDTH] + build[ROUNDING] + 0.05 and along > build[DISC]
            if j != n and there and labels.crosses[b, j] != start:
                if look == 1:
                    last -= pitch if along < wall else 0.0
                    j = desk.link[j]
                    continue
                heading = state.c[b, j] * tx + state.s[b, j] * ty
                slow = abs(state.speed[b, j]) < BRISK or heading < 0.5
                if slow and along < mouth + pitch:
                    return -1.0
                if labels.bits[b, j] & STANDS != 0 or heading < 0.0 or (j == EGO and n != EGO):
                    back = build[BACKS_UP] if j == EGO and n != EGO and crossing else 0.0
                    wall = min(wall, along)
                    last = min(last, along - back - pitch)
            j = desk.link[j]
    return last - pitch * inside - mouth


@jit
def is_free(b: int, n: int, out: int, state: State, roads: RoadTable, drivers: Drivers, desk: Desk) -> bool:
    """Tell whether nobody is in the lane `out` so near to the disc at its beginning that the exit is not free (E4)."""
    build = drivers.build[b]
    j = desk.head[out >> 1]
    while j >= 0:
        along, aside = lane_coordinates(
            roads, drivers.net[b], out, float(state.x[b, j]), float(state.y[b, j])
        )
        if j != n and aside <= 0.0 and along <= build[DISC] + build[EXIT_GAP]:
            return False
        j = desk.link[j]
    return True


@jit
def before_obstacles(
    b: int, lane: int, roads: RoadTable, obstacles: ObstacleTable, drivers: Drivers
) -> float:
    """Return how far along a lane a car can drive in its middle before an obstacle is in its way, metres."""
    build = drivers.build[b]
    free = INFINITE
    for p in range(obstacles.off[b], obstacles.off[b + 1]):
        row = obstacles.part[p]
        along, aside = lane_coordinates(roads, drivers.net[b], lane, row[0], row[1])
        wide = build[HALF_WIDTH] + build[ROUNDING] + SIDE + row[7]
        if abs(aside + build[MIDDLE]) < wide and along + row[7] > build[DISC]:
            free = min(free, along - row[7] - build[REACH] - QUEUE_GAP)
    return free


@jit
def turn_elsewhere(
    b: int, n: int, tick: int, state: State, labels: Labels, roads: RoadTable, obstacles: ObstacleTable,
    drivers: Drivers, desk: Desk,
) -> None:  # fmt: skip
    """Choose another exit for a car that is held up in a disc."""
    if take_another(b, n, tick, INFINITE, state, labels, roads, obstacles, drivers, desk):
        drivers.ints[b, n, WAITED] = 0
