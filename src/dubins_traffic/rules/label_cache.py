"""Which cars hold on to their labels in a frame, found for all cars of a trial at once (compiled).

Cars move a little in a tick. So with its labels a rectangle about a car is kept, a ring about the nearest vertex, and a
strip of its lane, in which the labels are the same for certain; there only its progress and whether it was still are
found anew.

What is kept stands in `Memory.kept`, in columns a fixed number of cars apart, and nothing in the loop over the cars is
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
    VALID_CELL_HIGH_X,
    VALID_CELL_HIGH_Y,
    VALID_CELL_LOW_X,
    VALID_CELL_LOW_Y,
    VALID_CELL_VERTEX,
    VALID_HIGH_X,
    VALID_HIGH_Y,
    VALID_LOW_X,
    VALID_LOW_Y,
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
    """Return where car n stands in the first column of a row of `Memory.kept`; column k is k * BLOCK farther."""
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
    kept = memory.kept[b]
    for first in range(0, state.count[b], BLOCK):
        begin = first * CALM
        here = min(state.count[b] - first, BLOCK)
        for k in range(begin, begin + ((here + WIDE - 1) & -WIDE)):
            x = kept[k + BLOCK * HERE_X]
            y = kept[k + BLOCK * HERE_Y]
            inside = (kept[k + BLOCK * VALID_LOW_X] < x) & (x < kept[k + BLOCK * VALID_HIGH_X])
            inside &= (kept[k + BLOCK * VALID_LOW_Y] < y) & (y < kept[k + BLOCK * VALID_HIGH_Y])
            rx = x - kept[k + BLOCK * VERTEX_X]
            ry = y - kept[k + BLOCK * VERTEX_Y]
            away2 = rx * rx + ry * ry
            inside &= (kept[k + BLOCK * RING_LOW] < away2) & (away2 < kept[k + BLOCK * RING_HIGH])
            rx = x - kept[k + BLOCK * FROM_X]
            ry = y - kept[k + BLOCK * FROM_Y]
            along = rx * kept[k + BLOCK * AXIS_X] + ry * kept[k + BLOCK * AXIS_Y]
            progress = kept[k + BLOCK * BASE] + kept[k + BLOCK * SIGN] * along
            top = kept[k + BLOCK * TOP_SO_FAR]
            inside &= (top - progress < back) & (kept[k + BLOCK * ALONG_LOW] < along)
            inside &= along < kept[k + BLOCK * ALONG_HIGH]
            aside = kept[k + BLOCK * AXIS_X] * ry - kept[k + BLOCK * AXIS_Y] * rx
            inside &= (kept[k + BLOCK * ASIDE_LOW] < aside) & (aside < kept[k + BLOCK * ASIDE_HIGH])
            half = kept[k + BLOCK * FORK_SURE]
            rx = x - kept[k + BLOCK * THEN_X]
            ry = y - kept[k + BLOCK * THEN_Y]
            kept[k + BLOCK * AWAY2] = away2
            kept[k + BLOCK * WAY_SO_FAR] = progress
            top = max(top, progress)
            kept[k + BLOCK * TOP_SO_FAR] = top
            then = growth[first + k - begin]
            growth[first + k - begin] = top
            kept[k + BLOCK * TOP_THEN] = then
            little = (now >= kept[k + BLOCK * LINGERS_FROM]) & (top - then < least)
            kept[k + BLOCK * WAS_LINGERING] = 1.0 if little else 0.0
            sure = (abs(x - kept[k + BLOCK * FORK_X]) < half) & (abs(y - kept[k + BLOCK * FORK_Y]) < half)
            holds = 1.0 if sure else IF_NEAREST
            kept[k + BLOCK * HOLDS] = holds if inside else 0.0
            kept[k + BLOCK * WAS_STILL] = 1.0 if rx * rx + ry * ry <= still2 else 0.0


@jit_inline
def _bring(b: int, tick: int, state: State, rules: RuleTable, memory: Memory) -> None:
    """Put where the cars are, and where they were `stand_time` ago, beside what is kept of them."""
    depth, places = memory.trail.shape[1], memory.trail.shape[3]
    now = tick % depth
    then = (now + depth - rules.whole[b, STAND_TICKS]) % depth
    memory.head[b, 0, NOW] = now
    kept = memory.kept[b]
    x, y, present, past = state.x[b], state.y[b], memory.trail[b, now], memory.trail[b, then]
    if places % TOGETHER == 0:
        for n in range(0, places, TOGETHER):
            k = place(n)
            _copy(past[0], n, kept, k + BLOCK * THEN_X)
            _copy(past[1], n, kept, k + BLOCK * THEN_Y)
            _copy(x, n, kept, k + BLOCK * HERE_X)
            _copy(y, n, kept, k + BLOCK * HERE_Y)
            _copy(x, n, present[0], n)
            _copy(y, n, present[1], n)
        return
    for n in range(places):
        k = place(n)
        kept[k + BLOCK * THEN_X] = past[0, n]
        kept[k + BLOCK * THEN_Y] = past[1, n]
        kept[k + BLOCK * HERE_X] = present[0, n] = x[n]
        kept[k + BLOCK * HERE_Y] = present[1, n] = y[n]


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
    return STILL if memory.kept[b, place(n) + BLOCK * WAS_STILL] != 0.0 else 0


@jit_inline
def lingers(b: int, n: int, memory: Memory) -> int:
    """Return LINGERS if car n lingers, else 0; after `look_who_holds`, or `note_growth` for who doesn't hold on."""
    return LINGERS if memory.kept[b, place(n) + BLOCK * WAS_LINGERING] != 0.0 else 0


