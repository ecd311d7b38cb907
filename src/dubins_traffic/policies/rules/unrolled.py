"""A road that bends as the law sees it: unrolled to a straight one, so that all else is said for straight roads only.

While a car decides, every car on its road is moved to where it would be if the road ran straight into the intersection
at its end: as far from that as along the middle of the deciding car's lane, and with the same lateral offset. A car
that is not on that road stays in place, or moves rigidly with the road's beginning if it is nearer to that. Obstacles
are unrolled with the road beside which they lie. Then the car decides as on a straight road. When the road is rolled up
again, only the yaw rate of its command changes: the car turns with the road. Its motion is the same except that
distances along the road are stretched in the other lane (`policies.rules.passing`). A last check asks whether the
command is safe at the real poses, and keeps the car right unless it overtakes.
"""

from __future__ import annotations

import numpy as np

from dubins_traffic.cars.state import Command, Pose
from dubins_traffic.kernels.arrays import Floats
from dubins_traffic.kernels.compile import jit, jit_inline, jit_rare
from dubins_traffic.kernels.records import Rows
from dubins_traffic.kernels.trig import advance
from dubins_traffic.policies.rules.standing import LINE, SURE
from dubins_traffic.policies.rules.tables import VIOLATION, Traffic
from dubins_traffic.policies.safety import NEAR, may_hit, may_meet, travel_of
from dubins_traffic.roads.lookup import (
    bends_before,
    bent_distance2,
    lane_coordinates,
    lane_direction,
    lane_direction_at,
    lane_end,
    lane_end_direction,
    lane_start,
    nearest_piece,
    piece_foot,
    tightness,
    vertex_distance2,
)
from dubins_traffic.roads.table import Piece, Segment
from dubins_traffic.rules.blocking import narrows
from dubins_traffic.rules.propositions import FLAG
from dubins_traffic.rules.shape import half_across, half_extent

BESIDE = 0.3
"""Obstacles this near to the road's edge are unrolled with it, metres."""
AROUND = 1.5
"""Those this near to the disc at its end stay where they are, metres; others are put out of the way:"""
AWAY = 1e6
"""so far off, metres."""
SHARE = 0.8
"""Of its largest yaw rate a car uses at most this share to turn with the road."""


@jit_inline
def lane_of(b: int, n: int, traffic: Traffic) -> int:
    """Return the lane of a car: in a disc the one by which it came, and from the end of its arc on the one out."""
    seen = traffic.labels.lane[b, n]
    return int(seen if seen >= 0 else traffic.drivers.car[b, n].lane)


@jit_inline
def bends_ahead(b: int, n: int, traffic: Traffic) -> bool:
    """Tell whether the road of a car bends between it and the end of its lane."""
    lane = lane_of(b, n, traffic)
    x, y = traffic.state.x[b, n], traffic.state.y[b, n]
    return lane >= 0 and bends_before(traffic.roads, traffic.drivers.net[b], lane, x, y)


