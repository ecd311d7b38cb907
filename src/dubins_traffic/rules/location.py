"""Where a car is in a frame: segment, disc and lane state; and the lists by which others find it.

Most cars hold on to what they had in the frame before (`rules.label_cache`); this is for the others.
"""

from __future__ import annotations

from math import sqrt
from typing import Any

import numpy as np

from dubins_traffic.cars.state import Labels, State
from dubins_traffic.kernels.arrays import Floats
from dubins_traffic.kernels.compile import jit, jit_inline
from dubins_traffic.roads.lookup import (
    distance2,
    lane_direction,
    lane_end,
    nearest_arm,
    valid_cell,
    vertex_distance2,
)
from dubins_traffic.roads.table import RoadTable
from dubins_traffic.rules.label_cache import FARTHEST, KEPT, hold, lingers, note_growth, still, trust_fork
from dubins_traffic.rules.lane_state import lane_state
from dubins_traffic.rules.propositions import (
    AHEAD,
    BREACH3,
    CLEAR,
    ENTERED,
    IN_CROSSING,
    LEFT,
    ON_ROAD,
    STOPPED,
    TURNED,
)
from dubins_traffic.rules.shape import distance2_to_body, half_extent
from dubins_traffic.rules.tables import (
    APPROACH_SINCE,
    CROSS2,
    CROSSERS,
    CROSSING_DEGREE,
    GAP2,
    HALF_LENGTH,
    HALF_WIDTH,
    JUDGED3,
    LANE,
    LATERAL,
    NET,
    NEXT_IN_LANE,
    NOW,
    PROGRESS,
    QUEUE2,
    RADIUS,
    REACH,
    ROUNDING,
    STOP2,
    TOP,
    TURN_BACK,
    VALID_CELL_HIGH_X,
    VALID_CELL_HIGH_Y,
    VALID_CELL_LOW_X,
    VALID_CELL_LOW_Y,
    VALID_CELL_SEGMENT,
    VALID_CELL_VERTEX,
    WAIT_SINCE,
    ZONE,
    Memory,
    RuleTable,
)

RULE3 = STOPPED | CLEAR | AHEAD


