"""How far the ego of a trial stays from breaking rules 1 and 2, compiled: the least values over its frames."""

from __future__ import annotations

from math import sqrt
from typing import TYPE_CHECKING, Any, Final, NamedTuple

import numpy as np

from dubins_traffic.kernels.arrays import Floats, Ints
from dubins_traffic.kernels.compile import jit
from dubins_traffic.logic.temporal import ticks
from dubins_traffic.roads.lookup import distance2, lane_coordinates, lane_direction, nearest_segment
from dubins_traffic.roads.table import RoadTable
from dubins_traffic.rules.propositions import LEFT, ON_ROAD, OVERTAKING

if TYPE_CHECKING:
    from collections.abc import Sequence

    from dubins_traffic.cars.tables import CarTable
    from dubins_traffic.rules.parameters import RuleParameters

INFINITE = float("inf")
LEFT_SET, LEFT_RELEASE = 0, 1
ROAD: Final = 0
LINE: Final = 1
RETURN: Final = 2
MARGINS: Final = 3
"""Columns of what is found: the margins of 1.road, 2.left and 2.return."""


class MarginTable(NamedTuple):
    """What the margins of each trial depend on.

    `line` (B, 2): where `left` rises and where it falls, metres; `window` (B,): ticks within which the ego must be
    back; `signal` (F,): scratch for the longest trial.
    """

    line: Floats
    window: Ints
    signal: Floats


def margin_table(
    rules: Sequence[RuleParameters], periods: Sequence[float], index: Ints, frames: int
) -> MarginTable:
    """Return the table of trials of up to `frames` frames; trial b has the rules and the period of number index[b]."""
    line = np.array([(own.left_set, own.left_release) for own in rules], dtype=np.float64)
    window = [ticks(own.left_time, period) for own, period in zip(rules, periods, strict=True)]
    return MarginTable(
        line[index],
        np.array(window, dtype=np.int64)[index],
        np.zeros(frames),
    )


@jit
def find_margins(
    trials: Ints, frames: Ints, pose: Floats, mark: Ints, nets: Ints, roads: RoadTable, cars: CarTable,
    table: MarginTable, found: Floats,
) -> None:  # fmt: skip
    """Write the margins of some trials into `found` (B, MARGINS); infinite where nothing could break a rule.

    Parameters
    ----------
    trials, frames : (K,)
        Which trials, and how many frames each has.
    pose : (B, F, 4)
        x, y, cosine and sine of the ego.
    mark : (B, F, 2)
        Its flags and lane state.
    nets : (B,)
        Number of each trial's road network.
    roads, cars, table
        The tables of all trials.
    found : (B, MARGINS)
        Written to.
    """
    for k in range(trials.shape[0]):
        b = trials[k]
        _find_margin(b, frames[k], pose[b], mark[b], nets[b], roads, cars, table, found[b])


@jit
def _find_margin(
    b: Any, frames: Any, pose: Floats, mark: Ints, net: Any, roads: RoadTable, cars: CarTable, table: MarginTable,
    found: Floats,
) -> None:  # fmt: skip
    half_road = roads.half_width[net]
    begun = False
    line = INFINITE
    segment = 0
    farthest = -1.0
    for f in range(frames):
        x, y, bits = pose[f, 0], pose[f, 1], mark[f, 0]
        if bits & ON_ROAD != 0:
            begun = True
        # No segment is farther than the one that was nearest before, so often none need be looked for.
        if begun and distance2(roads, net, segment, x, y) > farthest:
            segment, square = nearest_segment(roads, net, x, y)
            farthest = max(farthest, square)
        right = -_beyond(b, pose[f], mark[f], net, roads, cars, table)
        table.signal[f] = right
        if bits & OVERTAKING == 0:
            line = min(line, right)
    found[ROAD] = half_road - sqrt(farthest) if begun else INFINITE
    found[LINE] = line
    found[RETURN] = _least_of_greatest(table.signal, frames, table.window[b])


@jit
def _beyond(
    b: Any, pose: Floats, mark: Ints, net: Any, roads: RoadTable, cars: CarTable, table: MarginTable
) -> Any:
    """Return how far the body reaches over the line that `left` looks at, metres; -inf without a lane state."""
    lane = mark[1]
    if lane < 0:
        return -INFINITE
    tx, ty = lane_direction(roads, net, lane)
    c, s = pose[2], pose[3]
    half = abs(c * ty - s * tx) * cars.half_length[b] + abs(c * tx + s * ty) * cars.half_width[b]
    _, lateral = lane_coordinates(roads, net, lane, pose[0], pose[1])
    risen = mark[0] & LEFT != 0
    return lateral + (half + cars.rounding[b]) - table.line[b, LEFT_RELEASE if risen else LEFT_SET]


@jit
def _least_of_greatest(signal: Floats, count: Any, window: Any) -> Any:
    """Return the least, over all frames, of the greatest value at the frame and up to `window` frames after it.

    The last frame has none after it, and what ends there is no less. Any other span counts only once all of it lies
    below the least so far, so it is looked at again only then.
    """
    least = signal[count - 1]
    high = -1
    for f in range(count):
        if signal[f] >= least:
            high = f
        elif f - high > window:
            high = f - window
            for g in range(high + 1, f + 1):
                if signal[g] >= signal[high]:
                    high = g
            least = signal[high]
    return least
