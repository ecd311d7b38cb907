"""A road that bends as the law sees it: unrolled to a straight one, so that all else is said for straight roads only.

For the car that decides, whoever is on its road stands for a moment where he would be if that ran straight into the
intersection at its end, as far from it as along the middle of the car's own lane, and as far beside it as he is. Who is
not on that road is left where he is, or moved rigidly with the road's beginning if he is nearer to that. Then the car
decides as on any road. Of its command only the yaw rate changes when the road is rolled up again: it turns with the
road. A last look asks whether that is safe where everybody really is.
"""

from __future__ import annotations

from math import sqrt

from dubins_traffic.cars.state import Command, Pose
from dubins_traffic.kernels.arrays import Floats
from dubins_traffic.kernels.compile import jit, jit_inline
from dubins_traffic.kernels.records import Rows
from dubins_traffic.kernels.trig import angle
from dubins_traffic.policies.rules.tables import Traffic
from dubins_traffic.policies.safety import may_meet
from dubins_traffic.roads.bends import nearest_piece
from dubins_traffic.roads.lookup import (
    lane_direction,
    lane_end,
    lane_end_direction,
    lane_start,
    vertex_distance2,
)
from dubins_traffic.roads.table import Piece, Segment

SHARE = 0.8
"""Of its largest yaw rate a car uses at most this share to turn with the road."""


@jit_inline
def bends_ahead(b: int, n: int, traffic: Traffic) -> bool:
    """Tell whether the road of a car bends between it and the end of its lane."""
    state, labels, roads = traffic.state, traffic.labels, traffic.roads
    lane = labels.lane[b, n]
    if lane < 0:
        return False
    own = roads.segment[int(roads.seg_off[int(traffic.drivers.net[b])]) + int(lane >> 1)]
    if own.piece < 0:
        return False
    k, _ = nearest_piece(roads.piece, own, state.x[b, n], state.y[b, n])
    return k != (own.piece if lane & 1 else own.last)


@jit
def unroll(b: int, n: int, traffic: Traffic) -> None:
    """Put the cars of trial b where they are on the unrolled road of car n; `roll_up` puts them back."""
    state, labels, roads, drivers, scratch = (
        traffic.state, traffic.labels, traffic.roads, traffic.drivers, traffic.scratch,
    )  # fmt: skip
    net = drivers.net[b]
    lane = int(labels.lane[b, n])
    own = roads.segment[int(roads.seg_off[net]) + (lane >> 1)]
    back = lane & 1 != 0
    middle = drivers.vehicle[b].middle
    first, last = lane_start(roads, net, lane), lane_end(roads, net, lane)
    tx, ty = lane_end_direction(roads, net, lane)
    ux, uy = lane_direction(roads, net, lane)
    end, start = roads.vertex[int(roads.vert_off[net]) + last], roads.vertex[int(roads.vert_off[net]) + first]
    length = to_end(roads.piece, own, back, own.last if back else own.piece, 0.0, middle)
    for j in range(state.count[b]):
        x, y, c, s = state.x[b, j], state.y[b, j], state.c[b, j], state.s[b, j]
        scratch.real[0, j], scratch.real[1, j], scratch.real[2, j], scratch.real[3, j] = x, y, c, s
        if labels.segment[b, j] == lane >> 1:
            k, gone, left, dx, dy = place(roads.piece, own, back, x, y)
            if k == (own.piece if back else own.last):
                continue
            along = -to_end(roads.piece, own, back, k, gone, middle)
        elif vertex_distance2(roads, net, first, x, y) < vertex_distance2(roads, net, last, x, y):
            rx, ry = x - start.x, y - start.y
            along = rx * ux + ry * uy - length
            left = ux * ry - uy * rx
            dx, dy = ux, uy
        else:
            continue
        cosine = dx * c + dy * s
        sine = dx * s - dy * c
        state.x[b, j] = end.x + along * tx - left * ty
        state.y[b, j] = end.y + along * ty + left * tx
        state.c[b, j] = cosine * tx - sine * ty
        state.s[b, j] = cosine * ty + sine * tx


