"""A driver's senses: observations from the state of a trial, with the instance's noise."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING, Any, cast

import numpy as np

from dubins_traffic.cars.sensing import Surroundings, blur, neighbours, nothing_seen, rays_at, scan
from dubins_traffic.cars.state import EGO, Labels, Observation, Pose, Propositions, SensedCar, State, Twist
from dubins_traffic.cars.tables import pack_cars, pack_obstacles
from dubins_traffic.kernels.arrays import Floats
from dubins_traffic.kernels.calls import bound
from dubins_traffic.kernels.records import numbers

if TYPE_CHECKING:
    from dubins_traffic.problem.instance import Instance
    from dubins_traffic.problem.parts import Laser
    from dubins_traffic.protocols import Scans


new = cast("Callable[..., Any]", tuple.__new__)  # pyright: ignore[reportUnknownMemberType]
"""Makes a named tuple from a sequence of all its fields, in half the time of calling its class."""


class Senses:
    """Makes one car's observation of each tick of one trial.

    Parameters
    ----------
    instance : Instance
        What is run.
    car : int
        Index of the car; the ego by default. Only the ego's observations are noisy.
    radius : float, optional
        Distance within which other cars are seen, metres; by default the problem's sensing radius.
    laser : Laser, optional
        Replaces the problem's laser.
    scanner : Scans, optional
        Measures the laser ranges; by default they are computed from the state.
    """

    def __init__(
        self,
        instance: Instance,
        car: int = EGO,
        radius: float | None = None,
        laser: Laser | None = None,
        scanner: Scans | None = None,
    ) -> None:
        problem = instance.problem
        self._car = car
        self._look = bound(neighbours)
        self._scanner = scanner
        self._instance = instance
        self._names = instance.names
        self._body = problem.car.body
        self._radius = problem.sensing_radius if radius is None else radius
        self._rate = problem.rate
        self._view = nothing_seen(len(instance.starts))
        self._seen: list[tuple[str, int, Propositions]] = []
        noise = self._noise = instance.added
        self._noisy = car == EGO and (noise.position_noise > 0.0 or noise.heading_noise > 0.0)
        self._laser = laser or problem.laser
        if self._laser is not None:
            angles = np.linspace(self._laser.angle_min, self._laser.angle_max, self._laser.rays)
            self._rays = rays_at(angles)
            self._cars = pack_cars([problem.car])
            self._obstacles = pack_obstacles([problem.obstacles])
            self._around: Surroundings | None = None
            self._latest = -1
        self._scan: Floats | None = None

    def observe(self, tick: int, state: State, labels: Labels) -> Observation:
        """Return what the car's driver knows at the beginning of the tick that starts in `state`."""
        count = self._look(0, self._car, self._radius, self._view, state, labels)
        if count > 0:
            self._seen = self._labelled(count)
        count = len(self._seen)
        if self._noisy:
            noise = self._noise
            seed, trial = np.uint64(self._instance.seed), self._instance.trial
            blur(self._view, count, seed, trial, tick, noise.position_noise, noise.heading_noise)
        if self._laser is not None:
            self._sweep(tick, state, self._laser)
        reals: list[list[float]] = self._view.pose_rows[:count].tolist()
        body = self._body
        others = tuple(
            [
                new(SensedCar, (name, car, new(Pose, (x, y, c, s)), new(Twist, (speed, yaw)), body, labelled))
                for (name, car, labelled), (x, y, c, s, speed, yaw) in zip(self._seen[1:], reals[1:], strict=True)
            ]
        )
        x, y, c, s, speed, yaw = reals[0]
        pose, twist, labelled = new(Pose, (x, y, c, s)), new(Twist, (speed, yaw)), self._seen[0][2]
        return new(Observation, (tick, tick / self._rate, pose, twist, labelled, others, self._scan))

    def _labelled(self, count: int) -> list[tuple[str, int, Propositions]]:
        """Return name, index and propositions of the first `count` cars seen, which stay the same for most ticks."""
        wholes: list[list[int]] = self._view.label_rows[:count].tolist()
        return [(self._names[whole[0]], whole[0], new(Propositions, whole[1:])) for whole in wholes]

    def sweep(self, state: State) -> Floats:
        """Return the ranges of a laser sweep in `state`, (rays,), metres, from right to left.

        Raises
        ------
        ValueError
            If there is no laser.
        """
        laser = self._laser
        if laser is None:
            raise ValueError("these senses have no laser to sweep")
        if self._scanner is not None:
            rays = numbers(self._rays, np.float64)
            return _cut(self._scanner.scan(self._car, rays, laser.range_max), laser)
        if self._around is None or self._around.state is not state:
            self._around = Surroundings(state, self._cars, self._obstacles)
        ranges = np.zeros(laser.rays)
        scan(0, self._car, laser.range_min, laser.range_max, self._rays, ranges, self._around)
        return ranges

    def _sweep(self, tick: int, state: State, laser: Laser) -> None:
        """Make a scan if the laser's next sweep is due; otherwise the last scan stays."""
        number = int(tick * laser.rate / self._rate + 1e-9)
        if number > self._latest:
            self._latest = number
            self._scan = self.sweep(state)


def _cut(ranges: Floats, laser: Laser) -> Floats:
    """Return ranges with those out of the laser's bounds set to +-inf, as in `cars.sensing.scan`."""
    far = np.where(ranges >= laser.range_max, np.inf, ranges)
    return np.where(ranges < laser.range_min, -np.inf, far)
