"""One tick of all e-agents of a batch: the compiled entry point and what each kind does."""

from __future__ import annotations

from typing import Any

from dubins_traffic.agents.lanes import nearer_exit, random_exit
from dubins_traffic.agents.sight import look
from dubins_traffic.agents.tables import (
    BARRED,
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
    PATIENCE,
    PERIOD,
    PLACE,
    RADIUS,
    REACHED,
    REPEAT,
    SCRIPTED,
    SEES,
    SINCE,
    SLOWEST,
    SPEED,
    TANGENT,
    TIGHT,
    WEARY,
    YAW_RATE,
    Agents,
    W,
    Workspace,
)
from dubins_traffic.agents.trail import follow
from dubins_traffic.cars.state import STATE_END, State
from dubins_traffic.cars.tables import ObstacleTable
from dubins_traffic.kernels.arrays import Floats, Ints
from dubins_traffic.kernels.compile import jit, jit_inner
from dubins_traffic.kernels.random import below
from dubins_traffic.policies.waypoint import pursue, turn_then_drive
from dubins_traffic.roads.table import RoadTable
from dubins_traffic.routing.lane_graph import FAR, aim_for, frame, lane_at, place_of, spread

AIM = 0.6
"""How far along the lane's line a car that can't turn in place aims, metres (for w = 0.3 m), or twice its radius."""
Numbers = tuple[float, float, float, float]
TURN_DRAW = 1
TIRES = 4.0
"""Mean time for which a car whose patience ended waits for its way to be clear before it turns round, seconds."""
BACK = -0.99
"""Cosine of the turn between two lanes below which it counts as turning round."""


# Where each table begins and ends among the arrays of a call.
ROADS_END = STATE_END + len(RoadTable._fields)
OBSTACLES_END = ROADS_END + len(ObstacleTable._fields)
AGENTS_END = OBSTACLES_END + len(Agents._fields)


@jit
def decide(tick: int, begin: int, commands: Floats, *arrays: Any) -> int:
    """Write the commands of all e-agents of the trials from `begin` on.

    `arrays` are those of State, RoadTable, ObstacleTable, Agents and Workspace, one after another: a call from Python
    with arrays takes a third of the time of one with tables of them. Returns the number of trials, or -1 - b where
    the room for pairs of neighbours was too small for trial b, which is then untouched, like those after it.
    """
    return _decide(
        tick, begin, State(*arrays[:STATE_END]), RoadTable(*arrays[STATE_END:ROADS_END]),
        ObstacleTable(*arrays[ROADS_END:OBSTACLES_END]), Agents(*arrays[OBSTACLES_END:AGENTS_END]),
        Workspace(*arrays[AGENTS_END:]), commands,
    )  # fmt: skip


@jit
def _decide(
    tick: int,
    begin: int,
    state: State,
    roads: RoadTable,
    obstacles: ObstacleTable,
    agents: Agents,
    work: Workspace,
    commands: Floats,
) -> int:
    for b in range(begin, state.count.shape[0]):
        if state.count[b] > 1 and not decide_trial(b, tick, state, roads, obstacles, agents, work, commands):
            return -1 - b
    return state.count.shape[0]


@jit_inner
def decide_trial(
    b: int,
    tick: int,
    state: State,
    roads: RoadTable,
    obstacles: ObstacleTable,
    agents: Agents,
    work: Workspace,
    commands: Floats,
) -> bool:
    """Write the commands of the e-agents of one trial; False, and nothing done, if there is no room for its pairs."""
    build = agents.build[b]
    ints = agents.ints[b]
    floats = agents.floats[b]
    if look(state, b, build, ints, floats, obstacles, work) > work.pair.shape[0]:
        return False
    ego = (state.x[b, 0], state.y[b, 0], state.c[b, 0], state.s[b, 0])
    for n in range(1, state.count[b]):
        speed = 0.0
        yaw_rate = 0.0
        pose = (state.x[b, n], state.y[b, n], state.c[b, n], state.s[b, n])
        held = hold(tick, n, pose, ego, work.held[n], ints, floats)
        free = tick >= ints[n, BEGIN] and held & SEES == 0
        seen = False
        if ints[n, KIND] == SCRIPTED:
            speed, yaw_rate = play(tick, n, ints, agents.script)
            free = False
        elif ints[n, KIND] == FOLLOW:
            seen, free, speed, yaw_rate = follow(
                tick, n, pose, ego, free, build, ints, floats, agents.path, agents.mark, agents.last
            )
        if free and build[CURVES] != 0.0:
            navigate_arcs(
                tick, n, pose, ego, seen, build, roads, agents.net[b], ints, floats, agents.cycle,
                work.hops, work.queue, agents.seed[b], agents.trial[b],
            )  # fmt: skip
            speed, yaw_rate = pursue(
                pose[0], pose[1], pose[2], pose[3], floats[n, GOAL_X], floats[n, GOAL_Y],
                floats[n, SPEED], build[SLOWEST], floats[n, YAW_RATE], build[RADIUS],
            )  # fmt: skip
        elif free:
            dx = floats[n, GOAL_X] - pose[0]
            dy = floats[n, GOAL_Y] - pose[1]
            weary = held & WEARY != 0 and tires(tick, n, build[PERIOD], agents.seed[b], agents.trial[b])
            if weary or ints[n, LANE] < 0 or dx * dx + dy * dy < floats[n, REACHED] * floats[n, REACHED]:
                navigate(
                    tick, n, pose, ego, seen, weary, roads, agents.net[b], ints, floats, agents.cycle,
                    work.hops, work.queue, agents.seed[b], agents.trial[b],
                )  # fmt: skip
            speed, yaw_rate = turn_then_drive(
                pose[0], pose[1], pose[2], pose[3], floats[n, GOAL_X], floats[n, GOAL_Y],
                floats[n, TANGENT], floats[n, MISS], floats[n, SPEED], floats[n, YAW_RATE], build[PERIOD],
            )  # fmt: skip
        commands[b, n, 0] = speed if held & BARRED == 0 else 0.0
        commands[b, n, 1] = yaw_rate if held & TIGHT == 0 else 0.0
    return True


