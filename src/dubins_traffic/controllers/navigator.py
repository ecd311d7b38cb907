"""What a driver asks of the road: my lane, the line to follow, the stop line, who is ahead, who goes before me.

A `Navigator` is made of the problem and shown each observation; it answers with a `Situation`. It chooses no speed.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from math import acos, cos, inf, pi, sin, sqrt

import numpy as np

from dubins_traffic.cars.state import EGO, NONE, Observation, Pose, Propositions, SensedCar
from dubins_traffic.kernels.records import table
from dubins_traffic.policies.rules.turn_arcs import PART, ReferencePath, on_way, way_between
from dubins_traffic.problem.instance import Problem
from dubins_traffic.roads.lookup import lane_coordinates, lane_end_direction, lane_length
from dubins_traffic.roads.packing import pack
from dubins_traffic.roads.table import RoadTable
from dubins_traffic.routing.lane_graph import lane_at, nearest_stage, place_on_lane
from dubins_traffic.routing.rounds import stages
from dubins_traffic.rules.parameters import RuleParameters
from dubins_traffic.rules.propositions import FLAG, renews_ticket
from dubins_traffic.rules.queue import Queue, rank_queue
from dubins_traffic.rules.tables import CarMemory, ticks


@dataclass(frozen=True, slots=True)
class Situation:
    """What the ego may want to know of one frame. Lengths are in metres, measured along the way.

    Attributes
    ----------
    lane : int
        The lane that the ego is in, or came by into the disc in which it is: 2 segment + direction.
    next_lane : int
        The lane to take at the end of `lane`, on the shortest way to the goals in their order.
    intersection : int
        The number of the intersection between the two.
    crossing : bool
        Whether rule 3 holds there: stop, wait for one's turn, enter when it is clear.
    goal : int
        The number of the intersection to be visited next, -1 without goals.
    to_goal : float
        Metres of road to it, inf if no way leads there.
    stop_line : float
        Metres that the ego can go on until its body meets the disc of `intersection`; 0 if it does already.
    exit : float
        Metres until its body has left that disc on the other side.
    leader : SensedCar or None
        The nearest car ahead in `lane`, on the way through the disc, or in `next_lane`.
    gap : float
        Metres between its centre and the ego's, inf without one.
    inside : tuple of SensedCar
        The cars whose bodies meet the disc of `intersection`, in the order of their indices.
    before : tuple of SensedCar
        The cars that are before the ego in the order of arrival at `intersection`, first come first. All who have
        stopped there are, while the ego has not. Tickets that were given out of sight count from when they are seen.
    """

    lane: int
    next_lane: int
    intersection: int
    crossing: bool
    goal: int
    to_goal: float
    stop_line: float
    exit: float
    leader: SensedCar | None
    gap: float
    inside: tuple[SensedCar, ...]
    before: tuple[SensedCar, ...]
    _way: _Way
    _along: float

    def line(self, distance: float) -> Pose:
        """Return the point `distance` metres ahead on the line to follow, and the heading there.

        The line is the middle of the right lane; through the disc it is straight, or the arc between two such lines.
        Beyond the end of `next_lane` it goes straight on.
        """
        return self._way.point(self._along + distance)


class Navigator:
    """Answers what a driver asks of the road, frame by frame.

    Parameters
    ----------
    problem : Problem
        What `start` was given.

    Notes
    -----
    One object serves one trial, and has to be shown each observation: it remembers which goal is next and in which
    order cars have stopped. It works on what the problem and observations say, so in a box and in other processes too.
    """

    def __init__(self, problem: Problem) -> None:
        self._network = problem.network
        car = problem.car
        self._reach, self._middle, self._radius = car.body.reach, car.w, problem.intersection_radius
        self._roads = pack([problem.network], [2.0 * car.w])
        goals, metres = stages(problem.network, problem.goal_vertices)
        self._metres = metres
        self._goals: list[int] = goals.tolist()
        self._stage = NONE
        self._way: _Way | None = None
        rules = RuleParameters.from_mapping(problem.rules)
        self._degrees: list[int] = problem.network.degrees.tolist()
        self._crossing_degree = rules.crossing_degree
        self._tickets = _Tickets(self._roads, 1 + len(problem.e_agents), ticks(rules.group_time, problem.rate))

    def look(self, observation: Observation) -> Situation:
        """Return what there is to know of the frame of `observation`."""
        pose, seen = observation.pose, observation.propositions
        if self._stage < 0 and self._goals:
            stage = nearest_stage(self._metres, 0, len(self._goals), seen.lane, seen.segment)
            self._stage = int(stage)
        if self._goals and seen.at == self._goals[self._stage]:
            self._stage = (self._stage + 1) % len(self._goals)
        way = self._way = self._way_of(pose, seen)
        along = way.along(pose, seen)
        leader, gap = self._leader(way, along, observation.others)
        _, left = lane_coordinates(self._roads, 0, way.lane, pose.x, pose.y)
        disc = self._radius + self._reach
        off = min(abs(left), disc)
        goal = self._goals[self._stage] if self._goals else NONE
        return Situation(
            lane=way.lane,
            next_lane=way.out,
            intersection=way.vertex,
            crossing=self._degrees[way.vertex] >= self._crossing_degree,
            goal=goal,
            to_goal=self._to_goal(way, along),
            stop_line=max(0.0, way.end_of_lane - sqrt(disc * disc - off * off) - along),
            exit=max(0.0, way.start_of_next + sqrt(disc * disc - self._middle * self._middle) - along),
            leader=leader,
            gap=gap,
            inside=tuple(car for car in observation.others if car.propositions.crosses == way.vertex),
            before=self._tickets.before(observation, self._network.lane_ends(way.lane)[1]),
            _way=way,
            _along=along,
        )

    def _way_of(self, pose: Pose, seen: Propositions) -> _Way:
        """Return the way that is driven: in a disc the one that led there."""
        way = self._way
        lane = seen.lane
        if lane < 0:
            if way is not None and way.vertex == seen.at:
                return way
            lane = self._lane_in(pose, seen.at) if seen.at >= 0 else int(lane_at(self._roads, 0, pose))
        out = self._next_lane(lane)
        if way is not None and (lane, out) == (way.lane, way.out):
            return way
        return _Way(self._roads, lane, out, self._middle, self._radius, self._reach)

    def _lane_in(self, pose: Pose, vertex: int) -> int:
        """Return the lane by which a car may have come that is first seen in a disc: the one most along its heading."""
        ways = [arm ^ 1 for arm in self._network.arms(vertex)]
        directions = [lane_end_direction(self._roads, 0, lane) for lane in ways]
        return max(zip(directions, ways, strict=True), key=lambda way: way[0][0] * pose.c + way[0][1] * pose.s)[1]

    def _next_lane(self, lane: int) -> int:
        following = self._network.successors(lane)
        if not self._goals:
            return following[0]
        metres = self._metres[self._stage_after(lane)]
        return min(following, key=lambda other: metres[other])

    def _stage_after(self, lane: int) -> int:
        """Return the stage of the way on from the end of a lane."""
        reached = self._network.lane_ends(lane)[1] == self._goals[self._stage]
        return (self._stage + reached) % len(self._goals)

    def _to_goal(self, way: _Way, along: float) -> float:
        if not self._goals:
            return inf
        rest = way.end_of_lane - along
        if way.vertex == self._goals[self._stage]:
            return max(0.0, rest)
        return rest + float(self._metres[self._stage][way.out])

    def _leader(self, way: _Way, along: float, others: Sequence[SensedCar]) -> tuple[SensedCar | None, float]:
        leader, gap = None, inf
        for car in others:
            if way.holds(car.pose, car.propositions):
                ahead = way.along(car.pose, car.propositions) - along
                if 0.0 < ahead < gap:
                    leader, gap = car, ahead
        return leader, gap


class _Way:
    """The middles of a lane and of the next, and the line between; places on it count from where the turn begins."""

    def __init__(self, roads: RoadTable, lane: int, out: int, middle: float, radius: float, reach: float) -> None:
        self.lane, self.out = lane, out
        self._roads, self._middle, self._reach = roads, middle, reach
        self._path = path = ReferencePath(*way_between(roads, 0, lane, out, middle, radius))
        length = lane_length(roads, 0, lane)
        self._from, self._into, self._turn = length, 0.0, 0.0
        cosine = path.tx * path.ux + path.ty * path.uy
        if path.side != 0.0:
            self._turn = path.radius * (pi if out == lane ^ 1 else acos(max(-1.0, min(cosine, 1.0))))
            self._from += (path.cx - path.x) * path.tx + (path.cy - path.y) * path.ty
            self._into = (path.cx - path.x) * path.ux + (path.cy - path.y) * path.uy
        self.end_of_lane = length - self._from
        self.start_of_next = self._turn - self._into
        self.vertex = int(roads.ends[lane >> 1, 1 - (lane & 1)])

    def holds(self, pose: Pose, seen: Propositions) -> bool:
        """Tell whether a car is on the way."""
        if seen.at != self.vertex:
            return seen.lane in (self.lane, self.out)
        return abs(on_way(self._path, pose.x, pose.y)[2]) < self._middle + self._reach

    def along(self, pose: Pose, seen: Propositions) -> float:
        """Return where on the way a car is, metres from where the turn begins."""
        if seen.at != self.vertex and seen.lane == self.out:
            return self._turn - self._into + lane_coordinates(self._roads, 0, self.out, pose.x, pose.y)[0]
        if seen.at != self.vertex:
            return lane_coordinates(self._roads, 0, self.lane, pose.x, pose.y)[0] - self._from
        part, key, *_ = on_way(self._path, pose.x, pose.y)
        if part == PART.THROUGH:
            return self._path.radius * acos(max(-1.0, min(1.0 - key, 1.0)))
        return key + self._turn if part == PART.AFTER else key

    def point(self, along: float) -> Pose:
        """Return the point of the way that is `along` metres from where the turn begins."""
        path = self._path
        if 0.0 < along < self._turn:
            angle = along / path.radius
            ahead, left = sin(angle), path.side * cos(angle)
            x = path.cx + path.radius * (ahead * path.tx + left * path.ty)
            y = path.cy + path.radius * (ahead * path.ty - left * path.tx)
            turned = path.side * sin(angle)
            c, s = cos(angle) * path.tx - turned * path.ty, cos(angle) * path.ty + turned * path.tx
            return Pose(x, y, c, s)
        if along <= 0.0:
            x, y, c, s = place_on_lane(self._roads, 0, self.lane, along + self._from)
        else:
            x, y, c, s = place_on_lane(self._roads, 0, self.out, along - self._turn + self._into)
        return Pose(x + self._middle * s, y - self._middle * c, c, s)


class _Tickets:
    """When each car was seen to stop, and the order that follows."""

    def __init__(self, roads: RoadTable, cars: int, group_ticks: int) -> None:
        self._roads, self._group_ticks = roads, group_ticks
        self._rows = table(CarMemory, cars)
        self._lanes = np.full(cars, NONE, dtype=np.int64)
        self._bits: dict[int, int] = {}

    def before(self, observation: Observation, vertex: int) -> tuple[SensedCar, ...]:
        """Return the cars that are before the ego in the order at an intersection, first come first."""
        propositions = observation.propositions
        seen = {EGO: propositions} | {car.index: car.propositions for car in observation.others}
        for index, now in seen.items():
            self._note(index, now, observation.tick)
        self._bits = {index: now.bits for index, now in seen.items()}
        waiting = [index for index, now in seen.items() if self._waits(now, vertex)]
        if not waiting or propositions.bits & FLAG.FIRST:
            return ()
        members = np.array(waiting, dtype=np.int64)
        for index in waiting:
            self._lanes[index] = seen[index].lane
        rank_queue(self._roads, 0, Queue(self._rows, self._lanes, members, len(waiting)), self._group_ticks)
        cars = [car for car in observation.others if car.index in waiting]
        if EGO in waiting:
            cars = [car for car in cars if self._rows[car.index].rank < self._rows[EGO].rank]
        return tuple(sorted(cars, key=lambda car: self._rows[car.index].rank))

    def _note(self, index: int, now: Propositions, tick: int) -> None:
        """Note a ticket that a car has got since the frame before."""
        before = self._bits.get(index, 0)
        if now.bits & FLAG.STOPPED and (not before & FLAG.STOPPED or renews_ticket(before, now.bits)):
            self._rows[index].ticket = tick

    def _waits(self, now: Propositions, vertex: int) -> bool:
        if not now.bits & FLAG.STOPPED or now.lane < 0:
            return False
        return int(self._roads.ends[now.lane >> 1, 1 - (now.lane & 1)]) == vertex
