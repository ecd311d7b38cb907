"""The controller `lanes`: the shortest round through the goals in the right lane, with regard for other cars.

Planning is plain Python and rare: once at the start, and when the way has been blocked for long. What happens every
tick is the compiled policy `policies.lanes.policy`.
"""

from __future__ import annotations

from collections.abc import Callable
from math import hypot, inf

import numpy as np

from dubins_traffic.cars.state import EGO, Command, Observation, Pose, State
from dubins_traffic.cars.tables import pack_obstacles
from dubins_traffic.kernels.calls import bound
from dubins_traffic.kernels.records import table
from dubins_traffic.policies.in_flight import InFlight
from dubins_traffic.policies.lanes.knowledge import NOBODY, Follower, Knowledge, Manner, Sample, SeenCar
from dubins_traffic.policies.lanes.paths import PathMaker, PathRow
from dubins_traffic.policies.lanes.policy import decide, decide_in
from dubins_traffic.policies.lanes.turns import IMPOSSIBLE, can_pivot
from dubins_traffic.policies.rules.tables import vehicles_of
from dubins_traffic.problem.instance import Problem
from dubins_traffic.roads.packing import pack
from dubins_traffic.routing.tours import LaneGraph, Round, find_round

FOLLOW = 1.3
"""Gap kept behind cars, centre to centre, metres: the e-agent of 2016 stands while the ego is within 1 m."""
DETOUR = 80.0
"""Cost, metres, of a way past a place that was found blocked: a detour may be that much longer."""
FORGET = 60.0
"""Seconds after which a blocked place is tried again."""
TURN_ROUND = 15.0
"""Cost of turning round on the road when the way is blocked, metres; at the start it costs BREACH."""
BREACH = 1e3
SAMPLES = 46
"""Number of samples of the path ahead."""


