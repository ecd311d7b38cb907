"""The report of a campaign in a terminal: what matters in at most 30 lines, or all of it."""

from __future__ import annotations

import shlex
import textwrap
from collections.abc import Iterator, Mapping, Sequence
from typing import TYPE_CHECKING

from dubins_traffic.campaign.report.comparison import Comparison, Standing, shown, words
from dubins_traffic.campaign.report.conclusion import conclusion
from dubins_traffic.campaign.report.statistics import Interval, Share
from dubins_traffic.campaign.report.worst import Bad
from dubins_traffic.errors import shown as safe
from dubins_traffic.scoring.metric import Column

if TYPE_CHECKING:
    from rich.table import Table

WIDTH = 80
MOST_CONTROLLERS = 7
"""So many controllers have a line; of more it is said how many there are."""
MOST_WORST = 4
COLUMNS = (
    "clean", "counted_rounds", "rounds_before_breach", "breaches", "collisions_ego_fault", "rounds", "goals_visited",
    "longest_gap_s", "distance_m", "standing_share",
)  # fmt: skip
"""The metrics of the short table, what matters most first: the first `MOST_COLUMNS` that are not 0 in all trials."""
MOST_COLUMNS = 4
HEADINGS: Mapping[str, str] = {
    "rounds_before_breach": "rounds before\nthe first breach",
    "breaches": "breaches\nof the ego",
    "collisions_ego_fault": "collisions,\nego at fault",
    "counted_rounds": "counted\nrounds",
    "longest_gap_s": "longest\ngap (s)",
    "goals_visited": "goals\nvisited",
    "distance_m": "distance\n(m)",
    "standing_share": "standing\n(share)",
}


def short_tables(comparison: Comparison, width: int = WIDTH) -> Iterator[str | Table]:
    """Yield what matters of a report: the sentence, the controllers in the metrics that are not 0, what is left out."""
    yield f"{comparison.campaign.model.name}: {comparison.trials:,} of {comparison.total:,} trials"
    yield _wrapped(conclusion(comparison), width)
    yield ""
    chosen = _fitting(comparison, short_metrics(comparison), width)
    yield _short_table(comparison, chosen)
    ended = [standing for standing in comparison.standings if standing.ended.count]
    if ended:
        each = [
            f"{standing.controller} {standing.ended.count} of {standing.ended.total}"
            for standing in ended[:MOST_CONTROLLERS]
        ]
        rest = f", and {len(ended) - len(each)} more controllers" if len(ended) > len(each) else ""
        yield _wrapped(f"Trials ended by the controller: {', '.join(each)}{rest}.", width)
    left = [metric for metric in comparison.metrics if metric not in chosen]
    zeros = sum(is_zero(comparison, metric) for metric in left)
    more = len(comparison.standings) - MOST_CONTROLLERS
    others = f"{more} more controllers and " if more > 0 else ""
    also = f", {zeros} of them 0 in all trials" if zeros else ""
    yield _wrapped(f"Means, with 95 % intervals. --all shows {others}{len(left)} more metrics{also}.", width)


def short_metrics(comparison: Comparison) -> list[Column]:
    """Return the metrics of the short table."""
    known = {metric.name: metric for metric in comparison.metrics if not is_zero(comparison, metric)}
    return [known[name] for name in COLUMNS if name in known][:MOST_COLUMNS]


def is_zero(comparison: Comparison, metric: Column) -> bool:
    """Tell whether a metric is 0, or absent, in all trials."""
    estimates = [standing.estimates[metric.name] for standing in comparison.standings]
    return not any(estimate.mean or (estimate.mean_interval or (0.0, 0.0)) != (0.0, 0.0) for estimate in estimates)


def short_worst(worst: Mapping[str, Sequence[Bad]], folder: str, width: int = WIDTH) -> Iterator[str]:
    """Yield a line for the worst trial of each controller, and the command that replays one."""
    first = [(name, trials[0]) for name, trials in worst.items() if trials][:MOST_WORST]
    if not first:
        return
    yield "Worst trials:"
    for controller, bad in first:
        note = f" ({bad.note})" if bad.note else ""
        line = f"  {bad.row['number']:>5}  {safe(controller)}: {safe(bad.why)}{note}"
        yield line if len(line) <= width else line[: width - 3] + "..."
    command = f"dubins-traffic campaign replay {shlex.quote(folder)} {first[0][1].row['number']}"
    yield f"To see one: {command}"


def _wrapped(text: str, width: int) -> str:
    """Return a text in lines of at most `width`, with no break before a per cent sign."""
    kept = "\N{NO-BREAK SPACE}%"
    return textwrap.fill(safe(text).replace(" %", kept), width).replace(kept, " %")


def _short_table(comparison: Comparison, chosen: Sequence[Column]) -> Table:
    table = _table("")
    table.add_column("controller", no_wrap=True)
    for metric in chosen:
        table.add_column(_short_heading(metric), justify="right", no_wrap=True)
    for standing in comparison.standings[:MOST_CONTROLLERS]:
        table.add_row(_fitted(standing.controller), *(_short_cell(standing, metric) for metric in chosen))
    return table


