"""One tick of all e-agents of a batch: the compiled entry point and what each kind does."""

from __future__ import annotations

from dubins_traffic.agents.lanes import (
    aim_for,
    clear,
    frame,
    lane_at,
    loop_exit,
    nearer_exit,
    place_of,
    random_exit,
    spread,
    waypoint,
)
from dubins_traffic.agents.sight import look
from dubins_traffic.agents.tables import (
    BERTH,
    CURVES,
    FOLLOW,
    LOOP,
    MISS,
    OFFSET,
    PERIOD,
    RADIUS,
    REACHED,
    SCRIPTED,
    SLOWEST,
    SPEED,
    TANGENT,
    YAW_RATE,
    Cast,
    Memory,
    W,
    Workspace,
)
from dubins_traffic.agents.trail import observe, on_path, track
from dubins_traffic.cars.state import State
from dubins_traffic.cars.tables import ObstacleTable
from dubins_traffic.driving.waypoint import pursue, turn_then_drive
from dubins_traffic.kernels.arrays import Floats
from dubins_traffic.kernels.compile import jit
from dubins_traffic.roads.table import RoadTable

AIM = 0.6
"""How far along the lane line a car that can't turn in place aims, metres (for w = 0.3 m), or twice its radius."""
BACK = -0.99
"""Cosine of the turn between two lanes below which it counts as turning round."""


@jit
def decide(
    tick: int,
    begin: int,
    state: State,
    roads: RoadTable,
    obstacles: ObstacleTable,
    cast: Cast,
    memory: Memory,
    work: Workspace,
    commands: Floats,
) -> int:
    """Write the commands of all e-agents of the trials from `begin` on.

    Returns the number of trials, or -1 - b where the room for pairs of neighbours was too small for trial b, which
    is then untouched, like those after it.

    Notes
    -----
    What happens in every tick is done here on numbers: a call that takes tables costs more than all of it.
    """
    for b in range(begin, state.count.shape[0]):
        if state.count[b] < 2:
            continue
        if look(state, b, cast, obstacles, work) > work.pair.shape[0]:
            return -1 - b
        period = cast.build[b, PERIOD]
        curves = cast.build[b, CURVES] != 0.0
        for n in range(1, state.count[b]):
            commands[b, n, 0] = 0.0
            commands[b, n, 1] = 0.0
            kind = cast.kind[b, n]
            if kind == SCRIPTED:
                commands[b, n, 0], commands[b, n, 1] = _play(tick, b, n, cast, memory)
                continue
            seen = False
            if kind == FOLLOW:
                seen = observe(tick, state, b, n, cast, memory)
            if tick < cast.begin[b, n] or work.held[n] == 1:
                continue
            if kind == FOLLOW and on_path(state, b, n, cast, memory):
                commands[b, n, 0], commands[b, n, 1] = track(state, b, n, seen, cast, memory)
                continue
            if memory.lane[b, n] < 0:
                _enter(state, b, n, roads, cast, memory)
            x = state.x[b, n]
            y = state.y[b, n]
            if curves:
                speed, yaw_rate = _curve(tick, state, b, n, seen, roads, cast, memory, work)
            else:
                dx = memory.goal[b, n, 0] - x
                dy = memory.goal[b, n, 1] - y
                if dx * dx + dy * dy < cast.law[b, n, REACHED] * cast.law[b, n, REACHED]:
                    _arrive(tick, state, b, n, seen, roads, cast, memory, work)
                speed, yaw_rate = turn_then_drive(
                    x, y, state.c[b, n], state.s[b, n], memory.goal[b, n, 0], memory.goal[b, n, 1],
                    cast.law[b, n, TANGENT], cast.law[b, n, MISS],
                    cast.law[b, n, SPEED], cast.law[b, n, YAW_RATE], period,
                )  # fmt: skip
            dx = state.x[b, 0] - x
            dy = state.y[b, 0] - y
            if dx * dx + dy * dy > cast.law[b, n, BERTH] * abs(cast.law[b, n, BERTH]):
                commands[b, n, 0] = speed
            commands[b, n, 1] = yaw_rate
    return state.count.shape[0]


@jit
def _play(tick: int, b: int, n: int, cast: Cast, memory: Memory) -> tuple[float, float]:
    first = cast.plan[b, n, 0]
    last = cast.plan[b, n, 1]
    if first == last:
        return 0.0, 0.0
    total = int(cast.script[last - 1, 0])
    if total == 0 or (tick >= total and cast.plan[b, n, 2] == 0):
        return 0.0, 0.0
    tick = tick % total
    row = memory.place[b, n]
    if row < first or (row > first and cast.script[row - 1, 0] > tick):
        row = first
    while cast.script[row, 0] <= tick:
        row += 1
    memory.place[b, n] = row
    return cast.script[row, 1], cast.script[row, 2]


