"""RRT* in the space of Dubins paths past whoever is in the way, tracked by pure pursuit; by OMPL.

Karaman, Frazzoli, Sampling-based algorithms for optimal motion planning, IJRR 30, 2011, algorithm 6.
Sucan, Moll, Kavraki, The Open Motion Planning Library, IEEE RAM 19, 2012.
"""

from __future__ import annotations

from math import ceil, hypot
from typing import Any, Final

import numpy as np
from ompl import base, geometric, util

import dubins_traffic as dt
from dubins_traffic.cars.state import Observation, Pose
from dubins_traffic.controllers.navigator import Situation
from dubins_traffic.problem.instance import Problem
from experiments.baselines.following import LOOK, along_lane, at_top_speed, toward

HOLD: Final = 15
"""Ticks for which a plan is kept."""
AHEAD: Final = 3.0
"""So far ahead on its line a car looks for others, and so far it plans, metres."""
APART: Final = 0.25
"""Steps in which it looks, metres."""
CLEAR: Final = 0.1
"""Gap that is kept to cars, which the planner takes to stand, metres."""
VERGE: Final = 0.05
"""Gap between the car's centre and the edge of the road, metres."""
RADIUS: Final = 0.3
"""Turning radius of a plan, metres."""
ITERATIONS: Final = 100
CELL: Final = 0.1
"""Side of a cell of the map on which the planner looks whether a place is on the road, metres."""
STRIDE: Final = 0.02
"""Share of the box's diagonal between two places at which a motion is checked."""

util.setLogLevel(util.LOG_NONE)


class Rrt:
    """Drives along its lane; where a car is in the way, plans a path past it, and waits where it finds none."""

    def start(self, problem: Problem) -> None:
        """Learn the problem, and draw the map of the road."""
        self._navigator = dt.Navigator(problem)
        self._bounds, self._reach = problem.car.bounds, problem.car.body.reach
        points = problem.network.points
        low, high = points.min(axis=0) - 1.0, points.max(axis=0) + 1.0
        columns, rows = (ceil(side / CELL) for side in (high - low))
        x, y = (low[k] + CELL * (np.arange(count) + 0.5) for k, count in enumerate((columns, rows)))
        places = np.stack(np.meshgrid(x, y, indexing="ij"), axis=-1)
        self._road = problem.network.on_road(places, problem.car.lane_width - VERGE)
        self._corner = float(low[0]), float(low[1])
        self._path: list[tuple[float, float]] | None = []

    def act(self, observation: Observation) -> tuple[float, float]:
        """Track the path, or the lane where there is none to be tracked; stand where none was found."""
        here = self._navigator.look(observation)
        if observation.tick % HOLD == 0:
            self._path = self._planned(observation, here)
        if self._path is None:
            return 0.0, 0.0
        pose = observation.pose
        while self._path and hypot(self._path[0][0] - pose.x, self._path[0][1] - pose.y) < LOOK:
            del self._path[0]
        if not self._path:
            return toward(pose, self._bounds, *along_lane(here, pose, self._bounds))
        return toward(pose, self._bounds, *at_top_speed(pose, self._bounds, *self._path[0]))

    def _planned(self, observation: Observation, here: Situation) -> list[tuple[float, float]] | None:
        """Return the places of a path past the others; none where the lane is free, None where none was found."""
        others = [(car.pose.x, car.pose.y) for car in observation.others]
        line = [here.line(APART * (k + 1)) for k in range(round(AHEAD / APART))]
        least = 2.0 * self._reach + CLEAR
        if all(hypot(at.x - x, at.y - y) >= least for at in line for x, y in others):
            return []

        def is_free(state: Any) -> bool:
            x, y = state.getX(), state.getY()
            column, row = int((x - self._corner[0]) / CELL), int((y - self._corner[1]) / CELL)
            inside = 0 <= column < self._road.shape[0] and 0 <= row < self._road.shape[1]
            if not (inside and self._road[column, row]):
                return False
            return all((x - ox) ** 2 + (y - oy) ** 2 >= least * least for ox, oy in others)

        ends = [at for at in line if all(hypot(at.x - x, at.y - y) >= least for x, y in others)]
        return solved(observation.pose, ends[-1], is_free, observation.tick) if ends else None


def solved(pose: Pose, end: Pose, is_free: Any, seed: int) -> list[tuple[float, float]] | None:
    """Return the places of a path from a pose to another through states that are free; None if none was found."""
    util.RNG.setSeed(seed + 1)
    space = base.DubinsStateSpace(RADIUS)
    box = base.RealVectorBounds(2)
    for k, (one, other) in enumerate(((pose.x, end.x), (pose.y, end.y))):
        box.setLow(k, min(one, other) - AHEAD)
        box.setHigh(k, max(one, other) + AHEAD)
    space.setBounds(box)
    known = base.SpaceInformation(space)
    known.setStateValidityChecker(is_free)
    known.setStateValidityCheckingResolution(STRIDE)
    known.setup()
    problem = base.ProblemDefinition(known)
    first, last = space.allocState(), space.allocState()
    for state, at in ((first, pose), (last, end)):
        state.setX(at.x)
        state.setY(at.y)
        state.setYaw(at.theta)
    problem.setStartAndGoalStates(first, last)
    planner = geometric.RRTstar(known)
    planner.setRange(1.0)
    planner.setProblemDefinition(problem)
    planner.setup()
    turns = iter(range(ITERATIONS))
    planner.solve(base.PlannerTerminationCondition(lambda: next(turns, None) is None))
    if not problem.hasExactSolution():
        return None
    path = problem.getSolutionPath()
    path.interpolate()
    return [(state.getX(), state.getY()) for state in path.getStates()]