@jit
def hold(tick: int, n: int, pose: Numbers, ego: Numbers, held: int, ints: Ints, floats: Floats) -> int:
    """Return what holds a car: SEES for no motion, BARRED for no speed, TIGHT for no turning.

    A car stands while it SEES something, and has no speed near the ego. When its patience ends, only what is in
    its way or too near holds it, and WEARY says that something is in its way.
    """
    dx = ego[0] - pose[0]
    dy = ego[1] - pose[1]
    beside = dx * dx + dy * dy <= floats[n, BERTH] * abs(floats[n, BERTH])
    if held == 0 and not beside:
        ints[n, SINCE] = -1
        return 0
    if ints[n, SINCE] < 0:
        ints[n, SINCE] = tick
    if ints[n, PATIENCE] >= 0 and tick - ints[n, SINCE] >= ints[n, PATIENCE]:
        return held & (BARRED | TIGHT) | (WEARY if held & BARRED != 0 else 0)
    return held & SEES | (BARRED if beside else 0)


@jit
def tires(tick: int, n: int, period: float, seed: Any, trial: int) -> bool:
    """Return whether a car that is barred turns round in this tick: at random, so that not all do at once."""
    return below(seed, trial, n, tick, TURN_DRAW, min(int(TIRES / period) + 1, 1 << 16)) == 0


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
def begin_lane(n: int, pose: Numbers, roads: RoadTable, net: int, ints: Ints, cycle: Ints, leg: int) -> None:
    """Take the lane of the nearest segment that leads along the heading."""
    ints[n, LANE] = lane_at(roads, net, pose[0], pose[1], pose[2], pose[3])
    ints[n, LEG] = leg
    ints[n, PLACE] = place_of(ints[n, LANE], ints[n, FIRST], ints[n, LAST], cycle)


@jit
def navigate(
    tick: int, n: int, pose: Numbers, ego: Numbers, seen: bool, weary: bool, roads: RoadTable, net: int,
    ints: Ints, floats: Floats, cycle: Ints, hops: Ints, queue: Ints, seed: Any, trial: int,
) -> None:  # fmt: skip
    """Set the next waypoint: the end of the lane; after turning round at an end first the start of the lane back.

    A `weary` car turns round where it stands, others have reached their waypoint or begin to drive.
    """
    lane = ints[n, LANE]
    if lane < 0:
        begin_lane(n, pose, roads, net, ints, cycle, 1)
    elif weary:
        ints[n, LANE] = lane ^ 1
        ints[n, LEG] = 1
        ints[n, PLACE] = place_of(lane ^ 1, ints[n, FIRST], ints[n, LAST], cycle)
    elif ints[n, LEG] == 1:
        ints[n, LANE] = choose(tick, n, lane, ego, seen, roads, net, ints, cycle, hops, queue, seed, trial)
        ints[n, LEG] = 0 if ints[n, LANE] == lane ^ 1 else 1
    else:
        ints[n, LEG] = 1
    lane = ints[n, LANE]
    x0, y0, tx, ty, length = frame(roads.seg[roads.seg_off[net] + (lane >> 1)], lane)
    progress = length if ints[n, LEG] == 1 else 0.0
    floats[n, GOAL_X] = x0 + progress * tx + floats[n, OFFSET] * ty
    floats[n, GOAL_Y] = y0 + progress * ty - floats[n, OFFSET] * tx


@jit
def navigate_arcs(
    tick: int, n: int, pose: Numbers, ego: Numbers, seen: bool, build: Floats, roads: RoadTable, net: int,
    ints: Ints, floats: Floats, cycle: Ints, hops: Ints, queue: Ints, seed: Any, trial: int,
) -> None:  # fmt: skip
    """Set the waypoint of a car that can't turn in place: a point of its lane's line ahead.

    It chooses its next lane before the end of the present one and takes it where the arc between the two lines
    begins.
    """
    x, y, _, _ = pose
    if ints[n, LANE] < 0:
        begin_lane(n, pose, roads, net, ints, cycle, -1)
    lane = ints[n, LANE]
    x0, y0, tx, ty, length = frame(roads.seg[roads.seg_off[net] + (lane >> 1)], lane)
    ahead = length - (x - x0) * tx - (y - y0) * ty
    if ints[n, LEG] < 0 and ahead <= 2.0 * (floats[n, OFFSET] + build[RADIUS]):
        ints[n, LEG] = choose(tick, n, lane, ego, seen, roads, net, ints, cycle, hops, queue, seed, trial)
    coming = ints[n, LEG]
    if coming >= 0:
        _, _, ux, uy, _ = frame(roads.seg[roads.seg_off[net] + (coming >> 1)], coming)
        along = tx * ux + ty * uy
        half = (tx * uy - ty * ux) / (1.0 + along) if along > BACK else 0.0
        if ahead <= build[RADIUS] * abs(half) - floats[n, OFFSET] * half:
            lane = coming
            ints[n, LANE] = lane
            ints[n, LEG] = -1
            x0, y0, tx, ty, length = frame(roads.seg[roads.seg_off[net] + (lane >> 1)], lane)
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
        return int(cycle[ints[n, PLACE]])
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
