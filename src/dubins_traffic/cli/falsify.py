"""`dubins-traffic falsify`, `shrink` and `regress`."""

from __future__ import annotations

import contextlib
import json as json_text
from typing import TYPE_CHECKING, Annotated

import typer

from dubins_traffic.cli import faults, options
from dubins_traffic.cli.progress import progress
from dubins_traffic.errors import InputError

if TYPE_CHECKING:
    from collections.abc import Generator, Sequence

    from dubins_traffic.falsification.archive import Found
    from dubins_traffic.falsification.coverage import Row
    from dubins_traffic.falsification.remote import Remote
    from dubins_traffic.falsification.search import Search

EXAMPLES = options.examples(
    "falsify junction --controller lanes --trials 2000 -o found",
    "falsify town --controller my_controller.py:MyController --rule 3.clear --seconds 60 -o found",
    "falsify town --controller rules --trials 100000 --workers 4 -o found --resume",
    "falsify junction --over lines,port=7411 --trials 256 -o found",
)
SHRINK_EXAMPLES = options.examples("shrink found/cases/3.clear-left-4.json -o small.json")
REGRESS_EXAMPLES = options.examples("regress found --controller my_controller.py:MyController")

RulesOption = Annotated[
    list[str] | None,
    typer.Option(
        "--rule", metavar="R", show_default="the rules",
        help="A rule that is asked for, such as 3.clear; 1.goal: a goal is not visited for too long; blocked: no goal "
        "is, and nobody has broken a rule; provoked: a lawful e-agent breaks one first. May be given several times.",
    ),
]  # fmt: skip
FormulaOption = Annotated[
    str | None,
    typer.Option("--formula", metavar="F", help="A formula of your own that is asked for instead."),
]
LeastOption = Annotated[bool, typer.Option("--least-score", help="Look for the trials of the least score instead.")]
TrialsOption = Annotated[
    int | None,
    typer.Option("--trials", metavar="N", min=1, help="How many trials.", show_default="10000 without --seconds"),
]
SecondsOption = Annotated[
    float | None, typer.Option("--seconds", metavar="S", min=0, help="End after so many seconds.")
]
StrategyOption = Annotated[
    str,
    typer.Option(
        "--strategy", metavar="NAME",
        help="evolution, uniform or cma; or a class of your own, module:Class or path/to/file.py:Class, which runs in "
        "this process and is trusted.",
    ),
]  # fmt: skip
DurationOption = Annotated[
    float, typer.Option("--duration", metavar="S", help="Seconds of a trial; 0: as the configuration says.")
]
RayOption = Annotated[str | None, typer.Option("--ray", metavar="ADDRESS", help="Run on a Ray cluster, or `local`.")]
WorkersOption = Annotated[int, typer.Option("--workers", metavar="W", min=1, help="Processes.")]
FolderOption = Annotated[
    str, typer.Option("--output", "-o", metavar="DIR", help="Folder for what is found, made if missing.")
]
OverOption = Annotated[
    str | None,
    typer.Option(
        "--over", metavar="TRANSPORT",
        help="A program elsewhere drives, in lockstep: ros1, ros2, lcm, lines or stdio, with the options of its "
        "sessions, as in lines,port=7411.", show_default=False,
    ),
]  # fmt: skip
ResumeOption = Annotated[bool, typer.Option("--resume", help="Go on with the search that DIR holds.")]


