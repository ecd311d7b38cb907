"""From contacts of the physics to those of the record: one for each time that two bodies meet."""

from __future__ import annotations

from typing import TYPE_CHECKING, Final

from dubins_traffic.cars.motion import PARTED
from dubins_traffic.cars.state import Contact, State
from dubins_traffic.cars.tables import pack_cars, pack_obstacles
from dubins_traffic.kernels.arrays import Floats
from dubins_traffic.kernels.boxes import separation
from dubins_traffic.simulators.gazebo.link import BODY

if TYPE_CHECKING:
    from dubins_traffic.problem.instance import Instance

SLOWEST: Final = 0.01
"""Below this speed, m/s, a body counts as standing: wheels and contacts always shiver a little."""


class Contacts:
    """Knows which bodies have touched and have not parted since."""

    def __init__(self, instance: Instance, step: float) -> None:
        problem = instance.problem
        self._period = 1.0 / problem.rate
        self._step = step
        cars, obstacles = pack_cars([problem.car]), pack_obstacles([problem.obstacles])
        self._box = (float(cars.half_length[0]), float(cars.half_width[0]), float(cars.rounding[0]))
        self._turns = self._box[0] > 0.0
        self._parts: dict[int, list[list[float]]] = {}
        for owner, part in zip(obstacles.owner.tolist(), obstacles.part.tolist(), strict=True):
            self._parts.setdefault(-1 - owner, []).append(part)
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
            self._touching = {pair for pair in self._touching if self._gap(state, *pair) < PARTED}
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
        turn = yaw_rate if self._turns else 0.0
        return normal[0] * (vx - turn * (point[1] - y)) + normal[1] * (vy + turn * (point[0] - x))

    def _moved(self, body: list[float]) -> bool:
        _, _, _, _, vx, vy, yaw_rate = body
        turning = abs(yaw_rate) * self._box[0] if self._turns else 0.0
        return max(abs(vx), abs(vy), turning) > SLOWEST

    def _gap(self, state: State, car: int, other: int) -> float:
        """Return the gap, metres, between a car and another, or obstacle -1 - k."""
        own = (state.x[0, car], state.y[0, car], state.c[0, car], state.s[0, car], *self._box)
        if other >= 0:
            its = (state.x[0, other], state.y[0, other], state.c[0, other], state.s[0, other], *self._box)
            return separation(*own, *its)[0]
        return min(separation(*own, *part[:7])[0] for part in self._parts[other])
