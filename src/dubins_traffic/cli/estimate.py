"""`dubins-traffic estimate`."""

from __future__ import annotations

import json as json_text
from typing import TYPE_CHECKING, Annotated

import typer

from dubins_traffic.cli import faults, options
from dubins_traffic.cli.falsify import WorkersOption
from dubins_traffic.cli.progress import progress

if TYPE_CHECKING:
    from dubins_traffic.falsification.estimate import Probability

EXAMPLES = options.examples(
    "estimate junction --controller lanes --event 3.clear --trials 2000 --duration 15",
    "estimate town --controller rules --event 1.collision --below 0.05 --method splitting",
)

EventOption = Annotated[str, typer.Option("--event", metavar="RULE", help="The rule that is broken, or nearly.")]
BelowOption = Annotated[
    float, typer.Option("--below", metavar="X", help="How near to it, by its margin; 0: it is broken.")
]
MethodOption = Annotated[str, typer.Option("--method", metavar="NAME", help="monte-carlo or splitting.")]
TrialsOption = Annotated[
    int | None,
    typer.Option("--trials", metavar="N", min=1, help="Trials of Monte Carlo.", show_default="10000"),
]
DurationOption = Annotated[
    float | None,
    typer.Option("--duration", metavar="S", help="Seconds of a trial.", show_default="as the configuration says"),
]
ParticlesOption = Annotated[
    int, typer.Option("--particles", metavar="N", help="Trials that splitting steps at a time.")
]
RunsOption = Annotated[int, typer.Option("--runs", metavar="R", help="Independent runs of splitting.")]


def estimate(
    configuration: options.Config,
    controller: options.Controller = "rules",
    event: EventOption = "1.collision",
    below: BelowOption = 0.0,
    method: MethodOption = "monte-carlo",
    trials: TrialsOption = None,
    seed: options.Seed = 0,
    duration: DurationOption = None,
    particles: ParticlesOption = 200,
    runs: RunsOption = 10,
    workers: WorkersOption = 1,
    shield: options.Shield = False,
    json: options.Json = False,
) -> None:
    """Estimate the probability that an ego breaks a rule, or comes near it, with a 95 % interval."""
    from dubins_traffic.controllers.registry import dressed
    from dubins_traffic.falsification.estimate import estimate as run

    with faults.controllers_drive(), progress(what="trials") as tell:
        estimated = run(
            configuration, dressed(controller, shield=shield), event=event, below=below, method=method, trials=trials,
            seed=seed, duration=duration, particles=particles, runs=runs, workers=workers,
            progress=lambda done: tell(done, trials or done),
        )  # fmt: skip
    if json:
        print(json_text.dumps(estimated.to_json(), indent=2))
    else:
        _show(estimated)
    faults.fail_if(estimated.fault)


def _show(probability: Probability) -> None:
    """Print an estimate for people."""
    if probability.left_out == probability.trials:
        print(f"{probability.event}: no estimate, since all {probability.trials} trials ended by a fault")
        return
    low, high = probability.interval
    print(f"{probability.event}: {probability.probability:.3g}, 95 % interval {low:.3g} to {high:.3g}")
    if probability.wilson is not None:
        low, high = probability.wilson
        known = probability.trials - probability.left_out
        print(f"{probability.events} of {known} trials; Wilson's interval {low:.3g} to {high:.3g}")
        if probability.left_out:
            print(f"{probability.left_out} of {probability.trials} trials are left out: they ended by a fault before")
        if probability.discarded:
            faults.tell(
                f"{probability.discarded} trials count as trials without the event: e-agents broke the assumption first"
            )
    else:
        print(f"{probability.trials} trials in {len(probability.runs)} runs of multilevel splitting")
    if probability.replicas is not None:
        for sentence in probability.replicas.advice:
            print(sentence)
