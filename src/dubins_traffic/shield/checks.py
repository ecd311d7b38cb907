"""Whether after one tick of a command the ego can stand for ever without breaking a rule (compiled)."""

from __future__ import annotations

import numpy as np

from dubins_traffic.cars.sensing import within_sight
from dubins_traffic.cars.state import EGO, Command, Pose, State
from dubins_traffic.kernels.compile import jit, jit_inline
from dubins_traffic.kernels.trig import advance
from dubins_traffic.policies.rules.tables import Scratch, Traffic, Vehicle
from dubins_traffic.policies.safety import GUARD, body_at, keeps_clear, may_hit, travel_of
from dubins_traffic.roads.lookup import (
    lane_coordinates,
    lane_direction_at,
    lane_end,
    nearest_segment,
    nearest_vertex,
)
from dubins_traffic.rules.lane_state import along_lane, lane_here
from dubins_traffic.rules.propositions import FLAG
from dubins_traffic.rules.shape import distance2_to_body, half_across, half_extent
from dubins_traffic.shield.tables import REASON, ShieldTables

VERGE = 0.005
"""Distance that the centre keeps from the edge of the road, metres."""
BRINK = 0.002
"""Distance that the body keeps from where it counts as left, and from a disc that it may not enter, metres."""
TURNING = 0.01
"""The ego backs up by this much less than what counts as turning round, metres."""


@jit_inline
def bounded(speed: float, yaw_rate: float, vehicle: Vehicle) -> Command:
    """Return a command as the simulator clips it."""
    speed = min(max(speed, vehicle.slowest), vehicle.fastest)
    most = vehicle.yaw_most
    if vehicle.tightest > 0.0:
        most = min(most, abs(speed) / vehicle.tightest)
    return Command(speed, min(max(yaw_rate, -most), most))


@jit_inline
def gather_close(b: int, state: State, sight2: float, vehicle: Vehicle, scratch: Scratch) -> int:
    """List in `scratch.near` the cars within sight that the ego may touch in this tick; return how many are listed.

    `sight2` (m2) is the square of how far the ego sees, negative if everywhere.
    """
    far = 2.0 * (vehicle.reach + 1.2 * travel_of(vehicle)) + GUARD
    count = 0
    for n in range(1, state.count[b]):
        dx = state.x[b, n] - state.x[b, EGO]
        dy = state.y[b, n] - state.y[b, EGO]
        if dx * dx + dy * dy <= far * far and within_sight(dx, dy, sight2):
            scratch.near[count] = n
            count += 1
    return count


@jit
def may_touch(b: int, speed: float, yaw_rate: float, near: int, traffic: Traffic, vehicle: Vehicle) -> bool:
    """Tell whether a command could lead to a contact in a tick if the `near` (count) listed cars did their worst.

    `keeps_clear` looks at five poses of the arc; between two of them no point gets farther from both than an eighth
    of its way, which GUARD covers unless ticks are long.
    """
    state, obstacles, scratch = traffic.state, traffic.obstacles, traffic.scratch
    pose = Pose(state.x[b, EGO], state.y[b, EGO], state.c[b, EGO], state.s[b, EGO])
    command = Command(speed, yaw_rate)
    travel = travel_of(vehicle)
    turns = abs(yaw_rate) * vehicle.reach if vehicle.half_length > 0.0 else 0.0
    drive = (abs(speed) + turns) * vehicle.period
    between = max(drive / 8.0 - GUARD, 0.0)
    for k in range(near):
        j = scratch.near[k]
        other = body_at(Pose(state.x[b, j], state.y[b, j], state.c[b, j], state.s[b, j]), vehicle)
        if not keeps_clear(pose, command, vehicle, other, travel + between):
            return True
    return may_hit(b, pose, command, vehicle, obstacles, travel + between + GUARD, between)


@jit
def refusal(b: int, speed: float, yaw_rate: float, near: int, traffic: Traffic, shields: ShieldTables) -> int:
    """Return the rule (a `REASON`) that a command within bounds would break, in its tick or while the ego then stands.

    `near` (count) is how many cars `gather_close` has listed.

    `REASON.NOTHING` if it breaks none: then the ego is not left in the next frame, has entered no crossing against
    rule 3, is on the road, and has touched nothing, whatever the others did.
    """
    state, labels, roads, drivers = traffic.state, traffic.labels, traffic.roads, traffic.drivers
    vehicle = drivers.vehicle[b]
    bits = np.int64(labels.bits[b, EGO])
    turns = yaw_rate != 0.0 and vehicle.half_length > 0.0
    if speed == 0.0 and not turns:
        return REASON.RETURN if bits & FLAG.LEFT != 0 else REASON.NOTHING
    net = drivers.net[b]
    x, y, c, s = state.x[b, EGO], state.y[b, EGO], state.c[b, EGO], state.s[b, EGO]
    nx, ny, nc, ns = advance(x, y, c, s, speed, yaw_rate, vehicle.period)
    after = Pose(nx, ny, nc, ns)
    segment, off2 = nearest_segment(roads, net, nx, ny)
    edge = float(roads.half_width[net]) - VERGE - vehicle.unsure
    if off2 > edge * edge:
        _, before2 = nearest_segment(roads, net, x, y)
        if off2 >= before2:
            return REASON.ROAD
    v, away2 = nearest_vertex(roads, net, nx, ny)
    reason = _enters(b, v, after, traffic)
    if reason != REASON.NOTHING:
        return reason
    rim = vehicle.disc - vehicle.unsure
    at = v if away2 < rim * rim else -1
    reason = _leaves_lane(b, at, segment, off2, after, traffic, shields)
    if reason != REASON.NOTHING:
        return reason
    return REASON.CONTACT if may_touch(b, speed, yaw_rate, near, traffic, vehicle) else REASON.NOTHING


