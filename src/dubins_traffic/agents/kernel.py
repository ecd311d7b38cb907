"""One tick of all e-agents of a batch: the compiled entry point and what each kind does."""

from __future__ import annotations

from typing import Any

from dubins_traffic.agents.lanes import (
    FAR,
    aim_for,
    frame,
    lane_at,
    nearer_exit,
    place_of,
    random_exit,
    spread,
)
from dubins_traffic.agents.sight import look
from dubins_traffic.agents.tables import (
    BEGIN,
    BERTH,
    CURVES,
    FIRST,
    FOLLOW,
    GOAL_X,
    GOAL_Y,
    KIND,
    LANE,
    LAST,
    LEG,
    LOOP,
    MISS,
    OFFSET,
    PERIOD,
    PLACE,
    RADIUS,
    REACHED,
    REPEAT,
    SCRIPTED,
    SLOWEST,
    SPEED,
    TANGENT,
    YAW_RATE,
    Agents,
    W,
    Workspace,
)
from dubins_traffic.agents.trail import follow
from dubins_traffic.cars.state import State
from dubins_traffic.cars.tables import ObstacleTable
from dubins_traffic.driving.waypoint import pursue, turn_then_drive
from dubins_traffic.kernels.arrays import Floats, Ints
from dubins_traffic.kernels.compile import jit
from dubins_traffic.roads.table import RoadTable

AIM = 0.6
"""How far along the lane's line a car that can't turn in place aims, metres (for w = 0.3 m), or twice its radius."""
Numbers = tuple[float, float, float, float]
BACK = -0.99
"""Cosine of the turn between two lanes below which it counts as turning round."""


@jit
def decide(
    tick: int,
    begin: int,
    state: State,
    roads: RoadTable,
    obstacles: ObstacleTable,
    agents: Agents,
    work: Workspace,
    commands: Floats,
) -> int:
    """Write the commands of all e-agents of the trials from `begin` on.

    Returns the number of trials, or -1 - b where the room for pairs of neighbours was too small for trial b, which
    is then untouched, like those after it.
    """
    for b in range(begin, state.count.shape[0]):
        if state.count[b] < 2:
            continue
        build = agents.build[b]
        ints = agents.ints[b]
        floats = agents.floats[b]
        if look(state, b, build, floats, obstacles, work) > work.pair.shape[0]:
            return -1 - b
        ego = (state.x[b, 0], state.y[b, 0], state.c[b, 0], state.s[b, 0])
        for n in range(1, state.count[b]):
            speed = 0.0
            yaw_rate = 0.0
            free = tick >= ints[n, BEGIN] and work.held[n] == 0
            pose = (state.x[b, n], state.y[b, n], state.c[b, n], state.s[b, n])
            seen = False
            if ints[n, KIND] == SCRIPTED:
                speed, yaw_rate = play(tick, n, ints, agents.script)
                free = False
            elif ints[n, KIND] == FOLLOW:
                seen, free, speed, yaw_rate = follow(
                    tick, n, pose, ego, free, build, ints, floats, agents.path, agents.mark, agents.last
                )
            if free:
                dx = floats[n, GOAL_X] - pose[0]
                dy = floats[n, GOAL_Y] - pose[1]
                near = dx * dx + dy * dy < floats[n, REACHED] * floats[n, REACHED]
                if near or ints[n, LANE] < 0 or build[CURVES] != 0.0:
                    navigate(
                        tick, n, pose, ego, seen, roads, agents.net[b], build, ints, floats, agents.cycle,
                        work.hops, work.queue, agents.seed[b], agents.trial[b],
                    )  # fmt: skip
                speed, yaw_rate = steer(n, pose, ego, build, floats)
            commands[b, n, 0] = speed
            commands[b, n, 1] = yaw_rate
    return state.count.shape[0]


@jit
def steer(n: int, pose: Numbers, ego: Numbers, build: Floats, floats: Floats) -> tuple[float, float]:
    """Return (speed, yaw rate) toward the waypoint; no speed near the ego."""
    x, y, c, s = pose
    goal_x = floats[n, GOAL_X]
    goal_y = floats[n, GOAL_Y]
    yaw = floats[n, YAW_RATE]
    if build[CURVES] != 0.0:
        speed, yaw_rate = pursue(
            x, y, c, s, goal_x, goal_y, floats[n, SPEED], build[SLOWEST], yaw, build[RADIUS]
        )
    else:
        speed, yaw_rate = turn_then_drive(
            x, y, c, s, goal_x, goal_y, floats[n, TANGENT], floats[n, MISS], floats[n, SPEED], yaw, build[PERIOD]
        )  # fmt: skip
    dx = ego[0] - x
    dy = ego[1] - y
    if dx * dx + dy * dy <= floats[n, BERTH] * abs(floats[n, BERTH]):
        speed = 0.0
    return speed, yaw_rate


