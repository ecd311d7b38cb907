"""Driving along lanes: entering one, choosing the next at its end, and the waypoints on them."""

from __future__ import annotations

from typing import Any

from dubins_traffic.agents.tables import Cast, Memory, Workspace
from dubins_traffic.kernels.arrays import Ints
from dubins_traffic.kernels.compile import jit
from dubins_traffic.kernels.random import below
from dubins_traffic.roads.lookup import nearest_segment
from dubins_traffic.roads.table import RoadTable

CHOICE_DRAW = 0
FAR = 1 << 40


@jit
def frame(roads: RoadTable, net: int, lane: int) -> tuple[float, float, float, float, float]:
    """Return (x, y, tx, ty, length): start, unit direction and length of a lane's centre line of the road."""
    row = roads.seg[roads.seg_off[net] + (lane >> 1)]
    if lane & 1:
        return row[0] + row[4] * row[2], row[1] + row[4] * row[3], -row[2], -row[3], row[4]
    return row[0], row[1], row[2], row[3], row[4]


@jit
def waypoint(
    roads: RoadTable, net: int, lane: int, offset: float, progress: float, from_end: bool
) -> tuple[float, float]:
    """Return the point `offset` right of the centre line at `progress` from the lane's start, or from its end."""
    x, y, tx, ty, length = frame(roads, net, lane)
    if from_end:
        progress += length
    return x + progress * tx + offset * ty, y + progress * ty - offset * tx


@jit
def lane_at(roads: RoadTable, net: int, x: float, y: float, c: float, s: float) -> int:
    """Return the lane of the nearest segment that leads along the heading (its first-to-second end on ties)."""
    segment, _ = nearest_segment(roads, net, x, y)
    row = roads.seg[roads.seg_off[net] + segment]
    return 2 * segment + (0 if c * row[2] + s * row[3] >= 0.0 else 1)


@jit
def vertex_after(roads: RoadTable, net: int, lane: int) -> int:
    """Return the row of the vertex at the end of a lane, in the arrays over all vertices."""
    return roads.vert_off[net] + roads.ends[roads.seg_off[net] + (lane >> 1), 1 - (lane & 1)]


@jit
def random_exit(roads: RoadTable, net: int, lane: int, seed: Any, trial: int, car: int, tick: int) -> int:
    """Return a lane out of the end of `lane`, each equally likely but the one back, which only a dead end has."""
    v = vertex_after(roads, net, lane)
    others = roads.degree[v] - 1
    if others < 1:
        return lane ^ 1
    pick = below(seed, trial, car, tick, CHOICE_DRAW, others)
    for k in range(4):
        arm = roads.arms[v, k]
        if arm >= 0 and arm != lane ^ 1:
            if pick == 0:
                return arm
            pick -= 1
    return lane ^ 1


@jit
def clear(roads: RoadTable, net: int, hops: Ints) -> None:
    """Set the hops of every lane of a network to FAR."""
    for lane in range(2 * (roads.seg_off[net + 1] - roads.seg_off[net])):
        hops[lane] = FAR


@jit
def aim_for(lane: int, hops: Ints, queue: Ints, count: int) -> int:
    """Make a lane a target of `spread`, after `clear`; return the number of targets."""
    if hops[lane] == FAR:
        hops[lane] = 0
        queue[count] = lane
        count += 1
    return count


@jit
def spread(roads: RoadTable, net: int, hops: Ints, queue: Ints, count: int) -> None:
    """Fill `hops` with the number of lanes to drive from each lane to the `count` targets; FAR where there's no way.

    Turning round counts as possible at dead ends only.
    """
    done = 0
    while done < count:
        lane = queue[done]
        done += 1
        v = vertex_after(roads, net, lane ^ 1)
        for k in range(4):
            arm = roads.arms[v, k]
            if arm < 0 or (arm == lane and roads.degree[v] > 1):
                continue
            before = arm ^ 1
            if hops[before] == FAR:
                hops[before] = hops[lane] + 1
                queue[count] = before
                count += 1


@jit
def nearer_exit(roads: RoadTable, net: int, lane: int, hops: Ints) -> int:
    """Return the lane out of the end of `lane` with the fewest hops to go; back where no other leads there."""
    v = vertex_after(roads, net, lane)
    best = lane ^ 1
    fewest = FAR
    for k in range(4):
        arm = roads.arms[v, k]
        if arm >= 0 and arm != lane ^ 1 and hops[arm] < fewest:
            best = arm
            fewest = hops[arm]
    return best


@jit
def loop_exit(
    roads: RoadTable, net: int, lane: int, b: int, n: int, cast: Cast, memory: Memory, work: Workspace
) -> int:
    """Return the next lane of a car that loops, and step its place in the cycle: -1 while it is on the way there."""
    first = cast.plan[b, n, 0]
    last = cast.plan[b, n, 1]
    place = memory.place[b, n]
    if place >= 0:
        place = place + 1 if place + 1 < last else first
        memory.place[b, n] = place
        return cast.cycle[place]
    clear(roads, net, work.hops)
    count = 0
    for k in range(first, last):
        count = aim_for(cast.cycle[k], work.hops, work.queue, count)
    spread(roads, net, work.hops, work.queue, count)
    chosen = nearer_exit(roads, net, lane, work.hops)
    memory.place[b, n] = place_of(chosen, first, last, cast.cycle)
    return chosen


@jit
def place_of(lane: int, first: int, last: int, cycle: Ints) -> int:
    """Return the first row of `cycle` from `first` to `last` - 1 that holds `lane`, or -1."""
    for k in range(first, last):
        if cycle[k] == lane:
            return k
    return -1
