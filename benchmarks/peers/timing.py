"""What the peers' scripts share; it needs nothing but Python, for each peer runs in an environment of its own.

A script takes the number of cars and for how many seconds of processor time to measure, and prints one line of JSON.
"""

from __future__ import annotations

import json
import math
import sys
from collections.abc import Callable, Sequence
from time import process_time
from typing import Protocol

RATE = 30
"""Ticks a second: each car is given a command, and its new pose is known, thirty times a second."""
PERIOD = 1.0 / RATE
RADIUS = 0.177
"""Of a car's disc, metres."""
SPEED = 0.4
"""What the cars of peers that drive nobody by themselves are commanded, m/s."""


class Cars(Protocol):
    """Cars in a peer, in one world or in many worlds that are stepped together."""

    def drive(self) -> int:
        """Go on for a while; return the car-steps made: one is one car's way through one tick."""
        ...

    def positions(self) -> Sequence[tuple[float, float]]:
        """Return where the cars of one world are, metres."""
        ...

    def tick(self) -> None:
        """Go on for one tick."""
        ...


def yaw_rates(cars: int) -> list[float]:
    """Return the yaw rates that the cars are commanded: evenly spread from -1 to 1 rad/s, in a mixed order."""
    return [2.0 * ((n * 0.6180339887498949) % 1.0) - 1.0 for n in range(cars)]


def lattice(cars: int, spacing: float = 2.0) -> list[tuple[float, float]]:
    """Return where the cars begin: on a square, `spacing` metres apart."""
    side = math.isqrt(cars - 1) + 1
    return [(spacing * (n % side), spacing * (n // side)) for n in range(cars)]


def run(version: str, make: Callable[[int], Cars]) -> None:
    """Time rounds of driving, and print the best: its car-steps, the seconds they took; and the cars' speed at the end.

    Every round is driven by new cars, the making of which is not timed. The first round is a warm-up and is not
    counted. Seconds are of processor time, summed over all threads of the process.
    """
    cars, budget = int(sys.argv[1]), float(sys.argv[2])
    make(cars).drive()
    spent, steps, seconds, moving = 0.0, 0, 1.0, 0.0
    while spent < budget:
        world = make(cars)
        began = process_time()
        made = world.drive()
        took = process_time() - began
        spent += took
        if made * seconds > steps * took:
            steps, seconds = made, took
            moving = speed(world)
    found = {"version": version, "cars": cars, "car_steps": steps, "seconds": seconds, "speed": moving}
    print(json.dumps(found))


def speed(world: Cars) -> float:
    """Return the mean speed of the cars of one world over the next tick, m/s."""
    before = world.positions()
    world.tick()
    ways = [math.dist(*ends) for ends in zip(before, world.positions(), strict=True)]
    return sum(ways) / len(ways) / PERIOD
