"""`dubins-traffic batch`."""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated

import typer

from dubins_traffic.cli import faults, options
from dubins_traffic.cli.progress import progress

if TYPE_CHECKING:
    from dubins_traffic.engine.group import Outcome

EXAMPLES = options.examples(
    "batch town --trials 1000",
    "batch town --controller my_controller.py:MyController --batch 256 --json",
    "batch town --trials 200 --threads 2 --keep failures --records out",
)


def batch(
    configuration: options.Config,
    controller: Annotated[
        str,
        typer.Option(
            "--controller",
            metavar="C",
            help="A built-in name, module:Class or path/to/file.py:Class; `rules` runs compiled.",
            autocompletion=options.controllers,
        ),
    ] = "rules",
    trials: Annotated[
        int | None,
        typer.Option(
            "--trials", metavar="N", min=1, help="Trials 0 to N-1.", show_default="as the configuration says"
        ),
    ] = None,
    seed: options.Seed = 0,
    together: Annotated[
        int, typer.Option("--batch", metavar="B", min=1, help="Trials that are stepped together.")
    ] = 64,
    threads: Annotated[
        int, typer.Option("--threads", metavar="T", min=1, help="Batches at a time, where all is compiled.")
    ] = 1,
    keep: Annotated[
        str,
        typer.Option(
            "--keep", metavar="none|all|failures|sample:K", help="Of which trials a record is kept."
        ),
    ] = "none",
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
    from dubins_traffic.cli.tables import show
    from dubins_traffic.controllers.registry import dressed
    from dubins_traffic.engine.batch import in_order, run_each
    from dubins_traffic.problem.configuration import load_config
    from dubins_traffic.record.sink import FAULTS

    drawn = load_config(configuration)
    count = drawn.number_trials if trials is None else trials
    done: list[Outcome] = []
    each = run_each(
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
    try:
        with faults.no_silent_end(), progress(count) as tell:
            for outcome in each:
                done.append(outcome)
                tell(len(done), count)
    except KeyboardInterrupt:
        faults.tell(f"interrupted after {len(done)} of {count} trials")
        raise
    finally:
        if done:
            show(in_order(done).sheet, json=json)
            options.tell(*(() if records is None else (records,)))
    failed = [outcome for outcome in in_order(done).outcomes if outcome.ending.end in FAULTS]
    for outcome in failed:
        faults.tell(f"trial {outcome.instance.trial}: {outcome.ending.end}: {outcome.ending.detail}")
    if failed:
        raise typer.Exit(faults.FAILED)
