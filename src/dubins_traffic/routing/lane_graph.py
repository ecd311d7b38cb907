"""The graph of lanes: where a lane lies, which lane a car is on, distances between lanes (compiled)."""

from __future__ import annotations

from dubins_traffic.cars.state import Pose
from dubins_traffic.kernels.arrays import Floats, Ints
from dubins_traffic.kernels.compile import jit
from dubins_traffic.roads.lookup import bent_foot, bent_place, lane_direction_at, nearest_segment
from dubins_traffic.roads.table import RoadTable

FAR = 1 << 40


@jit
def frame(roads: RoadTable, net: int, lane: int) -> tuple[float, float, float, float, float]:
    """Return (x, y, tx, ty, length): start, unit direction there and length of a lane on the road's centre line."""
    row: int = roads.seg_off[net] + (lane >> 1)
    segment = roads.segment[row]
    if segment.piece >= 0 and lane & 1:
        return segment.end_x, segment.end_y, -segment.end_tx, -segment.end_ty, segment.length
    if lane & 1:
        return (
            segment.x + segment.length * segment.tx,
            segment.y + segment.length * segment.ty,
            -segment.tx,
            -segment.ty,
            segment.length,
        )
    return segment.x, segment.y, segment.tx, segment.ty, segment.length


@jit
def foot(roads: RoadTable, net: int, lane: int, x: float, y: float) -> tuple[float, float, float, float, float]:
    """Return (s, l, tx, ty, length): metres along a lane and left of it, its direction there, and its length."""
    row: int = roads.seg_off[net] + (lane >> 1)
    segment = roads.segment[row]
    if segment.piece >= 0:
        along, left, tx, ty = bent_foot(roads.piece, segment, lane & 1 != 0, x, y)
        return along, left, tx, ty, segment.length
    ax, ay, tx, ty, length = frame(roads, net, lane)
    rx, ry = x - ax, y - ay
    return rx * tx + ry * ty, tx * ry - ty * rx, tx, ty, length


@jit
def place_on_lane(roads: RoadTable, net: int, lane: int, along: float) -> tuple[float, float, float, float]:
    """Return (x, y, tx, ty): the point of a road's centre line `along` (m) from a lane's start, and the direction."""
    row: int = roads.seg_off[net] + (lane >> 1)
    segment = roads.segment[row]
    if segment.piece >= 0:
        return bent_place(roads.piece, segment, lane & 1 != 0, along)
    x0, y0, tx, ty, _ = frame(roads, net, lane)
    return x0 + along * tx, y0 + along * ty, tx, ty


@jit
def lane_at(roads: RoadTable, net: int, pose: Pose) -> int:
    """Return the lane of the nearest segment that leads along the heading (its first-to-second end on ties)."""
    segment, _ = nearest_segment(roads, net, pose.x, pose.y)
    tx, ty = lane_direction_at(roads, net, 2 * segment, pose.x, pose.y)
    return 2 * segment + (0 if pose.c * tx + pose.s * ty >= 0.0 else 1)


@jit
def nearest_stage(distance: Floats, first: int, last: int, lane: int, segment: int) -> int:
    """Return the stage that is nearest along lanes; the first of equally near ones.

    Stages are the rows `first` (index) to before `last` (index) of `distance` (M, L), metres from each lane. It is
    nearest from `lane`, or from `segment` for a car without lane state; -1 if there are no rows.
    """
    start = lane if lane >= 0 else 2 * segment
    best = -1
    for k in range(first, last):
        if best < 0 or distance[k, start] < distance[best, start]:
            best = k
    return best


@jit
def aim_for(lane: int, hops: Ints, queue: Ints, count: int) -> int:
    """Make a lane a target of `spread`; return the number of targets so far.

    `hops` (L,) and `queue` (L,) are those of `spread`, `count` (count) is the number of targets before.
    """
    if hops[lane] == FAR:
        hops[lane] = 0
        queue[count] = lane
        count += 1
    return count


@jit
def spread(roads: RoadTable, net: int, hops: Ints, queue: Ints, count: int) -> None:
    """Fill `hops` (L,) with the number of lanes to drive from each lane to the targets; FAR: there's no way.

    The first `count` (count) entries of `queue` (L,) are the targets; the rest is scratch.

    Turning round counts as possible at dead ends only. All but the targets were FAR before.
    """
    done = 0
    while done < count:
        lane = queue[done]
        done += 1
        v = roads.vert_off[net] + roads.ends[roads.seg_off[net] + (lane >> 1), lane & 1]
        for k in range(roads.degree[v]):
            before = roads.arms[v, k] ^ 1
            if hops[before] == FAR and (before != lane ^ 1 or roads.degree[v] == 1):
                hops[before] = hops[lane] + 1
                queue[count] = before
                count += 1


@jit
def place_of(lane: int, first: int, last: int, cycle: Ints) -> int:
    """Return the first row from `first` (index) to before `last` (index) of `cycle` (M,) that holds a lane, or -1."""
    for k in range(first, last):
        if cycle[k] == lane:
            return k
    return -1
