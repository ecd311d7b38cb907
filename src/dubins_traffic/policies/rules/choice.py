"""Choosing another exit for a car in a disc whose own exit is full or barred (compiled)."""

from __future__ import annotations

from math import sqrt

from dubins_traffic.kernels.compile import jit, jit_inline, jit_rare
from dubins_traffic.policies.rules.barred import has_place, stands_in_disc
from dubins_traffic.policies.rules.exits import BARRED, NO_WAY, cheapest, price_exits, ticks_of
from dubins_traffic.policies.rules.kept import KeptPath
from dubins_traffic.policies.rules.room import has_room, is_clear, is_free, is_open, room_in
from dubins_traffic.policies.rules.tables import Driver, Traffic, Vehicle
from dubins_traffic.policies.rules.turn_arcs import PART
from dubins_traffic.roads.lookup import INFINITE, lane_coordinates, lane_end

STUCK = 2.0
"""Seconds for which an e-agent in a disc waits for its exit before it takes another. The ego keeps its exit: it owes
no E4, and on the way to another it might leave the disc outside its lane."""
LATE = 1.0
"""A car that has been in a crossing for this long, seconds, keeps its exit while that is open, even if there may be no
room behind the cars there: on the way to another exit it might not leave the disc in time."""
HASTE = 1e3
"""Cost of a metre to an exit for such a car, metres: more than any way on from there counts."""

SOON = 0.5
"""Within this distance of a bend, metres, a car is about to enter it."""
CHOICES = 4
"""A car in a crossing looks for another exit once in this many ticks."""


@jit_rare
def take_another(b: int, n: int, tick: int, budget: float, traffic: Traffic) -> bool:
    """Choose the best exit in which there is room; tell whether there is one.

    An exit that counts more than the present one by `budget` (m) does not come into question, and neither does one
    in which an obstacle can't be passed, unless all are such.
    """
    roads, drivers, scratch = traffic.roads, traffic.drivers, traffic.scratch
    net = drivers.net[b]
    car = drivers.car[b, n]
    v = lane_end(roads, net, car.lane)
    row = int(roads.vert_off[net]) + v
    price_exits(b, n, tick, traffic)
    if is_late(car, drivers.vehicle[b]):
        prefer_near(b, n, row, drivers.vehicle[b], traffic)
    wanted = 0.0
    least = INFINITE
    for k in range(roads.degree[row]):
        least = min(least, scratch.cost[k])
        if roads.arms[row, k] == car.next_lane:
            wanted = scratch.cost[k]
    allowed = 0
    for k in range(roads.degree[row]):
        out = int(roads.arms[row, k])
        cheap = scratch.cost[k] - wanted < budget and (scratch.cost[k] < BARRED or least >= BARRED)
        if cheap and out != car.next_lane and has_room(b, n, out, 0, traffic):
            allowed |= 1 << k
    best = cheapest(v, roads.vert_off[net], allowed, roads, scratch)
    if best >= 0:
        car.next_lane = best
    return best >= 0


@jit_inline
def is_late(car: Driver, vehicle: Vehicle) -> bool:
    """Tell whether a car has been in a crossing for longer than `LATE`."""
    return car.within > ticks_of(LATE, vehicle)


@jit_rare
def prefer_near(b: int, n: int, row: int, vehicle: Vehicle, traffic: Traffic) -> None:
    """Let a car that has little time left prefer near exits of the intersection at `row` (row).

    From one side of a crossing to the other it might not get out in time (E4).
    """
    state, roads, drivers, scratch = traffic.state, traffic.roads, traffic.drivers, traffic.scratch
    for k in range(roads.degree[row]):
        out = int(roads.arms[row, k])
        along, left = lane_coordinates(roads, drivers.net[b], out, state.x[b, n], state.y[b, n])
        along, left = along - vehicle.disc, left + vehicle.middle
        scratch.cost[k] += HASTE * sqrt(along * along + left * left)


@jit_rare
def take_widest(b: int, n: int, traffic: Traffic) -> None:
    """Choose the exit in which there is most room, though it is not enough; `scratch.cost` has what they count."""
    roads, drivers, scratch = traffic.roads, traffic.drivers, traffic.scratch
    net = drivers.net[b]
    car = drivers.car[b, n]
    row = roads.vert_off[net] + lane_end(roads, net, car.lane)
    most = -INFINITE
    for k in range(roads.degree[row]):
        out = int(roads.arms[row, k])
        room = room_in(b, n, out, 0, traffic)
        room -= INFINITE * 0.5 if scratch.cost[k] >= BARRED else 0.0
        if room > most:
            most = room
            car.next_lane = out


@jit
def leads_out(b: int, lane: int, out: int, traffic: Traffic) -> bool:
    """Tell whether obstacles leave a car that comes by a lane the way out of the disc to `out`."""
    through = not stands_in_disc(b, lane, out, traffic)
    return through and has_place(b, out, traffic)


