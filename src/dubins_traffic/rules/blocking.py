"""Cars and obstacles on a segment that leave too little of a right lane free.

What stands: docs/rules.md#stands. What blocks: docs/rules.md#blocked.
"""

from __future__ import annotations

from typing import NamedTuple

from dubins_traffic.cars.state import State
from dubins_traffic.kernels.compile import jit, jit_inline, jit_rare
from dubins_traffic.roads.lookup import lane_coordinates, lane_direction_at
from dubins_traffic.roads.table import RoadTable
from dubins_traffic.rules.obstacles import ObstacleLanes
from dubins_traffic.rules.shape import half_across
from dubins_traffic.rules.tables import TrialRules


class RightLane(NamedTuple):
    """The right lane of `lane` in trial `trial`: `length` metres long, `width` metres wide."""

    trial: int
    lane: int
    length: float
    width: float


@jit_inline
def lane_of(t: RoadTable, rules: TrialRules, b: int, lane: int) -> RightLane:
    """Return the right lane of `lane` in trial b, whose rules are `rules`."""
    return RightLane(b, lane, t.segment[int(t.seg_off[rules.net]) + (lane >> 1)].length, rules.lane_width)


@jit_inline
def place_in_lane(
    b: int, k: int, lane: int, state: State, t: RoadTable, rules: TrialRules
) -> tuple[float, float, float]:
    """Return the progress in `lane` of car `k` (number) of trial b, and the lateral interval of its body, metres."""
    x, y = state.x[b, k], state.y[b, k]
    progress, lateral = lane_coordinates(t, rules.net, lane, x, y)
    tx, ty = lane_direction_at(t, rules.net, lane, x, y)
    half = half_across(b, k, tx, ty, state, rules)
    return progress, lateral - half, lateral + half


@jit
def narrows(low: float, high: float, lane_width: float, needed: float) -> bool:
    """Tell whether a body over the lateral interval [low, high] leaves less than `needed` (m) of the right lane free.

    The right lane lies over [-lane_width, 0]; a body outside it leaves all of it free. Otherwise the larger of the gaps
    on the two sides of the body counts.
    """
    if high <= -lane_width or low >= 0.0:
        return False
    return max(low + lane_width, -high) < needed


@jit_rare
def obstacle_narrows(obstacles: ObstacleLanes, place: RightLane, near: float, far: float, needed: float) -> bool:
    """Tell whether an obstacle leaves less than `needed` metres of a right lane free between two places along it.

    The stretch is from `near` (m) to `far` (m) along the lane. The lateral interval of an obstacle is the hull of its
    parts there; edges are clipped to the stretch.
    """
    base: int = obstacles.base[place.trial]
    if base < 0:
        return False
    begin = max(near, 0.0)
    end = min(far, place.length)
    segment = place.lane // 2
    back = place.lane % 2 == 1
    k: int = obstacles.start[base + segment]
    stop: int = obstacles.start[base + segment + 1]
    while k < stop:
        owner = obstacles.part[k].owner
        low = 1e300
        high = -1e300
        while k < stop and obstacles.part[k].owner == owner:
            part = obstacles.part[k]
            s0, l0, s1, l1 = part.s0, part.l0, part.s1, part.l1
            if back:
                s0, l0, s1, l1 = place.length - s0, -l0, place.length - s1, -l1
            part_low, part_high = _clipped(s0, l0, s1, l1, part.rounding, begin, end)
            low = min(low, part_low)
            high = max(high, part_high)
            k += 1
        if low <= high and narrows(low, high, place.width, needed):
            return True
    return False


@jit
def _clipped(
    s0: float, l0: float, s1: float, l1: float, rounding: float, begin: float, end: float
) -> tuple[float, float]:
    """Return the lateral interval of an obstacle's part within [begin, end] along the lane; empty if it lies beyond.

    The part is the line from (s0, l0) to (s1, l1) grown by `rounding`; a part with a rounding is not clipped.
    """
    if s0 > s1:
        s0, l0, s1, l1 = s1, l1, s0, l0
    if s1 + rounding < begin or s0 - rounding > end or begin > end:
        return 1e300, -1e300
    if rounding == 0.0 and s1 > s0:
        slope = (l1 - l0) / (s1 - s0)
        if s1 > end:
            l1 = l0 + (end - s0) * slope
        if s0 < begin:
            l0 = l0 + (begin - s0) * slope
    return min(l0, l1) - rounding, max(l0, l1) + rounding
