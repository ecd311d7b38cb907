"""Locates a car in a frame: segment, disc and lane state; and keeps the lists by which others find it (compiled).

Most cars have valid cached labels (`rules.label_cache`); this is for the others.
"""

from __future__ import annotations

from math import sqrt
from typing import Any

import numpy as np

from dubins_traffic.cars.state import Pose
from dubins_traffic.kernels.arrays import BLOCK
from dubins_traffic.kernels.compile import jit, jit_inline, jit_look
from dubins_traffic.kernels.records import Rows
from dubins_traffic.roads.lookup import (
    CERTAIN,
    ValidCell,
    distance2,
    lane_direction_at,
    lane_end,
    nearest_arm,
    valid_cell,
    vertex_distance2,
)
from dubins_traffic.roads.table import RoadTable
from dubins_traffic.rules.label_cache import (
    FARTHEST,
    HELD_FLAGS,
    growth_row,
    keep_region,
    lingers,
    note_growth,
    still,
)
from dubins_traffic.rules.lane_cache import keep_arm, keep_road
from dubins_traffic.rules.lane_state import along_lane, forget_lane, keep_tops, lane_here
from dubins_traffic.rules.propositions import FLAG
from dubins_traffic.rules.shape import distance2_to_body, half_extent
from dubins_traffic.rules.tables import NEVER_AGAIN, CarMemory, Heads, LabelTables, Memory, TrialRules

RULE3 = FLAG.STOPPED | FLAG.CLEAR | FLAG.AHEAD