@jit_rare
def take_last_resort(b: int, n: int, traffic: Traffic) -> bool:
    """Choose an exit for a car that finds room in none of those it wants; tell whether there is any.

    First come those that are open and lack but the room into which the ego might back up, then those in which there is
    room before an obstacle that bars the way, then all that are open. `scratch.cost` has what they count.
    """
    roads, drivers, scratch = traffic.roads, traffic.drivers, traffic.scratch
    net = drivers.net[b]
    car = drivers.car[b, n]
    v = lane_end(roads, net, car.lane)
    row = int(roads.vert_off[net]) + v
    ample = barred = opened = 0
    for k in range(roads.degree[row]):
        out = int(roads.arms[row, k])
        room = room_in(b, n, out, 0, traffic)
        if scratch.cost[k] < BARRED:
            if is_open(b, n, out, traffic):
                opened |= 1 << k
                ample |= 1 << k if room >= -drivers.vehicle[b].backs_up else 0
        elif scratch.cost[k] < NO_WAY and room >= 0.0 and leads_out(b, car.lane, out, traffic):
            barred |= 1 << k
    allowed = ample if ample != 0 else (barred if barred != 0 else opened)
    best = cheapest(v, roads.vert_off[net], allowed, roads, scratch)
    if best >= 0:
        car.next_lane = best
    return best >= 0


@jit_rare
def take_way_on(b: int, n: int, full: bool, traffic: Traffic) -> bool:
    """Choose the way on, even if it is barred beyond, for a car that would turn round in a bend; tell whether it does.

    It takes no exit that is not free (E4), unless `full` (yes or no) says that it may be full.
    """
    roads, drivers = traffic.roads, traffic.drivers
    net = drivers.net[b]
    car = drivers.car[b, n]
    row = roads.vert_off[net] + lane_end(roads, net, car.lane)
    free = False
    for k in range(roads.degree[row]):
        out = int(roads.arms[row, k])
        on = out != car.lane ^ 1 and leads_out(b, car.lane, out, traffic)
        if on and (full or is_free(b, n, out, traffic)):
            car.next_lane = out
            free = True
    return free


@jit_rare
def is_way_on_free(b: int, n: int, traffic: Traffic) -> bool:
    """Tell whether an exit other than the way back is free (E4) for a car before a bend, wherever it leads."""
    roads, drivers = traffic.roads, traffic.drivers
    net = drivers.net[b]
    car = drivers.car[b, n]
    row = roads.vert_off[net] + lane_end(roads, net, car.lane)
    free = False
    for k in range(roads.degree[row]):
        out = int(roads.arms[row, k])
        free = free or (out != car.lane ^ 1 and is_free(b, n, out, traffic))
    return free


@jit_rare
def turn_elsewhere(b: int, n: int, tick: int, traffic: Traffic) -> None:
    """Choose another exit for a car that is held up in a disc."""
    drivers = traffic.drivers
    car = drivers.car[b, n]
    turns = take_another(b, n, tick, INFINITE, traffic)
    if not turns and not is_open(b, n, car.next_lane, traffic):
        turns = take_last_resort(b, n, traffic)
    if turns:
        car.waited = 0


@jit_rare
def bars_others(b: int, n: int, traffic: Traffic) -> bool:
    """Tell whether a car that turned round in its bend now would bar others' ways: of who is in it, or about to enter.

    Who came by the other road is no excuse for them (E4), and the way back no exit for it.
    """
    drivers = traffic.drivers
    v = lane_end(traffic.roads, drivers.net[b], drivers.car[b, n].lane)
    for j in range(traffic.state.count[b]):
        if j != n and (traffic.labels.crosses[b, j] == v or is_about_to_enter(b, j, v, traffic)):
            return True
    return False


@jit_inline
def is_about_to_enter(b: int, j: int, v: int, traffic: Traffic) -> bool:
    """Tell whether car j is near to the end of its lane, and that is the intersection v."""
    state, roads, drivers = traffic.state, traffic.roads, traffic.drivers
    lane, net = traffic.labels.lane[b, j], drivers.net[b]
    if lane < 0 or lane_end(roads, net, int(lane)) != v:
        return False
    corner = roads.vertex[int(roads.vert_off[net]) + v]
    dx, dy = state.x[b, j] - corner.x, state.y[b, j] - corner.y
    near = drivers.vehicle[b].disc + drivers.vehicle[b].reach + SOON
    return bool(dx * dx + dy * dy < near * near)


@jit_inline
def keeps_exit(b: int, n: int, tick: int, way: KeptPath, traffic: Traffic) -> bool:
    """Tell whether `find_way_out` is certain to keep the exit of a car in a crossing and only count ticks.

    `way` (row) is its row of `Drivers.way`.
    """
    return tick % CHOICES != 0 or is_clear(b, n, way, traffic.labels, traffic.state.count[b])


@jit
def find_way_out(b: int, n: int, tick: int, part: int, traffic: Traffic) -> None:
    """Choose another exit for an e-agent in a disc whose own is barred: at once in a crossing, else after a while.

    A car that has been in a crossing for LATE does so only if its own exit is taken.
    """
    drivers = traffic.drivers
    car = drivers.car[b, n]
    vehicle = drivers.vehicle[b]
    crossing = drivers.way[b, n].crossing != 0
    if not crossing and (part == PART.BEFORE or car.waited <= ticks_of(STUCK, vehicle)):
        return
    if crossing:
        car.within += 1
        if tick % CHOICES != 0 or has_room(b, n, car.next_lane, 0, traffic):
            return
        if is_late(car, vehicle) and is_open(b, n, car.next_lane, traffic):
            return
    wanted = car.next_lane
    turn_elsewhere(b, n, tick, traffic)
    if not crossing and car.next_lane == car.lane ^ 1 != wanted and bars_others(b, n, traffic):
        car.next_lane = wanted
