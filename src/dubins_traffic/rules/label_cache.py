"""The label cache: finds for all cars of a trial at once which cached labels are still valid (compiled).

Cars move little in a tick. So with a car's labels regions are kept in which the labels are certain to be the same: a
rectangle about the car, a ring about the nearest vertex, and a strip of its lane. Within them only the car's progress,
and whether it is still or lingers, is found anew.

The regions stand in `Memory.kept`, in columns (`kernels.records`), and the loops over cars have no branches, so that
the compiler works on several cars at once.
"""

from __future__ import annotations

import numpy as np

from dubins_traffic.cars.clip_and_move import TOGETHER, copy_together
from dubins_traffic.cars.state import Labels, State
from dubins_traffic.kernels.arrays import BLOCK, WIDE, Floats
from dubins_traffic.kernels.compile import jit_inline, jit_look
from dubins_traffic.roads.lookup import CERTAIN, ValidCell, nearest_arm
from dubins_traffic.roads.table import RoadTable
from dubins_traffic.rules.propositions import FLAG
from dubins_traffic.rules.tables import NEVER_AGAIN, CarMemory, Memory, TrialRules, ValidRegions

HELD_FLAGS = FLAG.LEFT | FLAG.OVERTAKING | FLAG.STOPPED | FLAG.BREACH3
"""Flags that a car keeps from the frame before until something changes them."""
CACHED_FLAGS = HELD_FLAGS | FLAG.ON_ROAD | FLAG.IN_CROSSING | FLAG.CLEAR
"""Flags of a car that are valid as long as its cached labels are; other cars may still change some of them."""
IF_NEAREST = 2.0
"""Value of `ValidRegions.holds`: the labels are valid if the nearest of the roads at the vertex is the same."""
FARTHEST = 100.0
"""Metres beyond which distances to what changes labels are not told apart."""


