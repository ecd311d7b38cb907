"""The flat observation of one car (compiled); `learning.flat` gives its layout."""

from __future__ import annotations

from math import sqrt
from typing import Any

import numpy as np
import numpy.typing as npt

from dubins_traffic.cars.sensing import scan, within_sight
from dubins_traffic.cars.state import EGO
from dubins_traffic.kernels.arrays import Floats, Ints
from dubins_traffic.kernels.compile import jit, jit_inline, jit_rare
from dubins_traffic.learning.clocks import write_clocks
from dubins_traffic.learning.outlook import SIZE, Outlook, OutlookTables
from dubins_traffic.learning.seeking import lane_of, metres_to_goal, next_lane
from dubins_traffic.roads.lookup import lane_end
from dubins_traffic.routing.lane_graph import foot, frame


@jit_inline
def within(value: float) -> float:
    """Return `value` (share) clipped to [-1, 1]."""
    return min(max(value, -1.0), 1.0)


@jit_inline
def near_far(metres: float, scale: float) -> float:
    """Map `metres` (m), 0 to infinity, to [0, 1]: `scale` (m) becomes 1/2."""
    return 1.0 - scale / (max(metres, 0.0) + scale)


@jit_inline
def write_bearing(dx: float, dy: float, c: float, s: float, sight: float, out: npt.NDArray[np.float32]) -> None:
    """Write the direction of a point in a car's frame, as cosine and sine, and how far it is, into `out` (3,).

    The point is `dx` (m) and `dy` (m) away; `c` and `s` are the car's heading (unit vector), `sight` (m) is how far it
    sees.
    """
    away = sqrt(dx * dx + dy * dy)
    out[0] = within((c * dx + s * dy) / away) if away > 0.0 else 0.0
    out[1] = within((c * dy - s * dx) / away) if away > 0.0 else 0.0
    out[2] = near_far(away, sight)


@jit
def write_flat(b: int, n: int, out: npt.NDArray[np.float32], tables: OutlookTables) -> None:
    """Write what car n of trial b observes into `out` (F,), in the order of `learning.flat.Layout`."""
    trial = tables.trial[b]
    state, labels = tables.state, tables.labels
    out[0] = within(state.speed[b, n] / trial.speed)
    out[1] = within(state.yaw_rate[b, n] / trial.yaw_rate)
    _flags(np.int64(labels.bits[b, n]), 2, out)
    at: int = labels.at[b, n]
    crosses: int = labels.crosses[b, n]
    lane = lane_of(b, n, tables)
    ahead = crosses if crosses >= 0 else lane_end(tables.roads, trial.net, lane)
    _lane(b, n, lane, at, out, tables)
    _crossing(b, n, ahead, out, tables)
    _goal(b, n, trial, out, tables)
    place = SIZE.OWN + SIZE.LANE + SIZE.CROSSING + SIZE.GOAL
    write_clocks(tables.clock[b], out[place : place + SIZE.CLOCKS])
    place += SIZE.CLOCKS
    for k in range(SIZE.OBSTACLES * SIZE.OBSTACLE):
        out[place + k] = 0.0
    if tables.around.obstacles.off[b] != tables.around.obstacles.off[b + 1]:
        _obstacles(b, n, place, trial, out, tables)
    place += SIZE.OBSTACLES * SIZE.OBSTACLE
    shown = (out.shape[0] - place - tables.rays.shape[0]) // SIZE.CAR
    count = _nearest(b, n, shown, trial.sight2, tables)
    for k in range(shown):
        if k < count:
            _car(b, n, tables.near[k], place, out, tables)
            _relation(b, tables.near[k], lane, ahead, place, out, tables)
        else:
            for j in range(SIZE.CAR):
                out[place + j] = 0.0
        place += SIZE.CAR
    _laser(b, place, out, tables)


@jit_inline
def _flags(bits: Any, place: int, out: npt.NDArray[np.float32]) -> None:
    for k in range(SIZE.FLAGS):
        out[place + k] = (bits >> k) & 1


