"""Scores as tables for people, with what cost the ego most below them, and as JSON for machines."""

from __future__ import annotations

import json as json_text
import math
import shlex
from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, NamedTuple, TypeAlias

from dubins_traffic.campaign.notice import assumption_notice
from dubins_traffic.cli import faults
from dubins_traffic.errors import shown

if TYPE_CHECKING:
    from rich.table import Table

    from dubins_traffic.scoring import metric
    from dubins_traffic.scoring.formulas import FormulaVerdict
    from dubins_traffic.scoring.score import Score, ScoreSheet


Scores: TypeAlias = "Sequence[Score]"

WIDTH = 80
"""Columns of a terminal into which a table fits, unless told otherwise."""
NOTE = (
    "The best controller has the most counted rounds. A round is complete when every\n"
    "goal has been visited, and counts if the ego broke no rule in the whole trial.\n"
    "The columns paper and ICRA 2016 are scores of 2016; they rank nothing."
)
"""What stands below a table."""


@dataclass(frozen=True, slots=True)
class Column:
    """What is shown of a score: its cell, whether some scores need the column at all, and their sum.

    Where a table is too wide, the column with the highest `spare` is left out first; 0: never.
    """

    cell: Callable[[Score], str]
    needed: Callable[[Scores], bool] = lambda _scores: True
    spare: int = 0
    total: Callable[[ScoreSheet], str] | None = None


def _is_judged(scores: Scores) -> bool:
    return any(score.verdict is not None for score in scores)


def _counted(score: Score) -> str:
    """Return the rounds that count, and of how many where these are not all."""
    counted, rounds = score.counted_rounds, score.rounds
    return str(rounds) if counted == rounds else f"{counted} of {rounds}"


def _mean_before_breach(sheet: ScoreSheet) -> str:
    return f"{math.fsum(score.rounds_before_breach for score in sheet.trials) / max(1, len(sheet.trials)):.2f}"


def _breaches(score: Score) -> str:
    """Return how often the ego broke a rule."""
    return "-" if score.verdict is None else str(len(score.verdict.own_violations))


def _near(score: Score) -> str:
    return "-" if score.verdict is None or score.verdict.near is None else yes(score.verdict.near)


def yes(value: bool) -> str:
    """Return a switch as people write it."""
    return "yes" if value else "no"


def points(value: float | None) -> str:
    """Return a score by a formula, six digits that count; a dash where the formula does not apply."""
    return "-" if value is None else f"{value:g}"


def _clean(score: Score) -> str:
    if score.verdict is None:
        return "-"
    return "cut" if score.verdict.cut else yes(score.verdict.clean)


COLUMNS: dict[str, Column] = {
    "clean": Column(_clean, _is_judged),
    "counted rounds": Column(_counted, total=lambda sheet: str(sheet.counted_rounds_sum)),
    "before breach": Column(lambda score: f"{score.rounds_before_breach:.2f}", total=_mean_before_breach),
    "breaches": Column(_breaches, _is_judged, spare=1),
    "verdict": Column(lambda score: score.verdict.verdict.value if score.verdict else "-", _is_judged),
    "near": Column(_near, lambda scores: any(score.verdict and score.verdict.excuse for score in scores)),
    "end": Column(lambda score: (score.end or "cut off").replace("_", " "), spare=2),
    "goals visited": Column(lambda score: f"{score.goals_visited:.0%}", spare=1),
    "collisions": Column(lambda score: str(len(score.collisions))),
    "at fault": Column(lambda score: str(sum(collision.at_fault for collision in score.collisions)), spare=3),
    "off road": Column(lambda score: f"{score.driven.off_road_s:.1f} s", lambda scores: not _is_judged(scores)),
    "driven": Column(lambda score: f"{score.driven.distance_m:.1f} m", spare=4),
    "least gap": Column(
        lambda score: "-" if score.min_clearance_m is None else f"{score.min_clearance_m:.2f} m", spare=5
    ),
    "shield ticks": Column(
        lambda score: str(score.interventions), lambda scores: any(score.interventions for score in scores)
    ),
    "paper": Column(lambda score: points(score.paper_score), total=lambda sheet: points(sheet.paper_sum)),
    "ICRA 2016": Column(lambda score: points(score.icra2016), total=lambda sheet: points(sheet.icra2016_sum)),
}
"""The columns by their headings, in their order: what ranks first, the score of 2016 last."""

