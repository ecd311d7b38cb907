"""The report in a terminal."""

from __future__ import annotations

import shlex
from collections.abc import Iterator, Mapping, Sequence
from typing import TYPE_CHECKING

from dubins_traffic.campaign.report.comparison import Comparison, shown, words
from dubins_traffic.campaign.report.statistics import Interval, Share

if TYPE_CHECKING:
    from rich.table import Table

    from dubins_traffic.campaign.report.worst import Bad


def tables(comparison: Comparison) -> Iterator[Table]:
    """Return the tables that are printed: metrics, paired differences, verdicts and faults; they fit 80 columns."""
    yield _metrics(comparison)
    if comparison.differences:
        yield _differences(comparison)
    yield _shares(comparison)


def worst_lines(worst: Mapping[str, Sequence[Bad]], folder: str) -> Iterator[str]:
    """Return what is said of the worst trials of a campaign in `folder`: two lines each, the second a command."""
    for controller, trials in worst.items():
        for bad in trials:
            row = bad.row
            place = ", ".join(
                [row["configuration"], *bad.factors, f"trial {row['trial']} of seed {row['seed']}"]
            )
            note = f" ({bad.note})" if bad.note else ""
            yield f"{controller}, {place}: {bad.why}{note}"
            yield f"    dubins-traffic campaign replay {shlex.quote(folder)} {row['number']}"


def _metrics(comparison: Comparison) -> Table:
    table = _table(f"{comparison.campaign.model.name}: {comparison.trials} of {comparison.total} trials")
    _columns(table, ("metric", "controller"), ("mean", "95 %", "median", "95 %"))
    for metric in comparison.metrics:
        for k, standing in enumerate(comparison.standings):
            one = standing.estimates[metric.name]
            mean = (shown(one.mean), _interval(one.mean_interval))
            median = (shown(one.median), _interval(one.median_interval))
            table.add_row(metric.heading if k == 0 else "", standing.controller, *mean, *median)
    for metric in comparison.undefined:
        table.add_row(metric.heading, "", "not defined", "", "", "")
    return table


def _differences(comparison: Comparison) -> Table:
    table = _table("differences on the same instances; in bold those whose interval leaves out 0")
    _columns(table, ("metric", "controllers"), ("mean", "95 %", "more", "less"))
    for one in comparison.differences:
        interval = _interval(one.estimate.mean_interval)
        numbers = (shown(one.estimate.mean), interval, str(one.larger), str(one.smaller))
        pair = f"{one.first} - {one.second}"
        table.add_row(one.metric.heading, pair, *numbers, style="bold" if one.is_decided else "")
    return table


def _shares(comparison: Comparison) -> Table:
    table = _table("clean, verdicts, ends, collisions by fault, formulas")
    _columns(table, ("what", "controller"), ("trials", "share", "95 %"))
    for standing in comparison.standings:
        judged = {"clean": standing.clean} if standing.judged else {}
        near = {"excused, near": standing.near} if standing.near.total else {}
        ended = {"ended by the controller": standing.ended} if standing.ended.count else {}
        for name, share in {**judged, **standing.verdicts, **near, **ended, **standing.ends}.items():
            table.add_row(words(name), standing.controller, str(share.count), *_share(share))
        if standing.cut:
            table.add_row("cut", standing.controller, str(standing.cut), "", "")
        for who, count in standing.faults.items():
            table.add_row(f"fault of {who}", standing.controller, str(count), "", "")
        for name, found in standing.formulas.items():
            for verdict, share in found.items():
                table.add_row(f"{name}: {verdict}", standing.controller, str(share.count), *_share(share))
    return table


def _table(title: str) -> Table:
    from rich import box
    from rich.table import Table

    return Table(
        box=box.SIMPLE_HEAD, padding=(0, 1, 0, 0), show_edge=False, title=title, title_justify="left"
    )


def _columns(table: Table, names: tuple[str, ...], numbers: tuple[str, ...]) -> None:
    for name in names:
        table.add_column(name, overflow="fold")
    for name in numbers:
        table.add_column(name, justify="right", no_wrap=True)


def _interval(interval: Interval | None) -> str:
    return "" if interval is None else f"{shown(interval[0])} .. {shown(interval[1])}"


def _share(share: Share) -> tuple[str, str]:
    if share.share is None or share.interval is None:
        return shown(None), ""
    low, high = share.interval
    return f"{share.share:.1%}", f"{low:.1%} .. {high:.1%}"
