"""`dubins-traffic synth`."""

from __future__ import annotations

import json as json_text
from collections.abc import Callable, Generator, Sequence
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
    "synth first.json --check strategy.hoa --counter-play play.json --counter-trial lost.json",
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
    str | None, typer.Option("--graph", metavar="FILE", help="Write the game as an explicit graph, `*.npz`.")
]
SpecOption = Annotated[
    str | None,
    typer.Option(
        "--spec",
        metavar="FILE",
        help="Write the game as a specification: `*.structuredslugs`, `*.tlsf`, or `*.py` for TuLiP.",
    ),
]
CheckOption = Annotated[
    str | None,
    typer.Option(
        "--check",
        metavar="STRATEGY",
        help="Play a strategy, ours or another tool's, against everything that the e-agents may do.",
    ),
]
CounterPlayOption = Annotated[
    str | None,
    typer.Option(
        "--counter-play", metavar="FILE", help="Write a play that it does not win, if there is one, `*.json`."
    ),
]
CounterTrialOption = Annotated[
    str | None,
    typer.Option(
        "--counter-trial",
        metavar="FILE",
        help="Write the instance in which the e-agents drive by that play, `*.json`, for `run`.",
    ),
]
ExplainOption = Annotated[bool, typer.Option("--explain", help="Say why, and what to assume if the ego does not win.")]
MemoryOption = Annotated[
    int | None,
    typer.Option("--memory", metavar="MIB", min=1, help="Most memory to use.", show_default="half of the machine's"),
]
TrialOption = Annotated[int, typer.Option("--trial", metavar="I", min=0, help="Which trial of a configuration.")]


def synth(
    source: SourceArgument,
    cars: CarsOption = None,
    assume: AssumeOption = None,
    order_degree: OrderDegreeOption = None,
    strategy: StrategyOption = None,
    graph: GraphOption = None,
    spec: SpecOption = None,
    check: CheckOption = None,
    counter_play: CounterPlayOption = None,
    counter_trial: CounterTrialOption = None,
    overwrite: options.Replace = False,
    explain: ExplainOption = False,
    memory: MemoryOption = None,
    seed: options.Seed = 0,
    trial: TrialOption = 0,
    json: options.Json = False,
) -> None:
    """Say whether the ego can win at all: solve the game of cells behind a problem.

    Exit status: 0, or 1 if a strategy that is checked does not win. Ctrl-C ends it soon; nothing is written then.
    """
    from dubins_traffic.files import write_text
    from dubins_traffic.problem.document import instance_to_document
    from dubins_traffic.problem.files import write_document
    from dubins_traffic.synthesis.answer import answer
    from dubins_traffic.synthesis.exhaustive import check_strategy, read_strategy
    from dubins_traffic.synthesis.game import save_game
    from dubins_traffic.synthesis.instance import start_cells
    from dubins_traffic.synthesis.specification import specification_text
    from dubins_traffic.synthesis.strategy import Strategy, check_ranks

    _check_outputs(source, strategy, graph, spec, [counter_play, counter_trial], overwrite=overwrite)
    for option, path in (("--counter-play", counter_play), ("--counter-trial", counter_trial)):
        if path is not None and check is None:
            raise InputError("no strategy to be checked", file=option, expected="--check STRATEGY")
    instance = _instance(source, seed, trial)
    held = None if check is None else read_strategy(check)
    with _progress() as progress:
        answered = answer(
            instance,
            cars=cars,
            assumption=None if assume is None else _parsed(assume),
            order_degree=order_degree,
            limit=None if memory is None else memory << 20,
            progress=progress,
        )
        reasons = answered.explain(progress) if explain else []
        game = answered.solution.game
        checked = None if check is None else check_strategy(check, game, instance, progress, held)
    if graph is not None:
        save_game(game, graph, overwrite=overwrite)
    if spec is not None:
        text = specification_text(game.board, start_cells(game.board, instance), Path(spec).suffix)
        write_text(spec, text)
    if strategy is not None:
        won = Strategy.of(answered.solution)
        won.first()
        check_ranks(game, won.ranks)
        won.save(strategy, overwrite=overwrite)
    counter = None if checked is None else checked.counter
    if counter is not None and counter_play is not None:
        write_text(counter_play, json_text.dumps(counter.to_document(game), indent=1) + "\n")
    if counter is not None and counter_trial is not None:
        write_document(instance_to_document(counter.trial(instance)), counter_trial, overwrite=overwrite)
    if json:
        extra: dict[str, object] = {"explanation": reasons} if explain else {}
        if checked is not None:
            extra["check"] = checked.to_json(game)
        print(json_text.dumps(answered.to_json() | extra, indent=2))
    else:
        told = [] if checked is None or check is None else checked.lines(check, game)
        print("\n".join([*answered.lines(), *reasons, *told]))
    if checked is not None and not checked.wins:
        raise typer.Exit(1)


def _parsed(assume: str) -> Assumption:
    """Return what ``--assume`` says."""
    from dubins_traffic.synthesis.assumption import Assumption

    return Assumption.parse([word for word in assume.split(",") if word.strip() != "nothing"])


def _check_outputs(
    source: str,
    strategy: str | None,
    graph: str | None,
    spec: str | None,
    counters: Sequence[str | None],
    *,
    overwrite: bool,
) -> None:
    """Refuse outputs that can't be written, before the game is solved."""
    from dubins_traffic.synthesis.archive import ARCHIVE, SUFFIXES
    from dubins_traffic.synthesis.specification import FORMS

    options.require(strategy, ARCHIVE, SUFFIXES, overwrite=overwrite, apart_from=[source])
    options.require(graph, ARCHIVE, SUFFIXES, overwrite=overwrite, apart_from=[source, strategy])
    options.require(spec, "a specification", tuple(FORMS), overwrite=overwrite, apart_from=[source])
    for place, path in enumerate(counters):
        others = [source, spec, *counters[:place]]
        options.require(path, "a play", (".json",), overwrite=overwrite, apart_from=others)


def _instance(source: str, seed: int, trial: int) -> Instance:
    """Return the instance at a source; that of a trial, if it is a configuration."""
    from dubins_traffic.problem.configuration import Configuration
    from dubins_traffic.problem.draw import draw
    from dubins_traffic.problem.instance import Instance
    from dubins_traffic.record.reader import Record
    from dubins_traffic.runs.sources import load

    loaded = load(source, seed=seed)
    if isinstance(loaded, Configuration):
        return draw(loaded, seed, trial)
    if isinstance(loaded, Record):
        return loaded.instance
    if isinstance(loaded, Instance):
        return loaded
    raise InputError("has no goals", file=source, expected="a trials configuration, a problem instance or a record")


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
