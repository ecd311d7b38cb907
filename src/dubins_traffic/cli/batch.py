"""`dubins-traffic batch`."""

from __future__ import annotations

from functools import partial
from typing import TYPE_CHECKING, Annotated, Protocol

import typer

from dubins_traffic.cli import faults, maps, options
from dubins_traffic.cli.progress import progress

if TYPE_CHECKING:
    from collections.abc import Callable

    from dubins_traffic.engine.batch import Batch

    class Run(Protocol):
        """Runs the trials of a batch."""

        def __call__(self, *, ended: Callable[[Outcome], object]) -> object:
            """Run the trials, and call `ended` with the outcome of each when it ends."""
            ...

    from dubins_traffic.engine.group import Outcome

EXAMPLES = options.examples(
    "batch town --trials 1000",
    "batch town --controller my_controller.py:MyController --batch 256 --json",
    "batch town --trials 200 --threads 2 --keep failures --records out",
)

TogetherOption = Annotated[int, typer.Option("--batch", metavar="B", min=1, help="Trials that are stepped together.")]
ThreadsOption = Annotated[
    int, typer.Option("--threads", metavar="T", min=1, help="Groups that run at a time, if all is compiled.")
]
KeepOption = Annotated[
    str,
    typer.Option("--keep", metavar="none|all|failures|sample:K", help="Of which trials a record is kept."),
]


def batch(
    configuration: options.Config,
    controller: options.Controller = "rules",
    trials: options.Trials = None,
    seed: options.Seed = 0,
    together: TogetherOption = 64,
    threads: ThreadsOption = 1,
    keep: KeepOption = "none",
    records: options.Records = None,
    overwrite: options.Overwrite = False,
    append: options.Append = False,
    shield: options.Shield = False,
    sandbox: options.Sandbox = False,
    limits: options.Limits = "",
    trust: options.Trust = False,
    metric: options.Metrics = None,
    json: options.Json = False,
) -> None:
    """Run many trials together and score them: the same scores as of [b]run[/b], much sooner.

    Ctrl-C keeps the scores of all finished trials.
    """
    from dubins_traffic.cli.long_enough import LOOKED_AT, short_notice
    from dubins_traffic.controllers.registry import dressed
    from dubins_traffic.engine.batch import run_batch
    from dubins_traffic.problem.configuration import load_config
    from dubins_traffic.problem.draw import draw

    drawn = load_config(configuration)
    maps.report(drawn.network)
    count = drawn.number_trials if trials is None else trials
    if not json:
        faults.warn(short_notice([partial(draw, drawn, seed, trial) for trial in range(min(count, LOOKED_AT))]))
    run = partial(
        run_batch,
        drawn,
        dressed(controller, shield=shield, sandbox=options.boxes(sandbox, limits, trust)),
        trials=trials,
        seed=seed,
        batch=together,
        threads=threads,
        keep=keep,
        records=records,
        overwrite=overwrite,
        append=append,
        metrics=metric or (),
    )
    result = _run(run, count, records, json=json)
    if not faults.tell_failed([(outcome.instance, outcome.ending) for outcome in result.outcomes]):
        raise typer.Exit(faults.FAILED)


def _run(run: Run, count: int, records: str | None, *, json: bool) -> Batch:
    """Run `count` trials, show the scores of those that have ended, and return the batch."""
    from dubins_traffic.cli.tables import show
    from dubins_traffic.engine.batch import in_order

    done: list[Outcome] = []
    try:
        with (
            faults.interruptible(lambda: f"interrupted after {len(done)} of {count} trials"),
            faults.controllers_drive(),
            progress(count) as tell,
        ):
            run(ended=lambda outcome: (done.append(outcome), tell(len(done), count)))
    finally:
        if done:
            show(in_order(done).sheet, json=json)
            options.tell(*(() if records is None else (records,)))
    return in_order(done)
