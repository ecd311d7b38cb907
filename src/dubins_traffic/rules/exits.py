"""Whether a car in a disc may leave it (docs/rules.md#E4): the lanes out of it, and what takes them."""

from __future__ import annotations

from math import sqrt
from typing import NamedTuple

from dubins_traffic.cars.near import list_near, ticks_within
from dubins_traffic.cars.state import EGO, Labels, State
from dubins_traffic.kernels.compile import jit, jit_inline
from dubins_traffic.roads.lookup import lane_coordinates, lane_direction_at, lane_start
from dubins_traffic.roads.table import RoadTable
from dubins_traffic.rules.blocking import lane_of, narrows, obstacle_narrows
from dubins_traffic.rules.breach_log import RefereeParameters, RefereeTables
from dubins_traffic.rules.shape import Shape, half_across
from dubins_traffic.rules.tables import GRAIN, TrialRules


@jit_inline
def _is_bend(v: int, t: RoadTable, rules: TrialRules) -> bool:
    """Tell whether v is neither a crossing nor a dead end."""
    degree = t.degree[t.vert_off[rules.net] + v]
    return bool(2 <= degree < rules.crossing_degree)


@jit_inline
def way_back(v: int, came: int, t: RoadTable, rules: TrialRules) -> int:
    """Return the segment by which a car came to v if v is a bend, where that segment is no exit for it; else -1.

    The car came by the lane `came` (-1: none).

    Norm: docs/rules.md#exit.
    """
    return came // 2 if came >= 0 and _is_bend(v, t, rules) else -1


@jit_inline
def lane_taken(b: int, n: int, v: int, tables: RefereeTables) -> int:
    """Return the lane out of v that is car n's lane state while its centre is outside the disc, else -1.

    That lane is then its only exit, unless an obstacle narrows it.

    Norm: docs/rules.md#out.
    """
    lane = int(tables.labels.lane[b, n])
    if lane < 0 or lane_start(tables.roads, tables.rules[b].net, lane) != v:
        return -1
    return -1 if _is_barred(b, lane, tables) else lane


@jit_inline
def _is_barred(b: int, lane: int, tables: RefereeTables) -> bool:
    """Tell whether an obstacle narrows a lane next to the disc at its beginning."""
    rules, place = tables.rules[b], lane_of(tables.roads, tables.rules[b], b, lane)
    near, far = rules.radius, rules.radius + tables.terms[b].exit_room
    return obstacle_narrows(tables.obstacles, place, near, far, rules.free_needed + GRAIN)


@jit_inline
def is_exit(lane: int, only: int, back: int) -> bool:
    """Tell whether `lane` (index), out of a disc, is an exit for a car that has taken the lane `only` (index).

    If that is -1 all are exits, but for that on the segment `back` (index).
    """
    return lane == only if only >= 0 else lane // 2 != back


class LaneOut(NamedTuple):
    """The lane `lane` (index) of network `net` out of a disc: `width` metres wide, a car needs `needed` metres."""

    net: int
    lane: int
    width: float
    needed: float


@jit_inline
def _narrows_lane(b: int, k: int, out: LaneOut, lateral: float, body: Shape, state: State, roads: RoadTable) -> bool:
    """Tell whether the body of car `k` (index), `lateral` (m) left of a lane's centre line, narrows the lane `out`."""
    tx, ty = lane_direction_at(roads, out.net, out.lane, state.x[b, k], state.y[b, k])
    half = half_across(b, k, tx, ty, state, body)
    return narrows(lateral - half, lateral + half, out.width, out.needed + GRAIN)


@jit
def takes_lane(b: int, k: int, out: LaneOut, body: Shape, state: State, labels: Labels, roads: RoadTable) -> bool:
    """Tell whether car `k` (index), whose centre is outside the disc at the beginning of a lane, takes that lane.

    The car, whose `body` (m) is given, is near that disc. Its body narrows the lane, or its centre is in it and the car
    does not go toward the disc. The referee asks this of the lane `out`, and so do drivers.

    Norm: docs/rules.md#takes.
    """
    if labels.segment[b, k] != out.lane // 2:
        return False
    along, lateral = lane_coordinates(roads, out.net, out.lane, state.x[b, k], state.y[b, k])
    if along <= 0.0:
        return False
    if labels.lane[b, k] != out.lane ^ 1 and -out.width - GRAIN <= lateral <= GRAIN:
        return True
    return _narrows_lane(b, k, out, lateral, body, state, roads)


@jit_inline
def to_mouth(along: float, lateral: float, rules: TrialRules, terms: RefereeParameters) -> float:
    """Return the distance of (along, lateral) from the point where a lane leaves the disc at its beginning, metres.

    Norm: docs/rules.md#mouth.
    """
    far, aside = along - rules.radius, lateral + terms.lane_middle
    return sqrt(far * far + aside * aside)


