"""Discs in pymunk whose velocities are set every tick; they meet without friction.

usage: pymunk_peer.py CARS SECONDS
"""

from __future__ import annotations

import numpy as np
import pymunk
from pymunk.batch import BodyFields, Buffer, get_space_bodies, set_space_bodies
from timing import PERIOD, RADIUS, RATE, SPEED, lattice, run, yaw_rates

READ = BodyFields.POSITION | BodyFields.ANGLE
WRITTEN = BodyFields.VELOCITY | BodyFields.ANGULAR_VELOCITY


class World:
    """One space of discs; poses and velocities pass in one piece, by pymunk's batch interface."""

    def __init__(self, cars: int) -> None:
        self.space = pymunk.Space()
        for where in lattice(cars):
            body = pymunk.Body(1.0, pymunk.moment_for_circle(1.0, 0.0, RADIUS))
            body.position = where
            self.space.add(body, pymunk.Circle(body, RADIUS))
        self.read, self.written = Buffer(), Buffer()
        self.velocities = np.zeros((cars, 3))
        self.velocities[:, 2] = yaw_rates(cars)
        self.written.set_float_buf(self.velocities.reshape(-1))

    def drive(self) -> int:
        """Go on for a minute."""
        for _ in range(60 * RATE):
            self.tick()
        return 60 * RATE * len(self.velocities)

    def tick(self) -> None:
        """Read the poses, point the velocities along the headings, step."""
        theta = self.poses()[:, 2]
        np.cos(theta, out=self.velocities[:, 0])
        np.sin(theta, out=self.velocities[:, 1])
        self.velocities[:, :2] *= SPEED
        set_space_bodies(self.space, WRITTEN, self.written)
        self.space.step(PERIOD)

    def poses(self) -> np.ndarray:
        """Return x, y and heading of every disc, (cars, 3), valid until the next call."""
        self.read.clear()
        get_space_bodies(self.space, READ, self.read)
        return np.frombuffer(self.read.float_buf()).reshape(-1, 3)

    def positions(self) -> list[tuple[float, float]]:
        """Return where the discs are."""
        return [(float(x), float(y)) for x, y, _ in self.poses()]


run(pymunk.version, World)