@jit
def roll_up(b: int, n: int, traffic: Traffic, commands: Floats) -> None:
    """Put the cars back where they are, and make of the command of car n on the unrolled road that on the real one."""
    state, labels, roads, drivers, scratch = (
        traffic.state, traffic.labels, traffic.roads, traffic.drivers, traffic.scratch,
    )  # fmt: skip
    for j in range(state.count[b]):
        state.x[b, j], state.y[b, j] = scratch.real[0, j], scratch.real[1, j]
        state.c[b, j], state.s[b, j] = scratch.real[2, j], scratch.real[3, j]
    vehicle = drivers.vehicle[b]
    speed, yaw_rate = float(commands[b, n, 0]), float(commands[b, n, 1])
    if speed == 0.0:
        return
    lane = int(labels.lane[b, n])
    own = roads.segment[int(roads.seg_off[drivers.net[b]]) + (lane >> 1)]
    pose = Pose(state.x[b, n], state.y[b, n], state.c[b, n], state.s[b, n])
    k, _, left, dx, dy = place(roads.piece, own, lane & 1 != 0, pose.x, pose.y)
    bend = curvature(roads.piece[k], lane & 1 != 0)
    turn = bend * (dx * pose.c + dy * pose.s) / max(1.0 - bend * left, 0.1)
    if abs(turn * speed) > SHARE * vehicle.yaw_most:
        speed *= SHARE * vehicle.yaw_most / abs(turn * speed)
    commands[b, n, 0] = speed
    commands[b, n, 1] = min(max(yaw_rate + turn * speed, -vehicle.yaw_most), vehicle.yaw_most)
    if not is_safe(b, n, pose, Command(commands[b, n, 0], commands[b, n, 1]), traffic):
        commands[b, n, 0] = 0.0
        commands[b, n, 1] = 0.0 if vehicle.half_length > 0.0 else yaw_rate


@jit_inline
def is_safe(b: int, n: int, pose: Pose, command: Command, traffic: Traffic) -> bool:
    """Tell whether a command can't bring about a contact with another car, whatever that does in this tick."""
    state, vehicle = traffic.state, traffic.drivers.vehicle[b]
    travel = vehicle.fastest * vehicle.period
    if vehicle.half_length > 0.0:
        travel += vehicle.yaw_most * vehicle.reach * vehicle.period
    for j in range(state.count[b]):
        other = Pose(state.x[b, j], state.y[b, j], state.c[b, j], state.s[b, j])
        if j != n and may_meet(pose, command, vehicle, other, travel):
            return False
    return True


@jit_inline
def curvature(piece: Piece, back: bool) -> float:
    """Return the curvature of a piece, 1/m, to the left along the lane, against the piece if `back` (flag)."""
    if piece.side == 0.0:
        return 0.0
    return -piece.side / piece.radius if back else piece.side / piece.radius


@jit
def place(
    pieces: Rows[Piece], own: Segment, back: bool, x: float, y: float
) -> tuple[int, float, float, float, float]:
    """Return (piece, metres along it in the lane's direction, metres left of the lane's line, direction) of a point.

    The lane is one of the segment `own` (row), from its second to its first end if `back` (flag).
    """
    k, _ = nearest_piece(pieces, own, x, y)
    at = pieces[k]
    if at.side == 0.0:
        rx, ry = x - at.x, y - at.y
        along = rx * at.tx + ry * at.ty
        left = at.tx * ry - at.ty * rx
        dx, dy = at.tx, at.ty
    else:
        ox, oy = x - at.cx, y - at.cy
        far = max(sqrt(ox * ox + oy * oy), 1e-300)
        along = at.radius * angle(max(ox * at.tx + oy * at.ty, 0.0), at.side * (ox * at.ty - oy * at.tx))
        left = at.side * (at.radius - far)
        dx, dy = -at.side * oy / far, at.side * ox / far
    if back:
        return k, at.length - along, -left, -dx, -dy
    return k, along, left, dx, dy


@jit
def to_end(pieces: Rows[Piece], own: Segment, back: bool, k: int, gone: float, middle: float) -> float:
    """Return metres to the end of a lane from `gone` (m) along piece `k` (row), measured `middle` (m) to the right.

    The lane is one of the segment `own` (row), from its second to its first end if `back` (flag).
    """
    at = pieces[k]
    far = (at.length - gone) * (1.0 + curvature(at, back) * middle)
    step = -1 if back else 1
    stop = own.piece if back else own.last
    while k != stop:
        k += step
        far += pieces[k].length * (1.0 + curvature(pieces[k], back) * middle)
    return far
