"""One tick of all e-agents of a batch: the compiled entry point and what each kind does."""

from __future__ import annotations

from dubins_traffic.agents.lanes import nearer_exit, random_exit
from dubins_traffic.agents.sight import look
from dubins_traffic.agents.tables import (
    BARRED,
    FOLLOW,
    LOOP,
    SCRIPTED,
    SEES,
    TIGHT,
    WEARY,
    Agent,
    Scene,
    Stretch,
    Team,
)
from dubins_traffic.agents.trail import follow
from dubins_traffic.cars.state import State
from dubins_traffic.kernels.arrays import Floats, Ints
from dubins_traffic.kernels.compile import jit
from dubins_traffic.kernels.random import below
from dubins_traffic.kernels.records import Rows
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


@jit
def decide(tick: int, begin: int, commands: Floats, scene: Scene) -> int:
    """Write the commands of all e-agents of the trials from `begin` on.

    Returns the number of trials, or -1 - b where the room for pairs of neighbours was too small for trial b, which is
    then untouched, like those after it.
    """
    count = scene.state.count
    for b in range(begin, count.shape[0]):
        if count[b] > 1 and not decide_trial(b, tick, scene, commands):
            return -1 - b
    return count.shape[0]


@jit
def decide_trial(b: int, tick: int, scene: Scene, commands: Floats) -> bool:
    """Write the commands of the e-agents of one trial; False, and nothing done, if there is no room for its pairs."""
    state, agents, work = scene.state, scene.agents, scene.space
    if look(scene, b) > work.search.pair.shape[0]:
        return False
    ego = _pose(state, b, 0)
    for n in range(1, state.count[b]):
        agent = agents.agent[b, n]
        kind = agent.kind
        speed = 0.0
        yaw_rate = 0.0
        pose = _pose(state, b, n)
        held = hold(tick, pose, ego, work.held[n], agent)
        free = tick >= agent.begin and held & SEES == 0
        seen = False
        if kind == SCRIPTED:
            speed, yaw_rate = play(tick, agent, agents.script)
            free = False
        elif kind == FOLLOW:
            seen, free, speed, yaw_rate = follow(tick, b, n, pose, ego, free, agents)
        if free:
            weary = held & WEARY != 0
            speed, yaw_rate = drive(b, n, tick, pose, seen, weary, scene)
        commands[b, n, 0] = speed if held & BARRED == 0 else 0.0
        commands[b, n, 1] = yaw_rate if held & TIGHT == 0 else 0.0
    return True


@jit
def drive(
    b: int, n: int, tick: int, pose: Numbers, seen: bool, weary: bool, scene: Scene
) -> tuple[float, float]:
    """Return (speed, yaw rate) of a car that drives to its waypoint, after choosing the next where it is time."""
    team, agent = scene.agents.team[b], scene.agents.agent[b, n]
    x, y, c, s = pose
    if team.curves != 0:
        navigate_arcs(b, n, tick, pose, seen, scene)
        return pursue(
            x, y, c, s, agent.goal_x, agent.goal_y, agent.speed, team.slowest, agent.yaw_rate, team.radius
        )
    dx = agent.goal_x - x
    dy = agent.goal_y - y
    weary = weary and tires(tick, n, team)
    reached = agent.reached
    if weary or agent.lane < 0 or dx * dx + dy * dy < reached * reached:
        navigate(b, n, tick, pose, seen, weary, scene)
    return turn_then_drive(
        x, y, c, s, agent.goal_x, agent.goal_y, agent.tangent, agent.miss, agent.speed, agent.yaw_rate,
        team.period,
    )  # fmt: skip


@jit
def _pose(state: State, b: int, n: int) -> Numbers:
    return state.x[b, n], state.y[b, n], state.c[b, n], state.s[b, n]


@jit
def hold(tick: int, pose: Numbers, ego: Numbers, held: int, agent: Agent) -> int:
    """Return what holds a car: SEES for no motion, BARRED for no speed, TIGHT for no turning.

    A car stands while it SEES something, and has no speed near the ego. When its patience ends, only what is in
    its way or too near holds it, and WEARY says that something is in its way.
    """
    dx = ego[0] - pose[0]
    dy = ego[1] - pose[1]
    berth = agent.berth
    beside = dx * dx + dy * dy <= berth * abs(berth)
    if held == 0 and not beside:
        agent.since = -1
        return 0
    if agent.since < 0:
        agent.since = tick
    if agent.patience >= 0 and tick - agent.since >= agent.patience:
        return held & (BARRED | TIGHT) | (WEARY if held & BARRED != 0 else 0)
    return held & SEES | (BARRED if beside else 0)


@jit
def tires(tick: int, n: int, team: Team) -> bool:
    """Return whether a car that is barred turns round in this tick: at random, so that not all do at once."""
    bound = min(int(TIRES / team.period) + 1, 1 << 16)
    return below(team.seed, team.trial, n, tick, TURN_DRAW, bound) == 0