@jit
def find_exit(b: int, n: int, v: int, back: int, count: int, tables: RefereeTables) -> bool:
    """Tell whether any lane out of v, except that on segment `back`, is free for car n of trial b.

    The first `count` cars of `spacing.near` are all that may be near.

    Norm: docs/rules.md#free-exit.
    """
    t = tables.roads
    row = int(t.vert_off[tables.rules[b].net]) + v
    only = lane_taken(b, n, v, tables)
    taken = 0
    for i in range(count):
        k = tables.spacing.near[i]
        if k != n:
            taken |= taken_exits(b, n, k, v, back, tables)
    for arm in range(t.degree[row]):
        lane: int = t.arms[row, arm]
        if taken & (1 << arm) == 0 and is_exit(lane, only, back) and not _is_barred(b, lane, tables):
            return True
    return False


@jit_inline
def taken_exits(b: int, n: int, k: int, v: int, back: int, tables: RefereeTables) -> int:
    """Return the lanes out of v that car `k` (index) keeps car n from taking: bit `arm` is that arm's.

    The lane on `back` (segment) may be among them.
    """
    state, t, rules, terms = tables.state, tables.roads, tables.rules[b], tables.terms[b]
    net = rules.net
    row = int(t.vert_off[net]) + v
    x, y = state.x[b, k], state.y[b, k]
    dx, dy = x - t.vertex[row].x, y - t.vertex[row].y
    away2 = dx * dx + dy * dy
    inside = tables.labels.at[b, k] == v
    came = tables.log.car[b, k].came_by
    # Two cars that meet in a bend, each in front of the other's exit, do not excuse each other so.
    passes_by = inside and _is_bend(v, t, rules) and came >= 0 and came // 2 != back
    if away2 > terms.exit2 or (passes_by and k != EGO):
        return 0
    taken = 0
    for arm in range(t.degree[row]):
        lane = t.arms[row, arm]
        out = LaneOut(net, lane, rules.lane_width, rules.free_needed)
        if inside:
            along, lateral = lane_coordinates(t, net, lane, x, y)
            from_x, from_y = lane_coordinates(t, net, lane, state.x[b, n], state.y[b, n])
            way = to_mouth(from_x, from_y, rules, terms)
            in_the_way = to_mouth(along, lateral, rules, terms) < way + GRAIN
            if in_the_way and passes_by:
                in_the_way = _narrows_lane(b, k, out, lateral, rules, state, t)
        else:
            in_the_way = takes_lane(b, k, out, rules, state, tables.labels, t)
        if in_the_way:
            taken |= 1 << arm
    return taken


@jit
def look_for_exit(b: int, n: int, tick: int, v: int, back: int, tables: RefereeTables) -> tuple[bool, int]:
    """Return whether car n of trial b, in the disc of v, has a free exit (E4), and the tick in which to ask again.

    The lane on segment `back` is no exit. While no other car is near the disc, nothing is in the way of an exit. A car
    near it with its centre outside is in the way of one exit at most: so while fewer cars are near than there are
    lanes, and none has its centre in the disc, an exit is free until another car can have come near or into the disc.
    """
    state, t, spacing, rules = tables.state, tables.roads, tables.spacing, tables.rules[b]
    far2, lone = tables.terms[b].exit2, tables.terms[b].lone
    row = int(t.vert_off[rules.net]) + v
    vx, vy = t.vertex[row].x, t.vertex[row].y
    near = inside = 0
    nearest2 = beyond2 = lone * lone
    count = list_near(state, b, tick, vx, vy, lone, spacing)
    for i in range(count):
        k = spacing.near[i]
        if k == n:
            continue
        dx = state.x[b, k] - vx
        dy = state.y[b, k] - vy
        d2 = dx * dx + dy * dy
        near += 1 if d2 <= far2 else 0
        inside += 1 if tables.labels.at[b, k] == v else 0
        nearest2 = min(nearest2, d2)
        beyond2 = min(beyond2, d2 if d2 > far2 else beyond2)
    free, spare, lanes = near == 0, sqrt(beyond2) - sqrt(far2), t.degree[row] - (0 if back < 0 else 1)
    if not free and near < lanes and inside == 0 and lane_taken(b, n, v, tables) < 0:
        free, spare = True, min(spare, sqrt(nearest2) - rules.radius)
    if free and tables.obstacles.base[b] < 0:
        return True, tick + ticks_within(spare - GRAIN, spacing, b)
    return find_exit(b, n, v, back, count, tables), tick + 1


@jit
def ego_at_exit(b: int, v: int, back: int, tables: RefereeTables) -> bool:
    """Tell whether the ego of trial b is near the mouth of an exit of v (E6); the lane on `back` (segment) is none."""
    state, t, rules, terms = tables.state, tables.roads, tables.rules[b], tables.terms[b]
    row = int(t.vert_off[rules.net]) + v
    x, y = state.x[b, EGO], state.y[b, EGO]
    for arm in range(t.degree[row]):
        lane: int = t.arms[row, arm]
        if lane // 2 == back:
            continue
        along, lateral = lane_coordinates(t, rules.net, lane, x, y)
        if to_mouth(along, lateral, rules, terms) <= terms.goal_gap:
            return True
    return False
