"""Another exit for a car whose own is full (compiled)."""

from __future__ import annotations

from dubins_traffic.cars.state import Labels, State
from dubins_traffic.cars.tables import ObstacleTable
from dubins_traffic.kernels.compile import jit
from dubins_traffic.policies.rules.barred import has_place, stands_in_disc
from dubins_traffic.policies.rules.exits import BARRED, cheapest, price_exits, ticks_of
from dubins_traffic.policies.rules.room import has_room, is_free, is_open, room_in
from dubins_traffic.policies.rules.tables import (
    BACKS_UP,
    CROSSING,
    LANE,
    NEXT,
    WAITED,
    WITHIN,
    Drivers,
    Scratch,
)
from dubins_traffic.policies.rules.turn_arcs import BEFORE
from dubins_traffic.roads.lookup import INFINITE, lane_end
from dubins_traffic.roads.table import RoadTable

STUCK = 2.0
"""Seconds for which an e-agent in a disc waits for the way it wants before it takes another; of the ego that is not
asked, and on its way to another exit it might leave the disc outside its lane."""
LATE = 1.0
"""Who has been in a crossing for so long, seconds, keeps to its exit while this is open, though there may be no room
behind what drives there: on the way to another it might not leave the disc in time."""


@jit
def take_another(
    b: int, n: int, tick: int, budget: float, state: State, labels: Labels, roads: RoadTable,
    obstacles: ObstacleTable, drivers: Drivers, scratch: Scratch,
) -> bool:  # fmt: skip
    """Choose the best exit in which there is room; tell whether there is one.

    An exit that counts more than the present one by `budget` metres does not come into question, and neither does one
    in which an obstacle can't be passed, unless all are such.
    """
    net = drivers.net[b]
    ints = drivers.ints[b, n]
    v = lane_end(roads, net, ints[LANE])
    row = roads.vert_off[net] + v
    price_exits(b, n, tick, state, labels, roads, obstacles, drivers, scratch)
    wanted = 0.0
    least = INFINITE
    for k in range(roads.degree[row]):
        least = min(least, scratch.cost[k])
        if roads.arms[row, k] == ints[NEXT]:
            wanted = scratch.cost[k]
    allowed = 0
    for k in range(roads.degree[row]):
        out = int(roads.arms[row, k])
        cheap = scratch.cost[k] - wanted < budget and (scratch.cost[k] < BARRED or least >= BARRED)
        if (
            cheap
            and out != ints[NEXT]
            and has_room(b, n, out, 0, state, labels, roads, obstacles, drivers, scratch)
        ):
            allowed |= 1 << k
    best = cheapest(v, roads.vert_off[net], allowed, roads, scratch)
    if best >= 0:
        ints[NEXT] = best
    return best >= 0


@jit
def take_widest(
    b: int, n: int, state: State, labels: Labels, roads: RoadTable, obstacles: ObstacleTable,
    drivers: Drivers, scratch: Scratch,
) -> None:  # fmt: skip
    """Choose the exit in which there is most room, though it is not enough; `scratch.cost` has what they count."""
    net = drivers.net[b]
    ints = drivers.ints[b, n]
    row = roads.vert_off[net] + lane_end(roads, net, ints[LANE])
    most = -INFINITE
    for k in range(roads.degree[row]):
        out = int(roads.arms[row, k])
        room = room_in(b, n, out, 0, state, labels, roads, obstacles, drivers, scratch)
        room -= INFINITE * 0.5 if scratch.cost[k] >= BARRED else 0.0
        if room > most:
            most = room
            ints[NEXT] = out


@jit
def leads_out(
    b: int, lane: int, out: int, roads: RoadTable, obstacles: ObstacleTable, drivers: Drivers
) -> bool:
    """Tell whether obstacles leave a car that comes by a lane the way out of the disc to `out`."""
    through = not stands_in_disc(b, lane, out, roads, obstacles, drivers)
    return through and has_place(b, out, roads, obstacles, drivers)