class Lanes:
    """Drives the shortest round through the goals in the right lane; follows cars and waits at intersections.

    Notes
    -----
    The round is the shortest closed route along lanes (`routing.tours.find_round`), in whatever order of the goals
    that needs; goals that the car can't reach on the road, having too large a turning radius, are left out. It is
    joined where that is nearest. Without goals, or if none can be reached, the car stands.

    The car keeps 1.3 m behind others. It waits outside the disc of an intersection of three or more roads, or of a
    dead end, while a car that has moved within the last second is in it. It backs up from a car that it waits for and
    that stands within 1.06 m of it. What has stood in its way for some seconds it passes where there is room on the
    road, else it takes another route, and turns round on the road if that is the only way. A last look before
    every tick rules out all motions that could bring about a contact, whatever the others do.

    With ``speed_min > 0`` a car can't stop: it drives its round as slowly as it may where it ought to wait, and
    collisions can't be ruled out. With a turning radius and reverse, it turns on the spot by shuttling.
    """

    def __init__(self) -> None:
        self._known: Knowledge | None = None

    def start(self, problem: Problem) -> None:
        """Find the round through the goals."""
        self._problem = problem
        self._in_flight = InFlight(problem)
        self._network = problem.network
        self._maker = PathMaker(problem)
        self._blocked: dict[int, float] = {}
        self._closed: dict[int, float] = {}
        self._graph = LaneGraph(problem.network, self._maker.turn_cost)
        self._round = self._find_round()
        self._roads = pack([problem.network], [2.0 * problem.car.w])
        self._known = None

    def act(self, observation: Observation) -> Command:
        """Return the command of the compiled policy; find another route if that asks for one."""

        def decide_now(known: Knowledge) -> None:
            others = np.asarray(known.other)  # as a plain array, of which a whole row is assigned at once
            for car in observation.others:
                others[car.index - 1] = (*car.pose, *car.twist, observation.tick)
            self._decide(observation.tick, *observation.pose, known, self._roads)

        observation = self._in_flight.ahead(observation)
        return self._in_flight.sent(self._drive(observation.tick, lambda: observation.pose, decide_now))

    def act_in(self, b: int, tick: int, radius: float, state: State) -> Command:
        """Drive on as the ego of trial b of a batch, which sees the cars within `radius` (m): what `act` does."""
        return self._drive(
            tick,
            lambda: Pose(*(float(array[b, EGO]) for array in (state.x, state.y, state.c, state.s))),
            lambda known: self._decide_in(b, tick, radius, state, known, self._roads),
        )

    def _drive(self, tick: int, pose: Callable[[], Pose], decide_now: Callable[[Knowledge], None]) -> Command:
        """Let `decide_now` choose the command; `pose` tells where the car is, if it has to find a route."""
        if self._round is None:
            return Command(0.0, 0.0)
        known = self._known
        if known is None or self._blocked or self._closed:
            known = self._known = self._prepared(known, tick, pose())
        decide_now(known)
        ego = known.follower
        if ego.blocker != NOBODY:
            self._detour(tick, pose(), ego.blocker)
        return Command(ego.speed, ego.yaw_rate)

    def _find_round(self) -> Round | None:
        goals = self._problem.goal_vertices
        way = find_round(self._graph, goals)
        if way is None or way.length < IMPOSSIBLE:
            return way
        alone = {goal: find_round(self._graph, (goal,)) for goal in set(goals)}
        lengths = {goal: way.length if way is not None else inf for goal, way in alone.items()}
        way = find_round(self._graph, [goal for goal in goals if lengths[goal] < IMPOSSIBLE])
        return way if way is not None and way.length < IMPOSSIBLE else None

    def _prepared(self, known: Knowledge | None, tick: int, pose: Pose) -> Knowledge:
        """Return what is known, now that the car is at a pose: all that there is to know, or with less blocked."""
        if known is not None:
            return self._remember(known, tick, pose)
        self._decide, self._decide_in = bound(decide), bound(decide_in)
        return self._furnish(pose)

    def _furnish(self, pose: Pose) -> Knowledge:
        problem = self._problem
        vehicle = vehicles_of([problem], [True])[0]
        manner = table(Manner, 1)[0]
        manner.follow = max(FOLLOW, 2.0 * vehicle.reach + 0.5)
        others = len(problem.e_agents)
        known = Knowledge(
            path=table(PathRow, 1),
            follower=table(Follower, 1)[0],
            vehicle=vehicle,
            manner=manner,
            other=table(SeenCar, others),
            still=np.zeros(others),
            gap=np.zeros(others),
            obstacles=pack_obstacles([problem.obstacles]),
            sample=table(Sample, SAMPLES),
        )
        return self._plan(known, pose)

    def _plan(self, known: Knowledge, pose: Pose) -> Knowledge:
        """Return `known` with the cheapest path from `pose` to the round and along it."""
        tours = self._round
        assert tours is not None
        best = (inf, 0, 0.0, 0.0, -1)
        arrivals = tuple(dict.fromkeys(tours.arrivals[:8]))
        tables = [self._graph.distances(tours.lanes[place]) for place in arrivals]
        for lane, progress, left, cost in self._entries(pose):
            for k in range(len(tables)):
                total = cost + tables[k][lane]
                if total < best[0]:
                    best = (total, lane, progress, left, k)
        _, lane, progress, left, k = best
        place = arrivals[k]
        target = tours.lanes[place]
        approach = [lane]
        if lane != target:
            approach += self._graph.route(lane, target, tables[k])
        lanes = [*approach, *tours.lanes[place + 1 :], *tours.lanes[: place + 1]]
        path = self._maker.path(lanes, progress, len(approach))
        follower = table(Follower, 1)[0]
        follower.loop = path.loop
        follower.begin = follower.left = left
        follower.ramp = follower.until = 0.2 + 0.8 * abs(left)
        return known.replace(path=path.rows, follower=follower)

    def _entries(self, pose: Pose) -> list[tuple[int, float, float, float]]:
        """Return the lanes to begin with: (lane, progress, metres left of the right lane's middle, cost)."""
        network, w = self._network, self._problem.car.w
        point = np.array((pose.x, pose.y))
        segment = int(network.nearest_segment(point)[0])
        vertex, far = network.nearest_intersection(point)
        turning = TURN_ROUND if self._blocked or self._closed else BREACH
        if not can_pivot(self._problem.car):
            turning = IMPOSSIBLE
        lanes = {2 * segment: False, 2 * segment + 1: False}
        if float(far) < self._problem.intersection_radius:
            lanes |= dict.fromkeys(network.arms(int(vertex)), True)
        entries: list[tuple[int, float, float, float]] = []
        for lane, out in lanes.items():
            s, left = (float(value) for value in network.lane_coordinates(lane, point))
            length = self._graph.length[lane]
            tx, ty = network.lane_places(lane, np.array([s]))[1][0].tolist()
            along = pose.c * tx + pose.s * ty
            cost = length - s + (0.0 if along > 0.3 or out else turning)
            cost += DETOUR if lane in self._blocked else 0.0
            turns = (self._maker.turn(lane, other) for other in network.successors(lane))
            if not out and length - s < max(turn.before for turn in turns):
                cost += 20.0
            if abs(left + w) > 2.5 * w or s < -self._problem.intersection_radius:
                cost += 50.0
            entries.append((lane, min(s, length), left + w, cost))
        return entries

    def _cost(self, lane: int, other: int) -> float:
        """Return the cost of a turn, metres, with that of places found blocked."""
        cost = self._maker.turn_cost(lane, other)
        if other in self._blocked:
            cost += DETOUR
        if self._graph.end[lane] in self._closed:
            cost += DETOUR
        return cost

    def _reroute(self, known: Knowledge, pose: Pose) -> Knowledge:
        """Find the round again, with regard for places that are blocked now; return `known` with the path to it."""
        before = self._round
        self._graph = LaneGraph(self._network, self._cost)
        self._round = self._find_round() or before
        return self._plan(known, pose)

    def _remember(self, known: Knowledge, tick: int, pose: Pose) -> Knowledge:
        """Forget blocked places after FORGET seconds; return `known`, with a new path if that is possible here."""
        time = tick / self._problem.rate
        old = [place for places in (self._blocked, self._closed) for place in places if places[place] <= time]
        row = known.path[known.follower.row]
        if not old or row.lane < 0 or known.follower.sigma > 0.3 * row.length:
            return known
        self._blocked = {lane: until for lane, until in self._blocked.items() if until > time}
        self._closed = {vertex: until for vertex, until in self._closed.items() if until > time}
        return self._reroute(known, pose)

    def _detour(self, tick: int, pose: Pose, blocker: int) -> None:
        """Note where the way is blocked, and find another route."""
        known = self._known
        assert known is not None
        body = known.other[blocker] if blocker >= 0 else known.obstacles.parts[-1 - blocker]
        point = np.array((body.x, body.y))
        until = tick / self._problem.rate + FORGET
        vertex, far = self._network.nearest_intersection(point)
        if float(far) < self._problem.intersection_radius + self._problem.car.body.reach:
            self._closed[int(vertex)] = until
        else:
            segment = int(self._network.nearest_segment(point)[0])
            place, left = self._network.lane_coordinates(2 * segment, point)
            here, _ = self._network.lane_coordinates(2 * segment, (pose.x, pose.y))
            ahead = float(place) - float(here)
            self._blocked[2 * segment + (1 if float(left) > 0.0 else 0)] = until
            if hypot(point[0] - pose.x, point[1] - pose.y) < 3.0:
                self._blocked[2 * segment + (0 if ahead > 0.0 else 1)] = until
        self._known = self._reroute(known, pose)
