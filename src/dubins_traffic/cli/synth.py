"""`dubins-traffic synth`."""

from __future__ import annotations

import json as json_text
from collections.abc import Callable, Generator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from dubins_traffic.cli import faults, options
from dubins_traffic.errors import InputError

if TYPE_CHECKING:
    from dubins_traffic.problem.instance import Instance
    from dubins_traffic.synthesis.assumption import Assumption

EXAMPLES = options.examples(
    "synth demo --cars 2",
    "synth first.json --assume E1,E2,E4,E5,E6 --explain",
    "synth first.json --order-degree 1 -o first.npz --json",
    "synth first.json --spec game.structuredslugs",
)

SourceArgument = Annotated[
    str,
    typer.Argument(
        metavar="CONFIG|INSTANCE",
        help="A trials configuration (file or shipped name), an instance or a record.",
        show_default=False,
        autocompletion=options.shipped,
    ),
]
CarsOption = Annotated[
    int | None,
    typer.Option("--cars", metavar="N", min=1, help="E-agents.", show_default="those of the instance"),
]
AssumeOption = Annotated[
    str | None,
    typer.Option(
        "--assume",
        metavar="E1,E2,...",
        help="What is assumed of the e-agents: some of E1 to E6, weaker forms E1:any-order, E3:one-forfeit, "
        "E3:forfeits, E4:unmet, E5:moves-up; or nothing.",
        show_default="as the problem says",
    ),
]
OrderDegreeOption = Annotated[
    int | None,
    typer.Option(
        "--order-degree",
        metavar="D",
        min=1,
        help="Intersections of so many roads are crossings.",
        show_default="as the problem says",
    ),
]
StrategyOption = Annotated[
    str | None,
    typer.Option("--output", "-o", metavar="STRATEGY", help="Check the strategy and write it, `*.npz`."),
]
GraphOption = Annotated[
    str | None,
    typer.Option("--graph", metavar="FILE", help="Write the game as an explicit graph, `*.npz`."),
]
SpecOption = Annotated[
    str | None,
    typer.Option(
        "--spec",
        metavar="FILE",
        help="Write the game as a specification: `*.structuredslugs`, `*.tlsf`, or `*.py` for TuLiP.",
    ),
]
ExplainOption = Annotated[
    bool, typer.Option("--explain", help="Say why, and what to assume if the ego does not win.")
]
MemoryOption = Annotated[
    int | None,
    typer.Option(
        "--memory", metavar="MIB", min=1, help="Most memory to use.", show_default="half of the machine's"
    ),
]
TrialOption = Annotated[
    int, typer.Option("--trial", metavar="I", min=0, help="Which trial of a configuration.")
]


def synth(
    source: SourceArgument,
    cars: CarsOption = None,
    assume: AssumeOption = None,
    order_degree: OrderDegreeOption = None,
    strategy: StrategyOption = None,
    graph: GraphOption = None,
    spec: SpecOption = None,
    overwrite: options.Replace = False,
    explain: ExplainOption = False,
    memory: MemoryOption = None,
    seed: options.Seed = 0,
    trial: TrialOption = 0,
    json: options.Json = False,
) -> None:
    """Say whether the ego can win at all: solve the game of cells behind a problem.

    Ctrl-C ends it soon; nothing is written then.
    """
    from dubins_traffic.files import write_text
    from dubins_traffic.synthesis.answer import answer
    from dubins_traffic.synthesis.game import save_game
    from dubins_traffic.synthesis.instance import start_cells
    from dubins_traffic.synthesis.specification import specification_text
    from dubins_traffic.synthesis.strategy import Strategy, check

    _check_outputs(source, strategy, graph, spec, overwrite=overwrite)
    instance = _instance(source, seed, trial)
    with _progress() as progress:
        found = answer(
            instance,
            cars=cars,
            assumption=None if assume is None else _parsed(assume),
            order_degree=order_degree,
            limit=None if memory is None else memory << 20,
            progress=progress,
        )
        reasons = found.explain(progress) if explain else []
    if graph is not None:
        save_game(found.solution.game, graph, overwrite=overwrite)
    if spec is not None:
        board = found.solution.game.board
        write_text(spec, specification_text(board, start_cells(board, instance), Path(spec).suffix))
    if strategy is not None:
        won = Strategy.of(found.solution)
        won.first()
        check(found.solution.game, won.ranks)
        won.save(strategy, overwrite=overwrite)
    if json:
        extra = {"explanation": reasons} if explain else {}
        print(json_text.dumps(found.to_json() | extra, indent=2))
        return
    print("\n".join([*found.lines(), *reasons]))


def _parsed(assume: str) -> Assumption:
    """Return what ``--assume`` says."""
    from dubins_traffic.synthesis.assumption import Assumption

    return Assumption.parse([word for word in assume.split(",") if word.strip() != "nothing"])


def _check_outputs(
    source: str, strategy: str | None, graph: str | None, spec: str | None, *, overwrite: bool
) -> None:
    """Refuse outputs that can't be written, before the game is solved."""
    from dubins_traffic.synthesis.archive import ARCHIVE, SUFFIXES
    from dubins_traffic.synthesis.specification import FORMS

    options.require(strategy, ARCHIVE, SUFFIXES, overwrite=overwrite, apart_from=[source])
    options.require(graph, ARCHIVE, SUFFIXES, overwrite=overwrite, apart_from=[source, strategy])
    options.require(spec, "a specification", tuple(FORMS), overwrite=overwrite, apart_from=[source])


def _instance(source: str, seed: int, trial: int) -> Instance:
    """Return the instance at a source; that of a trial, if it is a configuration."""
    from dubins_traffic.problem.configuration import Configuration
    from dubins_traffic.problem.draw import draw
    from dubins_traffic.problem.instance import Instance
    from dubins_traffic.record.reader import Record
    from dubins_traffic.runs.sources import load

    found = load(source, seed=seed)
    if isinstance(found, Configuration):
        return draw(found, seed, trial)
    if isinstance(found, Record):
        return found.instance
    if isinstance(found, Instance):
        return found
    raise InputError(
        "has no goals", file=source, expected="a trials configuration, a problem instance or a record"
    )


@contextmanager
def _progress() -> Generator[Callable[[str, float], object]]:
    """Show what is being done and how far it is, on standard error and only to people."""
    from rich.console import Console
    from rich.progress import BarColumn, Progress, SpinnerColumn, TextColumn, TimeElapsedColumn

    console = Console(stderr=True)
    columns = (SpinnerColumn(), TextColumn("{task.description}"), BarColumn(), TimeElapsedColumn())
    with Progress(*columns, console=console, transient=True, disable=not console.is_terminal) as progress:
        task = progress.add_task("build", total=1.0)
        with faults.interruptible(lambda: "interrupted: the game is not solved"):
            yield lambda what, share: progress.update(task, description=what, completed=share)
