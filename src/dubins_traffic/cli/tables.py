"""Scores as tables for people, and as JSON for machines."""

from __future__ import annotations

import json as json_text
from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING

from dubins_traffic.errors import shown

if TYPE_CHECKING:
    from rich.table import Table

    from dubins_traffic.scoring.formulas import FormulaVerdict
    from dubins_traffic.scoring.score import Score, ScoreSheet


CELLS: dict[str, Callable[[Score], str]] = {
    "end": lambda score: (score.end or "cut off").replace("_", " "),
    "ICRA 2016": lambda score: f"{score.icra2016:g}",
    "rounds": lambda score: str(score.rounds),
    "goals visited": lambda score: f"{score.goals_visited:.0%}",
    "collisions": lambda score: str(len(score.collisions)),
    "at fault": lambda score: str(sum(collision.at_fault for collision in score.collisions)),
    "off road": lambda score: f"{score.driven.off_road_s:.1f} s",
    "driven": lambda score: f"{score.driven.distance_m:.1f} m",
    "least gap": lambda score: "-" if score.min_clearance_m is None else f"{score.min_clearance_m:.2f} m",
}
"""What is shown of a score: heading and cell."""

JUDGED: dict[str, Callable[[Score], str]] = {
    "verdict": lambda score: "-" if score.verdict is None else score.verdict.verdict.value,
}
"""What is shown where a score has a verdict, in place of the time off the road, which is one of the rules."""


SHIELDED: dict[str, Callable[[Score], str]] = {
    "shield ticks": lambda score: str(score.interventions),
}
"""What is shown where a shield has stepped in: in how many ticks."""

HYPHENATED = {"collisions": "colli-\nsions"}
"""Headings that are one word wider than their cells."""


def show(sheet: ScoreSheet, *, json: bool) -> None:
    """Print scores on standard output: JSON for machines, else a table."""
    if json:
        print(json_text.dumps(sheet.to_json(), indent=2))
        return
    from rich.console import Console

    console = Console()
    console.print(score_table(sheet))
    if any(score.formulas for score in sheet.trials):
        console.print(formula_table(sheet))


def summary(score: Score) -> dict[str, str]:
    """Return what a replay page shows of a score."""
    return {
        "controller": score.controller or "-",
        **{heading: cell(score) for heading, cell in _cells([score]).items()},
        **{f"formula {found.name}": verdict_text(found) for found in score.formulas},
    }


def verdict_text(found: FormulaVerdict) -> str:
    """Return the verdict on a formula, and since when it is definite."""
    return found.verdict if found.time is None else f"{found.verdict} since {found.time:.3f} s"


def score_table(sheet: ScoreSheet) -> Table:
    """Return a table with one row a trial, and the sum of ICRA 2016 at its foot."""
    from rich import box
    from rich.table import Table

    names = sorted({_safe(score.controller or "-") for score in sheet.trials})
    table = Table(box=box.SIMPLE_HEAD, show_footer=True, padding=0, title_justify="left", show_edge=False)
    table.add_column("trial", footer="sum", justify="right", no_wrap=True)
    if len(names) > 1:
        table.add_column("controller", overflow="fold")
    else:
        table.title = f"controller [b]{names[0]}[/b]"
    cells = _cells(sheet.trials)
    for heading in cells:
        footer = f"{sheet.icra2016_sum:g}" if heading == "ICRA 2016" else ""
        align = "left" if heading in ("end", "verdict") else "right"
        table.add_column(
            HYPHENATED.get(heading) or _narrow(heading), footer=footer, justify=align, no_wrap=True
        )
    for score in sheet.trials:
        leading = [str(score.trial), *([_safe(score.controller or "-")] if len(names) > 1 else [])]
        table.add_row(*leading, *(_narrow(cell(score), 10) for cell in cells.values()))
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
        for found in score.formulas:
            table.add_row(str(score.trial), Text(shown(found.name)), verdict_text(found))
    return table


def _cells(scores: Sequence[Score]) -> dict[str, Callable[[Score], str]]:
    judged = any(score.verdict is not None for score in scores)
    shielded = any(score.interventions for score in scores)
    rest = {heading: cell for heading, cell in CELLS.items() if heading != "off road"}
    shown = {**JUDGED, **rest} if judged else CELLS
    return {**shown, **SHIELDED} if shielded else shown


def _narrow(text: str, width: int = 0) -> str:
    """Return the words of what is wider than `width` below one another, so that a table fits 80 columns."""
    return text.replace(" ", "\n") if len(text) > width else text


def _safe(name: str) -> str:
    """Return somebody else's name so that it can stand in a table: neither control characters nor markup act."""
    from rich.markup import escape

    return escape(shown(name))
