"""Which cars hold on to their labels in a frame, found for all cars of a trial at once (compiled).

Cars move a little in a tick. So with its labels a rectangle about a car is kept, a ring about the nearest vertex, and a
strip of its lane, in which the labels are the same for certain; there only its progress and whether it was still are
found anew.

What is kept stands in `Memory.calm`, in columns a fixed number of cars apart, and nothing in the loop over the cars is
a branch: so the compiler sees that several may be taken at once.
"""

from __future__ import annotations

import numpy as np

from dubins_traffic.cars.rows import TOGETHER
from dubins_traffic.cars.state import Labels, State
from dubins_traffic.kernels.arrays import BLOCK, WIDE, Floats
from dubins_traffic.kernels.compile import jit_inline
from dubins_traffic.roads.lookup import CERTAIN, nearest_arm
from dubins_traffic.roads.table import RoadTable
from dubins_traffic.rules.propositions import (
    BREACH3,
    CLEAR,
    IN_CROSSING,
    LEFT,
    LINGERS,
    ON_ROAD,
    OVERTAKING,
    STILL,
    STOPPED,
)
from dubins_traffic.rules.tables import (
    ALONG_HIGH,
    ALONG_LOW,
    ASIDE_HIGH,
    ASIDE_LOW,
    AWAY2,
    AXIS_X,
    AXIS_Y,
    BASE,
    CALM,
    CALM_HIGH_X,
    CALM_HIGH_Y,
    CALM_LOW_X,
    CALM_LOW_Y,
    CROSS2,
    FORK_SURE,
    FORK_X,
    FORK_Y,
    FROM_X,
    FROM_Y,
    GAP2,
    HERE_X,
    HERE_Y,
    HOLDS,
    LATERAL,
    LEFT_SET,
    LINGER_GROWTH,
    LINGER_TICKS,
    LINGERS_FROM,
    NET,
    NEVER_AGAIN,
    NOW,
    PATCH_HIGH_X,
    PATCH_HIGH_Y,
    PATCH_LOW_X,
    PATCH_LOW_Y,
    PATCH_VERTEX,
    PROGRESS,
    QUEUE2,
    RADIUS,
    RING_HIGH,
    RING_LOW,
    ROUNDING,
    SIGN,
    STAND_MOVE2,
    STAND_TICKS,
    STOP2,
    THEN_X,
    THEN_Y,
    TOP,
    TOP_SO_FAR,
    TOP_THEN,
    TURN_BACK,
    VERTEX_X,
    VERTEX_Y,
    WAS_LINGERING,
    WAS_STILL,
    WAY_SO_FAR,
    ZONE,
    Memory,
    RuleTable,
)

KEPT = LEFT | OVERTAKING | STOPPED | BREACH3
CALMLY = KEPT | ON_ROAD | IN_CROSSING | CLEAR
"""Flags of a car that holds on to its labels, but for those that others bring about."""
IF_NEAREST = 2.0
"""Value of HOLDS of a car that holds on to its labels if the nearest of the roads that meet is still the same."""
FARTHEST = 100.0
"""Metres up to which a place is said to be far from any that matters."""
HUGE = 1e300


@jit_inline
def place(n: int) -> int:
    """Return where car n stands in the first column of a row of `Memory.calm`; column k is k * BLOCK farther."""
    return (n & -BLOCK) * CALM + (n & (BLOCK - 1))


