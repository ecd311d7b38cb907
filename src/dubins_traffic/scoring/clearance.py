"""The metric `min_clearance_m`: the smallest gap between the ego and any other body."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from dubins_traffic.cars.state import EGO, Frames
from dubins_traffic.cars.tables import pack_cars, pack_obstacles
from dubins_traffic.kernels.arrays import Floats
from dubins_traffic.problem.instance import Instance
from dubins_traffic.record.sink import Ending
from dubins_traffic.scoring.metric import Column, ScoreColumn

_Gap = Callable[[np.ndarray, np.ndarray], Floats]
_SLACK = 1e-9
"""Metres by which rounding may make a bound exceed its gap; so the order of pairs does not change the result."""


class Clearance:
    """The smallest gap between the ego's body and any other car's or obstacle, at frames; 0 after a contact.

    Bodies and obstacles are rounded boxes (`dubins_traffic.cars.tables`): discs, oriented rectangles, the edges of
    polygons. Gaps are exact; pairs whose reaches alone keep them farther apart than the smallest gap are skipped.
    """

    def begin(self, instance: Instance) -> None:
        """Start with no gap."""
        car = pack_cars([instance.problem.car])
        self._half = np.array([car.half_length[0], car.half_width[0]])
        self._rounding = float(car.rounding[0])
        self._reach = float(car.reach[0])
        self._parts = pack_obstacles([instance.problem.obstacles]).parts
        self._best = np.inf

    def frames(self, frames: Frames) -> None:
        """Take a block of frames."""
        if any(EGO in (contact.car, contact.other) for contact in frames.contacts):
            self._best = 0.0
        if len(frames) and self._best > 0.0:
            self._try_cars(frames)
            self._try_obstacles(frames)

    def end(self, ending: Ending) -> None:
        """Nothing is left to do."""

    def result(self) -> float | None:
        """Return the smallest gap in metres, None if there was nothing else."""
        return None if np.isinf(self._best) else max(0.0, self._best)

    def _try_cars(self, frames: Frames) -> None:
        others = np.stack([frames.x[:, 1:], frames.y[:, 1:], frames.c[:, 1:], frames.s[:, 1:]], axis=-1)
        bound = _distance(frames, others[..., 0], others[..., 1]) - 2.0 * self._reach

        def gap(f: np.ndarray, n: np.ndarray) -> Floats:
            half = np.broadcast_to(self._half, (len(f), 2))
            return box_distance(self._ego(frames, f), half, others[f, n], half) - 2.0 * self._rounding

        self._improve(bound, gap)

    def _try_obstacles(self, frames: Frames) -> None:
        parts = self._parts
        bound = _distance(frames, parts["x"], parts["y"]) - self._reach - parts["reach"]
        places = np.stack([parts["x"], parts["y"], parts["c"], parts["s"]], axis=-1)
        halves = np.stack([parts["half_length"], parts["half_width"]], axis=-1)

        def gap(f: np.ndarray, p: np.ndarray) -> Floats:
            half = np.broadcast_to(self._half, (len(f), 2))
            apart = box_distance(self._ego(frames, f), half, places[p], halves[p])
            return apart - self._rounding - parts["rounding"][p]

        self._improve(bound, gap)

    def _improve(self, bound: Floats, gap: _Gap) -> None:
        if not bound.size:
            return
        nearest = np.unravel_index(np.argmin(bound), bound.shape)
        if bound[nearest] >= self._best + _SLACK:
            return
        self._best = min(self._best, float(gap(*(index.reshape(1) for index in nearest))[0]))
        rows, columns = np.nonzero(bound < self._best + _SLACK)
        if len(rows):
            self._best = min(self._best, float(gap(rows, columns).min()))

    def _ego(self, frames: Frames, f: np.ndarray) -> Floats:
        return np.stack([frames.x[f, EGO], frames.y[f, EGO], frames.c[f, EGO], frames.s[f, EGO]], axis=-1)


def box_distance(a: Floats, half_a: Floats, b: Floats, half_b: Floats) -> Floats:
    """Return the distances between pairs of oriented boxes, 0 where they overlap.

    Parameters
    ----------
    a, b : (M, 4)
        Centres and headings: x, y, cosine, sine.
    half_a, half_b : (M, 2)
        Half lengths and half widths; both may be 0.
    """
    apart = np.minimum(_corners_to_box(a, half_a, b, half_b), _corners_to_box(b, half_b, a, half_a))
    return np.where(_overlap(a, half_a, b, half_b), 0.0, apart)


def _corners_to_box(a: Floats, half_a: Floats, b: Floats, half_b: Floats) -> Floats:
    sign = np.array([[1.0, 1.0], [1.0, -1.0], [-1.0, 1.0], [-1.0, -1.0]])
    along, across = (half_a[:, None, :] * sign).transpose(2, 0, 1)
    c, s = a[:, 2:3], a[:, 3:4]
    x = a[:, 0:1] + c * along - s * across - b[:, 0:1]
    y = a[:, 1:2] + s * along + c * across - b[:, 1:2]
    c, s = b[:, 2:3], b[:, 3:4]
    beyond = np.abs(c * x + s * y) - half_b[:, 0:1], np.abs(c * y - s * x) - half_b[:, 1:2]
    dx, dy = np.maximum(beyond[0], 0.0), np.maximum(beyond[1], 0.0)
    return np.sqrt(dx * dx + dy * dy).min(axis=1)


def _overlap(a: Floats, half_a: Floats, b: Floats, half_b: Floats) -> np.ndarray:
    """Tell whether no side of either box separates them."""
    x, y = b[:, 0] - a[:, 0], b[:, 1] - a[:, 1]
    c = np.abs(a[:, 2] * b[:, 2] + a[:, 3] * b[:, 3])
    s = np.abs(a[:, 2] * b[:, 3] - a[:, 3] * b[:, 2])
    meets = np.ones(len(a), dtype=bool)
    for one, half, other in ((a, half_a, half_b), (b, half_b, half_a)):
        along = np.abs(one[:, 2] * x + one[:, 3] * y)
        across = np.abs(one[:, 2] * y - one[:, 3] * x)
        meets &= along <= half[:, 0] + c * other[:, 0] + s * other[:, 1]
        meets &= across <= half[:, 1] + s * other[:, 0] + c * other[:, 1]
    return meets


def _distance(frames: Frames, x: Floats, y: Floats) -> Floats:
    dx, dy = x - frames.x[:, EGO, None], y - frames.y[:, EGO, None]
    return np.sqrt(dx * dx + dy * dy)


COLUMNS = (
    ScoreColumn(Column("min_clearance_m", "least clearance", "m", 1), lambda score: score.min_clearance_m),
)