@jit
def play(tick: int, agent: Agent, script: Rows[Stretch]) -> tuple[float, float]:
    """Return (speed, yaw rate) of a script in a tick."""
    first = agent.first
    last = agent.last
    if first == last:
        return 0.0, 0.0
    total = int(script[last - 1].end)
    if total == 0 or (tick >= total and agent.repeat == 0):
        return 0.0, 0.0
    tick = tick % total
    row = agent.place
    if row < first or (row > first and script[row - 1].end > tick):
        row = first
    while script[row].end <= tick:
        row += 1
    agent.place = row
    return script[row].speed, script[row].yaw_rate


@jit
def begin_lane(pose: Numbers, roads: RoadTable, net: int, agent: Agent, cycle: Ints, leg: int) -> None:
    """Take the lane of the nearest segment that leads along the heading."""
    lane = lane_at(roads, net, pose[0], pose[1], pose[2], pose[3])
    agent.lane = lane
    agent.leg = leg
    agent.place = place_of(lane, agent.first, agent.last, cycle)


@jit
def navigate(b: int, n: int, tick: int, pose: Numbers, seen: bool, weary: bool, scene: Scene) -> None:
    """Set the next waypoint: the end of the lane; after turning round at an end first the start of the lane back.

    A `weary` car turns round where it stands, others have reached their waypoint or begin to drive.
    """
    roads, cycle = scene.roads, scene.agents.cycle
    net, agent = scene.agents.team[b].net, scene.agents.agent[b, n]
    lane = agent.lane
    if lane < 0:
        begin_lane(pose, roads, net, agent, cycle, 1)
    elif weary:
        agent.lane = lane ^ 1
        agent.leg = 1
        agent.place = place_of(lane ^ 1, agent.first, agent.last, cycle)
    elif agent.leg == 1:
        taken = choose(b, n, tick, lane, seen, scene)
        agent.lane = taken
        agent.leg = 0 if taken == lane ^ 1 else 1
    else:
        agent.leg = 1
    lane = agent.lane
    x0, y0, tx, ty, length = frame(roads, net, lane)
    progress = length if agent.leg == 1 else 0.0
    _aim_at(agent, x0 + progress * tx, y0 + progress * ty, tx, ty)


@jit
def _aim_at(agent: Agent, x: float, y: float, tx: float, ty: float) -> None:
    """Set the waypoint `offset` right of a point of a centre line with direction (tx, ty)."""
    offset = agent.offset
    agent.goal_x = x + offset * ty
    agent.goal_y = y - offset * tx


@jit
def navigate_arcs(b: int, n: int, tick: int, pose: Numbers, seen: bool, scene: Scene) -> None:
    """Set the waypoint of a car that can't turn in place: a point of its lane's line ahead.

    It chooses its next lane before the end of the present one and takes it where the arc between the two lines
    begins.
    """
    roads, team, agent = scene.roads, scene.agents.team[b], scene.agents.agent[b, n]
    net, radius, offset = team.net, team.radius, agent.offset
    x, y, _, _ = pose
    if agent.lane < 0:
        begin_lane(pose, roads, net, agent, scene.agents.cycle, -1)
    lane = agent.lane
    x0, y0, tx, ty, length = frame(roads, net, lane)
    ahead = length - (x - x0) * tx - (y - y0) * ty
    if agent.leg < 0 and ahead <= 2.0 * (offset + radius):
        agent.leg = choose(b, n, tick, lane, seen, scene)
    coming = agent.leg
    if coming >= 0:
        _, _, ux, uy, _ = frame(roads, net, coming)
        along = tx * ux + ty * uy
        half = (tx * uy - ty * ux) / (1.0 + along) if along > BACK else 0.0
        if ahead <= radius * abs(half) - offset * half:
            lane = coming
            agent.lane = lane
            agent.leg = -1
            x0, y0, tx, ty, length = frame(roads, net, lane)
    progress = (x - x0) * tx + (y - y0) * ty + max(AIM * team.w / 0.3, 2.0 * radius)
    _aim_at(agent, x0 + progress * tx, y0 + progress * ty, tx, ty)


@jit
def choose(b: int, n: int, tick: int, lane: int, seen: bool, scene: Scene) -> int:
    """Return the lane to take at the end of `lane`: round the cycle or to it, toward the ego if seen, or any."""
    roads, cycle = scene.roads, scene.agents.cycle
    team, agent = scene.agents.team[b], scene.agents.agent[b, n]
    place, first, last, net = agent.place, agent.first, agent.last, team.net
    if place >= 0:
        place = place + 1 if place + 1 < last else first
        agent.place = place
        return int(cycle[place])
    v = roads.vert_off[net] + roads.ends[roads.seg_off[net] + (lane >> 1), 1 - (lane & 1)]
    if agent.kind != LOOP and not seen:
        return random_exit(roads, v, lane, team, n, tick)
    hops, queue = scene.space.hops, scene.space.queue
    for k in range(hops.shape[0]):
        hops[k] = FAR
    count = 0
    if seen:
        ego = _pose(scene.state, b, 0)
        count = aim_for(lane_at(roads, net, ego[0], ego[1], ego[2], ego[3]), hops, queue, count)
    for k in range(first, last):
        count = aim_for(cycle[k], hops, queue, count)
    spread(roads, net, hops, queue, count)
    taken = nearer_exit(roads.arms, roads.degree, v, lane, hops)
    agent.place = place_of(taken, first, last, cycle)
    return taken
