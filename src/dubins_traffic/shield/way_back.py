"""Whether an ego that crosses the centre line is sure to be back in time, whatever the others do (compiled).

The shield rehearses the law from the present tick on, among the obstacles alone, until the ego is back. If no other car
can come near the ego in any tick of the rehearsal, even at top speed straight toward where the ego is then, nothing can
change its course. The ego then does what was rehearsed: while it is left, the law drives it as if it saw no other car.
What it passes is an obstacle, which is sure to stand.
"""

from __future__ import annotations

from math import sqrt

from dubins_traffic.cars.sensing import within_sight
from dubins_traffic.cars.state import EGO, Command, Pose, State
from dubins_traffic.kernels.arrays import Floats
from dubins_traffic.kernels.compile import jit, jit_inline
from dubins_traffic.kernels.trig import advance
from dubins_traffic.policies.rules.policy import decide_trial
from dubins_traffic.policies.rules.tables import Drivers, Traffic, Vehicle
from dubins_traffic.policies.safety import GUARD, travel_of
from dubins_traffic.roads.lookup import lane_coordinates, lane_direction_at, nearest_segment, nearest_vertex
from dubins_traffic.roads.table import RoadTable
from dubins_traffic.rules.blocking import RightLane, obstacle_narrows
from dubins_traffic.rules.propositions import FLAG
from dubins_traffic.rules.shape import distance2_to_body, half_extent
from dubins_traffic.shield.checks import BRINK, TURNING, VERGE, bounded, may_touch
from dubins_traffic.shield.tables import ShieldTables

LONGEST = 60.0
"""Longest rehearsal, seconds; a way back that takes longer is not found."""
ROUNDED = 1e-6
"""An obstacle has to block a lane by at least this much, so that rounding does not decide, metres."""


@jit
def drive_by_law(b: int, tick: int, sight2: float, traffic: Traffic, commands: Floats) -> None:
    """Write the law's command for the ego, which sees other cars within the squared distance `sight2` (m2)."""
    scratch = traffic.scratch
    decide_trial(b, tick, sight2, scratch.apart, 0.0, traffic, commands)


@jit
def drive_alone(b: int, tick: int, lane: int, pose: Pose, traffic: Traffic, shields: ShieldTables) -> Command:
    """Return the law's command, within bounds, for an ego that is left, as if it saw no other car.

    The law's memory is that in `shields.alone`.
    """
    roads, drivers = traffic.roads, traffic.drivers
    alone, commands = shields.alone.traffic, shields.alone.commands
    alone.state.x[b, EGO], alone.state.y[b, EGO], alone.state.c[b, EGO], alone.state.s[b, EGO] = pose
    bits = FLAG.LEFT | FLAG.OVERTAKING
    here, _ = lane_coordinates(roads, drivers.net[b], lane, pose.x, pose.y)
    if _blocks(b, lane, here, here + shields.ego[b].blocked_ahead, roads, drivers, shields):
        bits |= FLAG.BLOCKED
    alone.labels.bits[b, EGO] = bits
    alone.labels.lane[b, EGO] = lane
    alone.labels.segment[b, EGO] = lane >> 1
    drive_by_law(b, tick, -1.0, alone, commands)
    return bounded(commands[b, EGO, 0], commands[b, EGO, 1], drivers.vehicle[b])


@jit_inline
def copy_memory(b: int, source: Drivers, to: Drivers) -> None:
    """Copy the law's memory of the ego of trial b from `source` to `to`."""
    to.car[b, EGO] = source.car[b, EGO]
    to.way[b, EGO] = source.way[b, EGO]


