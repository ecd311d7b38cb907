"""Two campaigns compared: paired where the instances are the same, else as independent samples."""

from __future__ import annotations

import os
import textwrap
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from dubins_traffic.campaign.report.comparison import floats, metrics_of, number_of, ranked, shown
from dubins_traffic.campaign.report.conclusion import FEWEST
from dubins_traffic.campaign.report.statistics import Estimate, Interval, apart, estimate, is_decided
from dubins_traffic.campaign.report.write import open_campaign
from dubins_traffic.kernels.arrays import Floats, Ints
from dubins_traffic.scoring.metric import Column

if TYPE_CHECKING:
    from rich.table import Table

WIDTH = 80


@dataclass(frozen=True, slots=True)
class Change:
    """A metric in both campaigns, and how much the second mean exceeds the first, with its 95 % interval."""

    metric: Column
    first: Estimate
    second: Estimate
    difference: float
    interval: Interval

    @property
    def is_decided(self) -> bool:
        """Whether the interval leaves out 0."""
        return is_decided(self.interval)


@dataclass(frozen=True, slots=True)
class Across:
    """A controller of one campaign beside one of another.

    `paired` is the number of trials on the same instances, which alone are compared if there are any; `first_trials`
    and `second_trials` count all trials of each.
    """

    first: str
    second: str
    first_trials: int
    second_trials: int
    paired: int
    changes: Sequence[Change]


@dataclass(frozen=True, slots=True)
class _Run:
    """A campaign that has been run: its manifest, its metrics, its table, and its controllers, the best first."""

    known: Mapping[str, Any]
    metrics: Sequence[Column]
    results: Any
    controllers: Sequence[str]


def compare_campaigns(first: str | os.PathLike[str], second: str | os.PathLike[str]) -> tuple[list[Across], str]:
    """Compare each controller of a campaign with that of the same name in another one, or if none is, the best of both.

    Trials are paired where configuration, factors, seed and number are the same, and so the instances.

    Returns
    -------
    compared : list of Across
        In the order of the first campaign's ranking.
    note : str
        What makes the comparison doubtful: that the campaigns were run by different code; empty if nothing does.

    Raises
    ------
    InputError
        If there is no campaign in a folder, or nothing of it is finished.
    MissingExtraError
        Without the extra `campaign`.
    """
    one, other = _load(first), _load(second)
    names = [(name, name) for name in one.controllers if name in other.controllers]
    pairs = names or [(one.controllers[0], other.controllers[0])]
    differ = one.known["code"] != other.known["code"]
    note = "the campaigns were run by different code, which may draw other instances from the same seed"
    return [_across(one, other, *pair) for pair in pairs], note if differ else ""


def said(one: Across) -> str:
    """Return a sentence on two controllers: what is compared, and whether they can be told apart."""
    names = one.first if one.first == one.second else f"{one.first} (A) and {one.second} (B)"
    how = f"{number_of(one.paired, 'pair')} of trials on the same instances"
    if not one.paired:
        how = f"{one.first_trials} and {one.second_trials} trials, of which no two are on the same instance"
    elif one.paired < max(one.first_trials, one.second_trials):
        how += f" (of {one.first_trials} and {one.second_trials} trials)"
    fewest = one.paired or min(one.first_trials, one.second_trials)
    if fewest < FEWEST:
        return f"{names}: {how}; too few to tell the campaigns apart, it takes {FEWEST} or more."
    decided = [change for change in one.changes if change.is_decided]
    if not decided:
        return f"{names}: {how}; no metric tells the campaigns apart."
    change = decided[0]
    more = "more" if change.difference > 0 else "less"
    ends = sorted(abs(end) for end in change.interval)
    size = f"{shown(abs(change.difference))} (95 % interval {shown(ends[0])} to {shown(ends[1])})"
    return f"{names}: {how}. B has {size} {more} of {change.metric.heading} than A."


def table(one: Across, *, everything: bool = False, width: int = WIDTH) -> Iterator[str | Table]:
    """Yield the sentence, and the metrics that are not 0 in both, in bold what tells the campaigns apart."""
    from rich import box
    from rich.table import Table

    yield textwrap.fill(said(one), width)
    made = Table(box=box.SIMPLE_HEAD, padding=(0, 1, 0, 0), show_edge=False)
    made.add_column("metric", overflow="fold")
    for heading in ("A", "B", "B - A", "95 %"):
        made.add_column(heading, justify="right", no_wrap=True)
    told = [change for change in one.changes if everything or change.first.mean or change.second.mean]
    for difference in told:
        cells = (shown(difference.first.mean), shown(difference.second.mean), f"{difference.difference:+.4g}")
        interval = f"{shown(difference.interval[0])} .. {shown(difference.interval[1])}"
        made.add_row(difference.metric.heading, *cells, interval, style="bold" if difference.is_decided else "")
    yield made
    left = len(one.changes) - len(told)
    if left:
        yield f"{number_of(left, 'metric')} more, 0 in both; --all shows them."


def _load(folder: str | os.PathLike[str]) -> _Run:
    _, known, campaign, results = open_campaign(folder)
    return _Run(known, metrics_of(campaign), results, ranked(campaign, results))


def _across(one: _Run, other: _Run, first: str, second: str) -> Across:
    left = np.array(one.results["controller"].to_pylist(), dtype=object) == first
    right = np.array(other.results["controller"].to_pylist(), dtype=object) == second
    rows, others = _same_instances(one, other, np.flatnonzero(left), np.flatnonzero(right))
    paired = len(rows)
    if not paired:
        rows, others = np.flatnonzero(left), np.flatnonzero(right)
    changes: list[Change] = []
    for metric in one.metrics:
        if metric not in other.metrics:
            continue
        values = floats(one.results[metric.name])[rows], floats(other.results[metric.name])[others]
        change = _change(metric, *values, paired=bool(paired))
        if change is not None:
            changes.append(change)
    return Across(first, second, int(left.sum()), int(right.sum()), paired, changes)


def _same_instances(one: _Run, other: _Run, left: Ints, right: Ints) -> tuple[Ints, Ints]:
    """Return the rows of both that are trials of the same instances, in the same order.

    The seed of a trial follows from the campaign's, the name of the configuration and the factors; the configuration's
    document stands in the manifest by its hash.
    """
    keys = [_instances(run, rows) for run, rows in ((one, left), (other, right))]
    both = [key for key in keys[0] if key in keys[1]]
    return np.array([keys[0][key] for key in both], int), np.array([keys[1][key] for key in both], int)


def _instances(run: _Run, rows: Ints) -> dict[tuple[str, int, int], int]:
    hashes = run.known["configurations"]
    columns = [run.results[name].to_pylist() for name in ("configuration", "seed", "trial")]
    return {(hashes[columns[0][row]], columns[1][row], columns[2][row]): int(row) for row in rows}


def _change(metric: Column, first: Floats, second: Floats, *, paired: bool) -> Change | None:
    one, other = estimate(first, median=False), estimate(second, median=False)
    if paired:
        change = estimate(second - first, median=False)
        mean, interval = change.mean, change.mean_interval
    else:
        mean, interval = apart(first, second)
    if mean is None or interval is None:
        return None
    return Change(metric, one, other, mean, interval)
