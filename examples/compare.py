"""Run the same trials with several controllers and print their score sheets side by side.

python examples/compare.py demo demo-output --controllers lanes simple --trials 3

Leaves all records, and a picture and a replay page of the first trial of the first controller, and prints where.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Callable, Sequence
from pathlib import Path

from rich import box
from rich.console import Console
from rich.table import Table

import dubins_traffic as dt


def points(value: float | None) -> str:
    """Return a score by a formula in few characters."""
    if value is None:
        return "not defined"
    return f"{value:.0f}" if abs(value) >= 1000 else f"{value:.4g}"


ROWS: dict[str, Callable[[dt.Score], str]] = {
    "clean": lambda score: "-" if score.verdict is None else ("yes" if score.verdict.clean else "no"),
    "counted rounds": lambda score: str(score.counted_rounds),
    "verdict": lambda score: "-" if score.verdict is None else str(score.verdict.verdict),
    "end": lambda score: score.end or "cut off",
    "rounds": lambda score: str(score.rounds),
    "goals visited": lambda score: f"{score.goals_visited:.0%}",
    "collisions": lambda score: str(len(score.collisions)),
    "  at fault": lambda score: str(sum(collision.at_fault for collision in score.collisions)),
    "off road, s": lambda score: f"{score.driven.off_road_s:.1f}",
    "standing": lambda score: f"{score.driven.standing_share:.0%}",
    "distance, m": lambda score: f"{score.driven.distance_m:.1f}",
    "least gap, m": lambda score: "-" if score.min_clearance_m is None else f"{score.min_clearance_m:.2f}",
    "paper": lambda score: points(score.paper_score),
    "ICRA 2016": lambda score: points(score.icra2016),
}
SUMS: dict[str, Callable[[dt.ScoreSheet], str]] = {
    "counted rounds": lambda sheet: str(sheet.counted_rounds_sum),
    "paper": lambda sheet: points(sheet.paper_sum),
    "ICRA 2016": lambda sheet: points(sheet.icra2016_sum),
}


def side_by_side(sheets: dict[str, dt.ScoreSheet]) -> Table:
    """Return a table with one column per controller and trial; the controller with most counted rounds comes first."""
    table = Table(box=box.SIMPLE_HEAD, padding=0, show_edge=False)
    table.add_column("\ntrial", no_wrap=True)
    sheets = dict(sorted(sheets.items(), key=lambda item: -item[1].counted_rounds_sum))
    for number, (controller, sheet) in enumerate(sheets.items()):
        if number:
            table.add_column("│\n│")
        for place, score in enumerate(sheet.trials):
            title = "" if place else f"[bold]{controller}[/bold]"
            table.add_column(f"{title}\n{score.trial}", justify="right", overflow="fold")
        table.add_column("\nsum", justify="right", style="bold")
    for heading, cell in ROWS.items():
        if all(cell(score) == "-" for sheet in sheets.values() for score in sheet.trials):
            continue
        cells = [heading]
        for number, sheet in enumerate(sheets.values()):
            total = SUMS[heading](sheet) if heading in SUMS else ""
            cells += ["│"] * bool(number) + [cell(score) for score in sheet.trials] + [total]
        table.add_row(*cells)
    return table


def compare(configuration: str, output: Path, controllers: Sequence[str], trials: int, seed: int) -> None:
    """Run the trials, print the table and the paths of what is left."""
    sheets: dict[str, dt.ScoreSheet] = {}
    for controller in controllers:
        name = Path(controller).name.replace(":", "-")
        folder = output / name
        plan = dt.plan(configuration, controller, trials=trials, seed=seed, records=folder, overwrite=True)
        print(f"{len(plan.jobs)} trials with {controller}", file=sys.stderr)
        sheets[name] = plan.conclude(dt.run_trials(plan.jobs))
    Console().print(side_by_side(sheets))
    print("Controllers are ranked by counted rounds, which are the rounds of clean trials.")
    print("ICRA 2016 is the score of that competition, and ranks nothing (docs/scores.md).\n")
    for sheet in sheets.values():
        for score in sheet.trials:
            print(score.record)
    record = dt.load_record(next(iter(sheets.values())).trials[0].record or "")
    picture, page = output / "picture.png", output / "replay.html"
    dt.write_plot(picture, record, overwrite=True)
    score = dt.score(record)
    summary = {heading.strip(): cell(score) for heading, cell in ROWS.items()}
    dt.write_replay(page, record.instance, record.frames, record.ending, summary, overwrite=True)
    print(f"{picture}  (trial {score.trial} of {score.controller})")
    print(f"{page}  (the same trial, to open in a browser)")


def main() -> int:
    """Read the command line and compare."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("configuration", help="a file or the name of a shipped configuration")
    parser.add_argument("output", type=Path, help="folder for what is left")
    parser.add_argument("--controllers", nargs="+", default=["lanes", "simple"])
    parser.add_argument("--trials", type=int, default=3)
    parser.add_argument("--seed", type=int, default=0)
    given = parser.parse_args()
    try:
        compare(given.configuration, given.output, given.controllers, given.trials, given.seed)
    except dt.DubinsTrafficError as error:
        print(f"compare: {error}", file=sys.stderr)
        return 2
    return 0


if __name__ == "__main__":
    sys.exit(main())