@jit_inline
def look_who_holds(b: int, tick: int, state: State, rules: RuleTable, memory: Memory) -> None:
    """Note where the cars of trial b are; find who holds on to its labels where no roads fork, and who was still.

    Of those who hold on it is found who lingers, too, and their greatest progress is kept.
    """
    _bring(b, tick, state, rules, memory)
    real = rules.real[b]
    back = real[TURN_BACK]
    still2 = real[STAND_MOVE2] if tick >= rules.whole[b, STAND_TICKS] else -1.0
    least, now = real[LINGER_GROWTH], float(tick)
    growth = memory.growth[b, growth_row(b, tick, rules)]
    calm = memory.calm[b]
    for first in range(0, state.count[b], BLOCK):
        begin = first * CALM
        here = min(state.count[b] - first, BLOCK)
        for k in range(begin, begin + ((here + WIDE - 1) & -WIDE)):
            x = calm[k + BLOCK * HERE_X]
            y = calm[k + BLOCK * HERE_Y]
            inside = (calm[k + BLOCK * CALM_LOW_X] < x) & (x < calm[k + BLOCK * CALM_HIGH_X])
            inside &= (calm[k + BLOCK * CALM_LOW_Y] < y) & (y < calm[k + BLOCK * CALM_HIGH_Y])
            rx = x - calm[k + BLOCK * VERTEX_X]
            ry = y - calm[k + BLOCK * VERTEX_Y]
            away2 = rx * rx + ry * ry
            inside &= (calm[k + BLOCK * RING_LOW] < away2) & (away2 < calm[k + BLOCK * RING_HIGH])
            rx = x - calm[k + BLOCK * FROM_X]
            ry = y - calm[k + BLOCK * FROM_Y]
            along = rx * calm[k + BLOCK * AXIS_X] + ry * calm[k + BLOCK * AXIS_Y]
            progress = calm[k + BLOCK * BASE] + calm[k + BLOCK * SIGN] * along
            top = calm[k + BLOCK * TOP_SO_FAR]
            inside &= (top - progress < back) & (calm[k + BLOCK * ALONG_LOW] < along)
            inside &= along < calm[k + BLOCK * ALONG_HIGH]
            aside = calm[k + BLOCK * AXIS_X] * ry - calm[k + BLOCK * AXIS_Y] * rx
            inside &= (calm[k + BLOCK * ASIDE_LOW] < aside) & (aside < calm[k + BLOCK * ASIDE_HIGH])
            half = calm[k + BLOCK * FORK_SURE]
            rx = x - calm[k + BLOCK * THEN_X]
            ry = y - calm[k + BLOCK * THEN_Y]
            calm[k + BLOCK * AWAY2] = away2
            calm[k + BLOCK * WAY_SO_FAR] = progress
            top = max(top, progress)
            calm[k + BLOCK * TOP_SO_FAR] = top
            then = growth[first + k - begin]
            growth[first + k - begin] = top
            calm[k + BLOCK * TOP_THEN] = then
            little = (now >= calm[k + BLOCK * LINGERS_FROM]) & (top - then < least)
            calm[k + BLOCK * WAS_LINGERING] = 1.0 if little else 0.0
            sure = (abs(x - calm[k + BLOCK * FORK_X]) < half) & (abs(y - calm[k + BLOCK * FORK_Y]) < half)
            holds = 1.0 if sure else IF_NEAREST
            calm[k + BLOCK * HOLDS] = holds if inside else 0.0
            calm[k + BLOCK * WAS_STILL] = 1.0 if rx * rx + ry * ry <= still2 else 0.0


@jit_inline
def _bring(b: int, tick: int, state: State, rules: RuleTable, memory: Memory) -> None:
    """Put where the cars are, and where they were `stand_time` ago, beside what is kept of them."""
    depth, places = memory.trail.shape[1], memory.trail.shape[3]
    now = tick % depth
    then = (now + depth - rules.whole[b, STAND_TICKS]) % depth
    memory.head[b, 0, NOW] = now
    calm = memory.calm[b]
    x, y, present, past = state.x[b], state.y[b], memory.trail[b, now], memory.trail[b, then]
    if places % TOGETHER == 0:
        for n in range(0, places, TOGETHER):
            k = place(n)
            _copy(past[0], n, calm, k + BLOCK * THEN_X)
            _copy(past[1], n, calm, k + BLOCK * THEN_Y)
            _copy(x, n, calm, k + BLOCK * HERE_X)
            _copy(y, n, calm, k + BLOCK * HERE_Y)
            _copy(x, n, present[0], n)
            _copy(y, n, present[1], n)
        return
    for n in range(places):
        k = place(n)
        calm[k + BLOCK * THEN_X] = past[0, n]
        calm[k + BLOCK * THEN_Y] = past[1, n]
        calm[k + BLOCK * HERE_X] = present[0, n] = x[n]
        calm[k + BLOCK * HERE_Y] = present[1, n] = y[n]


