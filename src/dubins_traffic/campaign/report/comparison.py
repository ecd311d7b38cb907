"""What a report says: the controllers of a campaign compared."""

from __future__ import annotations

import json
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import combinations
from typing import Any, get_args

import numpy as np

from dubins_traffic.campaign import rows, table
from dubins_traffic.campaign.campaign import Campaign
from dubins_traffic.campaign.columns import REPORTED, SCORES, SECOND
from dubins_traffic.campaign.report.statistics import Estimate, Share, estimate, is_decided, share
from dubins_traffic.kernels.arrays import Floats
from dubins_traffic.record.sink import BY_CONTROLLER
from dubins_traffic.scoring.formulas import Status
from dubins_traffic.scoring.metric import Column
from dubins_traffic.scoring.verdict import ASSUMPTIONS, EGO_RULES, OF_SIMULATED, Ruling, was_cut

CONFIGURATION = "configuration"
WALL_METRICS = (
    Column("time_to_begin_s", "time to begin, wall clock", "s", -1),
    Column("act_mean_s", "time to act, mean, wall clock", "s", -1),
    Column("act_p99_s", "time to act, 99 %, wall clock", "s", -1),
    Column("act_max_s", "time to act, longest, wall clock", "s", -1),
)
"""What was measured on a wall clock."""

FAULTS: Mapping[str, str] = {
    "collisions_ego_fault": "the ego",
    "collisions_other_fault": "the other",
    "collisions_both_fault": "both",
}
"""Collisions of the ego by who was at fault."""
RANKING: tuple[Column, ...] = tuple(SCORES[name].column for name in ("counted_rounds", SECOND))
"""What ranks controllers, and what ranks those that are equal in it."""
HELD: tuple[str, ...] = get_args(Status)
"""What can hold of a formula of the user's own."""


@dataclass(frozen=True, slots=True)
class Standing:
    """What is said of one controller.

    `estimates` holds a row a metric, by column; `clean` is the share of clean trials in the judged ones and those that
    came to nothing, without the `cut` ones (docs/rules.md#cut), `ended` that of trials that the controller ended
    (`BY_CONTROLLER`) in all, `near` that of excused trials whose excuses were near; `verdicts` holds the share of each
    verdict in the judged trials, `ends` that of each end in all, `broken` that of trials in which the ego broke each
    rule, `fallen` in which others broke each part of the assumption; `faults` counts collisions by who was at fault.
    `formulas` holds the share of each verdict on each formula of the user's own, by its name, in the trials that carry
    it.
    """

    controller: str
    trials: int
    judged: int
    estimates: Mapping[str, Estimate]
    clean: Share
    cut: int
    ended: Share
    near: Share
    verdicts: Mapping[str, Share]
    ends: Mapping[str, Share]
    broken: Mapping[str, Share]
    fallen: Mapping[str, Share]
    collisions: int
    faults: Mapping[str, int]
    formulas: Mapping[str, Mapping[str, Share]]


@dataclass(frozen=True, slots=True)
class Difference:
    """How much `first` exceeds `second` in a metric, trial by trial on the same instances.

    `larger` and `smaller` count the pairs in which the first has more, or less.
    """

    first: str
    second: str
    metric: Column
    estimate: Estimate
    larger: int
    smaller: int

    @property
    def is_decided(self) -> bool:
        """Whether the interval of the mean leaves out 0."""
        ends = self.estimate.mean_interval
        return ends is not None and is_decided(ends)

    @property
    def better(self) -> str | None:
        """The controller that is better in the metric, if the difference is decided."""
        mean, better = self.estimate.mean, self.metric.better
        if mean is None or not better or not self.is_decided:
            return None
        return self.first if (mean > 0) == (better > 0) else self.second


@dataclass(frozen=True, slots=True)
class Level:
    """The estimate of a metric for one controller where a factor has a value."""

    factor: str
    value: str
    controller: str
    metric: Column
    estimate: Estimate