@jit_inline
def check_label_caches(b: int, tick: int, state: State, rules: TrialRules, memory: Memory) -> None:
    """Find which cars of trial b have valid cached labels, and which are still; store where all cars are.

    Of cars with valid labels it also finds which linger, and stores their greatest progress.
    """
    _load_positions(b, tick, state, rules, memory)
    still2 = rules.stand_move2 if tick >= rules.stand_ticks else -1.0
    growth = memory.growth[b, growth_row(tick, rules)]
    count = state.count[b]
    for first in range(0, count, BLOCK):
        here = min(count - first, BLOCK)
        last = (here + WIDE - 1) & -WIDE
        block = memory.kept[b, first // BLOCK]
        _check_valid_regions(block, last, rules.turn_back)
        _check_motion(block, growth[first : first + last], float(tick), rules.linger_growth, still2)


@jit_inline
def _check_valid_regions(block: ValidRegions, last: int, back: float) -> None:
    """Find which of the first `last` cars of a block have valid labels, their progress, and its maximum so far.

    `back` is how far progress may fall, metres.
    """
    here_x, here_y, vertex_x, vertex_y = block.here_x, block.here_y, block.vertex_x, block.vertex_y
    low_x, high_x, low_y, high_y = (
        block.valid_low_x,
        block.valid_high_x,
        block.valid_low_y,
        block.valid_high_y,
    )
    ring_low, ring_high, from_x, from_y = block.ring_low, block.ring_high, block.from_x, block.from_y
    axis_x, axis_y, base, sign = block.axis_x, block.axis_y, block.base, block.sign
    along_low, along_high, aside_low, aside_high = (
        block.along_low, block.along_high, block.aside_low, block.aside_high,
    )  # fmt: skip
    arm_x, arm_y, right_x, right_y = block.arm_x, block.arm_y, block.right_x, block.right_y
    left_x, left_y, arm_least, tops = block.left_x, block.left_y, block.arm_least, block.top_so_far
    away, way, holds = block.away2, block.way_so_far, block.holds
    for k in range(last):
        x = here_x[k]
        y = here_y[k]
        inside = (low_x[k] < x) & (x < high_x[k])
        inside &= (low_y[k] < y) & (y < high_y[k])
        rx = x - vertex_x[k]
        ry = y - vertex_y[k]
        away2 = rx * rx + ry * ry
        inside &= (ring_low[k] < away2) & (away2 < ring_high[k])
        least = arm_least[k]
        sure = (rx * arm_x[k] + ry * arm_y[k] > least) & (rx * right_x[k] + ry * right_y[k] > least)
        sure &= rx * left_x[k] + ry * left_y[k] > least
        rx = x - from_x[k]
        ry = y - from_y[k]
        along = rx * axis_x[k] + ry * axis_y[k]
        progress = base[k] + sign[k] * along
        top = tops[k]
        inside &= (top - progress < back) & (along_low[k] < along)
        inside &= along < along_high[k]
        aside = axis_x[k] * ry - axis_y[k] * rx
        inside &= (aside_low[k] < aside) & (aside < aside_high[k])
        away[k] = away2
        way[k] = progress
        tops[k] = max(top, progress)
        held = 1.0 if sure else IF_NEAREST
        holds[k] = held if inside else 0.0


@jit_inline
def _check_motion(block: ValidRegions, growth: Floats, now: float, least: float, still2: float) -> None:
    """Find which of the first K cars of a block are still and which linger; store their greatest progress.

    `growth` (K,) holds the greatest progress `linger_time` ago, and is overwritten by the present one. A car whose
    greatest progress has grown by less than `least` (m) lingers. A car is still if it has moved at most `still2`, m2.
    """
    here_x, here_y, then_x, then_y = block.here_x, block.here_y, block.then_x, block.then_y
    tops, tops_then, lingers_from = block.top_so_far, block.top_then, block.lingers_from
    was_lingering, was_still = block.was_lingering, block.was_still
    for k in range(growth.shape[0]):
        rx = here_x[k] - then_x[k]
        ry = here_y[k] - then_y[k]
        top = tops[k]
        then = growth[k]
        growth[k] = top
        tops_then[k] = then
        little = (now >= lingers_from[k]) & (top - then < least)
        was_lingering[k] = 1.0 if little else 0.0
        was_still[k] = 1.0 if rx * rx + ry * ry <= still2 else 0.0


@jit_inline
def _load_positions(b: int, tick: int, state: State, rules: TrialRules, memory: Memory) -> None:
    """Copy the present positions of the cars, and those `stand_time` ago, into the blocks of trial b."""
    depth, places = memory.trail_x.shape[1], memory.trail_x.shape[2]
    now = tick % depth
    then = (now + depth - rules.stand_ticks) % depth
    x, y, now_x, now_y = state.x[b], state.y[b], memory.trail_x[b, now], memory.trail_y[b, now]
    past_x, past_y = memory.trail_x[b, then], memory.trail_y[b, then]
    for first in range(0, places, BLOCK):
        block = memory.kept[b, first // BLOCK]
        here_x, here_y, then_x, then_y = block.here_x, block.here_y, block.then_x, block.then_y
        last = min(places - first, BLOCK)
        if places % TOGETHER == 0:
            for k in range(0, last, TOGETHER):
                n = first + k
                copy_together(past_x, n, then_x, k)
                copy_together(past_y, n, then_y, k)
                copy_together(x, n, here_x, k)
                copy_together(y, n, here_y, k)
                copy_together(x, n, now_x, n)
                copy_together(y, n, now_y, n)
            continue
        for k in range(last):
            n = first + k
            then_x[k] = past_x[n]
            then_y[k] = past_y[n]
            here_x[k] = now_x[n] = x[n]
            here_y[k] = now_y[n] = y[n]


@jit_inline
def growth_row(tick: int, rules: TrialRules) -> int:
    """Return the row of `Memory.growth` for frame `tick`; until it is overwritten it holds that `linger_time` ago."""
    return tick % max(rules.linger_ticks, 1)


@jit_inline
def still(block: ValidRegions, n: int) -> int:
    """Return STILL if car n of this block is still, else 0; to be called after `check_label_caches`."""
    return FLAG.STILL if block.was_still[n & (BLOCK - 1)] != 0.0 else 0


@jit_inline
def lingers(block: ValidRegions, n: int) -> int:
    """Return LINGERS if car n of this block lingers, else 0.

    To be called after `check_label_caches`, or, for a car whose labels were not valid, after `note_growth`.
    """
    return FLAG.LINGERS if block.was_lingering[n & (BLOCK - 1)] != 0.0 else 0


@jit_inline
def note_growth(block: ValidRegions, n: int, tick: int, lane: int, fresh: bool, top: float, rules: TrialRules) -> None:
    """Find whether car n, just located in `lane` (-1: none), lingers; `fresh`: that lane was set in this frame.

    `top` is its greatest progress, metres, which the caller has to write to `Memory.growth`.

    Norm: docs/rules.md#lingers.
    """
    k = n & (BLOCK - 1)
    if lane < 0:
        block.lingers_from[k] = NEVER_AGAIN
    elif fresh:
        block.lingers_from[k] = float(tick + rules.linger_ticks)
    long = tick >= block.lingers_from[k]
    little = top - block.top_then[k] < rules.linger_growth
    block.was_lingering[k] = 1.0 if long and little else 0.0


@jit_look
def relabel_from_cache(b: int, n: int, t: RoadTable, rules: TrialRules, labels: Labels, memory: Memory) -> bool:
    """Relabel car n of trial b if its cached labels are valid: update progress and flags only.

    Returns False, and leaves the labels alone, if they may be invalid. To be called after `check_label_caches`.
    """
    block = memory.kept[b, n // BLOCK]
    k = n & (BLOCK - 1)
    holds = block.holds[k]
    if holds == 0.0:
        return False
    if holds == IF_NEAREST:
        x, y = block.here_x[k], block.here_y[k]
        segment, _ = nearest_arm(t, rules.net, memory.cell[b, n].vertex, x, y)
        if segment != labels.segment[b, n]:
            return False
    car = memory.car[b, n]
    car.top = block.top_so_far[k]
    car.progress = block.way_so_far[k]
    if car.zone != 0:
        car.gap2 = block.away2[k]
    labels.bits[b, n] = np.int64(labels.bits[b, n]) & CACHED_FLAGS | still(block, n) | lingers(block, n)
    return True


@jit_inline
def keep_region(
    block: ValidRegions,
    n: int,
    away2: float,
    spare: float,
    cell: ValidCell,
    car: CarMemory,
    rules: TrialRules,
) -> None:
    """Store the region in which the labels of car n, just located, are valid, apart from its lane's strip.

    They are valid less than `spare` metres from its present place, in its valid cell, and where the squared distance
    from its vertex lies between the same radii as `away2`. To be called after `lane_cache.keep_road`.
    """
    k = n & (BLOCK - 1)
    x, y = block.here_x[k], block.here_y[k]
    half = 0.7 * spare - CERTAIN
    block.valid_low_x[k] = max(cell.low_x, x - half)
    block.valid_high_x[k] = min(cell.high_x, x + half)
    block.valid_low_y[k] = max(cell.low_y, y - half)
    block.valid_high_y[k] = min(cell.high_y, y + half)
    block.top_so_far[k] = car.top
    _keep_ring(block, k, away2, rules)


@jit_inline
def forget_region(block: ValidRegions, n: int) -> None:
    """Let the labels of car n be found anew in the next frame."""
    block.valid_low_x[n & (BLOCK - 1)] = NEVER_AGAIN


@jit_inline
def _keep_ring(block: ValidRegions, k: int, away2: float, rules: TrialRules) -> None:
    """Store the ring about a car's vertex that holds `away2`: between the radii of disc, crossing and approach."""
    low = -1.0
    high = FARTHEST * FARTHEST
    outer2 = max(rules.stop2, rules.queue2)
    for edge2 in (rules.radius * rules.radius, rules.cross2, outer2):
        if edge2 <= away2:
            low = max(low, edge2)
        else:
            high = min(high, edge2)
    block.ring_low[k] = low
    block.ring_high[k] = high
