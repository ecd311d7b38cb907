"""`dubins-traffic campaign`."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from dubins_traffic.cli import faults, options
from dubins_traffic.errors import ClusterLostError, shown

if TYPE_CHECKING:
    from dubins_traffic.campaign.report.write import Written
    from dubins_traffic.campaign.run_campaign import Ran

RUN_EXAMPLES = options.examples(
    "campaign run gaps.toml -o gaps",
    "campaign run gaps.toml -o gaps --resume --workers 2",
    "campaign run gaps.toml -o gaps --ray 10.0.0.1:6379 --records failures",
)

REPORT_EXAMPLES = options.examples("campaign report gaps", "campaign report gaps -o report --worst 5")

COMPARE_EXAMPLES = options.examples("campaign compare gaps-before gaps-after")

REPLAY_EXAMPLES = options.examples("campaign replay gaps 17", "campaign replay gaps 17 -o trial.html")

campaign = typer.Typer(
    help="Many trials from one file: controllers compared on the same instances, with error bars.",
    no_args_is_help=True,
)


FolderOption = Annotated[
    str,
    typer.Option("--output", "-o", metavar="DIR", help="Folder of the campaign, made if missing.", show_default=False),
]
RayOption = Annotated[
    str | None,
    typer.Option(
        "--ray",
        metavar="ADDRESS",
        help="Run on a Ray cluster: host:port, ray://host:port, auto, or local for one of its own.",
    ),
]
RecordsOption = Annotated[
    str | None,
    typer.Option(
        "--records",
        metavar="WHICH",
        help="Keep the records of none, all, failures or sample:N trials.",
        show_default="none, or as before",
    ),
]


@campaign.command("run", epilog=RUN_EXAMPLES)
def run(
    file: Annotated[str, typer.Argument(metavar="FILE", help="A campaign file, TOML.", show_default=False)],
    folder: FolderOption,
    workers: options.Workers = None,
    ray: RayOption = None,
    resume: options.Resume = False,
    records: RecordsOption = None,
    sandbox: options.Sandbox = False,
    limits: options.Limits = "",
    trust: options.Trust = False,
) -> None:
    """Run a campaign, or what is left of it. Whatever ends it, finished trials are kept."""
    from dubins_traffic.campaign.campaign import load_campaign
    from dubins_traffic.campaign.folder import kept
    from dubins_traffic.campaign.run_campaign import run_campaign
    from dubins_traffic.cli.long_enough import short_notice
    from dubins_traffic.cli.progress import progress

    total = 0
    planned = load_campaign(file, sandbox=options.boxes(sandbox, limits, trust))
    faults.warn(short_notice(planned.first_trials()))

    def tell(done: int, count: int) -> None:
        nonlocal total
        total = count
        show(done, count)

    try:
        with progress() as show:
            ran = run_campaign(planned, folder, workers=workers, ray=ray, resume=resume, records=records, progress=tell)
    except (KeyboardInterrupt, ClusterLostError) as error:
        why = "interrupted" if isinstance(error, KeyboardInterrupt) else str(error)
        faults.tell(f"{why}; {kept(Path(folder))} of {total} trials are kept, --resume goes on")
        raise typer.Exit(faults.FAILED) from None
    _conclude(ran)


def _conclude(ran: Ran) -> None:
    """Say what there is, and fail if a trial came to nothing."""
    from dubins_traffic.campaign.notice import assumption_notice
    from dubins_traffic.campaign.table import RESULTS, assumption, faulty

    before = f", {ran.before} of them before" if ran.before else ""
    print(f"{ran.folder / RESULTS}: {ran.campaign.total} trials{before}")
    faults.warn(assumption_notice(*assumption(ran.folder)))
    faults.fail_if(faulty(ran.folder))


@campaign.command("report", epilog=REPORT_EXAMPLES)
def report(
    folder: Annotated[str, typer.Argument(metavar="DIR", help="Folder of a campaign.", show_default=False)],
    output: Annotated[
        str | None,
        typer.Option("--output", "-o", metavar="FOLDER", help="Where to write it.", show_default="DIR/report"),
    ] = None,
    worst: Annotated[
        int,
        typer.Option("--worst", metavar="K", min=0, max=100, help="Replays of the K worst trials of each controller."),
    ] = 3,
    overwrite: options.Replace = False,
    wall: Annotated[bool, typer.Option("--wall", help="Also wall-clock times, which differ from run to run.")] = False,
    everything: Annotated[
        bool, typer.Option("--all", help="Show all metrics, differences and worst trials here, too.")
    ] = False,
) -> None:
    """Compare the controllers of a campaign: who is best, a page with charts and replays, tables for LaTeX, and CSV."""
    from dubins_traffic.campaign.report.write import write_report
    from dubins_traffic.cli.progress import progress

    with progress() as show:
        written = write_report(folder, output, worst=worst, wall=wall, progress=show, overwrite=overwrite)
    _print(written, folder, everything=everything)
    options.tell(str(written.page))


def _print(written: Written, folder: str, *, everything: bool) -> None:
    """Print a report: in at most 30 lines, or everything."""
    from rich.console import Console

    from dubins_traffic.campaign.notice import assumption_notice
    from dubins_traffic.campaign.report import terminal

    console = Console(highlight=False)
    for part in terminal.short_tables(written.comparison):
        console.print(part, markup=False, soft_wrap=isinstance(part, str))
    if everything:
        for table in terminal.tables(written.comparison):
            console.print()
            console.print(table)
    if any(written.worst.values()):
        print()
        if everything:
            print("worst trials, each with the command that replays it")
            print(*terminal.worst_lines(written.worst, folder), sep="\n")
        else:
            print(*terminal.short_worst(written.worst, folder), sep="\n")
    notice = assumption_notice(written.comparison.broken, written.comparison.judged)
    if notice:
        print(f"\n{notice}")
    print()


@campaign.command("compare", epilog=COMPARE_EXAMPLES)
def compare(
    first: Annotated[str, typer.Argument(metavar="A", help="Folder of a campaign.", show_default=False)],
    second: Annotated[str, typer.Argument(metavar="B", help="Folder of another one.", show_default=False)],
    everything: Annotated[bool, typer.Option("--all", help="Show metrics that are 0 in both campaigns, too.")] = False,
) -> None:
    """Compare two campaigns: controllers of the same name, or if there is none, the best of each.

    Trials on the same instance are paired, and the rest is left out. If no two are, all are compared, unpaired.
    """
    from rich.console import Console

    from dubins_traffic.campaign.report.across import compare_campaigns, table

    compared, note = compare_campaigns(first, second)
    console = Console(highlight=False)
    print(f"A: {shown(first)}\nB: {shown(second)}")
    for one in compared:
        console.print()
        for part in table(one, everything=everything):
            console.print(part, markup=False, soft_wrap=isinstance(part, str))
    if note:
        faults.tell(note)


@campaign.command("replay", epilog=REPLAY_EXAMPLES)
def replay(
    folder: Annotated[str, typer.Argument(metavar="DIR", help="Folder of a campaign.", show_default=False)],
    number: Annotated[
        int,
        typer.Argument(metavar="NUMBER", min=0, help="The trial, as its table numbers it.", show_default=False),
    ],
    output: Annotated[
        str | None,
        typer.Option("--output", "-o", metavar="FILE.html", help="The page.", show_default="DIR/report/replays/..."),
    ] = None,
    overwrite: options.Replace = False,
) -> None:
    """Run one trial of a campaign again and make a page that replays it in a browser."""
    from dubins_traffic.campaign.report.write import replay_trial

    page, note = replay_trial(folder, number, output, overwrite=overwrite)
    if note:
        faults.tell(f"trial {number} {note}")
    options.tell(str(page))
