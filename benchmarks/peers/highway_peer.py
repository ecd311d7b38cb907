"""Cars of highway-env: up to 8 at its intersection, more on its highway.

usage: highway_peer.py CARS SECONDS [DECISIONS]

DECISIONS a second are made for the controlled car, and followed by an observation; as many as ticks unless given.
"""

from __future__ import annotations

import sys
import warnings
from importlib.metadata import version

import gymnasium
import highway_env  # noqa: F401  # registers its environments
from timing import RATE, run

IDLE = 1
SECONDS = 4
DECISIONS = int(sys.argv[3]) if len(sys.argv) > 3 else RATE


class World:
    """One world of cars. Of those at the intersection some leave; another comes as soon as there are too few."""

    def __init__(self, cars: int) -> None:
        self.cars = cars
        self.crossing = cars <= 8
        name, count = (
            ("intersection-v0", "initial_vehicle_count") if self.crossing else ("highway-v0", "vehicles_count")
        )
        config = {
            "simulation_frequency": RATE,
            "policy_frequency": DECISIONS,
            "duration": 1_000_000,
            count: cars if self.crossing else cars - 1,
        }
        warnings.simplefilter("ignore")
        self.environment = gymnasium.make(name, config=config).unwrapped
        self.environment.reset(seed=1)
        while len(self.environment.road.vehicles) < cars:
            self.tick()
        self.watched = list(self.environment.road.vehicles)

    def drive(self) -> int:
        """Go on for some seconds."""
        steps = 0
        for _ in range(SECONDS * DECISIONS):
            steps += len(self.environment.road.vehicles) * RATE // DECISIONS
            self.tick()
        self.watched = list(self.environment.road.vehicles)
        return steps

    def tick(self) -> None:
        """Let the controlled car keep its speed until the next decision."""
        missing = len(self.environment.road.vehicles) < self.cars
        self.environment.config["spawn_probability"] = 1.0 if missing else 0.0
        self.environment.step(IDLE)

    def positions(self) -> list[tuple[float, float]]:
        """Return where those cars are that were there at the end."""
        return [tuple(vehicle.position.tolist()) for vehicle in self.watched]


run(version("highway-env"), World)
