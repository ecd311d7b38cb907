"""`dubins-traffic evaluate`."""

from __future__ import annotations

import json as json_text
from collections import Counter
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from dubins_traffic.cli import faults, options

if TYPE_CHECKING:
    from dubins_traffic.competition.competition import Competition, Phase
    from dubins_traffic.competition.judging import Evaluation

EXAMPLES = options.examples(
    "evaluate controller.py --competition spring",
    "evaluate my_entry --competition spring/competition.toml --workers 2 --records",
    "evaluate entry.zip --competition spring --phase test",
)


PathArgument = Annotated[
    str,
    typer.Argument(
        metavar="PATH",
        help="A controller.py, a folder, a zip archive or a program that speaks lines.",
        show_default=False,
    ),
]
CompetitionOption = Annotated[
    str,
    typer.Option(
        "--competition",
        metavar="FILE|URL",
        help="A competition file, its folder, or the address of its page.",
        show_default=False,
    ),
]
PhaseOption = Annotated[
    str, typer.Option("--phase", metavar="NAME", help="A phase whose seeds are known, or have been revealed.")
]
OutputOption = Annotated[
    str | None,
    typer.Option(
        "--output",
        "-o",
        metavar="DIR",
        help="Where results are kept as they come.",
        show_default="evaluations/PHASE-DIGEST",
    ),
]
TrustOption = Annotated[
    bool,
    typer.Option("--trust-submissions", help="Run it too where this machine can't enforce all limits of the box."),
]


def evaluate(
    path: PathArgument,
    competition: CompetitionOption,
    phase: PhaseOption = "practice",
    output: OutputOption = None,
    workers: Annotated[int, typer.Option("--workers", metavar="N", min=1, max=1024, help="Processes.")] = 1,
    records: Annotated[bool, typer.Option("--records", help="Keep the records of the trials.")] = False,
    trust: TrustOption = False,
    json: options.Json = False,
) -> None:
    """Run a submission at home as the competition would: the same box, the same limits, the same frames.

    What is finished is kept; the same command goes on after Ctrl-C.
    """
    from dubins_traffic.campaign.notice import fault_notice
    from dubins_traffic.cli.progress import progress
    from dubins_traffic.competition import judging
    from dubins_traffic.competition.submission import EVALUATIONS, check_apart, check_submission
    from dubins_traffic.competition.visibility import summary

    opened = _competition(competition).phase(phase)
    base = Path(output or EVALUATIONS)
    check_apart(Path(path), base)
    submission = check_submission(path, base / "submissions")
    folder = base if output else base / f"{phase}-{submission.digest[:12]}"
    kept = "interrupted; {} of {} trials are kept, the same command goes on".format
    with faults.interruptible(lambda: kept(judging.kept(folder), len(opened.numbers))), progress() as show:
        done = judging.evaluate(
            opened, submission, folder, workers=workers, trust=trust, records=records, progress=show
        )
    if json:
        print(json_text.dumps({**done.to_json(), "summary": summary(opened, done.results)}, indent=2))
    else:
        _show(done, opened, folder)
    bad = [result for result in done.results if result.owner is not None]
    first = f"trial {bad[0].number}: {bad[0].end}: {bad[0].row['reason'] or ''}" if bad else ""
    faults.fail_if(fault_notice(Counter(result.end for result in bad), len(done.results), first))


def _competition(place: str) -> Competition:
    """Return the competition of a file, or of the address of its page."""
    from dubins_traffic.competition.competition import load_competition

    if not place.startswith(("http://", "https://")):
        return load_competition(place)
    from dubins_traffic.service.client import fetched_competition

    return fetched_competition(place)


def _show(done: Evaluation, phase: Phase, folder: Path) -> None:
    """Print what came of each trial, the log of the first that ended by a fault, and the means."""
    from rich.console import Console
    from rich.table import Table

    from dubins_traffic.competition.visibility import summary, tail
    from dubins_traffic.record.sink import BY_CONTROLLER

    several = len(phase.configurations) > 1
    ran = dict.fromkeys(result.ran for result in done.results if result.ran is not None)
    table = Table(title=", ".join([phase.name, f"submission {done.submission[:12]}", *ran]))
    where = ("configuration",) if several else ()
    for heading in ("trial", *where, "end", "rounds", "counted", "verdict", "collisions", "fault"):
        table.add_column(heading, justify="right" if heading in ("trial", "rounds", "counted") else "left")
    for result in done.results:
        place = (phase.place(result.number)[0].name,) if several else ()
        cells = [result.row[name] for name in ("rounds", "counted_rounds", "verdict", "collisions")]
        texts = ["" if cell is None else str(cell) for cell in cells]
        table.add_row(str(result.number), *place, result.end.replace("_", " "), *texts, result.owner or "")
    console = Console(highlight=False, markup=False)
    console.print(table)
    faulty = [result for result in done.results if result.owner is not None]
    if faulty:
        console.print(tail(faulty[0].log, phase.model.log_lines))
    means = summary(phase, done.results) or {"trials": 0}
    told = ", ".join(f"{name} {value:.4g}" for name, value in means.items() if name != "trials")
    quits = sum(result.end in BY_CONTROLLER for result in done.results)
    ended = f", {quits} ended by the controller" if quits else ""
    console.print(f"means of {means['trials']} trials{ended}: {told}")
    options.tell(str(folder / "results.jsonl"))
