"""`dubins-traffic instance`."""

from __future__ import annotations

from typing import Annotated

import typer

from dubins_traffic.cli import maps, options

EXAMPLES = options.examples(
    "instance demo --seed 4 --trial 2",
    "instance demo --full -o first.json",
    "instance my-trials.json | dubins-traffic plot - -o first.png",
)


def instance(
    config: options.Config,
    seed: options.Seed = 0,
    trial: Annotated[int, typer.Option("--trial", metavar="I", min=0, help="Number of the trial, from 0.")] = 0,
    full: Annotated[
        bool,
        typer.Option("--full", help="Version 1, with starts, duration, e-agents and seed: it can be run."),
    ] = False,
    output: options.Output = None,
    overwrite: options.Replace = False,
) -> None:
    """Print the problem instance that trial I of a configuration has: version 0, what a controller is told."""
    from dubins_traffic.problem.configuration import load_config
    from dubins_traffic.problem.document import instance_to_document
    from dubins_traffic.problem.draw import draw
    from dubins_traffic.problem.files import DOCUMENTS, dumps

    configuration = load_config(config)
    read = [config, configuration.network_file]
    options.require(output, "an instance", DOCUMENTS, overwrite=overwrite, apart_from=read, standard=True)
    maps.report(configuration.network)
    drawn = draw(configuration, seed, trial)
    options.write(dumps(instance_to_document(drawn, version=1 if full else 0)), output)
