"""Obstacles that leave a goal, or the only way to it, without room for a car: refused by name (docs/rules.md#room)."""

from __future__ import annotations

from collections.abc import Collection
from functools import cached_property

import numpy as np

from dubins_traffic.cars.body import Obstacle
from dubins_traffic.cars.tables import pack_obstacles
from dubins_traffic.errors import InputError
from dubins_traffic.problem.instance import Problem
from dubins_traffic.roads.network import RoadNetwork
from dubins_traffic.roads.packing import pack
from dubins_traffic.rules.blocking import RightLane, obstacle_narrows
from dubins_traffic.rules.obstacles import ObstacleLanes, place_obstacles
from dubins_traffic.rules.parameters import RuleParameters

STRETCH = 1.0 / 6.0
"""A road is looked at in stretches of this length, in units of w."""


def check_obstructions(problem: Problem) -> None:
    """Refuse a problem with rules in which a car could not leave a goal, or not come from one goal to another.

    Norm: docs/rules.md#passable.

    Raises
    ------
    InputError
        Naming the obstacle and the intersection.
    """
    if not problem.rules or not problem.obstacles or not problem.goals:
        return
    barred = _Obstructions(problem)
    for v in problem.goal_vertices:
        if (k := barred.traps(v)) is not None:
            raise _refused(
                k,
                f"leaves who comes to the goal {barred.name(v)} no exit as wide as a car",
                "a lane out of it with the body's width and 0.1 m (blocked_gap), or more at a low rate, free beside it",
            )
    barred.check_ways(problem.goal_vertices)


class _Obstructions:
    """What the obstacles of a problem bar.

    Attributes
    ----------
    mouths, roads : Mapping
        The lanes out of discs that are no free exits (E4), and the segments that no car can pass, each with an
        obstacle.
    """

    def __init__(self, problem: Problem) -> None:
        self._network = problem.network
        self._degree = RuleParameters.from_mapping(problem.rules).crossing_degree
        self.mouths: dict[int, int] = {}
        self.roads: dict[int, int] = {}
        for k, obstacle in enumerate(problem.obstacles):
            one = _Beside(problem, obstacle)
            self.mouths |= {lane: k for lane in one.mouths if lane not in self.mouths}
            self.roads |= {segment: k for segment in one.roads if segment not in self.roads}

    def traps(self, v: int) -> int | None:
        """Return an obstacle that leaves who comes to intersection `v` no free exit, None if there is none."""
        arms = self._network.arms(v)
        is_bend = 2 <= len(arms) < self._degree
        for came in arms:
            exits = [lane for lane in arms if not (is_bend and lane == came)]
            if came >> 1 not in self.roads and all(lane in self.mouths for lane in exits):
                return self.mouths[exits[0]]
        return None

    def check_ways(self, goals: Collection[int]) -> None:
        """Refuse obstacles that keep cars from coming from a goal to the others, or to any other intersection."""
        first = next(iter(goals))
        reached = self._reached(first, obstructed=True)
        whole = self._reached(first, obstructed=False)
        lost = [v for v in goals if v in whole and v not in reached]
        if lost or len(reached) == 1 < len(whole):
            raise _refused(
                self._in_the_way(reached),
                f"bars the only way to the goal {self.name(lost[0] if lost else first)}",
                "room for a car beside it, or another way",
            )

    def _reached(self, first: int, *, obstructed: bool) -> set[int]:
        """Return the intersections that can be reached from `first`."""
        reached, waiting = {first}, [first]
        while waiting:
            for lane in self._network.arms(waiting.pop()):
                far = self._network.lane_ends(lane)[1]
                if far not in reached and not (obstructed and self._bars(lane) is not None):
                    reached.add(far)
                    waiting.append(far)
        return reached

    def _bars(self, lane: int) -> int | None:
        """Return an obstacle that bars a lane or leaves the disc at its end no exit, None if there is none."""
        return self.roads[lane >> 1] if lane >> 1 in self.roads else self.traps(self._network.lane_ends(lane)[1])

    def _in_the_way(self, reached: Collection[int]) -> int:
        """Return an obstacle that bars a lane out of the intersections that are reached."""
        lanes = [lane for v in sorted(reached) for lane in self._network.arms(v)]
        bars = [self._bars(lane) for lane in lanes if self._network.lane_ends(lane)[1] not in reached]
        return next(k for k in bars if k is not None)

    def name(self, v: int) -> str:
        """Return what messages call an intersection."""
        return str(list(self._network.intersections[v]))


def _refused(k: int, problem: str, expected: str) -> InputError:
    return InputError(
        f"the obstacle {problem}",
        field=f"obstacles[{k}]",
        expected=f"{expected}, or rules: false (dubins-traffic explain room)",
    )


class _Beside:
    """What one obstacle bars: `mouths`, lanes out of discs, and `roads`, segments."""

    def __init__(self, problem: Problem, obstacle: Obstacle) -> None:
        rules, car = RuleParameters.from_mapping(problem.rules), problem.car
        self._network, self._w = problem.network, car.w
        self._radius = problem.intersection_radius
        self._room = rules.room_beyond(car.body.reach, 2)
        self._needed = rules.width_needed(car.body.width, car.point_speed * problem.period)
        self._beside = _placed(self._network, obstacle, car.lane_width)

    @cached_property
    def _segments(self) -> list[int]:
        return np.flatnonzero(np.diff(self._beside.start)).tolist()

    @property
    def mouths(self) -> list[int]:
        """The lanes of which it leaves too little just beyond the disc."""
        near, far = self._radius, self._radius + self._room
        lanes = [lane for segment in self._segments for lane in (2 * segment, 2 * segment + 1)]
        return [lane for lane in lanes if self._narrows(lane, near, far)]

    @property
    def roads(self) -> list[int]:
        """The segments of which it leaves too little on either side of it."""
        return [segment for segment in self._segments if self._bars(segment)]

    def _bars(self, segment: int) -> bool:
        length, step = float(self._network.lengths[segment]), STRETCH * self._w
        places = np.arange(0.0, length, step).tolist()
        return any(
            self._narrows(2 * segment, s, s + step) and self._narrows(2 * segment + 1, length - s - step, length - s)
            for s in places
        )

    def _narrows(self, lane: int, near: float, far: float) -> bool:
        place = RightLane(0, lane, float(self._network.lengths[lane >> 1]), 2.0 * self._w)
        return obstacle_narrows(self._beside, place, near, far, self._needed)


def _placed(network: RoadNetwork, obstacle: Obstacle, half_width: float) -> ObstacleLanes:
    roads = pack([network], [half_width])
    return place_obstacles(pack_obstacles([(obstacle,)]), roads, np.zeros(1, dtype=np.int64))
