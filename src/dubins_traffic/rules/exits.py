"""Whether a car in a disc may leave it (docs/rules.md#E4): the lanes out of it, and what takes them."""

from __future__ import annotations

from math import sqrt

from dubins_traffic.cars.near import Spacing, list_near, ticks_within
from dubins_traffic.cars.state import EGO, Labels, State
from dubins_traffic.kernels.arrays import Ints
from dubins_traffic.kernels.compile import jit_inline, jit_inner
from dubins_traffic.roads.lookup import lane_coordinates
from dubins_traffic.roads.table import RoadTable
from dubins_traffic.rules.blocking import obstacle_narrows
from dubins_traffic.rules.breach_log import (
    CAME_BY,
    EXIT2,
    EXIT_GAP,
    GOAL_GAP,
    LANE_MIDDLE,
    LONE,
    BreachLog,
    RefereeParameters,
)
from dubins_traffic.rules.obstacles import ObstacleLanes
from dubins_traffic.rules.tables import (
    CROSSING_DEGREE,
    FREE_NEEDED,
    GRAIN,
    LANE_WIDTH,
    NET,
    RADIUS,
    RuleTable,
)


@jit_inline
def _is_bend(b: int, v: int, t: RoadTable, rules: RuleTable) -> bool:
    """Tell whether v is neither a crossing nor a dead end."""
    degree = t.degree[t.vert_off[rules.whole[b, NET]] + v]
    return bool(2 <= degree < rules.whole[b, CROSSING_DEGREE])


@jit_inline
def way_back(b: int, v: int, came: int, t: RoadTable, rules: RuleTable) -> int:
    """Return the segment that is no exit of v for a car that came by the lane `came` (-1: none): at bends only."""
    return came // 2 if came >= 0 and _is_bend(b, v, t, rules) else -1


@jit_inline
def _passes_by(b: int, k: int, back: int, breach_log: BreachLog) -> bool:
    """Tell whether car k, in a bend, is an e-agent that came there by another segment than `back`.

    So cars that meet in a bend, each before the other's exit, do not excuse each other.
    """
    came = breach_log.clock[b, k, CAME_BY]
    return k != EGO and came >= 0 and came // 2 != back


@jit_inline
def stands_in_exit(
    b: int, k: int, lane: int, along: float, lateral: float, away2: float, far2: float, rules: RuleTable,
    labels: Labels,
) -> bool:  # fmt: skip
    """Tell whether the centre of car k, at (along, lateral) of the lane `lane` out of a disc, is in it and near by.

    It is outside the disc, and `away2` is its squared distance from the intersection: near by is up to `far2`.
    """
    inside = -rules.real[b, LANE_WIDTH] - GRAIN <= lateral <= GRAIN
    return inside and along > 0.0 and labels.segment[b, k] == lane // 2 and away2 <= far2


@jit_inline
def to_mouth(b: int, along: float, lateral: float, rules: RuleTable, terms: RefereeParameters) -> float:
    """Return how far (along, lateral) of a lane out of a disc is from where the lane leaves the disc, metres."""
    far, aside = along - rules.real[b, RADIUS], lateral + terms.real[b, LANE_MIDDLE]
    return sqrt(far * far + aside * aside)


