"""Finds contacts from frames alone, for simulators that move cars in another process."""

from __future__ import annotations

import itertools
import math
from collections.abc import Sequence

from dubins_traffic.cars.body import Car, Obstacle
from dubins_traffic.cars.motion import PARTED
from dubins_traffic.cars.state import Contact, State
from dubins_traffic.cars.tables import box_of, pack_cars, pack_obstacles
from dubins_traffic.kernels.boxes import Box, separation

STANDING = 0.02
"""Speed, m/s, up to which a body counts as standing: measured poses always vary a little."""
Separation = tuple[float, float, float, float, float]


class Bodies:
    """The bodies of a problem's cars, which are alike, and of its obstacles.

    Parameters
    ----------
    car : Car
        The car that all cars of the problem are.
    obstacles : sequence of Obstacle
        The static obstacles.
    """

    def __init__(self, car: Car, obstacles: Sequence[Obstacle]) -> None:
        cars, standing = pack_cars([car]), pack_obstacles([obstacles])
        self.box = (float(cars.half_length[0]), float(cars.half_width[0]), float(cars.rounding[0]))
        self.reach = float(cars.reach[0])
        self.parts: dict[int, list[Box]] = {}
        for k in range(len(standing.parts)):
            part = standing.parts[k]
            self.parts.setdefault(-1 - part.owner, []).append(box_of(part))

    @property
    def turns(self) -> bool:
        """Whether turning in place moves the edge of a car's body: it does not if the body is a disc."""
        return self.box[0] > 0.0

    def separation(self, state: State, car: int, other: int) -> Separation:
        """Return gap, normal and point of `kernels.boxes.separation` for a car and another, or obstacle -1 - k."""
        box = Box(*_pose(state, car), *self.box)
        if other >= 0:
            return separation(box, Box(*_pose(state, other), *self.box))
        return min(separation(box, part) for part in self.parts[other])


class Touching:
    """Finds the contacts in consecutive frames: pairs of bodies that touch in a frame and did not before.

    Parameters
    ----------
    car : Car
        The car that all cars of the problem are.
    obstacles : sequence of Obstacle
        The static obstacles.
    period : float
        Seconds between two frames.
    """

    def __init__(self, car: Car, obstacles: Sequence[Obstacle], period: float) -> None:
        self._bodies = Bodies(car, obstacles)
        self._period = period
        self._touching: set[tuple[int, int]] = set()

    def update(self, tick: int, state: State) -> tuple[Contact, ...]:
        """Return the new contacts of frame `tick`, whose state is given; its speeds are those of the tick before."""
        contacts: list[Contact] = []
        cars = range(state.x.shape[1])
        near = [pair for pair in itertools.combinations(cars, 2) if self._near(state, *pair)]
        for pair in [*near, *itertools.product(cars, self._bodies.parts)]:
            between = self._bodies.separation(state, *pair)
            if between[0] > PARTED:
                self._touching.discard(pair)
            elif between[0] <= 0.0 and pair not in self._touching:
                self._touching.add(pair)
                contacts.append(self.contact(tick, state, pair))
        self._touching = {pair for pair in self._touching if pair[1] < 0 or pair in near}
        return tuple(contacts)

    def _near(self, state: State, car: int, other: int) -> bool:
        dx, dy = state.x[0, other] - state.x[0, car], state.y[0, other] - state.y[0, car]
        return math.hypot(dx, dy) <= 2.0 * self._bodies.reach + PARTED

    def contact(self, tick: int, state: State, pair: tuple[int, int]) -> Contact:
        """Return the contact of a pair, a car and another or obstacle -1 - k, that touches in frame `tick`."""
        car, other = pair
        _, nx, ny, x, y = self._bodies.separation(state, *pair)
        its = (0.0, False) if other < 0 else self._motion(state, other, (x, y), (-nx, -ny))
        motion = self._motion(state, car, (x, y), (nx, ny))
        return Contact(
            tick=tick,
            time=tick * self._period,
            car=car,
            other=other,
            x=x,
            y=y,
            nx=nx,
            ny=ny,
            closing=(motion[0], its[0]),
            moved=(motion[1], its[1]),
        )

    def _motion(
        self, state: State, n: int, point: tuple[float, float], normal: tuple[float, float]
    ) -> tuple[float, bool]:
        """Return the speed of car n's body at `point` along `normal`, and whether it moved or, a rectangle, turned."""
        x, y, c, s = _pose(state, n)
        speed = float(state.speed[0, n])
        turn = float(state.yaw_rate[0, n]) if self._bodies.turns else 0.0
        closing = normal[0] * (speed * c - turn * (point[1] - y)) + normal[1] * (speed * s + turn * (point[0] - x))
        return closing, max(abs(speed), abs(turn) * self._bodies.box[0]) > STANDING


def _pose(state: State, n: int) -> tuple[float, float, float, float]:
    return float(state.x[0, n]), float(state.y[0, n]), float(state.c[0, n]), float(state.s[0, n])
