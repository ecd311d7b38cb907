"""`dubins-traffic suite`."""

from __future__ import annotations

import json as json_text
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from dubins_traffic.cli import faults, options
from dubins_traffic.errors import InputError

if TYPE_CHECKING:
    from dubins_traffic.suites.suite import Suite

LIST_EXAMPLES = options.examples("suite list")
SHOW_EXAMPLES = options.examples("suite show rules-2026", "suite show synthesis-2026 --json")
RUN_EXAMPLES = options.examples(
    "suite run icra2016 --controller simple -o simple",
    "suite run rules-2026 -o all --workers 2 --resume",
    "suite run rules-2026 --controller my.py:Mine --trials 1 -o mine",
    "suite run synthesis-2026 --solver 'python solve_game.py {game}' -o theirs",
)
COMPARE_EXAMPLES = options.examples(
    "suite compare simple mine -o page", "suite compare ada=a/rules-2026-0123456789ab.json bob=b"
)

suite = typer.Typer(
    help="Frozen sets of problems under a name, and results that can be compared.", no_args_is_help=True
)

Name = Annotated[str, typer.Argument(metavar="NAME", help="A shipped suite, or a suite's file.", show_default=False)]


@suite.command("list", epilog=LIST_EXAMPLES)
def list_suites(json: options.Json = False) -> None:
    """List the suites that are shipped, with their hashes."""
    from dubins_traffic.suites.suite import load_suite, shipped_suites

    suites = [load_suite(name) for name in shipped_suites()]
    if json:
        entries = [{"name": suite.name, "hash": suite.hash, "title": suite.model.title} for suite in suites]
        print(json_text.dumps({"suites": entries}, indent=2))
        return
    width = max(len(suite.label) for suite in suites)
    for listed in suites:
        print(f"{listed.label:{width}}  {listed.model.title}")


@suite.command("show", epilog=SHOW_EXAMPLES)
def show(name: Name, json: options.Json = False) -> None:
    """Say what a suite consists of; with --json its file."""
    from dubins_traffic.suites.suite import load_suite

    loaded = load_suite(name)
    if json:
        print(json_text.dumps(loaded.document, indent=2))
        return
    print(f"{loaded.name}: {loaded.model.title}")
    ranked = "" if loaded.model.games else f", ranked by {loaded.model.metric}"
    print(f"hash {loaded.hash}{ranked}")
    print("\n".join(_contents(loaded)))


def _contents(suite: Suite) -> list[str]:
    """Return what is in a suite, a line each."""
    if suite.model.cases is not None:
        return [f"  {case.name}" for case in suite.model.cases]
    if suite.model.campaign is None:
        return [
            f"  {game.name}: {game.positions:,} positions, the ego wins from {game.winning:,}"
            for game in suite.model.games or ()
        ]
    campaign = suite.campaign(["simple"])
    names = ", ".join(dict.fromkeys(cell.configuration for cell in campaign.cells))
    varied = [f"  {factor}: {', '.join(_values(suite, factor))}" for factor in campaign.factors]
    return [
        f"{campaign.total} trials of each controller: {suite.trials} of {len(campaign.cells)} combinations",
        f"  configurations: {names}",
        *varied,
        f"page of {', '.join(suite.controllers)}",
    ]


def _values(suite: Suite, factor: str) -> list[str]:
    cells = suite.campaign(["simple"]).cells
    return list(dict.fromkeys(str(cell.values[factor]) for cell in cells))


FolderOption = Annotated[
    str, typer.Option("--output", "-o", metavar="DIR", help="Folder, made if missing.", show_default=False)
]
ControllersOption = Annotated[
    list[str] | None,
    typer.Option(
        "--controller",
        metavar="C",
        help="A controller, as `run` takes it; may be given several times.",
        show_default="those of the suite's page: built-in ones, with and without the shield",
        autocompletion=options.controllers,
    ),
]
TrialsOption = Annotated[
    int | None,
    typer.Option(
        "--trials",
        metavar="N",
        min=1,
        help="Only the first N trials of each combination: no results of the whole suite.",
    ),
]
InProcessOption = Annotated[
    bool,
    typer.Option(
        "--in-process",
        help="Run controllers of yours in this process, trusted, and not in boxes; the results say so.",
    ),
]
SolverOption = Annotated[
    str | None,
    typer.Option(
        "--solver",
        metavar="COMMAND",
        help="Who solves the games of a suite: a command with a word {game} for the exported game.",
        show_default="dubins-traffic itself",
    ),
]
SecondsOption = Annotated[
    float,
    typer.Option("--seconds", metavar="S", min=0.001, max=1e6, help="Longest time of that command for one game."),
]


