"""`dubins-traffic falsify`, `shrink` and `regress`."""

from __future__ import annotations

import json as json_text
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from dubins_traffic.cli import faults, options
from dubins_traffic.cli.progress import progress

if TYPE_CHECKING:
    from collections.abc import Sequence

    from dubins_traffic.falsification.coverage import Row
    from dubins_traffic.falsification.search import Found, Search

EXAMPLES = options.examples(
    "falsify junction --controller lanes --trials 2000 -o found",
    "falsify town --controller my_controller.py:MyController --rule 3.clear --seconds 60 -o found",
    "falsify town --controller rules --trials 100000 --workers 4 -o found --resume",
)
SHRINK_EXAMPLES = options.examples("shrink found/cases/3.clear-left-4.json -o small.json")
REGRESS_EXAMPLES = options.examples("regress found --controller my_controller.py:MyController")

ControllerOption = Annotated[
    str,
    typer.Option(
        "--controller",
        metavar="C",
        help="A built-in name, module:Class or path/to/file.py:Class; `rules` runs compiled.",
        autocompletion=options.controllers,
    ),
]
RulesOption = Annotated[
    list[str] | None,
    typer.Option(
        "--rule", metavar="R", help="A rule that is asked for, such as 3.clear; may be given several times.",
        show_default="all",
    ),
]  # fmt: skip
FormulaOption = Annotated[
    str | None,
    typer.Option(
        "--formula", metavar="F", help="A formula of your own that is asked for instead (docs/task.md)."
    ),
]
LeastOption = Annotated[
    bool, typer.Option("--least-score", help="Look for the trials of the least score instead.")
]
TrialsOption = Annotated[
    int | None,
    typer.Option(
        "--trials", metavar="N", min=1, help="How many trials.", show_default="10000 without --seconds"
    ),
]
SecondsOption = Annotated[
    float | None, typer.Option("--seconds", metavar="S", min=0, help="End after so many seconds.")
]
StrategyOption = Annotated[str, typer.Option("--strategy", metavar="NAME", help="evolution, uniform or cma.")]
DurationOption = Annotated[
    float, typer.Option("--duration", metavar="S", help="Seconds of a trial; 0: as the configuration says.")
]
RayOption = Annotated[
    str | None, typer.Option("--ray", metavar="ADDRESS", help="Run on a Ray cluster, or `local`.")
]
WorkersOption = Annotated[int, typer.Option("--workers", metavar="W", min=1, help="Processes.")]
FolderOption = Annotated[
    str, typer.Option("--output", "-o", metavar="DIR", help="Folder for what is found, made if missing.")
]
ResumeOption = Annotated[bool, typer.Option("--resume", help="Go on with the search that DIR holds.")]


def falsify(
    configuration: options.Config,
    controller: ControllerOption = "rules",
    rule: RulesOption = None,
    formula: FormulaOption = None,
    least_score: LeastOption = False,
    trials: TrialsOption = None,
    seconds: SecondsOption = None,
    seed: options.Seed = 0,
    strategy: StrategyOption = "evolution",
    duration: DurationOption = 15.0,
    workers: WorkersOption = 1,
    ray: RayOption = None,
    output: FolderOption = "falsified",
    resume: ResumeOption = False,
    shield: options.Shield = False,
    sandbox: options.Sandbox = False,
    limits: options.Limits = "",
    trust: options.Trust = False,
    json: options.Json = False,
) -> None:
    """Search for trials in which an ego breaks a rule while all others keep theirs.

    Each kind of failure is judged afresh and kept once, as an instance that [b]run[/b] replays. Ctrl-C keeps what has
    been found, and --resume goes on.
    """
    from dubins_traffic.controllers.registry import dressed
    from dubins_traffic.falsification.search import falsify as search

    driver = dressed(controller, shield=shield, sandbox=options.boxes(sandbox, limits, trust))
    seen: list[Search] = []
    try:
        with faults.no_silent_end(), progress(trials) as tell:

            def heard(own: Search) -> None:
                seen[:] = [own]
                tell(own.counts.trials, trials or own.counts.trials)

            found = search(
                configuration, driver, output, rules=rule or (), formula=formula, least_score=least_score,
                trials=trials, seconds=seconds, seed=seed, strategy=strategy, duration=duration or None,
                workers=workers, ray=ray, resume=resume, progress=heard,
            )  # fmt: skip
    except KeyboardInterrupt:
        faults.tell(f"interrupted after {seen[0].counts.trials if seen else 0} trials; --resume goes on")
        raise
    _show(found, json=json)
    options.tell(output)