@dataclass(frozen=True, slots=True)
class Comparison:
    """A campaign compared: `trials` of `total` have rows, `metrics` are those of which there are values.

    `undefined` are those that are defined for none of the trials. `merits` are the differences in the columns that rank
    (`RANKING`), where a trial that came to nothing counts 0.

    `controllers` are ranked by their counted rounds a trial, most first, where a trial that came to nothing has none;
    all else follows that order. The e-agents broke the assumption in `broken` of the `judged` trials.
    """

    campaign: Campaign
    controllers: Sequence[str]
    trials: int
    total: int
    broken: int
    judged: int
    metrics: Sequence[Column]
    undefined: Sequence[Column]
    standings: Sequence[Standing]
    differences: Sequence[Difference]
    merits: Sequence[Difference]
    levels: Sequence[Level]
    factors: Mapping[str, Sequence[str]]


def compare(campaign: Campaign, results: Any, wall: Any = None) -> Comparison:
    """Compare the controllers of a campaign.

    Parameters
    ----------
    campaign : Campaign
        What was run.
    results : pyarrow.Table
        Its table, or the rows that there are.
    wall : pyarrow.Table, optional
        The wall-clock figures of the same trials.
    """
    metrics = metrics_of(campaign)
    values = {metric.name: floats(results[metric.name]) for metric in metrics}
    if wall is not None:
        values |= {metric.name: floats(wall[metric.name]) for metric in WALL_METRICS}
    known = [
        metric
        for metric in (*metrics, *WALL_METRICS)
        if metric.name in values and _is_told(metric, values[metric.name])
    ]
    names: Any = np.array(results["controller"].to_pylist(), dtype=object)
    merits = {metric.name: np.nan_to_num(floats(results[metric.name])) for metric in RANKING}
    order = ranked(campaign, results)
    chosen = {name: names == name for name in order}
    fallen = floats(results["assumption_broken"])
    factors = _factors(campaign)
    return Comparison(
        campaign,
        order,
        len(results),
        campaign.total,
        int((fallen > 0).sum()),
        int((~np.isnan(fallen)).sum()),
        known,
        [metric for metric in metrics if metric.bounded and metric not in known],
        [_standing(name, results.filter(_mask(of_name)), known, values, of_name) for name, of_name in chosen.items()],
        list(_differences(campaign, results, chosen, known, values)),
        list(_differences(campaign, results, chosen, RANKING, merits)),
        list(_levels(results, factors, chosen, known, values)),
        factors,
    )


def metrics_of(campaign: Campaign) -> tuple[Column, ...]:
    """Return the metrics of a campaign's table that are numbers: those of every score, and further ones."""
    return (*REPORTED, *(column for column in campaign.columns if column.kind != "string"))


def ranked(campaign: Campaign, results: Any) -> list[str]:
    """Return the controllers, those with the largest means of the first of `RANKING` first; ties by the second.

    A trial that came to nothing counts 0.
    """
    names: Any = np.array(results["controller"].to_pylist(), dtype=object)
    columns = [np.nan_to_num(floats(results[metric.name])) for metric in RANKING]

    def merit(name: str) -> list[float]:
        is_controller = names == name
        return [float(column[is_controller].sum()) / max(1, int(is_controller.sum())) for column in columns]

    return sorted(campaign.controllers, key=merit, reverse=True)


def _factors(campaign: Campaign) -> dict[str, list[str]]:
    """Return what varied, with its values as texts, in their order; the configuration is one of them."""
    factors = {CONFIGURATION: list(dict.fromkeys(cell.configuration for cell in campaign.cells))}
    for name in campaign.factors:
        factors[name] = list(dict.fromkeys(table.factor_text(cell.values[name]) for cell in campaign.cells))
    varied = {name: values for name, values in factors.items() if len(values) > 1}
    return varied or {CONFIGURATION: factors[CONFIGURATION]}