@jit_inline
def note_growth(
    b: int, n: int, tick: int, lane: int, fresh: bool, top: float, rules: RuleTable, memory: Memory
) -> None:
    """Find whether a car lingers that has been located in `lane` (-1: none), which was set in this frame if `fresh`."""
    kept = memory.kept[b]
    k = place(n)
    if lane < 0:
        kept[k + BLOCK * LINGERS_FROM] = NEVER_AGAIN
    elif fresh:
        kept[k + BLOCK * LINGERS_FROM] = float(tick + rules.whole[b, LINGER_TICKS])
    long = tick >= kept[k + BLOCK * LINGERS_FROM]
    little = top - kept[k + BLOCK * TOP_THEN] < rules.real[b, LINGER_GROWTH]
    kept[k + BLOCK * WAS_LINGERING] = 1.0 if long and little else 0.0
    memory.growth[b, growth_row(b, tick, rules), n] = top


@jit_inline
def holds_on(b: int, n: int, t: RoadTable, rules: RuleTable, labels: Labels, memory: Memory) -> bool:
    """Label a car of which it is known that all is as in the frame before but what changes with every metre.

    Returns False, and does nothing that matters, where it is not known. After `look_who_holds`.
    """
    kept = memory.kept[b]
    k = place(n)
    holds = kept[k + BLOCK * HOLDS]
    if holds == 0.0:
        return False
    if holds == IF_NEAREST:
        x, y = kept[k + BLOCK * HERE_X], kept[k + BLOCK * HERE_Y]
        segment, _, surely = nearest_arm(
            t, rules.whole[b, NET], int(memory.valid_cell[b, n, VALID_CELL_VERTEX]), x, y
        )
        if segment != labels.segment[b, n]:
            return False
        trust_fork(n, x, y, surely, kept)
    measure = memory.measure[b, n]
    measure[TOP] = kept[k + BLOCK * TOP_SO_FAR]
    measure[PROGRESS] = kept[k + BLOCK * WAY_SO_FAR]
    if memory.mark[b, n, ZONE] != 0:
        measure[GAP2] = kept[k + BLOCK * AWAY2]
    labels.bits[b, n] = np.int64(labels.bits[b, n]) & CALMLY | still(b, n, memory) | lingers(b, n, memory)
    return True