def falsify(
    configuration: options.Config,
    controller: options.Controller = "rules",
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
    over: OverOption = None,
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
    from dubins_traffic.falsification.search import falsify as search

    seen: list[Search] = []
    boxes = options.boxes(sandbox, limits, trust)
    kept = "interrupted after {} trials; --resume goes on".format
    with (
        faults.interruptible(lambda: kept(seen[0].finished if seen else 0)),
        faults.controllers_drive(),
        driven(controller, over, shield=shield, sandbox=boxes) as driver,
        progress(trials) as tell,
    ):

        def heard(going: Search) -> None:
            seen[:] = [going]
            tell(going.finished, trials or going.finished)

        result = search(
            configuration, driver, output, rules=rule or (), formula=formula, least_score=least_score,
            trials=trials, seconds=seconds, seed=seed, strategy=strategy, duration=duration or None,
            workers=workers, ray=ray, resume=resume, progress=heard,
        )  # fmt: skip
    _show(result, json=json)
    options.tell(output, str(result.page))
    faults.fail_if(result.fault)


@contextlib.contextmanager
def driven(controller: str, over: str | None, *, shield: bool, sandbox: str | None = None) -> Generator[str | Remote]:
    """Yield who drives: a controller by its name, or a program elsewhere over a transport."""
    from dubins_traffic.controllers.registry import dressed

    if over is None:
        yield dressed(controller, shield=shield, sandbox=sandbox)
        return
    from dubins_traffic.falsification.remote import Remote

    if sandbox is not None:
        raise InputError("both at once", file="--over, --sandbox", expected="one of them")
    with Remote(over, shield=shield, say=faults.tell) as remote:
        yield remote


def shrink(
    case: Annotated[str, typer.Argument(metavar="CASE", help="A case that falsify has kept.", show_default=False)],
    controller: Annotated[
        str | None,
        typer.Option(
            "--controller",
            metavar="C",
            help="The controller that drives the ego.",
            show_default="the one of the case",
        ),
    ] = None,
    output: Annotated[
        str | None,
        typer.Option("--output", "-o", metavar="FILE.json", help="The small case.", show_default="CASE.small.json"),
    ] = None,
    overwrite: options.Replace = False,
    over: OverOption = None,
    shield: options.Shield = False,
) -> None:
    """Take away from a case what its failure does not need; write what is left, with its replay page."""
    from dubins_traffic.falsification.case import write_page
    from dubins_traffic.falsification.shrink import shrink as smaller
    from dubins_traffic.problem.files import DOCUMENTS
    from dubins_traffic.viewer.pages import PAGES

    target = output or options.beside(case, ".small.json")
    page = options.beside(target, ".html")
    options.require(target, "a case", DOCUMENTS, overwrite=overwrite, apart_from=[case])
    options.require(page, "a page", PAGES, overwrite=overwrite)
    with contextlib.ExitStack() as held:
        driver: str | Remote | None = None
        if controller is not None or over is not None:
            driver = held.enter_context(driven(controller or "", over, shield=shield))
        smallest = smaller(case, driver, progress=lambda what: faults.tell(f"without {what}"))
        smallest.write(target, overwrite=overwrite)
        write_page(smallest, page, driver, overwrite=overwrite)
    print(smallest.story.sentence)
    options.tell(target, page)


def regress(
    folder: Annotated[
        str, typer.Argument(metavar="DIR", help="A folder of cases, or of a search.", show_default=False)
    ],
    controller: options.Controller = "rules",
    over: OverOption = None,
    shield: options.Shield = False,
    json: options.Json = False,
) -> None:
    """Run a folder of cases with a controller; exit with status 1 if it breaks a rule in any of them."""
    from dubins_traffic.falsification.regress import regress as run

    with driven(controller, over, shield=shield) as driver:
        replayed = run(folder, driver)
    if json:
        print(json_text.dumps([case.to_json() for case in replayed], indent=2))
    else:
        for case in replayed:
            print(f"{case.file.name}: {case.sentence or case.fault or case.verdict}")
        faulty = sum(bool(case.fault) for case in replayed)
        ended = f", {faulty} ended by a fault" if faulty else ""
        print(f"{sum(case.passed for case in replayed)} of {len(replayed)} cases passed{ended}")
    if not all(case.passed for case in replayed):
        raise typer.Exit(faults.FAILED)


def _show(result: Found, *, json: bool) -> None:
    _warn(result.coverage)
    if json:
        document = {
            "trials": result.trials,
            "discarded": result.discarded,
            "faulty": result.faulty,
            "fault": result.fault,
            "violated": result.violated,
            "cases": {name: case.story.sentence for name, case in result.cases.items()},
            "coverage": [row.to_json() for row in result.coverage],
        }
        print(json_text.dumps(document, indent=2))
        return
    _table(result.coverage)
    print(
        f"{result.trials} trials: the ego broke a rule in {result.violated}, e-agents broke the assumption first in "
        f"{result.discarded} (discarded), {result.faulty} ended by a fault; {len(result.cases)} kinds of failure"
    )
    for name, case in result.cases.items():
        print(f"{name}: {case.story.sentence}")


def _table(rows: Sequence[Row]) -> None:
    """Print which rule, manoeuvre and crossing were put to the test; an empty cell is a warning."""
    from rich.console import Console
    from rich.table import Table

    table = Table("rule", "manoeuvre", "roads", "tested", "broken", box=None, pad_edge=False)
    for row in rows:
        tested = "[bold yellow]never[/]" if row.empty else str(row.tested)
        name = row.cell.manoeuvre.name.lower()
        table.add_row(row.cell.rule, name, str(row.cell.degree), tested, str(row.broken or "-"))
    Console().print(table)


def _warn(rows: Sequence[Row]) -> None:
    """Say on standard error of which cells nothing is known."""
    missing = sum(row.empty for row in rows)
    if missing:
        faults.tell(f"{missing} of {len(rows)} cells were never put to the test")