@jit
def take_last_resort(
    b: int, n: int, state: State, labels: Labels, roads: RoadTable, obstacles: ObstacleTable, drivers: Drivers,
    scratch: Scratch,
) -> bool:  # fmt: skip
    """Choose an exit for a car that finds room in none of those it wants; tell whether there is any.

    First come those that are open and lack but the room into which the ego might back up, then those in which there is
    room before an obstacle that bars the way, then all that are open. `scratch.cost` has what they count.
    """
    net = drivers.net[b]
    ints = drivers.ints[b, n]
    v = lane_end(roads, net, ints[LANE])
    row = roads.vert_off[net] + v
    ample = barred = opened = 0
    for k in range(roads.degree[row]):
        out = int(roads.arms[row, k])
        room = room_in(b, n, out, 0, state, labels, roads, obstacles, drivers, scratch)
        if scratch.cost[k] < BARRED:
            if is_open(b, n, out, state, labels, roads, drivers, scratch):
                opened |= 1 << k
                ample |= 1 << k if room >= -drivers.build[b, BACKS_UP] else 0
        elif room >= 0.0 and leads_out(b, ints[LANE], out, roads, obstacles, drivers):
            barred |= 1 << k
    allowed = ample if ample != 0 else (barred if barred != 0 else opened)
    best = cheapest(v, roads.vert_off[net], allowed, roads, scratch)
    if best >= 0:
        ints[NEXT] = best
    return best >= 0


@jit
def take_way_on(
    b: int,
    n: int,
    state: State,
    roads: RoadTable,
    obstacles: ObstacleTable,
    drivers: Drivers,
    scratch: Scratch,
) -> None:
    """Choose an exit that is free as E4 says, whatever bars the way beyond, for who would turn round in a bend."""
    net = drivers.net[b]
    ints = drivers.ints[b, n]
    row = roads.vert_off[net] + lane_end(roads, net, ints[LANE])
    for k in range(roads.degree[row]):
        out = int(roads.arms[row, k])
        on = out != ints[LANE] ^ 1 and leads_out(b, ints[LANE], out, roads, obstacles, drivers)
        if on and is_free(b, n, out, state, roads, drivers, scratch):
            ints[NEXT] = out


@jit
def turn_elsewhere(
    b: int, n: int, tick: int, state: State, labels: Labels, roads: RoadTable, obstacles: ObstacleTable,
    drivers: Drivers, scratch: Scratch,
) -> None:  # fmt: skip
    """Choose another exit for a car that is held up in a disc."""
    ints = drivers.ints[b, n]
    found = take_another(b, n, tick, INFINITE, state, labels, roads, obstacles, drivers, scratch)
    if not found and not is_open(b, n, ints[NEXT], state, labels, roads, drivers, scratch):
        found = take_last_resort(b, n, state, labels, roads, obstacles, drivers, scratch)
    if found:
        ints[WAITED] = 0


@jit
def find_way_out(
    b: int, n: int, tick: int, part: int, state: State, labels: Labels, roads: RoadTable, obstacles: ObstacleTable,
    drivers: Drivers, scratch: Scratch,
) -> None:  # fmt: skip
    """Choose another exit for an e-agent in a disc whose own is barred: at once in a crossing, else after a while.

    Who has been in a crossing for a while does so only if its own exit is taken.
    """
    ints = drivers.ints[b, n]
    build = drivers.build[b]
    crossing = drivers.way[b, n, CROSSING] != 0.0
    if not crossing and (part == BEFORE or ints[WAITED] <= ticks_of(STUCK, build)):
        return
    if crossing:
        ints[WITHIN] += 1
        if tick % 4 != 0 or has_room(b, n, ints[NEXT], 0, state, labels, roads, obstacles, drivers, scratch):
            return
        late = ints[WITHIN] > ticks_of(LATE, build)
        if late and is_open(b, n, ints[NEXT], state, labels, roads, drivers, scratch):
            return
    turn_elsewhere(b, n, tick, state, labels, roads, obstacles, drivers, scratch)
