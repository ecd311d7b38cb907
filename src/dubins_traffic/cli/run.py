"""`dubins-traffic run`."""

from __future__ import annotations

from contextlib import nullcontext
from typing import TYPE_CHECKING, Annotated

import typer

from dubins_traffic.cli import faults, maps, options
from dubins_traffic.errors import InputError, WorkerLostError, needs

if TYPE_CHECKING:
    from dubins_traffic.live.stage import Stage
    from dubins_traffic.runs.plan import Plan
    from dubins_traffic.runs.single import Result

EXAMPLES = options.examples(
    "run demo",
    "run demo --controller simple --trials 20 --jobs 2 --records out",
    "run my-trials.json --controller my_controller.py:MyController --trial-data data.json",
    "run demo --trials 40 --records out --append",
    "run out/trial-0003.mcap --controller simple --json",
    "run town --controller lanes --shield",
    "run demo --simulator gazebo --records out",
    "run demo --controller theirs.py:Driver --sandbox --limits memory=512M",
    "run town --controller rules --watch",
)

ControllerOption = Annotated[
    str | None,
    typer.Option(
        "--controller",
        metavar="C",
        help="A built-in name, module:Class or path/to/file.py:Class.",
        show_default="lanes; of a record its own",
        autocompletion=options.controllers,
    ),
]
RepeatOption = Annotated[
    int, typer.Option("--repeat", metavar="N", min=1, help="Number of times that each trial is run.")
]
SeedOption = Annotated[
    int | None,
    typer.Option("--seed", metavar="S", min=0, help="Seed of all random numbers.", show_default="0"),
]
JobsOption = Annotated[int, typer.Option("--jobs", metavar="J", min=1, help="Trials at a time.")]
DeadlineOption = Annotated[
    float | None,
    typer.Option("--deadline", metavar="SECONDS", help="End a trial whose controller takes longer to act."),
]
SimulatorOption = Annotated[
    str | None,
    typer.Option(
        "--simulator",
        metavar="S",
        help="What moves the cars; `list simulators` names them.",
        show_default="as the source says",
        autocompletion=options.simulators,
    ),
]
WatchOption = Annotated[bool, typer.Option("--watch", help="Show the trials in a page of the browser as they run.")]
GuiOption = Annotated[
    bool, typer.Option("--gui", help="Show trials as they run in Gazebo's window, at the clock's pace.")
]


def run(
    source: options.Source,
    controller: ControllerOption = None,
    trials: options.Trials = None,
    repeat: RepeatOption = 1,
    seed: SeedOption = None,
    jobs: JobsOption = 1,
    rnd: options.Network = None,
    data: options.Data = None,
    data_over: options.DataOver = None,
    records: options.Records = None,
    overwrite: options.Overwrite = False,
    append: options.Append = False,
    deadline: DeadlineOption = None,
    simulator: SimulatorOption = None,
    gui: GuiOption = False,
    shield: options.Shield = False,
    sandbox: options.Sandbox = False,
    limits: options.Limits = "",
    trust: options.Trust = False,
    metric: options.Metrics = None,
    json: options.Json = False,
    watch: WatchOption = False,
    pace: options.Pace = 1.0,
    port: options.Port = 0,
    no_browser: options.NoBrowser = False,
) -> None:
    """Run a controller through trials and score it. Ctrl-C keeps all finished trials."""
    from dubins_traffic.runs.plan import plan

    _check_watch(watch=watch, jobs=jobs, pace=pace, port=port, no_browser=no_browser)
    with _stage(pace, port, opens=not no_browser) if watch else nullcontext() as stage:
        todo = plan(
            source,
            controller,
            trials=trials,
            repeat=repeat,
            seed=seed,
            rnd=rnd,
            data=options.trial_data(data, data_over),
            overwrite_data=data is None,
            records=records,
            overwrite=overwrite,
            append=append,
            deadline=deadline,
            simulator=simulator,
            show=gui,
            shield=shield,
            sandbox=options.boxes(sandbox, limits, trust),
            metrics=metric or (),
        )
        if todo.configuration is not None:
            maps.report(todo.configuration.network)
        if todo.before:
            faults.tell(f"{todo.before} trials have their records in {records}; {len(todo.jobs)} are left")
        results, lost = _run(todo, jobs, records, stage, json=json)
    is_sound = faults.tell_failed([(result.instance, result.ending) for result in results])
    if lost is not None:
        faults.tell(str(lost))
    if lost is not None or not is_sound:
        raise typer.Exit(faults.FAILED)


def _check_watch(*, watch: bool, jobs: int, pace: float, port: int, no_browser: bool) -> None:
    """Refuse trials at a time of which one can be shown, and options of a page without a page."""
    if watch and jobs > 1:
        raise InputError("trials are watched one at a time", file="--jobs", value=jobs, expected="1")
    given = {
        "--pace": pace if pace != 1.0 else None,
        "--port": port or None,
        "--no-browser": no_browser or None,
    }
    for option, value in given.items():
        if value is not None and not watch:
            raise InputError("is for a page", file=option, value=value, expected="--watch beside it")


def _stage(pace: float, port: int, *, opens: bool) -> Stage:
    """Return the page on which trials are watched."""
    with needs("watching trials in a page", "watch"):
        from dubins_traffic.live.stage import Stage

    return Stage(options.tell, port, opens=opens, pace=pace)


def _run(
    todo: Plan, jobs: int, records: str | None, stage: Stage | None, *, json: bool
) -> tuple[list[Result], WorkerLostError | None]:
    """Run the jobs of a plan and show the scores; return the results, and the error if a worker was lost."""
    from dubins_traffic.cli.long_enough import short_notice
    from dubins_traffic.cli.progress import progress
    from dubins_traffic.cli.tables import show, summary
    from dubins_traffic.runs.jobs import run_trials

    if not json:
        faults.warn(short_notice([job.drawn for job in {job.trial: job for job in todo.jobs}.values()]))
    results: list[Result] = []
    lost: WorkerLostError | None = None
    try:
        with (
            faults.interruptible(lambda: f"interrupted after {len(results)} of {len(todo.jobs)} trials"),
            faults.controllers_drive(),
            progress(len(todo.jobs)) as tell,
        ):
            for result in run_trials(todo.jobs, jobs, () if stage is None else (stage.feed,)):
                results.append(result)
                if stage is not None:
                    score = result.score
                    stage.feed.end(result.instance, result.ending, summary(score), score.verdict)
                    stage.feed.finish()
                tell(len(results), len(todo.jobs))
    except WorkerLostError as error:
        lost = error
    finally:
        if results:
            show(todo.conclude(results), json=json)
            options.tell(*(str(written) for written in (records, todo.data) if written is not None))
    return results, lost