@jit_inline
def _lane(b: int, n: int, lane: int, at: int, out: npt.NDArray[np.float32], tables: OutlookTables) -> None:
    """Write where the car is on its lane."""
    trial = tables.trial[b]
    state = tables.state
    along, left, tx, ty, length = foot(tables.roads, trial.net, lane, state.x[b, n], state.y[b, n])
    out[SIZE.OWN] = 1.0 if at < 0 else 0.0
    out[SIZE.OWN + 1] = within(left / trial.half_width)
    out[SIZE.OWN + 2] = within(tx * state.c[b, n] + ty * state.s[b, n])
    out[SIZE.OWN + 3] = within(tx * state.s[b, n] - ty * state.c[b, n])
    out[SIZE.OWN + 4] = min(max(along / length, 0.0), 1.0)
    out[SIZE.OWN + 5] = near_far(length - along, trial.radius)


@jit_inline
def _crossing(b: int, n: int, v: int, out: npt.NDArray[np.float32], tables: OutlookTables) -> None:
    """Write where the next crossing is, how many roads it has, and whether the car is in its disc."""
    trial = tables.trial[b]
    roads, state = tables.roads, tables.state
    row: int = roads.vert_off[trial.net] + v
    dx, dy = roads.vertex[row].x - state.x[b, n], roads.vertex[row].y - state.y[b, n]
    c, s = state.c[b, n], state.s[b, n]
    place = SIZE.OWN + SIZE.LANE
    out[place] = within((c * dx + s * dy) / trial.sight)
    out[place + 1] = within((c * dy - s * dx) / trial.sight)
    out[place + 2] = 0.25 * roads.degree[row]
    out[place + 3] = 1.0 if tables.labels.crosses[b, n] == v else 0.0
    out[place + 4] = 1.0 if tables.labels.at[b, n] == v else 0.0
    goal = 0.0
    for k in range(trial.first_goal, trial.last_goal):
        if tables.goal[k].vertex == v and tables.done[k] == 0:
            goal = 1.0
    out[place + 5] = goal


@jit_inline
def _goal(b: int, n: int, outlook: Outlook, out: npt.NDArray[np.float32], tables: OutlookTables) -> None:
    """Write where the goal that the ego seeks is, and which way leads there."""
    roads, state = tables.roads, tables.state
    place = SIZE.OWN + SIZE.LANE + SIZE.CROSSING
    for k in range(SIZE.GOAL):
        out[place + k] = 0.0
    if outlook.target < 0:
        return
    goal = tables.goal[outlook.target]
    row: int = roads.vert_off[outlook.net] + goal.vertex
    dx, dy = roads.vertex[row].x - state.x[b, n], roads.vertex[row].y - state.y[b, n]
    c, s = state.c[b, n], state.s[b, n]
    out[place] = 1.0
    write_bearing(dx, dy, c, s, outlook.sight, out[place + 1 : place + 4])
    out[place + 4] = near_far(metres_to_goal(b, n, outlook.target, tables), outlook.sight)
    turn = next_lane(b, n, outlook.target, tables)
    if turn >= 0:
        _, _, tx, ty, _ = frame(roads, outlook.net, turn)
        out[place + 5] = within(c * tx + s * ty)
        out[place + 6] = within(c * ty - s * tx)
    goals = outlook.last_goal - outlook.first_goal
    out[place + 7] = (goals - outlook.goals) / goals


@jit_rare
def _obstacles(
    b: int, n: int, place: int, outlook: Outlook, out: npt.NDArray[np.float32], tables: OutlookTables
) -> None:
    """Write the nearest parts of obstacles within sight of car n from `place` on, where zeros stand."""
    obstacles, state, near, apart = tables.around.obstacles, tables.state, tables.near, tables.apart
    x, y, c, s = state.x[b, n], state.y[b, n], state.c[b, n], state.s[b, n]
    count = 0
    for p in range(obstacles.off[b], obstacles.off[b + 1]):
        dx, dy = obstacles.parts[p].x - x, obstacles.parts[p].y - y
        d2 = dx * dx + dy * dy
        if d2 <= outlook.sight * outlook.sight and (count < SIZE.OBSTACLES or d2 < apart[count - 1]):
            count = put_in_order(p, d2, count, SIZE.OBSTACLES, near, apart)
    for k in range(count):
        at = place + k * SIZE.OBSTACLE
        part = obstacles.parts[int(near[k])]
        dx, dy = part.x - x, part.y - y
        out[at] = 1.0
        out[at + 1] = within((c * dx + s * dy) / outlook.sight)
        out[at + 2] = within((c * dy - s * dx) / outlook.sight)
        out[at + 3] = within(part.reach / outlook.half_width)


