"""The strip of its road in which a car's cached labels are valid (compiled).

`rules.label_cache` checks in every frame whether the car is still in it.
"""

from __future__ import annotations

from dubins_traffic.kernels.arrays import BLOCK
from dubins_traffic.kernels.compile import jit_inline, jit_rare
from dubins_traffic.roads.lookup import (
    CERTAIN,
    INFINITE,
    ValidCell,
    lane_direction,
    nearest_piece,
    straight_start,
)
from dubins_traffic.roads.table import RoadTable
from dubins_traffic.rules.tables import TrialRules, ValidRegions

HUGE = 1e300
BISECTED = 1e-4
"""About how near to the line where two roads are equally near the nearest one is looked for in every frame, metres."""


@jit_inline
def keep_road(
    block: ValidRegions, n: int, lane: int, segment: int, vertex: int, lateral: float, outside: float, t: RoadTable,
    rules: TrialRules,
) -> bool:  # fmt: skip
    """Store for car n, in a `block` (columns), its vertex and segment and the strip in which its labels are valid.

    `lateral` is the car's lateral offset in `lane` (-1: none), metres; the strip ends `outside` (m) before the end of
    the lane. Progress is measured as in `roads.lookup.lane_coordinates`. Tells whether in the whole strip the car is on
    the road, or off it, as it is now; False if that is not known.
    """
    k = n & (BLOCK - 1)
    net = rules.net
    place = int(t.vert_off[net]) + vertex
    block.vertex_x[k] = t.vertex[place].x
    block.vertex_y[k] = t.vertex[place].y
    row = int(t.seg_off[net]) + (lane >> 1 if lane >= 0 else segment)
    if t.segment[row].piece >= 0:
        return _keep_piece(block, k, lane, lateral, row, t, rules)
    length = t.segment[row].length
    back = lane >= 0 and lane & 1 != 0
    block.from_x[k] = t.segment[row].x
    block.from_y[k] = t.segment[row].y
    block.axis_x[k] = t.segment[row].tx
    block.axis_y[k] = t.segment[row].ty
    block.base[k] = length if back else 0.0
    block.sign[k] = 0.0 if lane < 0 else (-1.0 if back else 1.0)
    if lane >= 0:
        _keep_strip(block, k, back, lateral, outside, length, t.half_width[net], rules)
        return True
    return _keep_sides(block, k, length, t.half_width[net])


@jit_rare
def _keep_piece(
    block: ValidRegions, k: int, lane: int, lateral: float, row: int, t: RoadTable, rules: TrialRules
) -> bool:
    """Do as `keep_road` on a segment that bends, for a car on the road beside one of its lines; else store nothing."""
    net = rules.net
    place, _ = nearest_piece(t.piece, t.segment[row], block.here_x[k], block.here_y[k])
    piece = t.piece[place]
    back = lane >= 0 and lane & 1 != 0
    block.from_x[k], block.from_y[k] = piece.x, piece.y
    block.axis_x[k], block.axis_y[k] = piece.tx, piece.ty
    block.base[k] = piece.rest if back else piece.base
    block.sign[k] = 0.0 if lane < 0 else (-1.0 if back else 1.0)
    half = t.half_width[net]
    certain = _keep_sides(block, k, piece.length, half)
    rx = block.here_x[k] - piece.x
    ry = block.here_y[k] - piece.y
    if not certain or piece.side != 0.0 or abs(piece.tx * ry - piece.ty * rx) > half:
        block.along_low[k] = HUGE
        return False
    if lane >= 0:
        _keep_strip(block, k, back, lateral, 0.0, piece.length, half, rules)
    return True


