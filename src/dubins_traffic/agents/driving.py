"""Driving on lanes without regard for rules: choose the next lane, set the next waypoint, drive to it (compiled)."""

from __future__ import annotations

from dubins_traffic.agents.tables import Agent, Scene, Team
from dubins_traffic.cars.state import EGO, Command, Pose, State
from dubins_traffic.kernels.arrays import Ints
from dubins_traffic.kernels.compile import jit
from dubins_traffic.kernels.random import DRAW, below
from dubins_traffic.policies.waypoint import pursue, turn_or_pursue, turn_then_drive
from dubins_traffic.roads.lookup import bends_before, lane_length
from dubins_traffic.roads.table import RoadTable
from dubins_traffic.routing.lane_graph import (
    FAR,
    aim_for,
    foot,
    frame,
    lane_at,
    place_of,
    place_on_lane,
    spread,
)

AIM = 0.6
"""Distance to the waypoint of a car that can't turn in place, metres (for w = 0.3 m); at least twice its radius."""
BEND_AIM = 0.3
"""Distance to the waypoint on a bent road of a car that can turn in place, metres (for w = 0.3 m)."""
TIRES = 4.0
"""Mean time for which a car whose patience ended waits for its way to be clear before it turns round, seconds."""
BACK = -0.99
"""Cosine of the turn between two lanes below which it counts as turning round."""


@jit
def drive(b: int, n: int, tick: int, pose: Pose, seen: bool, weary: bool, scene: Scene) -> tuple[float, float]:
    """Return (speed, yaw rate) toward the waypoint of car n, which is set anew when the car has reached it.

    `seen` (bool): the ego is seen and to be followed; `weary` (bool): the car's patience has ended and something is in
    its way.
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
    if agent.leg == 1 and bends_before(scene.roads, team.net, agent.lane, pose.x, pose.y):
        x, y = _ahead(pose, BEND_AIM * team.w / 0.3, agent.lane, team.net, agent.offset, scene.roads)
        return turn_or_pursue(pose, x, y, most, team.slowest, team.radius, team.period)
    return turn_then_drive(pose, agent.goal_x, agent.goal_y, most, agent.tangent, agent.miss, team.period)


@jit
def pose_of(state: State, b: int, n: int) -> Pose:
    """Return the pose of car n of trial b."""
    return Pose(state.x[b, n], state.y[b, n], state.c[b, n], state.s[b, n])


@jit
def tires(tick: int, n: int, team: Team) -> bool:
    """Tell whether a barred car turns round in this tick: at random, so that not all cars do at once."""
    bound = min(int(TIRES / team.period) + 1, 1 << 16)
    return below(team.seed, team.trial, n, tick, DRAW.TURN, bound) == 0


@jit
def begin_lane(pose: Pose, roads: RoadTable, net: int, agent: Agent, cycle: Ints, leg: int) -> None:
    """Put a car on the lane of the nearest segment that follows its heading; set `Agent.leg` to `leg` (as there).

    `cycle` (M,) holds the lanes of all cycles in order.
    """
    lane = lane_at(roads, net, pose)
    agent.lane = lane
    agent.leg = leg
    agent.place = place_of(lane, agent.first, agent.last, cycle)


@jit
def navigate(b: int, n: int, tick: int, pose: Pose, seen: bool, weary: bool, scene: Scene) -> None:
    """Set the next waypoint: the end of the lane, or, after turning round there, first the start of the lane back.

    A `weary` (bool) car turns round where it stands; any other has reached its waypoint or begins to drive. The next
    lane leads toward the ego if that is `seen` (bool).
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
    progress = lane_length(roads, net, lane) if agent.leg == 1 else 0.0
    agent.goal_x, agent.goal_y = _beside(lane, progress, net, agent.offset, roads)


@jit
def _beside(lane: int, along: float, net: int, offset: float, roads: RoadTable) -> tuple[float, float]:
    """Return the point `offset` (m) right of a lane's road `along` (m) from its start."""
    x, y, tx, ty = place_on_lane(roads, net, lane, along)
    return x + offset * ty, y - offset * tx


@jit
def _ahead(pose: Pose, far: float, lane: int, net: int, offset: float, roads: RoadTable) -> tuple[float, float]:
    """Return the point `offset` (m) right of a lane's road that is `far` (m) ahead of a car along it."""
    along, _, _, _, _ = foot(roads, net, lane, pose.x, pose.y)
    return _beside(lane, along + far, net, offset, roads)


@jit
def navigate_arcs(b: int, n: int, tick: int, pose: Pose, seen: bool, scene: Scene) -> None:
    """Set the waypoint of a car that can't turn in place: a point of its lane's line ahead.

    It chooses its next lane before the end of the present one and takes it where the arc between the two lines
    begins; `seen` (bool) as for `navigate`.
    """
    roads, team, agent = scene.roads, scene.agents.team[b], scene.agents.agent[b, n]
    net, radius, offset = team.net, team.radius, agent.offset
    if agent.lane < 0:
        begin_lane(pose, roads, net, agent, scene.agents.cycle, -1)
    lane = agent.lane
    along, _, tx, ty, length = foot(roads, net, lane, pose.x, pose.y)
    ahead = length - along
    if agent.leg < 0 and ahead <= 2.0 * (offset + radius):
        agent.leg = choose(b, n, tick, lane, seen, scene)
    coming = agent.leg
    if coming >= 0:
        _, _, ux, uy, _ = frame(roads, net, coming)
        cosine = tx * ux + ty * uy
        half = (tx * uy - ty * ux) / (1.0 + cosine) if cosine > BACK else 0.0
        if ahead <= radius * abs(half) - offset * half:
            lane = coming
            agent.lane = lane
            agent.leg = -1
    far = max(AIM * team.w / 0.3, 2.0 * radius)
    agent.goal_x, agent.goal_y = _ahead(pose, far, lane, net, offset, roads)


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


@jit
def random_exit(roads: RoadTable, v: int, lane: int, team: Team, car: int, tick: int) -> int:
    """Return a random lane out of `v`, each equally likely, except the one back, which is taken at dead ends only.

    The draw follows from the team's seed, `car` (number) and tick.
    """
    arms, degree = roads.arms, roads.degree
    if degree[v] < 2:
        return lane ^ 1
    pick = below(team.seed, team.trial, car, tick, DRAW.LANE, degree[v] - 1)
    for k in range(degree[v]):
        if arms[v, k] != lane ^ 1:
            if pick == 0:
                return arms[v, k]
            pick -= 1
    return lane ^ 1


@jit
def nearer_exit(roads: RoadTable, v: int, lane: int, hops: Ints) -> int:
    """Return the lane out of `v` with the fewest hops to go; the lane back only if no other leads there.

    `hops` (L,) is the number of lanes to go from each lane.
    """
    arms, degree = roads.arms, roads.degree
    best = lane ^ 1
    fewest = FAR
    for k in range(degree[v]):
        if arms[v, k] != lane ^ 1 and hops[arms[v, k]] < fewest:
            best = arms[v, k]
            fewest = hops[best]
    return best