@jit_inline
def locate(b: int, n: int, tick: int, tables: LabelTables) -> bool:
    """Find segment, disc and lane state of car n of trial b, whether it was still and lingers; enter it in the lists.

    HELD_FLAGS of the frame before are kept, and BREACH3 is judged by that frame's flags. Tells whether the disc that
    the body meets has changed, or is known for the first time.

    Norm: docs/rules.md#on-road, docs/rules.md#at, docs/rules.md#cross.
    """
    state, t, labels, memory = tables.state, tables.roads, tables.labels, tables.memory
    rules, car, cell, block = tables.rules[b], memory.car[b, n], memory.cell[b, n], memory.kept[b, n // BLOCK]
    net = rules.net
    pose = Pose(state.x[b, n], state.y[b, n], state.c[b, n], state.s[b, n])
    half_road = t.half_width[net]
    segment, off2 = _look_up(pose.x, pose.y, t, rules, cell)
    v = cell.vertex
    away2 = vertex_distance2(t, net, v, pose.x, pose.y)
    at = v if away2 < rules.radius * rules.radius else -1
    round_body = rules.half_length + rules.half_width == 0.0
    body2 = away2 if round_body else _distance2_to_vertex(t, rules, v, pose)
    crosses = v if body2 < rules.cross2 else -1

    before = np.int64(labels.bits[b, n])
    lane_before, crossed = labels.lane[b, n], labels.crosses[b, n]
    lane = -1
    turned = False
    if at >= 0:
        forget_lane(car)
    else:
        lane, fresh = lane_here(t, net, labels.at[b, n], lane_before, segment, off2, pose)
        lane, car.progress, car.lateral, turned = along_lane(
            t, net, lane, fresh, min(car.top, car.held_top), rules.turn_back, pose
        )
        keep_tops(car, fresh or turned, before & FLAG.OVERTAKING != 0)
    bits = _entry_flags(tick, t, rules, crosses, crossed, lane_before, before) | (FLAG.TURNED if turned else 0)
    if off2 <= half_road * half_road:
        bits |= FLAG.ON_ROAD
    if lane != lane_before:
        bits &= ~FLAG.STOPPED
        car.approach_since = -1
        car.wait_since = -1
        _change_lists(n, lane_before, lane, memory.car[b], memory.head[b])
    labels.segment[b, n] = segment
    labels.at[b, n] = at
    labels.crosses[b, n] = crosses
    labels.lane[b, n] = lane
    note_growth(block, n, tick, lane, lane != lane_before, car.top, rules)
    memory.growth[b, growth_row(tick, rules), n] = car.top
    labels.bits[b, n] = bits | still(block, n) | lingers(block, n)

    spare, outside = _reach(car, pose, v, lane, t, rules)
    passes = bits & (FLAG.LEFT | FLAG.OVERTAKING) != 0 or car.held_top < NEVER_AGAIN
    if not round_body or passes or (lane >= 0 and segment != lane // 2):
        spare = 0.0
    if not keep_road(block, n, lane, segment, v, car.lateral, outside, t, rules):
        spare = min(spare, abs(sqrt(off2) - half_road))
    keep_region(block, n, away2, spare, cell, car, rules)
    keep_arm(block, n, segment, away2, cell, t, net)
    return _change_crossing(crossed, crosses, memory.head[b])


@jit_inline
def _look_up(x: float, y: float, t: RoadTable, rules: TrialRules, cell: ValidCell) -> tuple[int, float]:
    """Return the nearest segment and the squared distance from it, by `cell`, which is found anew if it is not valid.

    `cell.vertex` is the nearest vertex if the disc about the body may meet that vertex's disc.
    """
    net = rules.net
    if not _is_in(cell, x, y):
        valid_cell(t, net, x, y, sqrt(rules.cross2) + rules.half_length + rules.half_width, cell)
    segment = cell.segment
    if segment >= 0:
        return segment, distance2(t, net, segment, x, y)
    return nearest_arm(t, net, cell.vertex, x, y)


@jit_look
def _is_in(cell: ValidCell, x: float, y: float) -> bool:
    """Tell whether a point is in the rectangle in which `cell` is valid."""
    return cell.low_x < x < cell.high_x and cell.low_y < y < cell.high_y


@jit_inline
def _reach(car: CarMemory, pose: Pose, v: int, lane: int, t: RoadTable, rules: TrialRules) -> tuple[float, float]:
    """Find how far to the left the body reaches in its lane, and how far it is from the crossing ahead.

    Returns metres that a round body may move before it comes to where cars approach and queue, if the crossing is not
    v, the nearest vertex; 0 where it is there. And metres before the end of its lane up to which, along the lane, it
    certainly does not come there, if these are told apart from the first, which is then FARTHEST; else 0.

    Norm: docs/rules.md#progress.
    """
    net = rules.net
    round_body = rules.half_length + rules.half_width == 0.0
    reach = 0.0
    gap2 = -1.0
    zone = 0
    spare = FARTHEST
    outside = 0.0
    if lane >= 0:
        half = rules.rounding
        if not round_body:
            tx, ty = lane_direction_at(t, net, lane, pose.x, pose.y)
            half = half_extent(tx, ty, pose.c, pose.s, rules)
        reach = car.lateral + half
        end = lane_end(t, net, lane)
        if t.degree[t.vert_off[net] + end] >= rules.crossing_degree:
            gap2 = vertex_distance2(t, net, end, pose.x, pose.y)
            if not round_body:
                gap2 = _distance2_to_vertex(t, rules, end, pose)
            outer2 = max(rules.stop2, rules.queue2)
            outer = sqrt(outer2) + CERTAIN
            road = t.segment[int(t.seg_off[net]) + (lane >> 1)]
            to_go = road.length - car.progress
            if road.piece < 0 and end != v and to_go > outer + CERTAIN:
                outside = outer
            elif end != v:
                spare = max(sqrt(gap2) - outer, 0.0)
            zone = 1 if rules.cross2 <= gap2 <= outer2 else 0
    car.reach = reach
    car.gap2 = gap2
    car.zone = zone
    return spare, outside


@jit_inline
def _distance2_to_vertex(t: RoadTable, rules: TrialRules, v: int, pose: Pose) -> float:
    """Return the squared distance of intersection v from a body without its rounding, square metres."""
    row = int(t.vert_off[rules.net]) + v
    px, py = t.vertex[row].x, t.vertex[row].y
    return distance2_to_body(px, py, pose.x, pose.y, pose.c, pose.s, rules.half_length, rules.half_width)


@jit_inline
def _entry_flags(
    tick: int, t: RoadTable, rules: TrialRules, crosses: int, crossed: int, lane_before: int, before: Any
) -> Any:
    """Return HELD_FLAGS of the flags of the frame `before`, and the flags of the disc that the body meets.

    The body meets the disc of vertex `crosses` and met that of `crossed`, -1 for none; an entry is judged by `before`.

    Norm: docs/rules.md#crossing, docs/rules.md#enter.
    """
    bits = before & HELD_FLAGS
    if crosses < 0:
        return bits & ~FLAG.BREACH3
    crossing = t.degree[t.vert_off[rules.net] + crosses] >= rules.crossing_degree
    if crosses != crossed:
        bits &= ~FLAG.BREACH3
        if tick > 0:
            bits |= FLAG.ENTERED
        if crossing and tick > 0 and rules.judged3 != 0:
            rightly = before & RULE3 == FLAG.STOPPED | FLAG.CLEAR
            if not (rightly and lane_end(t, rules.net, lane_before) == crosses):
                bits |= FLAG.BREACH3
    if crossing:
        bits |= FLAG.IN_CROSSING
    return bits


@jit_inline
def moved2(b: int, n: int, tick: int, ago: int, x: float, y: float, memory: Memory) -> float:
    """Return the squared distance of the centre (x, y) from where it was `ago` ticks before; huge in earlier ticks."""
    if tick < ago:
        return 1e300
    then = (tick - ago) % memory.trail_x.shape[1]
    dx = x - memory.trail_x[b, then, n]
    dy = y - memory.trail_y[b, then, n]
    return dx * dx + dy * dy


@jit_inline
def _change_crossing(crossed: int, crosses: int, head: Rows[Heads]) -> bool:
    """Update `Heads.crossers` if the vertex that a car crosses has changed from `crossed`; tell whether it has."""
    if crosses == crossed:
        return False
    if crossed >= 0:
        head[crossed].crossers -= 1
    if crosses >= 0:
        head[crosses].crossers += 1
    return True


@jit
def _change_lists(n: int, before: int, lane: int, cars: Rows[CarMemory], head: Rows[Heads]) -> None:
    """Move car n from the list of the lane `before` to that of `lane`; -1 for none."""
    if before >= 0:
        other = head[before].lane
        if other == n:
            head[before].lane = cars[n].next_in_lane
        else:
            while cars[other].next_in_lane != n:
                other = cars[other].next_in_lane
            cars[other].next_in_lane = cars[n].next_in_lane
    if lane >= 0:
        cars[n].next_in_lane = head[lane].lane
        head[lane].lane = n


@jit
def put_in_order(first: Heads, cars: Rows[CarMemory]) -> None:
    """Sort the list of the cars (N,) of a lane, which begins with `first.lane`, foremost first."""
    n = first.lane
    first.lane = -1
    while n >= 0:
        following = cars[n].next_in_lane
        _enter_in_lane(n, first, cars)
        n = following


@jit_inline
def _enter_in_lane(n: int, first: Heads, cars: Rows[CarMemory]) -> None:
    """Insert car n into the sorted list of its lane."""
    car = cars[n]
    progress = car.progress
    behind = first.lane
    ahead = -1
    while behind >= 0 and cars[behind].progress > progress:
        ahead = behind
        behind = cars[behind].next_in_lane
    car.next_in_lane = behind
    if ahead < 0:
        first.lane = n
    else:
        cars[ahead].next_in_lane = n