LEFT = ("clean", "verdict", "near", "end")
"""Headings of texts."""
HYPHENATED = {"collisions": "colli-\nsions"}
"""Headings that are one word wider than their cells."""


def show(sheet: ScoreSheet, *, json: bool) -> None:
    """Print scores on standard output: JSON for machines, else a table; a notice goes to standard error."""
    if json:
        print(json_text.dumps(sheet.to_json(), indent=2))
    else:
        from rich.console import Console

        console = Console()
        console.print(score_table(sheet, console.width))
        for line in worst(sheet):
            console.print(line, highlight=False, markup=False, soft_wrap=True)
        console.print(NOTE, style="dim", highlight=False, soft_wrap=True)
        if any(score.formulas for score in sheet.trials):
            console.print(formula_table(sheet))
    faults.warn(assumption_notice(*sheet.assumption_broken))


def summary(score: Score) -> dict[str, str]:
    """Return what a replay page shows of a score."""
    return {
        "controller": score.controller or "-",
        **{heading: column.cell(score) for heading, column in _needed([score]).items()},
        **{f"formula {formula.name}": verdict_text(formula) for formula in score.formulas},
    }


def verdict_text(formula: FormulaVerdict) -> str:
    """Return the verdict on a formula, since when it is definite, and whether false may be said late."""
    when = "" if formula.time is None else f" since {formula.time:.3f} s"
    return f"{formula.verdict}{when}" + ("" if formula.early or formula.verdict == "true" else " (judged by parts)")


def score_table(sheet: ScoreSheet, width: int = WIDTH) -> Table:
    """Return a table with one row a trial, and sums at its foot; the controller with most counted rounds comes first.

    Columns that matter less are left out of a table that would be wider than `width`.
    """
    from rich import box
    from rich.table import Table

    from dubins_traffic.controllers.registry import ran

    ranked = _ranked(sheet.trials)
    names = list(ranked)
    table = Table(box=box.SIMPLE_HEAD, show_footer=True, padding=0, title_justify="left", show_edge=False)
    table.add_column("trial", footer="sum", justify="right", no_wrap=True)
    if len(names) > 1:
        table.add_column("controller", overflow="fold")
    else:
        where = ran(sheet.trials[0].controller)
        table.title = f"controller [b]{_safe(names[0])}[/b]" + ("" if where is None else f", {where}")
    room = width - len("trial") - (1 + min(20, max(map(len, names))) if len(names) > 1 else 0)
    columns = _fitting(_needed(sheet.trials), sheet, room)
    for heading, column in columns.items():
        footer = column.total(sheet) if column.total else ""
        align = "left" if heading in LEFT else "right"
        table.add_column(_heading(heading), footer=_narrow(footer, 10), justify=align, no_wrap=True)
    for name, scores in ranked.items():
        for score in scores:
            leading = [str(score.trial), *([_safe(name)] if len(names) > 1 else [])]
            table.add_row(*leading, *(_narrow(column.cell(score), 10) for column in columns.values()))
    return table


def formula_table(sheet: ScoreSheet) -> Table:
    """Return a table with one row for each formula of each trial."""
    from rich import box
    from rich.table import Table
    from rich.text import Text

    table = Table(box=box.SIMPLE_HEAD, padding=0, show_edge=False)
    table.add_column("trial", justify="right", no_wrap=True)
    table.add_column("formula", overflow="fold")
    table.add_column("verdict", no_wrap=True)
    for score in sheet.trials:
        for formula in score.formulas:
            table.add_row(str(score.trial), Text(shown(formula.name)), verdict_text(formula))
    return table


