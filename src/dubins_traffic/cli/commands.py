"""The commands of `dubins-traffic`, put together."""

from __future__ import annotations

from typing import Annotated

import typer

from dubins_traffic.cli import (
    batch,
    build,
    campaign,
    check,
    check_controller,
    competition,
    convert,
    estimate,
    evaluate,
    explain,
    falsify,
    faults,
    gazebo,
    instance,
    listing,
    network,
    play,
    plot,
    replay,
    run,
    sandbox,
    serve,
    session,
    spec,
    submit,
    suite,
    synth,
    template,
    verify,
    watch,
    worker,
)
from dubins_traffic.sessions.registry import TRANSPORTS

app = typer.Typer(
    name=faults.PROGRAM,
    rich_markup_mode="rich",
    pretty_exceptions_enable=False,
    context_settings={"help_option_names": ["-h", "--help"]},
    epilog="Exit status: 0 all went well; 1 a trial ended by a fault, or something unexpected; 2 wrong input.",
)


@app.callback(invoke_without_command=True)
def _options(  # pyright: ignore[reportUnusedFunction]
    context: typer.Context,
    version: Annotated[
        bool, typer.Option("--version", help="Print version, commit and a hash of the sources, and leave.")
    ] = False,
    debug: Annotated[  # noqa: ARG001
        bool, typer.Option("--debug", help="Show the traceback of an error. Stands before the command.")
    ] = False,
) -> None:
    """The benchmark [b]Traffic network of Dubins cars[/b]: draw problems, run trials, score and show them.

    CONFIG may be a file or the name of a shipped configuration, such as [b]demo[/b]; `-` reads standard input.
    """
    if version:
        from dubins_traffic.release import release

        installed = release()
        print(f"{faults.PROGRAM} {installed.version}")
        print(f"commit {installed.commit or 'unknown'}")
        print(f"sources sha256 {installed.sources}")
        raise typer.Exit
    if context.invoked_subcommand is None:
        print(context.get_help())
        raise typer.Exit(faults.WRONG_INPUT)


app.command("network", epilog=network.EXAMPLES)(network.network)
app.command("instance", epilog=instance.EXAMPLES)(instance.instance)
app.command("run", epilog=run.EXAMPLES)(run.run)
app.command("watch", epilog=watch.EXAMPLES)(watch.watch)
app.command("play", epilog=play.EXAMPLES)(play.play)
app.command("batch", epilog=batch.EXAMPLES)(batch.batch)
app.command("score", epilog=check.SCORE_EXAMPLES)(check.score)
app.command("check", epilog=check.EXAMPLES)(check.check)
app.command("explain", epilog=explain.EXAMPLES)(explain.explain)
app.command("verify", epilog=verify.EXAMPLES)(verify.verify)
app.command("check-controller", epilog=check_controller.EXAMPLES)(check_controller.check_controller)
app.command("spec", epilog=spec.EXAMPLES)(spec.spec)
app.command("synth", epilog=synth.EXAMPLES)(synth.synth)
app.command("plot", epilog=plot.EXAMPLES)(plot.plot)
app.command("replay", epilog=replay.EXAMPLES)(replay.replay)
app.command("convert", epilog=convert.EXAMPLES)(convert.convert)
app.add_typer(campaign.campaign, name="campaign")
app.command("falsify", epilog=falsify.EXAMPLES)(falsify.falsify)
app.command("shrink", epilog=falsify.SHRINK_EXAMPLES)(falsify.shrink)
app.command("estimate", epilog=estimate.EXAMPLES)(estimate.estimate)
app.command("regress", epilog=falsify.REGRESS_EXAMPLES)(falsify.regress)
app.add_typer(competition.competition, name="competition")
app.add_typer(suite.suite, name="suite")
app.command("evaluate", epilog=evaluate.EXAMPLES)(evaluate.evaluate)
app.command("template", epilog=template.EXAMPLES)(template.template)
transports = {name: session.app(name, entry) for name, entry in TRANSPORTS.items()}
transports["ros1"].command("messages", epilog=template.ROS1_EXAMPLES)(template.ros1)
transports["lcm"].command("messages", epilog=template.LCM_EXAMPLES)(template.lcm)
app.add_typer(gazebo.app, name="gazebo")
app.add_typer(sandbox.app, name="sandbox")
for name, transport in transports.items():
    app.add_typer(transport, name=name)
app.command("submit", epilog=submit.EXAMPLES)(submit.submit)
app.command("status", epilog=submit.STATUS_EXAMPLES)(submit.status)
app.command("logs", epilog=submit.LOGS_EXAMPLES)(submit.logs)
app.command("cancel", epilog=submit.CANCEL_EXAMPLES)(submit.cancel)
app.command("serve", epilog=serve.EXAMPLES)(serve.serve)
app.command("worker", epilog=worker.EXAMPLES)(worker.worker)
app.command("build", epilog=build.EXAMPLES)(build.build)
app.command("warm", epilog=build.WARM_EXAMPLES, deprecated=True)(build.warm)
app.command("list", epilog=listing.EXAMPLES)(listing.listing)
