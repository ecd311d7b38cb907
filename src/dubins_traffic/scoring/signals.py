"""Propositions as signals: how far each is from changing, for the robustness of users' formulas.

The signal of a proposition about places is a length in metres: from the car's centre to the edge of a disc or of the
road, from its body to a disc, to the centre line, or to the nearest body. That of an event within a tick is infinite,
since there is no being close to it. Any other is a time in seconds: since when the proposition has had its value;
infinite if since the first frame.

The sign of a signal is that of the proposition, as the judge has found it, whatever was measured.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import TYPE_CHECKING, Final

import numpy as np
import numpy.typing as npt

from dubins_traffic.cars.body import Disc
from dubins_traffic.cars.tables import pack_obstacles
from dubins_traffic.kernels.arrays import Floats, Ints
from dubins_traffic.rules.parameters import RuleParameters
from dubins_traffic.rules.vocabulary import AT, FREE, VISIT, Proposition

if TYPE_CHECKING:
    from dubins_traffic.cars.state import Frames
    from dubins_traffic.problem.instance import Instance

Mask = npt.NDArray[np.bool_]
SURE: Final = 1e-9
"""Least absolute value of a signal, with the sign of its proposition."""
SUDDEN: Final = frozenset({"enter", "entered", VISIT, "turned", "at_fault", "renewed", "excess"})
"""Propositions about events within a tick."""


class Signals:
    """The signals of propositions in the frames of a trial, kept block by block.

    Parameters
    ----------
    instance : Instance
        The trial.
    wanted : mapping of str to Proposition
        The propositions by name.
    """

    def __init__(self, instance: Instance, wanted: Mapping[str, Proposition]) -> None:
        problem = instance.problem
        self._problem, self._wanted = problem, dict(wanted)
        self._rules = RuleParameters.from_mapping(problem.rules)
        body = problem.car.body
        self._reach = body.reach
        self._half = body.radius if isinstance(body, Disc) else 0.5 * body.width
        self._blocks: list[Frames] = []
        self._held: list[Mask] = []
        self._measures: dict[str, Callable[[Proposition], Floats]] = {
            AT: self._at, FREE: self._free, "cross": self._cross, "clear": self._clear,
            "in_crossing": self._in_crossing, "collision": self._collision, "left": self._left,
            "on_road": self._on_road,
        }  # fmt: skip

    def take(self, frames: Frames, held: Mask) -> None:
        """Take a block of frames, and which of the propositions hold in each, (F, P)."""
        self._blocks.append(frames)
        self._held.append(held)

    def result(self) -> dict[str, Floats]:
        """Return the signal of each proposition, by name, (K,) each."""
        if not self._blocks:
            return {name: np.zeros(0) for name in self._wanted}
        blocks = self._blocks
        self._x, self._y = (np.concatenate([getattr(block, name) for block in blocks]) for name in "xy")
        self._lane: Ints = np.concatenate([block.lane for block in blocks])
        held = np.concatenate(self._held)
        by_name: dict[str, Floats] = {}
        for column, (name, wanted) in enumerate(self._wanted.items()):
            by_name[name] = self._signal(wanted, held[:, column])
        del self._x, self._y, self._lane
        return by_name

    def _signal(self, wanted: Proposition, held: Mask) -> Floats:
        measure = self._measures.get(wanted.word)
        if measure is not None:
            value = measure(wanted)
        elif wanted.word in SUDDEN:
            value = np.where(held, np.inf, -np.inf)
        else:
            since = _since(held) * self._problem.period
            value = np.where(held, since, -since)
        return np.where(held, np.maximum(value, SURE), np.minimum(value, -SURE))

    def _distance(self, car: int, vertex: int) -> Floats:
        x, y = self._problem.network.points[vertex].tolist()
        return _apart(self._x[:, car] - x, self._y[:, car] - y)

    def _others(self, car: int) -> list[int]:
        return [other for other in range(self._x.shape[1]) if other != car]

    def _at(self, wanted: Proposition) -> Floats:
        return self._problem.intersection_radius - self._distance(wanted.car, wanted.place)

    def _free(self, wanted: Proposition) -> Floats:
        apart = [self._distance(car, wanted.place) for car in range(1, self._x.shape[1])]
        return _least(apart, len(self._x)) - self._problem.intersection_radius

    def _cross(self, wanted: Proposition) -> Floats:
        return self._at(wanted) + self._reach

    def _clear(self, wanted: Proposition) -> Floats:
        if wanted.place < 0:  # the proposition is about the crossing ahead, whichever that is
            return np.zeros(len(self._x))
        apart = [self._distance(car, wanted.place) for car in self._others(wanted.car)]
        return _least(apart, len(self._x)) - self._problem.intersection_radius - self._reach

    def _in_crossing(self, wanted: Proposition) -> Floats:
        degrees = self._problem.network.degrees.tolist()
        crossings = [v for v, degree in enumerate(degrees) if degree >= self._rules.crossing_degree]
        apart = _least([self._distance(wanted.car, v) for v in crossings], len(self._x))
        return self._problem.intersection_radius + self._reach - apart

    def _collision(self, wanted: Proposition) -> Floats:
        x, y = self._x[:, wanted.car], self._y[:, wanted.car]
        others = self._others(wanted.car)
        apart = [_apart(self._x[:, n] - x, self._y[:, n] - y) - self._reach for n in others]
        parts = pack_obstacles([self._problem.obstacles]).parts
        places = zip(parts["x"].tolist(), parts["y"].tolist(), parts["reach"].tolist(), strict=True)
        apart += [_apart(px - x, py - y) - reach for px, py, reach in places]
        return self._reach - _least(apart, len(x))

    def _left(self, wanted: Proposition) -> Floats:
        """Return how far the body reaches over the line at which `left` rises; -inf without a lane state."""
        lanes = self._lane[:, wanted.car]
        points = np.stack([self._x[:, wanted.car], self._y[:, wanted.car]], axis=-1)
        left = np.full(len(points), -np.inf)
        for lane in np.unique(lanes[lanes >= 0]).tolist():
            is_there = lanes == lane
            _, across = self._problem.network.lane_coordinates(lane, points[is_there])
            left[is_there] = across + self._half - self._rules.left_set
        return left

    def _on_road(self, wanted: Proposition) -> Floats:
        points = np.stack([self._x[:, wanted.car], self._y[:, wanted.car]], axis=-1)
        _, apart = self._problem.network.nearest_segment(points)
        return 2.0 * self._problem.car.w - apart


def _apart(dx: Floats, dy: Floats) -> Floats:
    return np.sqrt(dx * dx + dy * dy)


def _least(values: Sequence[Floats], count: int) -> Floats:
    """Return the least of signals of `count` frames, infinite if there is none."""
    return np.minimum.reduce(values) if values else np.full(count, np.inf)


def _since(held: Mask) -> Floats:
    """Return for how many frames each value has been the same, infinite if since the first frame."""
    changes = np.flatnonzero(np.diff(held)) + 1
    last = np.full(len(held), -np.inf)
    last[changes] = changes
    return np.arange(len(held), dtype=np.float64) - np.maximum.accumulate(last)
