"""Where a car is in a frame: segment, disc, lane state, whether it was still; and the lists by which others find it."""

from __future__ import annotations

from typing import Any

import numpy as np

from dubins_traffic.cars.state import Labels, State
from dubins_traffic.kernels.compile import jit, jit_inline
from dubins_traffic.roads.lookup import (
    distance2,
    lane_direction,
    lane_end,
    patch,
    vertex_distance2,
)
from dubins_traffic.roads.table import RoadTable
from dubins_traffic.spec.lane_state import lane_state
from dubins_traffic.spec.propositions import (
    AHEAD,
    BREACH3,
    CLEAR,
    ENTERED,
    IN_CROSSING,
    LEFT,
    ON_ROAD,
    OVERTAKING,
    STILL,
    STOPPED,
    TURNED,
)
from dubins_traffic.spec.shape import distance2_to_body, half_extent
from dubins_traffic.spec.tables import (
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
    NEXT_ON_SEGMENT,
    NOW,
    PATCH_HIGH_X,
    PATCH_HIGH_Y,
    PATCH_LOW_X,
    PATCH_LOW_Y,
    PATCH_SEGMENT,
    PATCH_VERTEX,
    PROGRESS,
    RADIUS,
    REACH,
    ROUNDING,
    SEGMENT,
    STAND_MOVE2,
    STAND_TICKS,
    TOP,
    TURN_BACK,
    Memory,
    RuleTable,
)

RULE3 = STOPPED | CLEAR | AHEAD
KEPT = LEFT | OVERTAKING | STOPPED | BREACH3


@jit_inline
def locate(
    b: int, n: int, tick: int, state: State, t: RoadTable, rules: RuleTable, labels: Labels, memory: Memory
) -> None:
    """Find segment, disc and lane state of a car, and whether it was still; enter it in the lists.

    Of the flags of the frame before those that hold on are kept, and BREACH3 is judged by them.
    """
    real = rules.real
    net: int = rules.whole[b, NET]
    x, y, c, s = state.x[b, n], state.y[b, n], state.c[b, n], state.s[b, n]
    half_length, half_width = real[b, HALF_LENGTH], real[b, HALF_WIDTH]
    row = memory.patch[b, n]
    if not (row[PATCH_LOW_X] < x < row[PATCH_HIGH_X] and row[PATCH_LOW_Y] < y < row[PATCH_HIGH_Y]):
        patch(t, net, x, y, row)
    segment = int(row[PATCH_SEGMENT])
    v = int(row[PATCH_VERTEX])
    off2 = distance2(t, net, segment, x, y)
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
    labels.segment[b, n] = segment
    labels.at[b, n] = at
    labels.crosses[b, n] = crosses
    labels.lane[b, n] = lane
    labels.bits[b, n] = bits | _still(b, n, tick, x, y, rules, memory)

    measure = memory.measure[b, n]
    measure[TOP] = top
    measure[PROGRESS] = progress
    measure[LATERAL] = lateral
    if crosses >= 0:
        memory.head[crosses, CROSSERS] += 1
    memory.link[n, NEXT_ON_SEGMENT] = memory.head[segment, SEGMENT]
    memory.head[segment, SEGMENT] = n
    _reach(b, n, x, y, c, s, lane, lateral, t, rules, memory)


@jit_inline
def _reach(
    b: int, n: int, x: float, y: float, c: float, s: float, lane: int, lateral: float, t: RoadTable,
    rules: RuleTable, memory: Memory,
) -> None:  # fmt: skip
    """Find how far to the left the body reaches in its lane, and how far it is from the crossing ahead."""
    net: int = rules.whole[b, NET]
    real = rules.real[b]
    half_length, half_width = real[HALF_LENGTH], real[HALF_WIDTH]
    round_body = half_length + half_width == 0.0
    reach = 0.0
    gap2 = -1.0
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
        _enter_in_lane(b, n, lane, memory)
    memory.measure[b, n, REACH] = reach
    memory.measure[b, n, GAP2] = gap2


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
def _still(b: int, n: int, tick: int, x: float, y: float, rules: RuleTable, memory: Memory) -> int:
    """Remember where the car is; return STILL if it is near where it was `stand_time` ago, else 0."""
    trail = memory.trail
    now = memory.head[0, NOW]
    trail[b, now, n, 0] = x
    trail[b, now, n, 1] = y
    if moved2(b, n, tick, rules.whole[b, STAND_TICKS], memory) <= rules.real[b, STAND_MOVE2]:
        return STILL
    return 0


@jit_inline
def moved2(b: int, n: int, tick: int, ago: int, memory: Memory) -> float:
    """Return the squared distance of the centre from where it was `ago` ticks before; huge before that."""
    if tick < ago:
        return 1e300
    trail = memory.trail
    now = memory.head[0, NOW]
    then = now - ago
    if then < 0:
        then += trail.shape[1]
    dx = trail[b, now, n, 0] - trail[b, then, n, 0]
    dy = trail[b, now, n, 1] - trail[b, then, n, 1]
    return dx * dx + dy * dy


@jit
def _enter_in_lane(b: int, n: int, lane: int, memory: Memory) -> None:
    """Put car n into the list of its lane, foremost first."""
    progress = memory.measure[b, n, PROGRESS]
    behind = memory.head[lane, LANE]
    ahead = -1
    while behind >= 0 and memory.measure[b, behind, PROGRESS] > progress:
        ahead = behind
        behind = memory.link[behind, NEXT_IN_LANE]
    memory.link[n, NEXT_IN_LANE] = behind
    if ahead < 0:
        memory.head[lane, LANE] = n
    else:
        memory.link[ahead, NEXT_IN_LANE] = n