@jit
def play(tick: int, n: int, ints: Ints, script: Floats) -> tuple[float, float]:
    """Return (speed, yaw rate) of a script in a tick."""
    first = ints[n, FIRST]
    last = ints[n, LAST]
    if first == last:
        return 0.0, 0.0
    total = int(script[last - 1, 0])
    if total == 0 or (tick >= total and ints[n, REPEAT] == 0):
        return 0.0, 0.0
    tick = tick % total
    row = ints[n, PLACE]
    if row < first or (row > first and script[row - 1, 0] > tick):
        row = first
    while script[row, 0] <= tick:
        row += 1
    ints[n, PLACE] = row
    return script[row, 1], script[row, 2]


@jit
def navigate(
    tick: int, n: int, pose: Numbers, ego: Numbers, seen: bool, roads: RoadTable, net: int,
    build: Floats, ints: Ints, floats: Floats, cycle: Ints, hops: Ints, queue: Ints, seed: Any, trial: int,
) -> None:  # fmt: skip
    """Set the waypoint of a car that begins to drive on lanes, has reached its waypoint, or can't turn in place.

    A car begins with the lane of the nearest segment that leads along its heading. Its waypoint is the end of the
    lane; when the lane leads back, first its start. A car that can't turn in place chooses its next lane before
    the end of the present one and takes it where the arc between their two lines begins; its waypoint is a point
    of the lane's line ahead.
    """
    x, y, c, s = pose
    curves = build[CURVES] != 0.0
    began = ints[n, LANE] < 0
    if began:
        ints[n, LANE] = lane_at(roads, net, x, y, c, s)
        ints[n, LEG] = -1 if curves else 1
        ints[n, PLACE] = place_of(ints[n, LANE], ints[n, FIRST], ints[n, LAST], cycle)
    lane = ints[n, LANE]
    x0, y0, tx, ty, length = frame(roads.seg[roads.seg_off[net] + (lane >> 1)], lane)
    ahead = length - (x - x0) * tx - (y - y0) * ty
    if curves:
        leaves = ints[n, LEG] < 0 and ahead <= 2.0 * (floats[n, OFFSET] + build[RADIUS])
    else:
        leaves = ints[n, LEG] == 1 and not began
    coming = -1
    if leaves:
        coming = choose(tick, n, lane, ego, seen, roads, net, ints, cycle, hops, queue, seed, trial)
    if curves:
        if leaves:
            ints[n, LEG] = coming
        coming = ints[n, LEG]
        if coming >= 0:
            _, _, ux, uy, _ = frame(roads.seg[roads.seg_off[net] + (coming >> 1)], coming)
            along = tx * ux + ty * uy
            half = (tx * uy - ty * ux) / (1.0 + along) if along > BACK else 0.0
            if ahead <= build[RADIUS] * abs(half) - floats[n, OFFSET] * half:
                ints[n, LANE] = coming
                ints[n, LEG] = -1
    elif leaves:
        ints[n, LANE] = coming
        ints[n, LEG] = 0 if coming == lane ^ 1 else 1
    elif not began:
        ints[n, LEG] = 1
    lane = ints[n, LANE]
    x0, y0, tx, ty, length = frame(roads.seg[roads.seg_off[net] + (lane >> 1)], lane)
    progress = length if ints[n, LEG] == 1 else 0.0
    if curves:
        progress = (x - x0) * tx + (y - y0) * ty + max(AIM * build[W] / 0.3, 2.0 * build[RADIUS])
    floats[n, GOAL_X] = x0 + progress * tx + floats[n, OFFSET] * ty
    floats[n, GOAL_Y] = y0 + progress * ty - floats[n, OFFSET] * tx


@jit
def choose(
    tick: int, n: int, lane: int, ego: Numbers, seen: bool, roads: RoadTable, net: int,
    ints: Ints, cycle: Ints, hops: Ints, queue: Ints, seed: Any, trial: int,
) -> int:  # fmt: skip
    """Return the lane to take at the end of `lane`: round the cycle or to it, toward the ego if seen, or any."""
    if ints[n, PLACE] >= 0:
        ints[n, PLACE] = ints[n, PLACE] + 1 if ints[n, PLACE] + 1 < ints[n, LAST] else ints[n, FIRST]
        return cycle[ints[n, PLACE]]
    v = roads.vert_off[net] + roads.ends[roads.seg_off[net] + (lane >> 1), 1 - (lane & 1)]
    if ints[n, KIND] != LOOP and not seen:
        return random_exit(roads.arms, roads.degree, v, lane, seed, trial, n, tick)
    for k in range(hops.shape[0]):
        hops[k] = FAR
    count = 0
    if seen:
        count = aim_for(lane_at(roads, net, ego[0], ego[1], ego[2], ego[3]), hops, queue, count)
    for k in range(ints[n, FIRST], ints[n, LAST]):
        count = aim_for(cycle[k], hops, queue, count)
    spread(roads, net, hops, queue, count)
    taken = nearer_exit(roads.arms, roads.degree, v, lane, hops)
    ints[n, PLACE] = place_of(taken, ints[n, FIRST], ints[n, LAST], cycle)
    return taken