@jit_inline
def hold(
    b: int, n: int, x: float, y: float, away2: float, lane: int, spare: float, t: RoadTable, rules: RuleTable,
    memory: Memory,
) -> None:  # fmt: skip
    """Keep where a car that has been located is sure to hold on to its labels.

    It does while it is less than `spare` metres from (x, y), in the valid_cell, where the squared distance from its
    vertex compares with all radii that matter as `away2` does, the nearest road is the same, and it is no farther
    aside in its lane than `_keep_strip` says.
    """
    net: int = rules.whole[b, NET]
    row = memory.valid_cell[b, n]
    kept = memory.kept[b]
    k = place(n)
    half = 0.7 * spare - CERTAIN
    kept[k + BLOCK * VALID_LOW_X] = max(row[VALID_CELL_LOW_X], x - half)
    kept[k + BLOCK * VALID_HIGH_X] = min(row[VALID_CELL_HIGH_X], x + half)
    kept[k + BLOCK * VALID_LOW_Y] = max(row[VALID_CELL_LOW_Y], y - half)
    kept[k + BLOCK * VALID_HIGH_Y] = min(row[VALID_CELL_HIGH_Y], y + half)
    vertex = t.vert_off[net] + int(row[VALID_CELL_VERTEX])
    kept[k + BLOCK * VERTEX_X] = float(t.vert[vertex, 0])
    kept[k + BLOCK * VERTEX_Y] = float(t.vert[vertex, 1])
    _keep_ring(k, away2, rules.real[b], kept)
    _keep_axis(k, net, lane, t, kept)
    _keep_strip(b, n, lane, t, rules, memory)
    kept[k + BLOCK * TOP_SO_FAR] = memory.measure[b, n, TOP]


@jit_inline
def trust_fork(n: int, x: float, y: float, surely: float, kept: Floats) -> None:
    """Keep that the nearest road is the same up to `surely` metres from (x, y), along x and along y."""
    k = place(n)
    kept[k + BLOCK * FORK_X] = x
    kept[k + BLOCK * FORK_Y] = y
    kept[k + BLOCK * FORK_SURE] = surely


@jit_inline
def _keep_ring(k: int, away2: float, real: Floats, kept: Floats) -> None:
    """Keep between which squared distances of its vertex a car is at `away2`: of its discs, and who approaches it."""
    low = -1.0
    high = FARTHEST * FARTHEST
    outer2 = max(real[STOP2], real[QUEUE2])
    for edge2 in (real[RADIUS] * real[RADIUS], real[CROSS2], outer2):
        if edge2 <= away2:
            low = max(low, edge2)
        else:
            high = min(high, edge2)
    kept[k + BLOCK * RING_LOW] = low
    kept[k + BLOCK * RING_HIGH] = high


@jit_inline
def _keep_axis(k: int, net: int, lane: int, t: RoadTable, kept: Floats) -> None:
    """Keep the segment along which a car makes progress, as `roads.lookup.lane_coordinates` measures it."""
    row = t.seg_off[net] + (max(lane, 0) >> 1)
    back = lane >= 0 and lane & 1 != 0
    kept[k + BLOCK * FROM_X] = t.seg[row, 0]
    kept[k + BLOCK * FROM_Y] = t.seg[row, 1]
    kept[k + BLOCK * AXIS_X] = t.seg[row, 2]
    kept[k + BLOCK * AXIS_Y] = t.seg[row, 3]
    kept[k + BLOCK * BASE] = t.seg[row, 4] if back else 0.0
    kept[k + BLOCK * SIGN] = 0.0 if lane < 0 else (-1.0 if back else 1.0)


@jit_inline
def _keep_strip(b: int, n: int, lane: int, t: RoadTable, rules: RuleTable, memory: Memory) -> None:
    """Keep how far to the left of its segment a car is on the road as it is now and not left, and where that holds."""
    net: int = rules.whole[b, NET]
    kept = memory.kept[b]
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
    kept[k + BLOCK * ASIDE_LOW] = low
    kept[k + BLOCK * ASIDE_HIGH] = high
    kept[k + BLOCK * ALONG_LOW] = begin
    kept[k + BLOCK * ALONG_HIGH] = end