@jit_inline
def growth_row(b: int, tick: int, rules: RuleTable) -> int:
    """Return the row of `Memory.growth` that holds what was `linger_time` ago, until it holds what is now."""
    return tick % max(rules.whole[b, LINGER_TICKS], 1)


@jit_inline
def _copy(source: Floats, n: int, target: Floats, k: int) -> None:
    """Copy TOGETHER numbers at once: all are read before one is written."""
    first, second, third, fourth = source[n], source[n + 1], source[n + 2], source[n + 3]
    target[k], target[k + 1], target[k + 2], target[k + 3] = first, second, third, fourth


@jit_inline
def still(b: int, n: int, memory: Memory) -> int:
    """Return STILL if car n is near where it was `stand_time` ago, else 0; after `look_who_holds`."""
    return STILL if memory.calm[b, place(n) + BLOCK * WAS_STILL] != 0.0 else 0


@jit_inline
def lingers(b: int, n: int, memory: Memory) -> int:
    """Return LINGERS if car n lingers, else 0; after `look_who_holds`, or `note_growth` for who doesn't hold on."""
    return LINGERS if memory.calm[b, place(n) + BLOCK * WAS_LINGERING] != 0.0 else 0


@jit_inline
def note_growth(
    b: int, n: int, tick: int, lane: int, fresh: bool, top: float, rules: RuleTable, memory: Memory
) -> None:
    """Find whether a car lingers that has been located in `lane` (-1: none), which was set in this frame if `fresh`."""
    calm = memory.calm[b]
    k = place(n)
    if lane < 0:
        calm[k + BLOCK * LINGERS_FROM] = NEVER_AGAIN
    elif fresh:
        calm[k + BLOCK * LINGERS_FROM] = float(tick + rules.whole[b, LINGER_TICKS])
    long = tick >= calm[k + BLOCK * LINGERS_FROM]
    little = top - calm[k + BLOCK * TOP_THEN] < rules.real[b, LINGER_GROWTH]
    calm[k + BLOCK * WAS_LINGERING] = 1.0 if long and little else 0.0
    memory.growth[b, growth_row(b, tick, rules), n] = top


@jit_inline
def holds_on(b: int, n: int, t: RoadTable, rules: RuleTable, labels: Labels, memory: Memory) -> bool:
    """Label a car of which it is known that all is as in the frame before but what changes with every metre.

    Returns False, and does nothing that matters, where it is not known. After `look_who_holds`.
    """
    calm = memory.calm[b]
    k = place(n)
    holds = calm[k + BLOCK * HOLDS]
    if holds == 0.0:
        return False
    if holds == IF_NEAREST:
        x, y = calm[k + BLOCK * HERE_X], calm[k + BLOCK * HERE_Y]
        segment, _, surely = nearest_arm(t, rules.whole[b, NET], int(memory.patch[b, n, PATCH_VERTEX]), x, y)
        if segment != labels.segment[b, n]:
            return False
        trust_fork(n, x, y, surely, calm)
    measure = memory.measure[b, n]
    measure[TOP] = calm[k + BLOCK * TOP_SO_FAR]
    measure[PROGRESS] = calm[k + BLOCK * WAY_SO_FAR]
    if memory.mark[b, n, ZONE] != 0:
        measure[GAP2] = calm[k + BLOCK * AWAY2]
    labels.bits[b, n] = np.int64(labels.bits[b, n]) & CALMLY | still(b, n, memory) | lingers(b, n, memory)
    return True