@jit_inner
def find_exit(
    b: int,
    n: int,
    v: int,
    back: int,
    crowd: Ints,
    count: int,
    state: State,
    t: RoadTable,
    obstacles: ObstacleLanes,
    rules: RuleTable,
    terms: RefereeParameters,
    labels: Labels,
    breach_log: BreachLog,
) -> bool:
    """Tell whether some lane out of v, but for that on segment `back`, is free for car n.

    At a bend `back` is the segment by which n came or comes. All that may be near are among the first `count` cars of
    `crowd`.
    """
    real = rules.real[b]
    bend = _is_bend(b, v, t, rules)
    net: int = rules.whole[b, NET]
    row = t.vert_off[net] + v
    vx, vy = t.vert[row, 0], t.vert[row, 1]
    taken = 0
    for i in range(count):
        k = crowd[i]
        x, y = state.x[b, k], state.y[b, k]
        away2 = (x - vx) * (x - vx) + (y - vy) * (y - vy)
        inside = labels.at[b, k] == v
        if k == n or away2 > terms.real[b, EXIT2] or (inside and bend and _passes_by(b, k, back, breach_log)):
            continue
        for arm in range(t.degree[row]):
            lane = t.arms[row, arm]
            along, lateral = lane_coordinates(t, net, lane, x, y)
            if inside:
                own, own_lateral = lane_coordinates(t, net, lane, state.x[b, n], state.y[b, n])
                own_way = to_mouth(b, own, own_lateral, rules, terms)
                in_the_way = to_mouth(b, along, lateral, rules, terms) < own_way + GRAIN
            else:
                in_the_way = stands_in_exit(
                    b, k, lane, along, lateral, away2, terms.real[b, EXIT2], rules, labels
                )
            if in_the_way:
                taken |= 1 << arm
    for arm in range(t.degree[row]):
        lane: int = t.arms[row, arm]
        if taken & (1 << arm) != 0 or lane // 2 == back:
            continue
        length = t.seg[t.seg_off[net] + lane // 2, 4]
        mouth = real[RADIUS]
        far = mouth + terms.real[b, EXIT_GAP]
        if obstacles.base[b] < 0 or not obstacle_narrows(
            obstacles, b, lane, length, mouth, far, real[LANE_WIDTH], real[FREE_NEEDED] + GRAIN
        ):
            return True
    return False


@jit_inline
def look_for_exit(
    b: int,
    n: int,
    tick: int,
    v: int,
    back: int,
    spacing: Spacing,
    state: State,
    t: RoadTable,
    obstacles: ObstacleLanes,
    rules: RuleTable,
    terms: RefereeParameters,
    labels: Labels,
    breach_log: BreachLog,
) -> tuple[bool, int]:
    """E4: tell whether car n, whose body meets the disc of v, may leave by some lane, and when to ask again.

    That on segment `back` is no exit. Who is near with his centre outside the disc is in the way to one lane at most.
    Where fewer are near than there are lanes, an exit is free until another one can have come near, or into the disc.
    """
    row = t.vert_off[rules.whole[b, NET]] + v
    vx, vy = t.vert[row, 0], t.vert[row, 1]
    far2, lone = terms.real[b, EXIT2], terms.real[b, LONE]
    near = 0 if back < 0 else 1
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
    free = find_exit(
        b, n, v, back, spacing.near, count, state, t, obstacles, rules, terms, labels, breach_log
    )
    return free, tick + 1


@jit_inner
def ego_at_exit(
    b: int,
    v: int,
    back: int,
    state: State,
    t: RoadTable,
    rules: RuleTable,
    terms: RefereeParameters,
    labels: Labels,
) -> bool:
    """E6: tell whether the ego is near an exit of v, of which that on segment `back` is none.

    It is near if its centre is near to where the lane leaves the disc, or in the lane and near the disc.
    """
    net: int = rules.whole[b, NET]
    row = t.vert_off[net] + v
    x, y = state.x[b, EGO], state.y[b, EGO]
    dx, dy = x - t.vert[row, 0], y - t.vert[row, 1]
    far = rules.real[b, RADIUS] + terms.real[b, GOAL_GAP]
    for arm in range(t.degree[row]):
        lane: int = t.arms[row, arm]
        if lane // 2 == back:
            continue
        along, lateral = lane_coordinates(t, net, lane, x, y)
        takes = labels.at[b, EGO] != v and stands_in_exit(
            b, EGO, lane, along, lateral, dx * dx + dy * dy, far * far, rules, labels
        )
        if takes or to_mouth(b, along, lateral, rules, terms) <= terms.real[b, GOAL_GAP]:
            return True
    return False
