"""Cars and obstacles on a segment that leave too little of a right lane free.

What stands: docs/rules.md#stands. What blocks: docs/rules.md#blocked.
"""

from __future__ import annotations

from dubins_traffic.kernels.compile import jit
from dubins_traffic.rules.obstacles import ObstacleLanes


@jit
def narrows(low: float, high: float, lane_width: float, needed: float) -> bool:
    """Tell whether a thing over the lateral interval [low, high] leaves less than `needed` of the right lane.

    The right lane lies over [-lane_width, 0]; what does not reach into it leaves all of it. Else the larger of
    the gaps on the two sides of the thing counts.
    """
    if high <= -lane_width or low >= 0.0:
        return False
    return max(low + lane_width, -high) < needed


@jit
def obstacle_narrows(
    obstacles: ObstacleLanes,
    b: int,
    lane: int,
    length: float,
    near: float,
    far: float,
    lane_width: float,
    needed: float,
) -> bool:
    """Tell whether an obstacle narrows `lane` where its progress is in [near, far].

    An obstacle's lateral interval is the hull of its parts within that reach of the lane; its edges are clipped.
    """
    base: int = obstacles.base[b]
    if base < 0:
        return False
    begin = max(near, 0.0)
    end = min(far, length)
    segment = lane // 2
    k = obstacles.start[base + segment]
    stop = obstacles.start[base + segment + 1]
    while k < stop:
        owner = obstacles.owner[k]
        low = 1e300
        high = -1e300
        while k < stop and obstacles.owner[k] == owner:
            s0, l0 = obstacles.part[k, 0], obstacles.part[k, 1]
            s1, l1 = obstacles.part[k, 2], obstacles.part[k, 3]
            if lane % 2 == 1:
                s0, l0, s1, l1 = length - s0, -l0, length - s1, -l1
            part_low, part_high = _clipped(s0, l0, s1, l1, obstacles.part[k, 4], begin, end)
            low = min(low, part_low)
            high = max(high, part_high)
            k += 1
        if low <= high and narrows(low, high, lane_width, needed):
            return True
    return False


@jit
def _clipped(
    s0: float, l0: float, s1: float, l1: float, rounding: float, begin: float, end: float
) -> tuple[float, float]:
    """Return the lateral interval of a part within [begin, end]; an empty one if it lies beyond.

    A part is the line from (s0, l0) to (s1, l1) grown by `rounding`; with a rounding it is not clipped.
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