@jit
def unroll(b: int, n: int, traffic: Traffic) -> None:
    """Put cars and obstacles of trial b where they are on the unrolled road of car n; `put_back` puts them back."""
    state, labels, roads, drivers, scratch = (
        traffic.state, traffic.labels, traffic.roads, traffic.drivers, traffic.scratch,
    )  # fmt: skip
    net = drivers.net[b]
    lane = lane_of(b, n, traffic)
    segment = roads.segment[int(roads.seg_off[net]) + (lane >> 1)]
    back = lane & 1 != 0
    middle = drivers.vehicle[b].middle
    first, last = lane_start(roads, net, lane), lane_end(roads, net, lane)
    tx, ty = lane_end_direction(roads, net, lane)
    ux, uy = lane_direction(roads, net, lane)
    end, start = roads.vertex[int(roads.vert_off[net]) + last], roads.vertex[int(roads.vert_off[net]) + first]
    length = to_end(roads.piece, segment, back, segment.last if back else segment.piece, 0.0, middle)
    scratch.tight[0] = tightness(roads, net, lane, middle)
    unroll_obstacles(b, n, traffic)
    for j in range(state.count[b]):
        x, y, c, s = state.x[b, j], state.y[b, j], state.c[b, j], state.s[b, j]
        scratch.real[0, j], scratch.real[1, j], scratch.real[2, j], scratch.real[3, j] = x, y, c, s
        if labels.segment[b, j] == lane >> 1:
            k, gone, left, dx, dy = place(roads.piece, segment, back, x, y)
            if k == (segment.piece if back else segment.last):
                continue
            along = -to_end(roads.piece, segment, back, k, gone, middle)
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
def unroll_obstacles(b: int, n: int, traffic: Traffic) -> None:
    """Put the obstacles of trial b where they are on the unrolled road of car n, those elsewhere out of the way."""
    roads, obstacles, drivers, scratch = traffic.roads, traffic.obstacles, traffic.drivers, traffic.scratch
    net, vehicle = drivers.net[b], drivers.vehicle[b]
    lane = lane_of(b, n, traffic)
    segment = roads.segment[int(roads.seg_off[net]) + (lane >> 1)]
    back = lane & 1 != 0
    last = lane_end(roads, net, lane)
    end = roads.vertex[int(roads.vert_off[net]) + last]
    tx, ty = lane_end_direction(roads, net, lane)
    for p in range(obstacles.off[b], obstacles.off[b + 1]):
        part, q = obstacles.parts[p], p - obstacles.off[b]
        x, y, c, s = part.x, part.y, part.c, part.s
        real = scratch.real_part
        real[0, q], real[1, q], real[2, q], real[3, q] = x, y, c, s
        edge = float(roads.half_width[net]) + part.reach + BESIDE
        if bent_distance2(roads.piece, segment, x, y) > edge * edge:
            near = vehicle.disc + part.reach + AROUND
            if vertex_distance2(roads, net, last, x, y) > near * near:
                part.x += AWAY
            continue
        k, gone, left, dx, dy = place(roads.piece, segment, back, x, y)
        if k == (segment.piece if back else segment.last):
            continue
        along = -to_end(roads.piece, segment, back, k, gone, vehicle.middle)
        cosine = dx * c + dy * s
        sine = dx * s - dy * c
        part.x = end.x + along * tx - left * ty
        part.y = end.y + along * ty + left * tx
        part.c = cosine * tx - sine * ty
        part.s = cosine * ty + sine * tx


@jit
def put_back(b: int, traffic: Traffic) -> None:
    """Put cars and obstacles of trial b back where they are."""
    state, obstacles, scratch = traffic.state, traffic.obstacles, traffic.scratch
    for j in range(state.count[b]):
        state.x[b, j], state.y[b, j] = scratch.real[0, j], scratch.real[1, j]
        state.c[b, j], state.s[b, j] = scratch.real[2, j], scratch.real[3, j]
    for p in range(obstacles.off[b], obstacles.off[b + 1]):
        part, q = obstacles.parts[p], p - obstacles.off[b]
        part.x, part.y = scratch.real_part[0, q], scratch.real_part[1, q]
        part.c, part.s = scratch.real_part[2, q], scratch.real_part[3, q]
    scratch.tight[0] = 0.0


@jit_rare
def roll_up(b: int, n: int, traffic: Traffic, commands: Floats) -> None:
    """Put cars and obstacles back, and turn the command of car n on the unrolled road into that on the real one."""
    state, roads, drivers = traffic.state, traffic.roads, traffic.drivers
    watched = watched_car(b, n, traffic)
    put_back(b, traffic)
    vehicle = drivers.vehicle[b]
    speed, yaw_rate = float(commands[b, n, 0]), float(commands[b, n, 1])
    if speed == 0.0:
        return
    lane = lane_of(b, n, traffic)
    segment = roads.segment[int(roads.seg_off[drivers.net[b]]) + (lane >> 1)]
    pose = Pose(state.x[b, n], state.y[b, n], state.c[b, n], state.s[b, n])
    k, _, left, dx, dy = place(roads.piece, segment, lane & 1 != 0, pose.x, pose.y)
    bend = curvature(roads.piece[k], lane & 1 != 0)
    turn = bend * (dx * pose.c + dy * pose.s) / max(1.0 - bend * left, 0.1)
    if abs(turn * speed) > SHARE * vehicle.yaw_most:
        speed *= SHARE * vehicle.yaw_most / abs(turn * speed)
    command = Command(speed, min(max(yaw_rate + turn * speed, -vehicle.yaw_most), vehicle.yaw_most))
    commands[b, n, 0] = command.speed
    commands[b, n, 1] = command.yaw_rate
    if not (is_safe(b, n, pose, command, traffic) and keeps_right(b, n, pose, command, watched, traffic)):
        commands[b, n, 0] = 0.0
        commands[b, n, 1] = 0.0 if vehicle.half_length > 0.0 else yaw_rate


@jit
def watched_car(b: int, n: int, traffic: Traffic) -> int:
    """Return the car that car n has watched for long enough to be sure that it stands, -1 if there is none."""
    state, drivers = traffic.state, traffic.drivers
    car, vehicle = drivers.car[b, n], drivers.vehicle[b]
    if car.watched * vehicle.period >= vehicle.stand_time + vehicle.period:
        for j in range(state.count[b]):
            if j != n and state.x[b, j] == car.watch_x and state.y[b, j] == car.watch_y:
                return j
    return -1


