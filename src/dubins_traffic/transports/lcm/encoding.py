"""Between this package's values and LCM messages; every double keeps its bits."""

from __future__ import annotations

import json
import struct
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from dubins_traffic.cars.state import Labels, Observation, Pose, Propositions, SensedCar, State, Twist
from dubins_traffic.problem.public_problem import problem_from_document, problem_to_document
from dubins_traffic.transports.lcm.dubins_traffic_lcm import car_t, instance_t, state_t, world_t

if TYPE_CHECKING:
    from dubins_traffic.problem.instance import Problem

FINGERPRINT = 8
"""Bytes of a message that say of what type it is."""
HEAD = struct.Struct(">qqd")
"""Trial, tick and time, with which the messages of a tick begin."""
INT = struct.Struct(">i")
CAR = struct.Struct(">6d4iq")
"""What follows a car's name and index in a `car_t`."""


def problem_to_message(problem: Problem, trial: int) -> instance_t:
    """Return the announcement of `problem` as trial number `trial` of a session."""
    network = problem.network
    message = instance_t()
    message.trial = trial
    message.problem = json.dumps(problem_to_document(problem), separators=(",", ":"))
    message.rate = problem.rate
    bounds = problem.car.bounds
    message.speed_min, message.speed_max = bounds.speed_low, bounds.speed
    message.yaw_rate_max, message.turning_radius = bounds.yaw_rate, bounds.turning_radius
    message.w = problem.car.w
    message.radius = problem.intersection_radius
    message.intersection = network.points.tolist()
    message.intersections = len(message.intersection)
    message.segment = network.ends.tolist()
    message.segments = len(message.segment)
    message.goal = list(problem.goal_vertices)
    message.goals = len(message.goal)
    return message


def problem_from_message(message: instance_t) -> Problem:
    """Return the problem announced."""
    return problem_from_document(json.loads(message.problem))


def observation_from_message(message: state_t, problem: Problem) -> Observation:
    """Return the observation, equal to the one that was sent."""
    body = problem.car.body
    generated: Any = message
    ego: car_t = message.own
    others: list[car_t] = generated.others
    scan: tuple[float, ...] = generated.scan
    return Observation(
        message.tick,
        message.time,
        _pose(ego),
        Twist(ego.speed, ego.yaw_rate),
        _propositions(ego),
        tuple(
            SensedCar(car.name, car.index, _pose(car), Twist(car.speed, car.yaw_rate), body, _propositions(car))
            for car in others
        ),
        np.array(scan, dtype=np.float64) if scan else None,
    )


class Encoder:
    """Encodes the messages of every tick of one trial as their classes do, but some times as fast."""

    def __init__(self, names: Sequence[str]) -> None:
        self._state = state_t().encode()[:FINGERPRINT]
        self._world = world_t().encode()[:FINGERPRINT]
        self._names = [_string(name) + INT.pack(n) for n, name in enumerate(names)]

    def state(self, seen: Observation, trial: int, car: int) -> bytes:
        """Return the `state_t` of the driver of `car`; bodies are left out: all cars are alike."""
        names = self._names
        others = [
            names[other.index] + CAR.pack(*other.pose, *other.twist, *other.propositions) for other in seen.others
        ]
        ranges = b"" if seen.scan is None else seen.scan.astype(">f8").tobytes()
        return b"".join(
            (
                self._state,
                HEAD.pack(trial, seen.tick, seen.time),
                names[car],
                CAR.pack(*seen.pose, *seen.twist, *seen.propositions),
                INT.pack(len(others)),
                *others,
                INT.pack(len(ranges) // 8),
                ranges,
            )
        )

    def world(self, trial: int, tick: int, time: float, state: State, labels: Labels) -> bytes:
        """Return the `world_t` of trial 0 of a batch."""
        count = len(self._names)
        columns = [column[0, :count].tolist() for column in (*state[:6], *labels)]
        cars = [name + CAR.pack(*car) for name, car in zip(self._names, zip(*columns, strict=True), strict=True)]
        return b"".join((self._world, HEAD.pack(trial, tick, time), INT.pack(count), *cars))


def _string(text: str) -> bytes:
    data = text.encode() + b"\0"
    return INT.pack(len(data)) + data


def _pose(car: car_t) -> Pose:
    return Pose(car.x, car.y, car.c, car.s)


def _propositions(car: car_t) -> Propositions:
    return Propositions(car.segment, car.at, car.crosses, car.lane, car.bits)
