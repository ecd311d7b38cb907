"""The further metrics of a trial, by name or a user's own: fed in blocks of one second, and checked."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any, cast

from dubins_traffic.cars.state import Frames
from dubins_traffic.errors import DubinsTrafficError, InputError
from dubins_traffic.outside import plainly
from dubins_traffic.problem.instance import Instance
from dubins_traffic.record.sink import Ending
from dubins_traffic.scoring.blocks import Seconds
from dubins_traffic.scoring.metric import KINDS, Column, Maker, Measured, Metric, Value


class OwnMetrics:
    """A sink that hands a trial to further metrics, in the same blocks wherever the frames come from.

    An error of a metric does not end the trial: it becomes an `InputError` that names the metric.
    """

    def __init__(self, makers: Sequence[Maker]) -> None:
        self._metrics: tuple[Metric, ...] = tuple(maker() for maker in makers)

    def begin(self, instance: Instance) -> None:
        """Start all metrics."""
        self._seconds = Seconds(instance.problem.rate)
        for metric in self._metrics:
            _guarded(metric, "begin", instance)

    def frames(self, frames: Frames) -> None:
        """Take a block of frames, of any length."""
        for block in self._seconds.take(frames):
            self._show(block)

    def end(self, ending: Ending) -> None:
        """Hand the remaining frames and the ending to the metrics."""
        self._show_rest()
        for metric in self._metrics:
            _guarded(metric, "end", ending)

    def result(self) -> tuple[Measured, ...]:
        """Return the values of all metrics, in the order of their columns.

        Raises
        ------
        InputError
            If a metric raises, or its result is not a value of the right kind for each of its columns.
        """
        self._show_rest()
        return tuple(value for metric in self._metrics for value in _values(metric))

    def _show(self, block: Frames) -> None:
        for metric in self._metrics:
            _guarded(metric, "frames", block)

    def _show_rest(self) -> None:
        block = self._seconds.rest()
        if block is not None:
            self._show(block)


def _guarded(metric: Metric, method: str, *arguments: object) -> Any:
    try:
        return getattr(metric, method)(*arguments)
    except DubinsTrafficError:
        raise
    except Exception as error:
        raise _fault(metric, f"raised {plainly(error)} in {method}", None, "a metric that takes every trial") from error


def _values(metric: Metric) -> list[Measured]:
    measured = _guarded(metric, "result")
    names = [column.name for column in metric.columns]
    if not isinstance(measured, Mapping) or set(cast("Mapping[str, Any]", measured)) != set(names):
        raise _fault(
            metric,
            "returns other values than its columns",
            cast("object", measured),
            f"a mapping of {', '.join(names)}",
        )
    return [Measured(column, _value(metric, column, measured[column.name])) for column in metric.columns]


def _value(metric: Metric, column: Column, value: Any) -> Value:
    """Return a value as a plain Python value."""
    plain = value.item() if hasattr(value, "item") and getattr(value, "shape", None) == () else value
    if plain is None:
        return None
    kind = KINDS[column.kind]
    fits = isinstance(plain, kind) and (column.kind == "bool" or not isinstance(plain, bool))
    if fits and column.kind == "float64":
        plain = float(plain)
        fits = math.isfinite(plain)
    if fits and column.kind in ("int32", "int64"):
        fits = abs(plain) < 2 ** (int(column.kind[3:]) - 1)
    if not fits:
        raise _fault(metric, f"returns no {column.kind} for {column.name}", value, f"a finite {column.kind}, or None")
    return plain


def _fault(metric: Metric, problem: str, value: object, expected: str) -> InputError:
    return InputError(f"{type(metric).__name__} {problem}", file="--metric", value=value, expected=expected)