@jit_inline
def put_in_order(which: int, d2: float, count: int, most: int, near: Ints, apart: Floats) -> int:
    """Put `which` (index) at the squared distance `d2` (m^2) into the `count` (count) nearest; return how many.

    At most `most` (count) are kept, in `near` (K,) with their squared distances in `apart` (K,).
    """
    place = min(count, most - 1)
    while place > 0 and apart[place - 1] > d2:
        near[place] = near[place - 1]
        apart[place] = apart[place - 1]
        place -= 1
    near[place] = which
    apart[place] = d2
    return min(count + 1, most)


@jit
def _nearest(b: int, n: int, shown: int, sight2: float, tables: OutlookTables) -> int:
    """List the nearest cars that car n sees in `tables.near`, of equally near ones the lower index first."""
    state, near, apart = tables.state, tables.near, tables.apart
    count = 0
    if shown == 0:
        return 0
    for other in range(state.count[b]):
        dx, dy = state.x[b, other] - state.x[b, n], state.y[b, other] - state.y[b, n]
        d2 = dx * dx + dy * dy
        if other != n and within_sight(dx, dy, sight2) and (count < shown or d2 < apart[count - 1]):
            count = put_in_order(other, d2, count, shown, near, apart)
    return count


@jit_inline
def _car(b: int, n: int, other: int, place: int, out: npt.NDArray[np.float32], tables: OutlookTables) -> None:
    """Write another car, seen from car n, from `place` on."""
    trial = tables.trial[b]
    state, labels = tables.state, tables.labels
    dx, dy = state.x[b, other] - state.x[b, n], state.y[b, other] - state.y[b, n]
    c, s = state.c[b, n], state.s[b, n]
    oc, os = state.c[b, other], state.s[b, other]
    out[place] = 1.0
    out[place + 1] = within((c * dx + s * dy) / trial.sight)
    out[place + 2] = within((c * dy - s * dx) / trial.sight)
    out[place + 3] = within(c * oc + s * os)
    out[place + 4] = within(c * os - s * oc)
    out[place + 5] = within(state.speed[b, other] / trial.speed)
    out[place + 6] = within(state.yaw_rate[b, other] / trial.yaw_rate)
    _flags(np.int64(labels.bits[b, other]), place + 9, out)


@jit_inline
def _relation(
    b: int, other: int, lane: int, ahead: int, place: int, out: npt.NDArray[np.float32], tables: OutlookTables
) -> None:
    """Write whether another car is in the same lane, and at the same crossing."""
    trial, labels = tables.trial[b], tables.labels
    its = lane_of(b, other, tables)
    crosses: int = labels.crosses[b, other]
    its_ahead = crosses if crosses >= 0 else lane_end(tables.roads, trial.net, its)
    out[place + 7] = 1.0 if its == lane else 0.0
    out[place + 8] = 1.0 if its_ahead == ahead else 0.0


@jit
def sweep(b: int, tick: int, tables: OutlookTables) -> None:
    """Make the laser scan of the ego of trial b if one is due in frame `tick`; otherwise the last scan stays."""
    laser, trial = tables.laser[0], tables.trial[b]
    if laser.rate == 0.0:
        return
    number = int(tick * laser.rate / laser.control + 1e-9)
    if number > trial.swept:
        trial.swept = number
        scan(b, EGO, laser.shortest, laser.longest, tables.rays, tables.ranges[b], tables.around)


@jit_inline
def _laser(b: int, place: int, out: npt.NDArray[np.float32], tables: OutlookTables) -> None:
    """Write the last scan: 0 is a body nearer than the shortest range, 1 no body within the longest."""
    for k in range(tables.rays.shape[0]):
        out[place + k] = min(max(tables.ranges[b, k] / tables.laser[0].longest, 0.0), 1.0)