@jit
def surely_returns(
    b: int, tick: int, speed: float, yaw_rate: float, sight2: float, traffic: Traffic, shields: ShieldTables
) -> bool:
    """Tell whether the law is sure to bring the ego back in time after this command, which makes it left.

    `sight2` (m2) is the square of how far the ego sees, negative if everywhere.
    """
    state, labels, roads, drivers = traffic.state, traffic.labels, traffic.roads, traffic.drivers
    vehicle = drivers.vehicle[b]
    net = drivers.net[b]
    lane = labels.lane[b, EGO]
    if lane < 0:
        return False
    x, y, c, s = state.x[b, EGO], state.y[b, EGO], state.c[b, EGO], state.s[b, EGO]
    before, _ = lane_coordinates(roads, net, lane, x, y)
    top = shields.ego[b].top
    last = int(min(shields.ego[b].left_time, LONGEST) / vehicle.period)
    copy_memory(b, drivers, shields.alone.traffic.drivers)
    for k in range(1, last + 1):
        if k > 1 and may_touch(b, speed, yaw_rate, 0, shields.alone.traffic, vehicle):
            return False
        x, y, c, s = advance(x, y, c, s, speed, yaw_rate, vehicle.period)
        progress, lateral = lane_coordinates(roads, net, lane, x, y)
        top = max(top, progress)
        if progress < before and top - progress > shields.ego[b].turn_back - TURNING:
            return False
        if k == 1 and not _overtakes(b, lane, progress, traffic, shields):
            return False
        pose = Pose(x, y, c, s)
        if _leaves(lane, pose, roads, net, vehicle) or _may_come(b, k, pose, sight2, state, shields, vehicle):
            return False
        tx, ty = lane_direction_at(roads, net, lane, x, y)
        half = half_extent(tx, ty, c, s, vehicle)
        if lateral + half < shields.ego[b].left_release:
            return True
        before = progress
        speed, yaw_rate = drive_alone(b, tick + k, lane, pose, traffic, shields)
    return False


@jit_inline
def _overtakes(b: int, lane: int, progress: float, traffic: Traffic, shields: ShieldTables) -> bool:
    """Tell whether an ego whose progress in the next frame is `progress` overtakes an obstacle in that frame."""
    labels, roads, drivers = traffic.labels, traffic.roads, traffic.drivers
    vehicle = drivers.vehicle[b]
    if _blocks(b, lane, progress, progress + shields.ego[b].blocked_ahead, roads, drivers, shields):
        return True
    return labels.bits[b, EGO] & FLAG.OVERTAKING != 0 and _blocks(
        b, lane, progress - vehicle.behind, progress + vehicle.fore, roads, drivers, shields
    )


@jit
def _blocks(
    b: int, lane: int, near: float, far: float, roads: RoadTable, drivers: Drivers, shields: ShieldTables
) -> bool:
    """Tell whether an obstacle whose progress in a lane is in [near, far] blocks it."""
    vehicle = drivers.vehicle[b]
    length = roads.segment[int(roads.seg_off[drivers.net[b]]) + (lane >> 1)].length
    place = RightLane(b, lane, length, 2.0 * vehicle.middle)
    needed = vehicle.needed - ROUNDED
    return obstacle_narrows(shields.obstacles, place, near + ROUNDED, far - ROUNDED, needed)


@jit_inline
def _leaves(lane: int, pose: Pose, roads: RoadTable, net: int, vehicle: Vehicle) -> bool:
    """Tell whether an ego at a pose is off the road of its lane, or its body meets a disc."""
    x, y, c, s = pose
    segment, off2 = nearest_segment(roads, net, x, y)
    edge = float(roads.half_width[net]) - VERGE - vehicle.unsure
    if segment != lane >> 1 or off2 > edge * edge:
        return True
    v, _ = nearest_vertex(roads, net, x, y)
    row = int(roads.vert_off[net]) + v
    vx, vy = roads.vertex[row].x, roads.vertex[row].y
    rim = vehicle.disc + vehicle.unsure + vehicle.rounding + BRINK
    return distance2_to_body(vx, vy, x, y, c, s, vehicle.half_length, vehicle.half_width) < rim * rim


@jit_inline
def _may_come(
    b: int, ticks: int, pose: Pose, sight2: float, state: State, shields: ShieldTables, vehicle: Vehicle
) -> bool:
    """Tell whether a car, seen or unseen, could in `ticks` ticks be so near to a pose that it might touch the ego."""
    x, y = pose.x, pose.y
    near = 2.0 * vehicle.reach + 2.0 * travel_of(vehicle) + GUARD
    far = near + max(vehicle.fastest, -vehicle.slowest) * vehicle.period * ticks
    ex, ey = state.x[b, EGO], state.y[b, EGO]
    unseen = shields.ego[b].cars - 1
    for n in range(1, state.count[b]):
        ox, oy = state.x[b, n], state.y[b, n]
        if not within_sight(ox - ex, oy - ey, sight2):
            continue
        unseen -= 1
        if (ox - x) * (ox - x) + (oy - y) * (oy - y) <= far * far:
            return True
    if unseen <= 0:
        return False
    gone = sqrt((x - ex) * (x - ex) + (y - ey) * (y - ey))
    return gone + far >= sqrt(shields.ego[b].sight2)
