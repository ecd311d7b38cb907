"""Whether a car in a disc may leave it (RULES, *phi_env*, E4)."""

from __future__ import annotations

from math import sqrt

from dubins_traffic.cars.near import Spacing, list_near, ticks_within
from dubins_traffic.cars.state import Labels, State
from dubins_traffic.kernels.arrays import Ints
from dubins_traffic.kernels.compile import jit_inline, jit_inner
from dubins_traffic.roads.lookup import lane_coordinates, lane_direction
from dubins_traffic.roads.table import RoadTable
from dubins_traffic.spec.blocking import obstacle_narrows
from dubins_traffic.spec.docket import EXIT2, EXIT_GAP, LANE_MIDDLE, LONE, NEAR2, Terms
from dubins_traffic.spec.obstacles import ObstacleLanes
from dubins_traffic.spec.shape import distance2_to_body, half_extent
from dubins_traffic.spec.tables import (
    FREE_NEEDED,
    GRAIN,
    HALF_LENGTH,
    HALF_WIDTH,
    LANE_WIDTH,
    LEFT_SET,
    NET,
    RADIUS,
    ROUNDING,
    RuleTable,
)


@jit_inner
def find_exit(
    b: int,
    n: int,
    v: int,
    crowd: Ints,
    count: int,
    state: State,
    t: RoadTable,
    obstacles: ObstacleLanes,
    rules: RuleTable,
    terms: Terms,
    labels: Labels,
) -> bool:
    """Do what `look_for_exit` does, by a look at each lane and each of the first `count` cars of `crowd`."""
    real = rules.real[b]
    net: int = rules.whole[b, NET]
    row = t.vert_off[net] + v
    vx, vy = t.vert[row, 0], t.vert[row, 1]
    mouth, middle = real[RADIUS], terms.real[b, LANE_MIDDLE]
    taken = 0
    for i in range(count):
        k = crowd[i]
        x, y, c, s = state.x[b, k], state.y[b, k], state.c[b, k], state.s[b, k]
        near2 = distance2_to_body(vx, vy, x, y, c, s, real[HALF_LENGTH], real[HALF_WIDTH])
        if k == n or near2 > terms.real[b, EXIT2]:
            continue
        for arm in range(t.degree[row]):
            lane = t.arms[row, arm]
            along, lateral = lane_coordinates(t, net, lane, x, y)
            in_the_way = False
            if labels.at[b, k] == v:
                own, own_lateral = lane_coordinates(t, net, lane, state.x[b, n], state.y[b, n])
                far2 = (along - mouth) * (along - mouth) + (lateral + middle) * (lateral + middle)
                own2 = (own - mouth) * (own - mouth) + (own_lateral + middle) * (own_lateral + middle)
                in_the_way = far2 < own2
            elif labels.segment[b, k] == lane // 2:
                tx, ty = lane_direction(t, net, lane)
                half = half_extent(tx, ty, c, s, real[HALF_LENGTH], real[HALF_WIDTH], real[ROUNDING])
                in_the_way = lateral - half < -real[LEFT_SET]
            if in_the_way:
                taken |= 1 << arm
    for arm in range(t.degree[row]):
        if taken & (1 << arm) != 0:
            continue
        lane: int = t.arms[row, arm]
        length = t.seg[t.seg_off[net] + lane // 2, 4]
        far = mouth + terms.real[b, EXIT_GAP]
        if obstacles.base[b] < 0 or not obstacle_narrows(
            obstacles, b, lane, length, mouth, far, real[LANE_WIDTH], real[FREE_NEEDED]
        ):
            return True
    return False


@jit_inline
def look_for_exit(
    b: int,
    n: int,
    tick: int,
    v: int,
    spacing: Spacing,
    state: State,
    t: RoadTable,
    obstacles: ObstacleLanes,
    rules: RuleTable,
    terms: Terms,
    labels: Labels,
) -> tuple[bool, int]:
    """E4: tell whether car n, whose body meets the disc of v, may leave by some lane, and when to ask again.

    Who is near with his centre outside the disc is in the way to one lane at most. Where fewer are near than there are
    lanes, an exit is free until another one can have come near, or into the disc.
    """
    row = t.vert_off[rules.whole[b, NET]] + v
    vx, vy = t.vert[row, 0], t.vert[row, 1]
    far2, lone = terms.real[b, NEAR2], terms.real[b, LONE]
    near = 0
    nearest2 = beyond2 = lone * lone
    count = list_near(state, b, tick, float(vx), float(vy), lone, spacing)
    for i in range(count):
        k = spacing.near[i]
        if k == n:
            continue
        dx = state.x[b, k] - vx
        dy = state.y[b, k] - vy
        d2 = dx * dx + dy * dy
        near += 1 if d2 <= far2 else 0
        near += 4 if labels.at[b, k] == v else 0
        nearest2 = min(nearest2, d2)
        beyond2 = min(beyond2, d2 if d2 > far2 else beyond2)
    if near < t.degree[row] and obstacles.base[b] < 0:
        spare = min(sqrt(nearest2) - rules.real[b, RADIUS], sqrt(beyond2) - sqrt(far2)) - GRAIN
        return True, tick + ticks_within(spare, spacing, b)
    return find_exit(b, n, v, spacing.near, count, state, t, obstacles, rules, terms, labels), tick + 1
