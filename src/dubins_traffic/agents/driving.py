"""Driving on lanes, as all e-agents do that drive where they like: next lane, next waypoint, commands."""

from __future__ import annotations

from dubins_traffic.agents.lanes import nearer_exit, random_exit
from dubins_traffic.agents.tables import Agent, Scene, Team
from dubins_traffic.cars.state import EGO, Command, Pose, State
from dubins_traffic.kernels.arrays import Ints
from dubins_traffic.kernels.compile import jit
from dubins_traffic.kernels.random import DRAW, below
from dubins_traffic.policies.waypoint import pursue, turn_then_drive
from dubins_traffic.roads.table import RoadTable
from dubins_traffic.routing.lane_graph import FAR, aim_for, frame, lane_at, place_of, spread

AIM = 0.6
"""How far along the lane's line a car that can't turn in place aims, metres (for w = 0.3 m), or twice its radius."""
TIRES = 4.0
"""Mean time for which a car whose patience ended waits for its way to be clear before it turns round, seconds."""
BACK = -0.99
"""Cosine of the turn between two lanes below which it counts as turning round."""


@jit
def drive(
    b: int, n: int, tick: int, pose: Pose, seen: bool, weary: bool, scene: Scene
) -> tuple[float, float]:
    """Return (speed, yaw rate) of a car that drives to its waypoint, after choosing the next where it is time.

    `seen` (whether the ego is to be sought), `weary` (whether its patience ended and something is in its way).
    """
    team, agent = scene.agents.team[b], scene.agents.agent[b, n]
    most = Command(agent.speed, agent.yaw_rate)
    if team.curves != 0:
        navigate_arcs(b, n, tick, pose, seen, scene)
        return pursue(pose, agent.goal_x, agent.goal_y, most, team.slowest, team.radius)
    dx = agent.goal_x - pose.x
    dy = agent.goal_y - pose.y
    weary = weary and tires(tick, n, team)
    reached = agent.reached
    if weary or agent.lane < 0 or dx * dx + dy * dy < reached * reached:
        navigate(b, n, tick, pose, seen, weary, scene)
    return turn_then_drive(pose, agent.goal_x, agent.goal_y, most, agent.tangent, agent.miss, team.period)


@jit
def pose_of(state: State, b: int, n: int) -> Pose:
    """Return the pose of car n of trial b."""
    return Pose(state.x[b, n], state.y[b, n], state.c[b, n], state.s[b, n])


@jit
def tires(tick: int, n: int, team: Team) -> bool:
    """Return whether a car that is barred turns round in this tick: at random, so that not all do at once."""
    bound = min(int(TIRES / team.period) + 1, 1 << 16)
    return below(team.seed, team.trial, n, tick, DRAW.TURN, bound) == 0


@jit
def begin_lane(pose: Pose, roads: RoadTable, net: int, agent: Agent, cycle: Ints, leg: int) -> None:
    """Take the lane of the nearest segment that leads along the heading, `leg` (as `Agent.leg`).

    `cycle` (M,) holds the lanes of all cycles in order.
    """
    lane = lane_at(roads, net, pose)
    agent.lane = lane
    agent.leg = leg
    agent.place = place_of(lane, agent.first, agent.last, cycle)


@jit
def navigate(b: int, n: int, tick: int, pose: Pose, seen: bool, weary: bool, scene: Scene) -> None:
    """Set the next waypoint: the end of the lane; after turning round at an end first the start of the lane back.

    A `weary` (bool) car turns round where it stands, others have reached their waypoint or begin to drive; where the
    ego is `seen` (bool) they go toward it.
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
def navigate_arcs(b: int, n: int, tick: int, pose: Pose, seen: bool, scene: Scene) -> None:
    """Set the waypoint of a car that can't turn in place: a point of its lane's line ahead.

    It chooses its next lane before the end of the present one and takes it where the arc between the two lines
    begins; `seen` (bool) as for `navigate`.
    """
    roads, team, agent = scene.roads, scene.agents.team[b], scene.agents.agent[b, n]
    net, radius, offset = team.net, team.radius, agent.offset
    x, y = pose.x, pose.y
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
    """Return the lane to take at the end of `lane`: round the cycle or to it, toward the ego if `seen`, or any.

    `seen` (bool) is whether the ego is to be sought.
    """
    roads, cycle = scene.roads, scene.agents.cycle
    team, agent = scene.agents.team[b], scene.agents.agent[b, n]
    place, first, last, net = agent.place, agent.first, agent.last, team.net
    if place >= 0:
        place = place + 1 if place + 1 < last else first
        agent.place = place
        return int(cycle[place])
    v = roads.vert_off[net] + roads.ends[roads.seg_off[net] + (lane >> 1), 1 - (lane & 1)]
    if first == last and not seen:
        return random_exit(roads, v, lane, team, n, tick)
    hops, queue = scene.space.hops, scene.space.queue
    for k in range(hops.shape[0]):
        hops[k] = FAR
    count = 0
    if seen:
        ego = pose_of(scene.state, b, EGO)
        count = aim_for(lane_at(roads, net, ego), hops, queue, count)
    for k in range(first, last):
        count = aim_for(cycle[k], hops, queue, count)
    spread(roads, net, hops, queue, count)
    taken = nearer_exit(roads, v, lane, hops)
    agent.place = place_of(taken, first, last, cycle)
    return taken
