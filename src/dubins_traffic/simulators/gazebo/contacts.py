"""Turns contacts of the physics engine into those of records: one each time that two bodies meet."""

from __future__ import annotations

from typing import TYPE_CHECKING, Final

from dubins_traffic.cars.motion import PARTED
from dubins_traffic.cars.state import Contact, State
from dubins_traffic.cars.touching import Bodies
from dubins_traffic.kernels.arrays import Floats
from dubins_traffic.simulators.gazebo.link import BODY

if TYPE_CHECKING:
    from dubins_traffic.problem.instance import Instance

SLOWEST: Final = 0.01
"""Speed below which a body counts as standing, m/s: simulated wheels and contacts always move a little."""


class Contacts:
    """Keeps which bodies have touched and have not parted since."""

    def __init__(self, instance: Instance, step: float) -> None:
        problem = instance.problem
        self._period = 1.0 / problem.rate
        self._step = step
        self._bodies = Bodies(problem.car, problem.obstacles)
        self._touching: set[tuple[int, int]] = set()

    def collect(self, tick: int, rows: Floats, state: State) -> tuple[Contact, ...]:
        """Return the new contacts of the tick that ends in frame `tick`, whose state is given; earliest first."""
        found: list[Contact] = []
        for row in sorted(rows.tolist(), key=lambda row: (row[0], row[1], row[2])):
            pair = (int(row[1]), int(row[2]))
            if pair not in self._touching:
                self._touching.add(pair)
                found.append(self._contact(tick, row))
        if self._touching:
            self._touching = {
                pair for pair in self._touching if self._bodies.separation(state, *pair)[0] < PARTED
            }
        return tuple(found)

    def _contact(self, tick: int, row: list[float]) -> Contact:
        point, normal = (row[3], row[4]), (row[5], row[6])
        back = (-normal[0], -normal[1])
        bodies = row[7 : 7 + BODY], row[7 + BODY :]
        return Contact(
            tick=tick,
            time=(tick - 1) * self._period + row[0] * self._step,
            car=int(row[1]),
            other=int(row[2]),
            x=point[0],
            y=point[1],
            nx=normal[0],
            ny=normal[1],
            closing=(self._closing(bodies[0], point, normal), self._closing(bodies[1], point, back)),
            moved=(self._moved(bodies[0]), self._moved(bodies[1])),
        )

    def _closing(self, body: list[float], point: tuple[float, float], normal: tuple[float, float]) -> float:
        """Return the speed of the body's touching point along `normal`, m/s."""
        x, y, _, _, vx, vy, yaw_rate = body
        turn = yaw_rate if self._bodies.turns else 0.0
        return normal[0] * (vx - turn * (point[1] - y)) + normal[1] * (vy + turn * (point[0] - x))

    def _moved(self, body: list[float]) -> bool:
        _, _, _, _, vx, vy, yaw_rate = body
        turning = abs(yaw_rate) * self._bodies.box[0] if self._bodies.turns else 0.0
        return max(abs(vx), abs(vy), turning) > SLOWEST
