"""The ego's senses: observations from the state of a trial, with the instance's noise."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from dubins_traffic.cars.sensing import SEEN_FIELDS, blur, neighbours, scan
from dubins_traffic.cars.state import EGO, Labels, Observation, Pose, Propositions, SensedCar, State, Twist
from dubins_traffic.cars.tables import pack_cars, pack_obstacles
from dubins_traffic.kernels.arrays import Floats
from dubins_traffic.kernels.trig import sincos

if TYPE_CHECKING:
    from dubins_traffic.problem.instance import Instance


class Senses:
    """Makes the ego's observation of each tick of one trial."""

    def __init__(self, instance: Instance) -> None:
        problem = instance.problem
        self._instance = instance
        self._names = instance.names
        self._body = problem.car.body
        self._radius = problem.sensing_radius
        self._rate = problem.rate
        self._seen = np.zeros((len(instance.starts), SEEN_FIELDS))
        noise = instance.disturbances
        self._noisy = noise.position_noise > 0.0 or noise.heading_noise > 0.0
        self._laser = problem.laser
        if self._laser is not None:
            angles = np.linspace(self._laser.angle_min, self._laser.angle_max, self._laser.rays)
            self._rays = np.array([sincos(float(angle)) for angle in angles])
            self._cars = pack_cars([problem.car])
            self._obstacles = pack_obstacles([problem.obstacles])
            self._latest = -1
        self._scan: Floats | None = None

    def observe(self, tick: int, state: State, labels: Labels) -> Observation:
        """Return what the ego knows at the beginning of the tick that starts in `state`."""
        seen = self._seen
        count = neighbours(state, labels, 0, EGO, self._radius, seen)
        if self._noisy:
            noise = self._instance.disturbances
            seed = np.uint64(self._instance.seed)
            trial = self._instance.trial
            blur(seen, count, seed, trial, tick, noise.position_noise, noise.heading_noise)
        if self._laser is not None:
            self._sweep(tick, state)
        rows = seen[:count].tolist()
        _, x, y, c, s, speed, yaw, segment, at, crosses, lane, bits = rows[0]
        names = self._names
        body = self._body
        others = tuple(
            SensedCar(
                names[int(row[0])],
                int(row[0]),
                Pose(row[1], row[2], row[3], row[4]),
                Twist(row[5], row[6]),
                body,
                Propositions(int(row[7]), int(row[8]), int(row[9]), int(row[10]), int(row[11])),
            )
            for row in rows[1:]
        )
        return Observation(
            tick,
            tick / self._rate,
            Pose(x, y, c, s),
            Twist(speed, yaw),
            Propositions(int(segment), int(at), int(crosses), int(lane), int(bits)),
            others,
            self._scan,
        )

    def _sweep(self, tick: int, state: State) -> None:
        """Scan when the laser's next sweep is due; in between the last scan stays."""
        laser = self._laser
        assert laser is not None
        sweep = int(tick * laser.rate / self._rate + 1e-9)
        if sweep > self._latest:
            self._latest = sweep
            ranges = np.zeros(laser.rays)
            scan(
                state,
                0,
                EGO,
                self._cars,
                self._obstacles,
                self._rays,
                laser.range_min,
                laser.range_max,
                ranges,
            )
            self._scan = ranges