@jit
def _enter(state: State, b: int, n: int, roads: RoadTable, cast: Cast, memory: Memory) -> None:
    """Take the lane of the nearest segment that leads along the heading, and drive to its end."""
    net = cast.net[b]
    lane = lane_at(roads, net, state.x[b, n], state.y[b, n], state.c[b, n], state.s[b, n])
    memory.lane[b, n] = lane
    memory.leg[b, n] = 1 if cast.build[b, CURVES] == 0.0 else -1
    goal_x, goal_y = waypoint(roads, net, lane, cast.law[b, n, OFFSET], 0.0, True)
    memory.goal[b, n, 0] = goal_x
    memory.goal[b, n, 1] = goal_y
    if cast.kind[b, n] == LOOP:
        memory.place[b, n] = place_of(lane, cast.plan[b, n, 0], cast.plan[b, n, 1], cast.cycle)


@jit
def _exit(
    tick: int,
    state: State,
    b: int,
    n: int,
    seen: bool,
    roads: RoadTable,
    cast: Cast,
    memory: Memory,
    work: Workspace,
) -> int:
    """Return the lane to take at the end of the present one: round the loop, toward the ego, or any."""
    net = cast.net[b]
    lane = memory.lane[b, n]
    if cast.kind[b, n] == LOOP:
        return loop_exit(roads, net, lane, b, n, cast, memory, work)
    if seen:
        clear(roads, net, work.hops)
        goal = lane_at(roads, net, state.x[b, 0], state.y[b, 0], state.c[b, 0], state.s[b, 0])
        spread(roads, net, work.hops, work.queue, aim_for(goal, work.hops, work.queue, 0))
        return nearer_exit(roads, net, lane, work.hops)
    return random_exit(roads, net, lane, cast.seed[b], cast.trial[b], n, tick)


@jit
def _arrive(
    tick: int,
    state: State,
    b: int,
    n: int,
    seen: bool,
    roads: RoadTable,
    cast: Cast,
    memory: Memory,
    work: Workspace,
) -> None:
    """Set the next waypoint: the end of the next lane, or first its start when that leads back."""
    net = cast.net[b]
    lane = memory.lane[b, n]
    to_end = True
    if memory.leg[b, n] == 1:
        taken = _exit(tick, state, b, n, seen, roads, cast, memory, work)
        to_end = taken != lane ^ 1
        lane = taken
    memory.lane[b, n] = lane
    memory.leg[b, n] = 1 if to_end else 0
    goal_x, goal_y = waypoint(roads, net, lane, cast.law[b, n, OFFSET], 0.0, to_end)
    memory.goal[b, n, 0] = goal_x
    memory.goal[b, n, 1] = goal_y


@jit
def _curve(
    tick: int,
    state: State,
    b: int,
    n: int,
    seen: bool,
    roads: RoadTable,
    cast: Cast,
    memory: Memory,
    work: Workspace,
) -> tuple[float, float]:
    """Drive along the lines of lanes on arcs, for cars that can't turn in place.

    The next lane is chosen before the end of the present one, and taken where the arc between the two lines begins.
    """
    net = cast.net[b]
    offset = cast.law[b, n, OFFSET]
    radius = cast.build[b, RADIUS]
    lane = memory.lane[b, n]
    x0, y0, tx, ty, length = frame(roads, net, lane)
    progress = (state.x[b, n] - x0) * tx + (state.y[b, n] - y0) * ty
    if memory.leg[b, n] < 0 and progress >= length - 2.0 * (offset + radius):
        memory.leg[b, n] = _exit(tick, state, b, n, seen, roads, cast, memory, work)
    coming = memory.leg[b, n]
    if coming >= 0:
        _, _, ux, uy, _ = frame(roads, net, coming)
        along = tx * ux + ty * uy
        half = (tx * uy - ty * ux) / (1.0 + along) if along > BACK else 0.0
        if progress >= length + offset * half - radius * abs(half):
            lane = coming
            memory.lane[b, n] = lane
            memory.leg[b, n] = -1
            x0, y0, tx, ty, length = frame(roads, net, lane)
            progress = (state.x[b, n] - x0) * tx + (state.y[b, n] - y0) * ty
    progress += max(AIM * cast.build[b, W] / 0.3, 2.0 * radius)
    goal_x, goal_y = waypoint(roads, net, lane, offset, progress, False)
    return pursue(
        state.x[b, n], state.y[b, n], state.c[b, n], state.s[b, n], goal_x, goal_y,
        cast.law[b, n, SPEED], cast.build[b, SLOWEST], cast.law[b, n, YAW_RATE], radius,
    )  # fmt: skip