def _fitting(comparison: Comparison, metrics: Sequence[Column], width: int) -> list[Column]:
    """Return the first of some metrics, as many as the table has room for."""
    standings = comparison.standings[:MOST_CONTROLLERS]
    room = width - max(len("controller"), *(len(_fitted(standing.controller)) for standing in standings)) - 1
    columns: list[Column] = []
    for metric in metrics:
        lines = [
            *_short_heading(metric).split("\n"),
            *(_short_cell(standing, metric) for standing in standings),
        ]
        room -= 2 + max(map(len, lines))
        if room < 0:
            break
        columns.append(metric)
    return columns


def _short_heading(metric: Column) -> str:
    return HEADINGS.get(metric.name, metric.heading)


def _fitted(name: str, most: int = 22) -> str:
    """Return a name in one line; of one that is too long its end, which says the class."""
    from rich.markup import escape

    told = safe(name)
    return escape(told if len(told) <= most else "..." + told[3 - most :])


def short_estimate(standing: Standing, metric: Column) -> tuple[float | None, Interval | None]:
    """Return the mean of a metric and its 95 % interval; of clean trials the share, with Wilson's."""
    if metric.name == "clean":
        return standing.clean.share, standing.clean.interval
    estimate = standing.estimates[metric.name]
    return estimate.mean, estimate.mean_interval


def _short_cell(standing: Standing, metric: Column) -> str:
    mean, ends = short_estimate(standing, metric)
    if mean is None or ends is None:
        return shown(None)
    low, high = ends
    if metric.unit == "share":
        return f"{mean:.0%} {100 * low:.0f}..{100 * high:.0f}"
    return f"{mean:.3g} {low:.3g}..{high:.3g}"


def tables(comparison: Comparison) -> Iterator[Table]:
    """Return the tables that are printed: metrics, paired differences, verdicts and faults; they fit 80 columns."""
    yield _metric_table(comparison)
    if comparison.differences:
        yield _difference_table(comparison)
    yield _share_table(comparison)


def worst_lines(worst: Mapping[str, Sequence[Bad]], folder: str) -> Iterator[str]:
    """Return what is said of the worst trials of a campaign in `folder`: two lines each, the second a command."""
    for controller, trials in worst.items():
        for bad in trials:
            row = bad.row
            place = ", ".join([row["configuration"], *bad.factors, f"trial {row['trial']} of seed {row['seed']}"])
            note = f" ({bad.note})" if bad.note else ""
            yield f"{controller}, {place}: {bad.why}{note}"
            yield f"    dubins-traffic campaign replay {shlex.quote(folder)} {row['number']}"


def _metric_table(comparison: Comparison) -> Table:
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


def _difference_table(comparison: Comparison) -> Table:
    table = _table("differences on the same instances; in bold those whose interval leaves out 0")
    _columns(table, ("metric", "controllers"), ("mean", "95 %", "more", "less"))
    for one in comparison.differences:
        interval = _interval(one.estimate.mean_interval)
        numbers = (shown(one.estimate.mean), interval, str(one.larger), str(one.smaller))
        pair = f"{one.first} - {one.second}"
        table.add_row(one.metric.heading, pair, *numbers, style="bold" if one.is_decided else "")
    return table


def _share_table(comparison: Comparison) -> Table:
    table = _table("clean, verdicts, ends, collisions by fault, formulas")
    _columns(table, ("what", "controller"), ("trials", "share", "95 %"))
    for standing in comparison.standings:
        judged = {"clean": standing.clean} if standing.judged else {}
        near = {"excused, near": standing.near} if standing.near.total else {}
        ended = {"ended by the controller": standing.ended} if standing.ended.count else {}
        for name, counted in {**judged, **standing.verdicts, **near, **ended, **standing.ends}.items():
            table.add_row(words(name), standing.controller, str(counted.count), *_share_cell(counted))
        if standing.cut:
            table.add_row("cut", standing.controller, str(standing.cut), "", "")
        for who, count in standing.faults.items():
            table.add_row(f"fault of {who}", standing.controller, str(count), "", "")
        for name, formula in standing.formulas.items():
            for verdict, counted in formula.items():
                table.add_row(f"{name}: {verdict}", standing.controller, str(counted.count), *_share_cell(counted))
    return table


def _table(title: str) -> Table:
    from rich import box
    from rich.table import Table

    return Table(box=box.SIMPLE_HEAD, padding=(0, 1, 0, 0), show_edge=False, title=title, title_justify="left")


def _columns(table: Table, names: tuple[str, ...], numbers: tuple[str, ...]) -> None:
    for name in names:
        table.add_column(name, overflow="fold")
    for name in numbers:
        table.add_column(name, justify="right", no_wrap=True)


def _interval(interval: Interval | None) -> str:
    return "" if interval is None else f"{shown(interval[0])} .. {shown(interval[1])}"


def _share_cell(share: Share) -> tuple[str, str]:
    if share.share is None or share.interval is None:
        return shown(None), ""
    low, high = share.interval
    return f"{share.share:.1%}", f"{low:.1%} .. {high:.1%}"