def shrink(
    case: Annotated[
        str, typer.Argument(metavar="CASE", help="A case that falsify has kept.", show_default=False)
    ],
    controller: Annotated[
        str | None,
        typer.Option("--controller", metavar="C", help="Who drives.", show_default="the one of the case"),
    ] = None,
    output: Annotated[
        str | None,
        typer.Option(
            "--output", "-o", metavar="FILE.json", help="The small case.", show_default="CASE.small.json"
        ),
    ] = None,
) -> None:
    """Take away from a case what its failure does not need; write what is left, with its replay page."""
    from dubins_traffic.falsification.pages import write_page
    from dubins_traffic.falsification.shrink import shrink as smaller

    target = output or options.beside(case, ".small.json")
    page = str(Path(target).with_suffix(".html"))
    found = smaller(case, controller, progress=lambda what: faults.tell(f"without {what}"))
    found.write(target)
    write_page(found, page, controller)
    print(found.story.sentence)
    options.tell(target, page)


def regress(
    folder: Annotated[
        str, typer.Argument(metavar="DIR", help="A folder of cases, or of a search.", show_default=False)
    ],
    controller: ControllerOption = "rules",
    shield: options.Shield = False,
    json: options.Json = False,
) -> None:
    """Run a folder of cases with a controller; exit with status 1 if it breaks a rule in any of them."""
    from dubins_traffic.controllers.registry import dressed
    from dubins_traffic.falsification.regress import regress as run

    found = run(folder, dressed(controller, shield=shield))
    if json:
        print(json_text.dumps([own.to_json() for own in found], indent=2))
    else:
        for own in found:
            print(f"{own.file.name}: {own.sentence or own.verdict}")
        print(f"{sum(own.passed for own in found)} of {len(found)} cases passed")
    if not all(own.passed for own in found):
        raise typer.Exit(faults.FAILED)


def _show(found: Found, *, json: bool) -> None:
    if json:
        document = {
            "trials": found.trials,
            "discarded": found.discarded,
            "faulty": found.faulty,
            "violated": found.violated,
            "cases": {name: case.story.sentence for name, case in found.cases.items()},
            "coverage": [row.to_json() for row in found.coverage],
        }
        print(json_text.dumps(document, indent=2))
        return
    _table(found.coverage)
    print(
        f"{found.trials} trials: {found.violated} broke a rule, {found.discarded} discarded since the assumption was "
        f"broken, {found.faulty} ended by a fault; {len(found.cases)} kinds of failure"
    )
    for name, case in found.cases.items():
        print(f"{name}: {case.story.sentence}")


def _table(rows: Sequence[Row]) -> None:
    """Print which rule, manoeuvre and crossing were put to the test; an empty cell is a warning."""
    from rich.console import Console
    from rich.table import Table

    table = Table("rule", "manoeuvre", "roads", "tested", "broken", box=None, pad_edge=False)
    for row in rows:
        empty = not row.tested and not row.broken
        tested = "[bold yellow]never[/]" if empty else str(row.tested)
        name = row.cell.manoeuvre.name.lower()
        table.add_row(row.cell.rule, name, str(row.cell.degree), tested, str(row.broken or "-"))
    Console().print(table)
    missing = sum(not row.tested and not row.broken for row in rows)
    if missing:
        faults.tell(f"{missing} of {len(rows)} cells were never put to the test")
