"""Finds the bodies that overlap in recorded poses."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import combinations, product
from math import hypot
from typing import Final

import numpy as np

from dubins_traffic.cars.motion import PARTED
from dubins_traffic.cars.state import Contact, Frames, State
from dubins_traffic.cars.touching import Bodies
from dubins_traffic.kernels.arrays import Floats
from dubins_traffic.problem.instance import Instance

POSES: Final = ("x", "y", "c", "s", "speed", "yaw_rate")


def put_frame(state: State, frames: Frames, f: int) -> None:
    """Write frame f of a record into trial 0 of `state`."""
    for name in POSES:
        getattr(state, name)[0] = getattr(frames, name)[f]


class Meetings:
    """The pairs of bodies that are near each other in the frames of a trial, and those that have touched.

    Parameters
    ----------
    instance : Instance
        What bodies there are; obstacle k is number -1 - k.
    frames : Frames
        All frames of the trial.
    """

    def __init__(self, instance: Instance, frames: Frames) -> None:
        problem = instance.problem
        self.bodies = Bodies(problem.car, problem.obstacles)
        self._near: dict[int, list[tuple[int, int]]] = {}
        self._touching: set[tuple[int, int]] = set()
        self._collect(frames)

    def note(self, contacts: tuple[Contact, ...]) -> None:
        """Take the contacts of the next frame: two bodies that touch count as one meeting until they have parted."""
        self._touching.update((contact.car, contact.other) for contact in contacts)

    def gaps(self, f: int, state: State) -> Iterator[tuple[tuple[int, int], float]]:
        """Yield each pair that is near in frame f, whose state is given, and the gap between the bodies, metres.

        Pairs that have touched and not parted since are left out.
        """
        near = self._near.get(f, [])
        self._touching.intersection_update(near)
        for pair in near:
            gap = self.bodies.separation(state, *pair)[0]
            if gap > PARTED:
                self._touching.discard(pair)
            if pair not in self._touching:
                yield pair, gap

    def _collect(self, frames: Frames) -> None:
        reach = self.bodies.reach + 0.5 * PARTED
        for car, other in combinations(range(frames.x.shape[1]), 2):
            dx, dy = frames.x[:, car] - frames.x[:, other], frames.y[:, car] - frames.y[:, other]
            self._add((car, other), dx * dx + dy * dy <= (2.0 * reach) ** 2)
        for car, (number, parts) in product(range(frames.x.shape[1]), self.bodies.parts.items()):
            close = np.zeros(len(frames), dtype=bool)
            for part in parts:
                far = reach + PARTED + hypot(part[4], part[5]) + part[6]
                dx, dy = frames.x[:, car] - part[0], frames.y[:, car] - part[1]
                close |= dx * dx + dy * dy <= far * far
            self._add((car, number), close)

    def _add(self, pair: tuple[int, int], close: Floats | np.ndarray) -> None:
        for f in np.flatnonzero(close).tolist():
            self._near.setdefault(f, []).append(pair)