@jit
def _enters(b: int, v: int, pose: Pose, traffic: Traffic) -> int:
    """Return which part of rule 3 (a `REASON`) the ego breaks by going to a pose, to which v is the nearest vertex."""
    state, labels, roads, drivers = traffic.state, traffic.labels, traffic.roads, traffic.drivers
    vehicle = drivers.vehicle[b]
    net = drivers.net[b]
    row = int(roads.vert_off[net]) + v
    if labels.crosses[b, EGO] == v or roads.degree[row] < vehicle.degree:
        return REASON.NOTHING
    vx, vy = roads.vertex[row].x, roads.vertex[row].y
    half_length, half_width = vehicle.half_length, vehicle.half_width
    edge = vehicle.disc + vehicle.unsure + vehicle.rounding + BRINK
    x, y, c, s = pose
    after2 = distance2_to_body(vx, vy, x, y, c, s, half_length, half_width)
    if after2 >= edge * edge:
        return REASON.NOTHING
    before2 = distance2_to_body(
        vx, vy, state.x[b, EGO], state.y[b, EGO], state.c[b, EGO], state.s[b, EGO], half_length, half_width
    )
    if after2 >= before2:
        return REASON.NOTHING
    bits = np.int64(labels.bits[b, EGO])
    lane = labels.lane[b, EGO]
    if bits & FLAG.STOPPED == 0 or lane < 0 or lane_end(roads, net, lane) != v:
        return REASON.STOP
    if bits & FLAG.AHEAD != 0:
        return REASON.ORDER
    return REASON.CLEARANCE if bits & FLAG.CLEAR == 0 else REASON.NOTHING


@jit
def _leaves_lane(
    b: int, at: int, segment: int, off2: float, pose: Pose, traffic: Traffic, shields: ShieldTables
) -> int:
    """Return whether the ego is left or turns round (a `REASON`) at a pose in the disc of `at` (-1: none)."""
    state, labels, roads, drivers = traffic.state, traffic.labels, traffic.roads, traffic.drivers
    net = drivers.net[b]
    vehicle = drivers.vehicle[b]
    lane = labels.lane[b, EGO]
    back = shields.ego[b].turn_back
    if at >= 0:
        return REASON.NOTHING
    after, fresh = lane_here(roads, net, labels.at[b, EGO], lane, segment, off2, pose)
    top = shields.ego[b].top
    after, progress, lateral, turned = along_lane(roads, net, after, fresh, top, back, pose)
    if turned:
        return REASON.TURN
    if not fresh and after == lane and top - progress > back - TURNING - 2.0 * vehicle.unsure:
        before, _ = lane_coordinates(roads, net, lane, state.x[b, EGO], state.y[b, EGO])
        if progress < before:
            return REASON.TURN
    tx, ty = lane_direction_at(roads, net, after, pose.x, pose.y)
    half = half_extent(tx, ty, pose.c, pose.s, vehicle)
    reach = lateral + half
    if np.int64(labels.bits[b, EGO]) & FLAG.LEFT != 0 and labels.at[b, EGO] < 0:
        return REASON.RETURN if reach + vehicle.unsure >= shields.ego[b].left_release else REASON.NOTHING
    if reach <= vehicle.over - BRINK:
        return REASON.NOTHING
    return REASON.NOTHING if reach < min(vehicle.over, _reach(b, after, traffic, net, vehicle)) else REASON.LANE


@jit
def _reach(b: int, lane: int, traffic: Traffic, net: int, vehicle: Vehicle) -> float:
    """Return the largest lateral coordinate of the ego's body in `lane`, its lane state, metres."""
    state, labels, roads = traffic.state, traffic.labels, traffic.roads
    if labels.lane[b, EGO] != lane:
        return 0.0
    tx, ty = lane_direction_at(roads, net, lane, state.x[b, EGO], state.y[b, EGO])
    _, lateral = lane_coordinates(roads, net, lane, state.x[b, EGO], state.y[b, EGO])
    return lateral + half_across(b, EGO, tx, ty, state, vehicle)