def _standing(
    controller: str, results: Any, metrics: Sequence[Column], values: Mapping[str, Floats], chosen: Any
) -> Standing:
    ends: list[str] = results["end"].to_pylist()
    verdicts: list[str | None] = results["verdict"].to_pylist()
    judged = sum(verdict is not None for verdict in verdicts)
    seen = [verdict.value for verdict in OF_SIMULATED]
    nothing = sum(ends.count(end) for end in rows.NOTHING)
    clean: list[bool | None] = results["clean"].to_pylist()
    cut = sum(map(was_cut, verdicts, clean, ends))

    def happened(column: str) -> Share:
        return share(int((floats(results[column]) > 0).sum()), judged)

    return Standing(
        controller,
        len(results),
        judged,
        {metric.name: estimate(values[metric.name][chosen]) for metric in metrics},
        share(clean.count(True), judged - cut + nothing if judged else 0),
        cut,
        share(sum(ends.count(end) for end in BY_CONTROLLER), len(ends)),
        share(int((floats(results["near"]) > 0).sum()), verdicts.count(Ruling.EXCUSED.value)),
        {verdict: share(verdicts.count(verdict), judged) for verdict in seen} if judged else {},
        {end: share(ends.count(end), len(ends)) for end in sorted(set(ends))},
        {rule: happened(f"breaches.{rule}") for rule in EGO_RULES} if judged else {},
        {part: happened(f"breaches_of_others.{part}") for part in ASSUMPTIONS} if judged else {},
        int(np.nansum(floats(results["collisions"]))),
        {who: int(np.nansum(floats(results[column]))) for column, who in FAULTS.items()},
        _formulas(results["formulas"].to_pylist()),
    )


def _formulas(column: Sequence[str | None]) -> dict[str, dict[str, Share]]:
    """Return the share of each verdict on each formula, in the order in which the problems have them."""
    counts: dict[str, Counter[str]] = {}
    for text, times in Counter(column).items():
        held: dict[str, str] = json.loads(text or "{}")
        for name, verdict in held.items():
            counts.setdefault(name, Counter())[verdict] += times
    return {name: {verdict: share(count[verdict], count.total()) for verdict in HELD} for name, count in counts.items()}


def _is_told(metric: Column, values: Floats) -> bool:
    known = values[~np.isnan(values)]
    return len(known) > 0 and (not metric.rare or bool((known > 0).any()))


def _differences(
    campaign: Campaign,
    results: Any,
    chosen: Mapping[str, Any],
    metrics: Sequence[Column],
    values: Mapping[str, Floats],
) -> Iterator[Difference]:
    """Return the paired differences of all pairs of controllers in all metrics."""
    cells, _, trials = table.places(campaign, results["number"].to_numpy())
    pair = np.array([cell.first for cell in campaign.cells])[cells] + trials
    for first, second in combinations(chosen, 2):
        one, other = np.flatnonzero(chosen[first]), np.flatnonzero(chosen[second])
        _, left, right = np.intersect1d(pair[one], pair[other], return_indices=True)
        for metric in metrics:
            column = values[metric.name]
            differences = column[one[left]] - column[other[right]]
            larger, smaller = int((differences > 0).sum()), int((differences < 0).sum())
            yield Difference(first, second, metric, estimate(differences), larger, smaller)


def _levels(
    results: Any,
    factors: Mapping[str, Sequence[str]],
    chosen: Mapping[str, Any],
    metrics: Sequence[Column],
    values: Mapping[str, Floats],
) -> Iterator[Level]:
    for factor, levels in factors.items():
        name = factor if factor == CONFIGURATION else table.FACTOR + factor
        texts: Any = np.array([table.factor_text(value) for value in results[name].to_pylist()], dtype=object)
        for level in levels:
            here = texts == level
            for controller, of_controller in chosen.items():
                for metric in metrics:
                    mean = estimate(values[metric.name][here & of_controller], median=False)
                    yield Level(factor, level, controller, metric, mean)


def floats(column: Any) -> Floats:
    """Return a column of numbers or switches as floats, NaN where it has none."""
    made = rows.arrow()
    return (
        column.cast(made.float64() if column.type != made.bool_() else made.int8())
        .cast(made.float64())
        .to_numpy(zero_copy_only=False)
    )


def _mask(flags: Any) -> Any:
    return rows.arrow().array(flags)


def shown(value: float | None) -> str:
    """Return a number as people read it: four digits that count."""
    return "\N{EN DASH}" if value is None else f"{value:.4g}"


def words(name: str) -> str:
    """Return the name of a factor or of an end as people write it."""
    return name.replace("e_agent", "e-agent").replace("_", " ")


def number_of(count: int, one: str, many: str = "") -> str:
    """Return a number with what it counts, in the singular or the plural."""
    return f"{count:,} {one if count == 1 else many or one + 's'}"