@jit
def keeps_right(b: int, n: int, pose: Pose, command: Command, watched: int, traffic: Traffic) -> bool:
    """Tell whether a command leaves the body of car n in its lane, or it overtakes in the next frame for certain.

    As `policies.rules.standing.stays_right` says, on the road as it is; car `watched` (number) is sure to stand. In a
    disc there is no lane to leave.
    """
    state, labels, roads, obstacles = traffic.state, traffic.labels, traffic.roads, traffic.obstacles
    vehicle, net, lane = traffic.drivers.vehicle[b], traffic.drivers.net[b], int(labels.lane[b, n])
    bits = np.int64(labels.bits[b, n])
    if lane < 0 or bits & FLAG.LEFT != 0 or traffic.drivers.car[b, n].violations & VIOLATION.LEFT_SIDE != 0:
        return True
    x, y, c, s = advance(pose.x, pose.y, pose.c, pose.s, command.speed, command.yaw_rate, vehicle.period)
    here, left = lane_coordinates(roads, net, lane, x, y)
    tx, ty = lane_direction_at(roads, net, lane, x, y)
    half = half_extent(tx, ty, c, s, vehicle)
    if left + half <= vehicle.over - LINE:
        return True
    if bits & FLAG.OVERTAKING == 0:
        return False
    for p in range(obstacles.off[b], obstacles.off[b + 1]):
        part = obstacles.parts[p]
        key, its = lane_coordinates(roads, net, lane, part.x, part.y)
        if here - part.reach <= key <= here + part.reach + vehicle.fore and abs(its + vehicle.middle) < (
            vehicle.middle + part.reach
        ):
            return True
    for j in range(state.count[b]):
        its_bits = np.int64(labels.bits[b, j])
        if j != n and labels.lane[b, j] == lane and its_bits & (FLAG.APPROACH | FLAG.STOPPED) == FLAG.APPROACH:
            return False
    if watched < 0 or labels.bits[b, watched] & FLAG.STANDS == 0:
        return False
    x, y = state.x[b, watched], state.y[b, watched]
    key, its = lane_coordinates(roads, net, lane, x, y)
    tx, ty = lane_direction_at(roads, net, lane, x, y)
    half = half_across(b, watched, tx, ty, state, vehicle)
    there = here - vehicle.behind + SURE < key < here + vehicle.fore - SURE
    return there and narrows(its - half, its + half, 2.0 * vehicle.middle, vehicle.needed)


@jit_inline
def is_safe(b: int, n: int, pose: Pose, command: Command, traffic: Traffic) -> bool:
    """Tell whether a command can't bring about a contact, whatever other cars do in this tick."""
    state, vehicle = traffic.state, traffic.drivers.vehicle[b]
    travel = travel_of(vehicle)
    for j in range(state.count[b]):
        other = Pose(state.x[b, j], state.y[b, j], state.c[b, j], state.s[b, j])
        if j != n and may_meet(pose, command, vehicle, other, travel):
            return False
    return not may_hit(b, pose, command, vehicle, traffic.obstacles, NEAR, 0.0)


@jit_inline
def curvature(piece: Piece, back: bool) -> float:
    """Return the curvature of a piece, 1/m, to the left along the lane, against the piece if `back` (flag)."""
    if piece.side == 0.0:
        return 0.0
    return -piece.side / piece.radius if back else piece.side / piece.radius


@jit
def place(
    pieces: Rows[Piece], segment: Segment, back: bool, x: float, y: float
) -> tuple[int, float, float, float, float]:
    """Return (piece, metres along it in the lane's direction, metres left of the lane's line, direction) of a point.

    The lane is one of the segment `segment` (row), from its second to its first end if `back` (flag).
    """
    k, _ = nearest_piece(pieces, segment, x, y)
    along, left, dx, dy = piece_foot(pieces[k], x, y)
    if back:
        return k, pieces[k].length - along, -left, -dx, -dy
    return k, along, left, dx, dy


@jit
def to_end(pieces: Rows[Piece], segment: Segment, back: bool, k: int, gone: float, middle: float) -> float:
    """Return metres to the end of a lane from `gone` (m) along piece `k` (row), measured `middle` (m) to the right.

    The lane is one of the segment `segment` (row), from its second to its first end if `back` (flag).
    """
    at = pieces[k]
    far = (at.length - gone) * (1.0 + curvature(at, back) * middle)
    step = -1 if back else 1
    stop = segment.piece if back else segment.last
    while k != stop:
        k += step
        far += pieces[k].length * (1.0 + curvature(pieces[k], back) * middle)
    return far
