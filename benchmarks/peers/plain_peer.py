"""Cars in plain Python, without any library: exact arcs, and all pairs of discs at the end pose.

usage: plain_peer.py CARS SECONDS
"""

from __future__ import annotations

import math
import platform

from timing import PERIOD, RADIUS, RATE, SPEED, lattice, run, yaw_rates

Pose = tuple[float, float, float]


class World:
    """One world of cars."""

    def __init__(self, cars: int) -> None:
        self.poses: list[Pose] = [(x, y, 0.0) for x, y in lattice(cars)]
        self.commands = [(SPEED, yaw) for yaw in yaw_rates(cars)]
        self.overlaps = 0

    def drive(self) -> int:
        """Go on for ten seconds."""
        for _ in range(10 * RATE):
            self.tick()
        return 10 * RATE * len(self.poses)

    def tick(self) -> None:
        """Move every car along its arc, and count the pairs that overlap."""
        self.poses = [advance(pose, *command) for pose, command in zip(self.poses, self.commands, strict=True)]
        limit = (2.0 * RADIUS) ** 2
        for n, (x, y, _) in enumerate(self.poses):
            for other in self.poses[:n]:
                dx, dy = x - other[0], y - other[1]
                self.overlaps += dx * dx + dy * dy < limit

    def positions(self) -> list[tuple[float, float]]:
        """Return where the cars are."""
        return [(x, y) for x, y, _ in self.poses]


def advance(pose: Pose, u: float, yaw: float) -> Pose:
    """Return the pose after a tick; the chord of the arc lies half the turn to the side."""
    x, y, theta = pose
    half = 0.5 * yaw * PERIOD
    chord = u * PERIOD * (math.sin(half) / half if half else 1.0)
    return x + chord * math.cos(theta + half), y + chord * math.sin(theta + half), theta + 2.0 * half


run(platform.python_version(), World)