@jit_inline
def _keep_strip(
    block: ValidRegions, k: int, back: bool, lateral: float, outside: float, length: float, half: float,
    rules: TrialRules,
) -> None:  # fmt: skip
    """Store the strip in which a car is on the road, or off it, as it is now, and not left.

    The segment is `length` metres long and its road reaches `half` metres to each side.
    """
    low, high = -HUGE, HUGE
    aside = -lateral if back else lateral
    if abs(aside) <= half:
        low = CERTAIN - half
        high = half - CERTAIN
    elif aside > 0.0:
        low = half + CERTAIN
    else:
        high = -half - CERTAIN
    most = rules.left_set - rules.rounding - CERTAIN
    if lateral >= most:
        low = high
    elif back:
        low = max(low, -most)
    else:
        high = min(high, most)
    block.aside_low[k] = low
    block.aside_high[k] = high
    block.along_low[k] = max(outside, CERTAIN) if back else CERTAIN
    block.along_high[k] = length - CERTAIN if back else length - max(outside, CERTAIN)


@jit_inline
def _keep_sides(block: ValidRegions, k: int, length: float, half: float) -> bool:
    """Store the strip in which a car without lane state stays on its side of the road's edges; tell if there is one.

    There is one beside the segment, which is `length` metres long and whose road reaches `half` metres to each side;
    beyond its ends the edge is round.
    """
    rx = block.here_x[k] - block.from_x[k]
    ry = block.here_y[k] - block.from_y[k]
    along = rx * block.axis_x[k] + ry * block.axis_y[k]
    aside = block.axis_x[k] * ry - block.axis_y[k] * rx
    beside = CERTAIN < along < length - CERTAIN
    low, high = -HUGE, HUGE
    if beside and abs(aside) <= half:
        low = CERTAIN - half
        high = half - CERTAIN
    elif beside and aside > 0.0:
        low = half + CERTAIN
    elif beside:
        high = -half - CERTAIN
    block.aside_low[k] = low
    block.aside_high[k] = high
    block.along_low[k] = CERTAIN if beside else -HUGE
    block.along_high[k] = length - CERTAIN if beside else HUGE
    return beside


@jit_inline
def keep_arm(block: ValidRegions, n: int, segment: int, away2: float, cell: ValidCell, t: RoadTable, net: int) -> None:
    """Store in `block` (columns) where `segment` is the nearest of the roads that meet at the vertex of car n.

    Let u be the unit vector along this road, w along another, and r the vector from the vertex to the car. If r.u > 0
    and r.(u - w) > 0, this road is nearer. Only the two roads next to it by bearing need be compared. All that holds
    while r, whose square is `away2` (m^2), is shorter than each road. To be called after `label_cache.keep_region`.
    """
    k = n & (BLOCK - 1)
    _trust(block, k, -1.0)
    row = int(t.vert_off[net]) + cell.vertex
    roads = t.degree[row]
    if cell.segment >= 0 or roads == 1:
        return
    shortest = INFINITE
    mine = 0
    for i in range(roads):
        arm: int = t.arms[row, i]
        shortest = min(shortest, straight_start(t, net, arm))
        if arm >> 1 == segment:
            mine = i
    room = shortest - CERTAIN
    if away2 >= room * room:
        _trust(block, k, 1.0)
        return
    block.ring_high[k] = min(block.ring_high[k], room * room)
    ux, uy = lane_direction(t, net, t.arms[row, mine])
    vx, vy = lane_direction(t, net, t.arms[row, mine - 1 if mine > 0 else roads - 1])
    wx, wy = lane_direction(t, net, t.arms[row, mine + 1 if mine < roads - 1 else 0])
    block.arm_x[k], block.arm_y[k] = ux, uy
    block.right_x[k], block.right_y[k] = ux - vx, uy - vy
    block.left_x[k], block.left_y[k] = ux - wx, uy - wy
    block.arm_least[k] = BISECTED


@jit_inline
def _trust(block: ValidRegions, k: int, least: float) -> None:
    """Store that the nearest road is the same everywhere (`least` < 0), or that it has to be looked for always."""
    block.arm_x[k] = block.arm_y[k] = block.right_x[k] = block.right_y[k] = 0.0
    block.left_x[k] = block.left_y[k] = 0.0
    block.arm_least[k] = least
