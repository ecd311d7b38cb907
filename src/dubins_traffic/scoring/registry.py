"""Metrics by name: the one that trials may have unasked, those that packages offer, and a user's own.

The values that every score has stand in `scoring.score.Score`; the metrics here are added on request. This package
offers its own as others do, by entry points (docs/extending/metric.md).
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping, Sequence
from functools import cache
from typing import Any, TypeVar, cast, get_args

from dubins_traffic import outside
from dubins_traffic.controllers.registry import plays_foreign
from dubins_traffic.errors import InputError
from dubins_traffic.outside import Seam
from dubins_traffic.scoring.metric import KINDS, Column, Kind, Maker, MetricSpec

STRATEGY_SHARE = "strategy_share"
"""The metric that every trial has whose ego plays a strategy of another tool."""
GROUP = "dubins_traffic.metrics"
"""Group of the entry points by which other packages offer metrics."""
OPTION = "--metric"
_SEAM = Seam(
    OPTION,
    "metric",
    ("begin", "frames", "end", "result"),
    "columns, begin(instance), frames(frames), end(ending) and result() -> mapping",
)
Spec = TypeVar("Spec", bound=MetricSpec)
_NAME = re.compile(r"[A-Za-z]\w*", re.ASCII)


def names() -> Mapping[str, str]:
    """Return the metrics of this and other packages: name to one line of description."""
    return {name: (maker.__doc__ or "").strip().partition("\n")[0].rstrip(".") for name, maker in _registered().items()}


def load(spec: MetricSpec) -> Maker:
    """Return the callable that makes a metric, after a trial call.

    Parameters
    ----------
    spec : str or callable
        A registered name, ``module:Class``, ``path/to/file.py:Class``, or a class without arguments.

    Raises
    ------
    InputError
        If there is no such metric, or it lacks a member of `scoring.metric.Metric`.
    """
    maker = _maker(spec)
    _columns_of(maker, spec)
    return maker


def columns(specs: Sequence[MetricSpec], taken: Sequence[str] = ()) -> tuple[Column, ...]:
    """Return the columns of some metrics, in their order; `taken` are names that other columns have.

    Raises
    ------
    InputError
        As `load`; and if two columns have one name.
    """
    by_name: dict[str, Column] = {}
    for spec in specs:
        for column in _columns_of(_maker(spec), spec):
            if column.name in by_name or column.name in taken:
                raise _refuse(spec, f"has a column whose name is taken: {column.name}", "a name of its own")
            by_name[column.name] = column
    return tuple(by_name.values())


def makers(specs: Sequence[MetricSpec]) -> tuple[Maker, ...]:
    """Return the callables that make some metrics; the exceptions are those of `columns`."""
    made = tuple(_maker(spec) for spec in specs)
    columns(made)
    return made


def with_share(specs: Iterable[Spec], controllers: Iterable[object]) -> tuple[Spec | str, ...]:
    """Return further metrics, and with them `strategy_share` if a controller plays a strategy of another tool."""
    given = tuple(specs)
    if STRATEGY_SHARE in given or not any(isinstance(one, str) and plays_foreign(one) for one in controllers):
        return given
    return (*given, STRATEGY_SHARE)


def forget() -> None:
    """Forget the metrics of other packages, so that the next call looks for them again."""
    _registered.cache_clear()


def _columns_of(maker: Maker, spec: MetricSpec) -> tuple[Column, ...]:
    made = outside.make(maker, _called(spec), _SEAM)
    columns: Any = getattr(made, "columns", None)
    sound = isinstance(columns, list | tuple) and columns and all(isinstance(column, Column) for column in columns)  # pyright: ignore[reportUnknownVariableType]
    if not sound:
        raise _refuse(spec, "has no columns", "columns, a tuple of dubins_traffic.Column")
    checked = tuple(cast("Sequence[Column]", columns))
    for described in checked:
        if not _NAME.fullmatch(described.name) or described.kind not in get_args(Kind) or described.kind not in KINDS:
            raise _refuse(
                spec, f"has a column that is none: {described.name} of kind {described.kind}", "a name and a kind"
            )
    return checked


def _called(spec: MetricSpec) -> str:
    return spec if isinstance(spec, str) else getattr(spec, "__name__", "metric")


def _refuse(spec: MetricSpec, problem: str, expected: str) -> InputError:
    return _SEAM.refuse(f"{_called(spec).rpartition(':')[2]} {problem}", _called(spec), expected)


def _maker(spec: MetricSpec) -> Maker:
    if not isinstance(spec, str):
        return spec
    if outside.is_place(spec):
        return outside.find(spec, _SEAM)
    if spec not in _registered():
        known = ", ".join(_registered())
        raise _SEAM.refuse("unknown metric", spec, f"one of {known}, module:Class or path/to/file.py:Class")
    return _registered()[spec]


@cache
def _registered() -> Mapping[str, Maker]:
    return outside.of_packages(GROUP)