@jit_inline
def locate(
    b: int, n: int, tick: int, state: State, t: RoadTable, rules: RuleTable, labels: Labels, memory: Memory
) -> bool:
    """Find segment, disc and lane state of a car, whether it was still and lingers; enter it in the lists.

    Of the flags of the frame before those that hold on are kept, and BREACH3 is judged by them. Tells whether the car
    crosses another vertex than before, or one or none for the first time.
    """
    real = rules.real
    net: int = rules.whole[b, NET]
    x, y, c, s = state.x[b, n], state.y[b, n], state.c[b, n], state.s[b, n]
    half_length, half_width = real[b, HALF_LENGTH], real[b, HALF_WIDTH]
    v, segment, off2, surely = _look_up(
        net, x, y, sqrt(real[b, CROSS2]) + half_length + half_width, t, memory.valid_cell[b, n]
    )
    away2 = vertex_distance2(t, net, v, x, y)
    at = v if away2 < real[b, RADIUS] * real[b, RADIUS] else -1
    round_body = half_length + half_width == 0.0
    body2 = away2
    if not round_body:
        body2 = distance2_to_vertex(t, net, v, x, y, c, s, half_length, half_width)
    crosses = v if body2 < real[b, CROSS2] else -1

    before = np.int64(labels.bits[b, n])
    bits = before & KEPT
    lane_before = labels.lane[b, n]
    lane, top, progress, lateral, turned = lane_state(
        t,
        net,
        at,
        labels.at[b, n],
        lane_before,
        memory.measure[b, n, TOP],
        segment,
        off2,
        x,
        y,
        c,
        s,
        real[b, TURN_BACK],
    )
    bits = _entry(b, tick, t, rules, crosses, labels.crosses[b, n], lane_before, before, bits)
    if off2 <= t.half_width[net] * t.half_width[net]:
        bits |= ON_ROAD
    if turned:
        bits |= TURNED
    if lane != lane_before:
        bits &= ~STOPPED
        memory.mark[b, n, APPROACH_SINCE] = -1
        memory.mark[b, n, WAIT_SINCE] = -1
        _change_lists(b, n, lane_before, lane, memory)
    stirs = _change_crossing(b, int(labels.crosses[b, n]), crosses, memory)
    labels.segment[b, n] = segment
    labels.at[b, n] = at
    labels.crosses[b, n] = crosses
    labels.lane[b, n] = lane
    note_growth(b, n, tick, lane, lane != lane_before, top, rules, memory)
    labels.bits[b, n] = bits | still(b, n, memory) | lingers(b, n, memory)

    measure = memory.measure[b, n]
    measure[TOP] = top
    measure[PROGRESS] = progress
    measure[LATERAL] = lateral
    spare = _reach(b, n, x, y, c, s, v, lane, lateral, t, rules, memory)
    if not round_body or bits & LEFT != 0 or (lane >= 0 and segment != lane // 2):
        spare = 0.0
    if lane < 0:
        spare = min(spare, abs(sqrt(off2) - t.half_width[net]))
    hold(b, n, x, y, away2, lane, spare, t, rules, memory)
    trust_fork(n, x, y, surely, memory.kept[b])
    return stirs


@jit_inline
def _look_up(
    net: int, x: float, y: float, radius: float, t: RoadTable, row: Floats
) -> tuple[int, int, float, float]:
    """Return (vertex, segment, off2, surely): the nearest of each, by the valid_cell in `row`, which is renewed if
    need be.

    The vertex is the nearest one if any is within `radius` metres. off2 is the squared distance from the segment, which
    is the nearest for `surely` metres along x and along y, as long as the valid_cell holds.
    """
    if not (
        row[VALID_CELL_LOW_X] < x < row[VALID_CELL_HIGH_X]
        and row[VALID_CELL_LOW_Y] < y < row[VALID_CELL_HIGH_Y]
    ):
        valid_cell(t, net, x, y, radius, row)
    v = int(row[VALID_CELL_VERTEX])
    segment = int(row[VALID_CELL_SEGMENT])
    if segment >= 0:
        return v, segment, distance2(t, net, segment, x, y), FARTHEST
    segment, off2, surely = nearest_arm(t, net, v, x, y)
    return v, segment, off2, surely


@jit_inline
def _reach(
    b: int, n: int, x: float, y: float, c: float, s: float, v: int, lane: int, lateral: float, t: RoadTable,
    rules: RuleTable, memory: Memory,
) -> float:  # fmt: skip
    """Find how far to the left the body reaches in its lane, and how far it is from the crossing ahead.

    Returns metres that a round body may move before it comes to where cars approach and queue, if the crossing is not
    v, the nearest vertex; 0 where it is there.
    """
    net: int = rules.whole[b, NET]
    real = rules.real[b]
    half_length, half_width = real[HALF_LENGTH], real[HALF_WIDTH]
    round_body = half_length + half_width == 0.0
    reach = 0.0
    gap2 = -1.0
    zone = 0
    spare = FARTHEST
    if lane >= 0:
        half = real[ROUNDING]
        if not round_body:
            tx, ty = lane_direction(t, net, lane)
            half = half_extent(tx, ty, c, s, half_length, half_width, half)
        reach = lateral + half
        end = lane_end(t, net, lane)
        if t.degree[t.vert_off[net] + end] >= rules.whole[b, CROSSING_DEGREE]:
            gap2 = vertex_distance2(t, net, end, x, y)
            if not round_body:
                gap2 = distance2_to_vertex(t, net, end, x, y, c, s, half_length, half_width)
            outer2 = max(real[STOP2], real[QUEUE2])
            if end != v:
                spare = max(sqrt(gap2) - sqrt(outer2), 0.0)
            zone = 1 if real[CROSS2] <= gap2 <= outer2 else 0
    memory.measure[b, n, REACH] = reach
    memory.measure[b, n, GAP2] = gap2
    memory.mark[b, n, ZONE] = zone
    return spare


@jit_inline
def distance2_to_vertex(
    t: RoadTable, net: int, v: int, x: float, y: float, c: float, s: float, half_length: float, half_width: float
) -> float:  # fmt: skip
    """Return the squared distance of an intersection from a body without its rounding."""
    row = t.vert_off[net] + v
    return distance2_to_body(
        float(t.vert[row, 0]), float(t.vert[row, 1]), x, y, c, s, half_length, half_width
    )


@jit_inline
def _entry(
    b: int,
    tick: int,
    t: RoadTable,
    rules: RuleTable,
    crosses: int,
    crossed: int,
    lane_before: int,
    before: Any,
    bits: Any,
) -> Any:
    """Return `bits` with the flags of the disc that the body meets; an entry is judged on the flags `before`."""
    if crosses < 0:
        return bits & ~BREACH3
    net: int = rules.whole[b, NET]
    crossing = t.degree[t.vert_off[net] + crosses] >= rules.whole[b, CROSSING_DEGREE]
    if crosses != crossed:
        bits &= ~BREACH3
        if tick > 0:
            bits |= ENTERED
        if crossing and tick > 0 and rules.whole[b, JUDGED3] != 0:
            rightly = before & RULE3 == STOPPED | CLEAR
            if not (rightly and lane_end(t, net, lane_before) == crosses):
                bits |= BREACH3
    if crossing:
        bits |= IN_CROSSING
    return bits


@jit_inline
def moved2(b: int, n: int, tick: int, x: float, y: float, ago: int, memory: Memory) -> float:
    """Return the squared distance of the centre (x, y) from where it was `ago` ticks before; huge before that."""
    if tick < ago:
        return 1e300
    trail = memory.trail
    then = memory.head[b, 0, NOW] - ago
    if then < 0:
        then += trail.shape[1]
    dx = x - trail[b, then, 0, n]
    dy = y - trail[b, then, 1, n]
    return dx * dx + dy * dy


@jit_inline
def _change_crossing(b: int, crossed: int, crosses: int, memory: Memory) -> bool:
    """Count a car that crosses another vertex, or one or none for the first time; tell whether it does."""
    if crosses == crossed:
        return False
    if crossed >= 0:
        memory.head[b, crossed, CROSSERS] -= 1
    if crosses >= 0:
        memory.head[b, crosses, CROSSERS] += 1
    return True


@jit
def _change_lists(b: int, n: int, before: int, lane: int, memory: Memory) -> None:
    """Take car n from the list of the lane `before` to that of `lane`; -1 for none."""
    link = memory.link[b]
    if before >= 0:
        other = memory.head[b, before, LANE]
        if other == n:
            memory.head[b, before, LANE] = link[n, NEXT_IN_LANE]
        else:
            while link[other, NEXT_IN_LANE] != n:
                other = link[other, NEXT_IN_LANE]
            link[other, NEXT_IN_LANE] = link[n, NEXT_IN_LANE]
    if lane >= 0:
        link[n, NEXT_IN_LANE] = memory.head[b, lane, LANE]
        memory.head[b, lane, LANE] = n


@jit
def put_in_order(b: int, lane: int, memory: Memory) -> None:
    """Bring the list of the cars of a lane into order, foremost first."""
    n = memory.head[b, lane, LANE]
    memory.head[b, lane, LANE] = -1
    while n >= 0:
        following = memory.link[b, n, NEXT_IN_LANE]
        _enter_in_lane(b, n, lane, memory)
        n = following


@jit_inline
def _enter_in_lane(b: int, n: int, lane: int, memory: Memory) -> None:
    """Put car n into the list of its lane, foremost first."""
    link, measure = memory.link[b], memory.measure[b]
    progress = measure[n, PROGRESS]
    behind = memory.head[b, lane, LANE]
    ahead = -1
    while behind >= 0 and measure[behind, PROGRESS] > progress:
        ahead = behind
        behind = link[behind, NEXT_IN_LANE]
    link[n, NEXT_IN_LANE] = behind
    if ahead < 0:
        memory.head[b, lane, LANE] = n
    else:
        link[ahead, NEXT_IN_LANE] = n