@jit_inline
def hold(
    b: int, n: int, x: float, y: float, away2: float, lane: int, spare: float, t: RoadTable, rules: RuleTable,
    memory: Memory,
) -> None:  # fmt: skip
    """Keep where a car that has been located is sure to hold on to its labels.

    It does while it is less than `spare` metres from (x, y), in the patch, where the squared distance from its vertex
    compares with all radii that matter as `away2` does, the nearest road is the same, and it is no farther aside in its
    lane than `_keep_strip` says.
    """
    net: int = rules.whole[b, NET]
    row = memory.patch[b, n]
    calm = memory.calm[b]
    k = place(n)
    half = 0.7 * spare - CERTAIN
    calm[k + BLOCK * CALM_LOW_X] = max(row[PATCH_LOW_X], x - half)
    calm[k + BLOCK * CALM_HIGH_X] = min(row[PATCH_HIGH_X], x + half)
    calm[k + BLOCK * CALM_LOW_Y] = max(row[PATCH_LOW_Y], y - half)
    calm[k + BLOCK * CALM_HIGH_Y] = min(row[PATCH_HIGH_Y], y + half)
    vertex = t.vert_off[net] + int(row[PATCH_VERTEX])
    calm[k + BLOCK * VERTEX_X] = float(t.vert[vertex, 0])
    calm[k + BLOCK * VERTEX_Y] = float(t.vert[vertex, 1])
    _keep_ring(k, away2, rules.real[b], calm)
    _keep_axis(k, net, lane, t, calm)
    _keep_strip(b, n, lane, t, rules, memory)
    calm[k + BLOCK * TOP_SO_FAR] = memory.measure[b, n, TOP]


@jit_inline
def trust_fork(n: int, x: float, y: float, surely: float, calm: Floats) -> None:
    """Keep that the nearest road is the same up to `surely` metres from (x, y), along x and along y."""
    k = place(n)
    calm[k + BLOCK * FORK_X] = x
    calm[k + BLOCK * FORK_Y] = y
    calm[k + BLOCK * FORK_SURE] = surely


@jit_inline
def _keep_ring(k: int, away2: float, real: Floats, calm: Floats) -> None:
    """Keep between which squared distances of its vertex a car is at `away2`: of its discs, and who approaches it."""
    low = -1.0
    high = FARTHEST * FARTHEST
    outer2 = max(real[STOP2], real[QUEUE2])
    for edge2 in (real[RADIUS] * real[RADIUS], real[CROSS2], outer2):
        if edge2 <= away2:
            low = max(low, edge2)
        else:
            high = min(high, edge2)
    calm[k + BLOCK * RING_LOW] = low
    calm[k + BLOCK * RING_HIGH] = high


@jit_inline
def _keep_axis(k: int, net: int, lane: int, t: RoadTable, calm: Floats) -> None:
    """Keep the segment along which a car makes progress, as `roads.lookup.lane_coordinates` measures it."""
    row = t.seg_off[net] + (max(lane, 0) >> 1)
    back = lane >= 0 and lane & 1 != 0
    calm[k + BLOCK * FROM_X] = t.seg[row, 0]
    calm[k + BLOCK * FROM_Y] = t.seg[row, 1]
    calm[k + BLOCK * AXIS_X] = t.seg[row, 2]
    calm[k + BLOCK * AXIS_Y] = t.seg[row, 3]
    calm[k + BLOCK * BASE] = t.seg[row, 4] if back else 0.0
    calm[k + BLOCK * SIGN] = 0.0 if lane < 0 else (-1.0 if back else 1.0)


@jit_inline
def _keep_strip(b: int, n: int, lane: int, t: RoadTable, rules: RuleTable, memory: Memory) -> None:
    """Keep how far to the left of its segment a car is on the road as it is now and not left, and where that holds."""
    net: int = rules.whole[b, NET]
    calm = memory.calm[b]
    low = begin = -HUGE
    high = end = HUGE
    if lane >= 0:
        half = t.half_width[net]
        back = lane & 1 != 0
        lateral = memory.measure[b, n, LATERAL]
        aside = -lateral if back else lateral
        if abs(aside) <= half:
            low = CERTAIN - half
            high = half - CERTAIN
        elif aside > 0.0:
            low = half + CERTAIN
        else:
            high = -half - CERTAIN
        most = rules.real[b, LEFT_SET] - rules.real[b, ROUNDING] - CERTAIN
        if lateral >= most:
            low = high
        elif back:
            low = max(low, -most)
        else:
            high = min(high, most)
        begin = CERTAIN
        end = t.seg[t.seg_off[net] + (lane >> 1), 4] - CERTAIN
    k = place(n)
    calm[k + BLOCK * ASIDE_LOW] = low
    calm[k + BLOCK * ASIDE_HIGH] = high
    calm[k + BLOCK * ALONG_LOW] = begin
    calm[k + BLOCK * ALONG_HIGH] = end