@suite.command("run", epilog=RUN_EXAMPLES)
def run(
    name: Name,
    folder: FolderOption,
    controllers: ControllersOption = None,
    trials: TrialsOption = None,
    in_process: InProcessOption = False,
    workers: options.Workers = None,
    resume: options.Resume = False,
    solver: SolverOption = None,
    seconds: SecondsOption = 600.0,
) -> None:
    """Run a suite, or what is left of it; write a file of results to send, and a page. What is finished is kept."""
    from dubins_traffic.campaign import table
    from dubins_traffic.suites import running
    from dubins_traffic.suites.results import open_sources
    from dubins_traffic.suites.running import seated
    from dubins_traffic.suites.suite import load_suite
    from dubins_traffic.suites.writing import PAGE, write_results

    loaded = load_suite(name)
    _check_options(loaded, controllers, trials, workers, solver)
    named = controllers or []
    if loaded.model.games is None and not in_process:
        named, notice = seated(named or ([] if loaded.model.cases is not None else loaded.controllers))
        if notice:
            faults.tell(notice)
    if loaded.model.games is not None:
        path = _games(loaded, Path(folder), solver, seconds, resume=resume)
    elif loaded.model.cases is not None:
        path = _cases(loaded, Path(folder), named, workers, resume=resume)
    else:
        path = _trials(loaded, Path(folder), named, trials, workers, resume=resume)
    report = Path(folder) / "report"
    print(write_results(loaded, open_sources([str(path)]), report, overwrite=True), end="")
    options.tell(str(path), str(report / PAGE))
    if loaded.model.cases is not None:
        faults.fail_if(running.faulty(Path(folder), loaded))
    elif loaded.model.campaign is not None:
        faults.fail_if(table.faulty(Path(folder)))


def _check_options(
    suite: Suite, controllers: list[str] | None, trials: int | None, workers: int | None, solver: str | None
) -> None:
    """Refuse options that say nothing for a suite of this kind."""
    given = {"--controller": controllers, "--trials": trials, "--workers": workers, "--solver": solver}
    kind = "games" if suite.model.games else "cases" if suite.model.cases else "trials"
    known = {
        "trials": ("--controller", "--trials", "--workers"),
        "cases": ("--controller", "--workers"),
        "games": ("--solver",),
    }
    for option, value in given.items():
        if value is not None and option not in known[kind]:
            raise InputError(f"nothing for a suite of {kind}", file=option, value=value, expected="no such option")


def _trials(
    suite: Suite,
    folder: Path,
    controllers: list[str],
    trials: int | None,
    workers: int | None,
    *,
    resume: bool,
) -> Path:
    from dubins_traffic.campaign.folder import kept
    from dubins_traffic.cli.long_enough import short_notice
    from dubins_traffic.cli.progress import progress
    from dubins_traffic.suites.running import run_suite

    faults.warn(short_notice(suite.campaign(["simple"]).first_trials()))
    with (
        faults.interruptible(lambda: f"interrupted; {kept(folder)} trials are kept, --resume goes on"),
        progress() as tell,
    ):
        return run_suite(suite, folder, controllers, trials=trials, workers=workers, resume=resume, progress=tell)


def _cases(suite: Suite, folder: Path, controllers: list[str], workers: int | None, *, resume: bool) -> Path:
    import os

    from dubins_traffic.cli.progress import progress
    from dubins_traffic.suites.running import run_cases

    if not controllers:
        raise InputError("missing", file="--controller", expected="who drives in the cases")
    count = workers or os.cpu_count() or 1
    with (
        faults.interruptible(lambda: "interrupted; the cases that are finished are kept, --resume goes on"),
        progress() as tell,
    ):
        return run_cases(suite, folder, controllers, workers=count, resume=resume, progress=tell)


def _games(suite: Suite, folder: Path, solver: str | None, seconds: float, *, resume: bool) -> Path:
    from dubins_traffic.cli.progress import progress
    from dubins_traffic.suites.running import Solver, check_command, run_games

    if solver is not None:
        check_command(solver)
    asked = Solver() if solver is None else Solver(solver.split()[0], solver, seconds)
    with (
        faults.interruptible(lambda: "interrupted; the answers that are there are kept, --resume goes on"),
        progress() as tell,
    ):
        return run_games(suite, folder, asked, resume=resume, progress=tell)


@suite.command("compare", epilog=COMPARE_EXAMPLES)
def compare(
    places: Annotated[
        list[str],
        typer.Argument(
            metavar="[NAME=]DIR...",
            help="Folders of `suite run`, or files of results; NAME is what their entries are called.",
            show_default=False,
        ),
    ],
    output: Annotated[
        str | None,
        typer.Option("--output", "-o", metavar="FOLDER", help="Write the page, the table and CSV there."),
    ] = None,
    overwrite: options.Replace = False,
    name: Annotated[
        str | None,
        typer.Option("--suite", metavar="FILE", help="The suite's file, if the suite is not shipped."),
    ] = None,
) -> None:
    """Compare results of one suite: a table here, and a page. Results of different hashes are refused."""
    from dubins_traffic.suites.results import made_by, open_sources
    from dubins_traffic.suites.suite import load_suite, shipped_suites
    from dubins_traffic.suites.writing import PAGE, TABLE, results, write_results

    sources = open_sources(places)
    first = sources[0].results.suite
    if name is None and first not in shipped_suites():
        file, expected = str(sources[0].path), "its file, by --suite"
        raise InputError("results of a suite that is not shipped", file=file, value=first, expected=expected)
    loaded = load_suite(name or first)
    if output is None:
        print(results(loaded, sources)[TABLE], end="")
    else:
        print(write_results(loaded, sources, Path(output), overwrite=overwrite), end="")
        options.tell(str(Path(output) / PAGE))
    if len({source.results.code for source in sources}) > 1:
        faults.tell(made_by(sources))
