"""Nonlinear model predictive control of a Dubins car along its lane, past cars that drive straight on, by CasADi.

Rawlings, Mayne, Diehl, Model Predictive Control, 2nd ed., ch. 2 (the problem), 8.5 (multiple shooting).
Andersson, Gillis, Horn, Rawlings, Diehl, CasADi, Math. Prog. Comp. 11, 2019.
"""

from __future__ import annotations

from functools import cache
from math import atan2
from typing import Any

import casadi
import numpy as np

import dubins_traffic as dt
from dubins_traffic.cars.state import Observation
from dubins_traffic.problem.instance import Problem

STEPS, STEP = 8, 0.25
"""Steps of the horizon, and seconds of each."""
HOLD = 6
"""Ticks for which a command is held."""
OTHERS = 3
"""So many of the nearest cars are looked at."""
CLEAR = 0.45
"""Distance of centres that is to be kept, metres; what lacks costs `SOFT` times its square."""
SOFT = 200.0
FAR = 100.0
"""Where a car is put that is not there, metres."""


class Mpc:
    """Solves, five times a second, for the commands that track the line best and keep clear of all predictions."""

    def start(self, problem: Problem) -> None:
        """Learn the problem."""
        self._navigator = dt.Navigator(problem)
        self._bounds = problem.car.bounds
        self._solver = solver(self._bounds.speed, self._bounds.speed_low, self._bounds.yaw_rate)
        self._guess = np.zeros(2 * STEPS)
        self._command = 0.0, 0.0

    def act(self, observation: Observation) -> tuple[float, float]:
        """Hold the last command, or solve for the next one."""
        here = self._navigator.look(observation)
        if observation.tick % HOLD == 0:
            pose = observation.pose
            lines = [here.line(self._bounds.speed * STEP * (k + 1)) for k in range(STEPS)]
            near = sorted(observation.others, key=lambda car: _away2(car.pose, pose))[:OTHERS]
            cars = [(p.x, p.y, v.speed * p.c, v.speed * p.s) for _, _, p, v, *_ in near]
            cars += [(FAR, FAR, 0.0, 0.0)] * (OTHERS - len(cars))
            given = [pose.x, pose.y, atan2(pose.s, pose.c)]
            given += [value for line in lines for value in (line.x, line.y)]
            given += [value for car in cars for value in car]
            found = np.array(self._solver(x0=self._guess, p=given)["x"]).ravel()
            if np.isfinite(found).all():
                self._guess = np.concatenate([found[2:], found[-2:]])
                self._command = float(found[0]), float(found[1])
        return self._command


def _away2(one: Any, other: Any) -> float:
    return (one.x - other.x) ** 2 + (one.y - other.y) ** 2


class Bounded:
    """A solver whose commands stay within bounds."""

    def __init__(self, solve: Any, low: Any, high: Any) -> None:
        self._solve, self._low, self._high = solve, low, high

    def __call__(self, **given: Any) -> Any:
        """Solve from a first guess `x0` for the parameters `p`."""
        return self._solve(lbx=self._low, ubx=self._high, **given)


@cache
def solver(speed: float, slowest: float, yaw_rate: float) -> Bounded:
    """Return the solver for cars with these bounds, m/s and rad/s."""
    commands, given = casadi.SX.sym("u", 2 * STEPS), casadi.SX.sym("p", 3 + 2 * STEPS + 4 * OTHERS)
    x, y, angle = given[0], given[1], given[2]
    lines, cars = given[3 : 3 + 2 * STEPS], given[3 + 2 * STEPS :]
    cost = 0.0
    for k in range(STEPS):
        v, turn = commands[2 * k], commands[2 * k + 1]
        middle = angle + 0.5 * STEP * turn
        x, y, angle = (
            x + STEP * v * casadi.cos(middle),
            y + STEP * v * casadi.sin(middle),
            angle + STEP * turn,
        )
        cost += (x - lines[2 * k]) ** 2 + (y - lines[2 * k + 1]) ** 2 + 0.01 * turn**2
        for j in range(OTHERS):
            cx, cy, vx, vy = (cars[4 * j + i] for i in range(4))
            ahead = STEP * (k + 1)
            away = casadi.sqrt((x - cx - ahead * vx) ** 2 + (y - cy - ahead * vy) ** 2 + 1e-6)
            cost += SOFT * casadi.fmax(0.0, CLEAR - away) ** 2
    options = {
        "print_time": False, "ipopt.print_level": 0, "ipopt.sb": "yes", "ipopt.max_iter": 30, "ipopt.tol": 1e-4,
    }  # fmt: skip
    solve = casadi.nlpsol("mpc", "ipopt", {"x": commands, "p": given, "f": cost}, options)
    return Bounded(solve, [slowest, -yaw_rate] * STEPS, [speed, yaw_rate] * STEPS)