def _ranked(scores: Scores) -> dict[str, list[Score]]:
    """Return the scores of each controller, best first.

    That has the most counted rounds a trial, and among equal ones the most rounds before the first breach.
    """
    by_name: dict[str, list[Score]] = {}
    for score in scores:
        by_name.setdefault(score.controller or "-", []).append(score)

    def merit(name: str) -> tuple[float, float]:
        of_controller, trials = by_name[name], len(by_name[name])
        counted = sum(score.counted_rounds for score in of_controller) / trials
        return counted, math.fsum(score.rounds_before_breach for score in of_controller) / trials

    return {name: by_name[name] for name in sorted(by_name, key=merit, reverse=True)}


def _needed(scores: Scores) -> dict[str, Column]:
    """Return the columns that some scores need: ours, then those of the metrics that were asked for."""
    columns = {heading: column for heading, column in COLUMNS.items() if column.needed(scores)}
    names = dict.fromkeys(metric.column for score in scores for metric in score.metrics)
    return {**columns, **{column.short or column.label: _further(column) for column in names}}


def _further(column: metric.Column) -> Column:
    """Return what is shown of a further metric's column."""

    def cell(score: Score) -> str:
        value = {metric.column: metric.value for metric in score.metrics}.get(column)
        if value is None:
            return "-"
        if isinstance(value, bool):
            return yes(value)
        if isinstance(value, str):
            return shown(value)
        if column.unit == "share":
            return f"{value:.1%}"
        return f"{value:.4g} {column.unit}".rstrip()

    return Column(cell)


def _fitting(columns: dict[str, Column], sheet: ScoreSheet, room: int) -> dict[str, Column]:
    """Leave out what can be spared until the columns, a space before each, fit into `room`."""
    widths = {
        heading: 1
        + max(
            len(line)
            for text in (
                _heading(heading),
                _narrow(column.total(sheet), 10) if column.total else "",
                *(_narrow(column.cell(score), 10) for score in sheet.trials),
            )
            for line in text.split("\n")
        )
        for heading, column in columns.items()
    }
    kept = dict(columns)
    for heading in sorted(columns, key=lambda heading: -columns[heading].spare):
        if sum(widths[place] for place in kept) <= room or not columns[heading].spare:
            break
        del kept[heading]
    return kept


def _heading(heading: str) -> str:
    return HYPHENATED.get(heading) or _narrow(heading)


def _narrow(text: str, width: int = 0) -> str:
    """Return the words of what is wider than `width` below one another, so that a table fits 80 columns."""
    return text.replace(" ", "\n") if len(text) > width else text


def _safe(name: str) -> str:
    """Return somebody else's name so that it can stand in a table: neither control characters nor markup act."""
    from rich.markup import escape

    return escape(shown(name))


class Cost(NamedTuple):
    """A breach of the ego, or where no rules are judged a collision: `what`, in which trial, at which second."""

    what: str
    score: Score
    time: float


def costs_of(score: Score) -> Iterator[Cost]:
    """Yield what a trial cost its ego, in order of time."""
    if score.verdict is not None:
        for breach in score.verdict.own_violations:
            yield Cost(breach.rule, score, breach.time)
    else:
        for collision in score.collisions:
            yield Cost("a collision", score, collision.time)


def worst(sheet: ScoreSheet) -> list[str]:
    """Return lines that say what happened most often and where to look; none if nothing did, or of several controllers.

    Of what happened equally often, that which happened first is told.
    """
    if len({score.controller for score in sheet.trials}) > 1:
        return []
    costs = [cost for score in sheet.trials for cost in costs_of(score)]
    if not costs:
        return []
    what, number = Counter(cost.what for cost in costs).most_common(1)[0]
    first = next(cost for cost in costs if cost.what == what)
    often = "once" if number == 1 else f"{number} times"
    where = f"trial {first.score.trial} at {first.time:.2f} s"
    said = f"Cost most: {what}, {often}, {'in' if number == 1 else 'first in'} {where}."
    if first.score.record is None:
        return [said, "The option --records DIR keeps the trials, so that you can look at them."]
    begin = max(0.0, first.time - 1.0)
    return [said, f"To see it: dubins-traffic replay {shlex.quote(first.score.record)} --at {begin:.2f}"]
