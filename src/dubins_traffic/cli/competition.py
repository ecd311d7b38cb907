"""`dubins-traffic competition`."""

from __future__ import annotations

import json as json_text
import os
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from dubins_traffic.cli import faults, options
from dubins_traffic.errors import InputError, shown

if TYPE_CHECKING:
    from dubins_traffic.competition.competition import Phase
    from dubins_traffic.competition.ranking import RankedEntry

NEW_EXAMPLES = options.examples("competition new spring")
CHECK_EXAMPLES = options.examples("competition check spring")
SEAL_EXAMPLES = options.examples(
    "competition seal spring --phase test --key-file ~/spring.key", "competition seal spring --phase test"
)
OPEN_EXAMPLES = options.examples("competition open spring --phase test")
REVEAL_EXAMPLES = options.examples("competition reveal spring --phase test --key-file ~/spring.key")
VERIFY_EXAMPLES = options.examples(
    "competition verify spring --phase test",
    "competition verify spring --phase test --seeds test.seeds.txt --commitment 5f2c...",
)
RANK_EXAMPLES = options.examples("competition rank spring --phase practice ada=evaluations/a bob=evaluations/b")
REHEARSE_EXAMPLES = options.examples("competition rehearse spring --workers 4 --teams 20 --submissions 30")

competition = typer.Typer(
    help="A competition from one file: phases, secret seeds, places with error bars.", no_args_is_help=True
)

File = Annotated[
    str, typer.Argument(metavar="FILE", help="A competition file, TOML, or its folder.", show_default=False)
]
PhaseName = Annotated[str, typer.Option("--phase", metavar="NAME", help="Which phase.", show_default=False)]
KeyFile = Annotated[
    str | None,
    typer.Option(
        "--key-file",
        metavar="KEY",
        help="A file with the key, outside the folder.",
        show_default="a passphrase",
    ),
]


@competition.command("new", epilog=NEW_EXAMPLES)
def new(
    folder: Annotated[str, typer.Argument(metavar="DIR", help="A folder to make.", show_default=False)],
) -> None:
    """Make the folder of a competition: a file to change, with three phases."""
    from dubins_traffic.competition.templates import write_template

    for path in write_template("competition", Path(folder)):
        options.tell(str(path))


@competition.command("check", epilog=CHECK_EXAMPLES)
def check(file: File) -> None:
    """Check a competition file, draw a trial of each configuration, and say what its phases are."""
    from dubins_traffic.competition.competition import load_competition

    loaded = load_competition(file)
    for phase in loaded.phases:
        phase.check_draws()
    print(f"{shown(loaded.title)}: {loaded.ranking.metric}, ties by {loaded.ranking.ties}")
    for phase in loaded.phases:
        print(f"  {phase.name}: {_phase_line(phase)}")


@competition.command("seal", epilog=SEAL_EXAMPLES)
def seal(
    file: File,
    phase: PhaseName,
    key_file: KeyFile = None,
    overwrite: Annotated[bool, typer.Option("--overwrite", help="Replace seeds that are there.")] = False,
) -> None:
    """Draw the secret seeds of a phase and write them encrypted; a key file that is not there is made."""
    from dubins_traffic.competition import sealing
    from dubins_traffic.competition.sealing import make_key_file

    sealing.cipher_class()
    phase_there = _phase(file, phase)
    if key_file is not None and not Path(key_file).exists():
        make_key_file(Path(key_file), phase_there.folder)
        faults.tell(f"{key_file}: a new key")
    key = _key(phase_there, key_file, confirm=True)
    faults.tell("who loses the key, or the passphrase, has no results: keep a copy elsewhere")
    commitment = sealing.seal(phase_there, key, overwrite=overwrite)
    options.tell(str(sealing.sealed_path(phase_there)))
    print(f"commitment {commitment}")


@competition.command("open", epilog=OPEN_EXAMPLES)
def open_phase(file: File, phase: PhaseName) -> None:
    """Publish the commitment to the secret seeds of a phase."""
    from dubins_traffic.competition import sealing
    from dubins_traffic.competition.competition import load_competition

    loaded = load_competition(file)
    opened = loaded.phase(phase)
    published = sealing.publish(opened, loaded.title)
    options.tell(str(sealing.commitment_path(opened)))
    print(f"commitment {published.commitment}")


@competition.command("reveal", epilog=REVEAL_EXAMPLES)
def reveal(file: File, phase: PhaseName, key_file: KeyFile = None) -> None:
    """Publish the seeds of a phase that has closed, so that anybody can run its trials again."""
    from dubins_traffic.competition import sealing

    sealing.cipher_class()
    phase_there = _phase(file, phase)
    options.tell(str(sealing.reveal(phase_there, _key(phase_there, key_file))))


@competition.command("verify", epilog=VERIFY_EXAMPLES)
def verify(
    file: File,
    phase: PhaseName,
    seeds: Annotated[
        str | None,
        typer.Option("--seeds", metavar="FILE", help="The revealed seeds.", show_default="those in the folder"),
    ] = None,
    commitment: Annotated[
        str | None,
        typer.Option(
            "--commitment",
            metavar="SHA256",
            help="What was published when the phase opened: note it then, and give it here.",
            show_default="that in the folder",
        ),
    ] = None,
) -> None:
    """Say whether revealed seeds are those that were committed to, for these configurations, limits and ranking."""
    from dubins_traffic.competition import sealing
    from dubins_traffic.competition.sealing import read_seeds
    from dubins_traffic.files import read_text

    phase_there = _phase(file, phase)
    path = Path(seeds) if seeds else sealing.revealed_path(phase_there)
    committed = commitment or sealing.read_published(sealing.commitment_path(phase_there)).commitment
    published = read_seeds(read_text(path), str(path))
    sealing.check_revealed(published, phase_there, committed)
    print(f"{path}: {len(published.seeds)} seeds, as committed to")


@competition.command("rank", epilog=RANK_EXAMPLES)
def rank(
    file: File,
    phase: PhaseName,
    entries: Annotated[
        list[str],
        typer.Argument(
            metavar="[NAME=]DIR...",
            help="Folders that `evaluate` has filled, with names.",
            show_default=False,
        ),
    ],
    json: options.Json = False,
) -> None:
    """Rank entries by their results in the same trials, with intervals, and say which places are ties."""
    from dubins_traffic.competition.judging import load_entries
    from dubins_traffic.competition.ranking import rank as ranked
    from dubins_traffic.competition.ranking import ranking_document

    phase_there = _phase(file, phase)
    entered = load_entries(entries, phase_there)
    places = ranked(entered, phase_there)
    if json:
        print(json_text.dumps(ranking_document(entered, phase_there), indent=2))
    else:
        _show(places, phase_there)


@competition.command("rehearse", epilog=REHEARSE_EXAMPLES)
def rehearse(
    file: File,
    controllers: Annotated[
        list[str], typer.Option("--controller", metavar="NAME", help="Built-in; may be given several times.")
    ] = ["lanes", "rules", "simple"],  # noqa: B006
    trials: Annotated[int, typer.Option("--trials", metavar="N", min=1, help="Trials of each configuration.")] = 4,
    workers: Annotated[int, typer.Option("--workers", metavar="N", min=1, max=1024, help="Processes.")] = 1,
    teams: Annotated[int, typer.Option("--teams", metavar="N", min=1, help="Teams of the season.")] = 10,
    submissions: Annotated[
        int, typer.Option("--submissions", metavar="N", min=1, help="Those of a team to a phase.")
    ] = 10,
    trust: Annotated[
        bool, typer.Option("--trust-submissions", help="Go on where this machine can't enforce all limits.")
    ] = False,
) -> None:
    """Send built-in controllers through all phases, and say how long the season's load will take on such workers."""
    from dubins_traffic.competition.competition import load_competition
    from dubins_traffic.competition.rehearsal import rehearse as rehearsed

    loads: dict[str, float] = {}
    for rehearsal in rehearsed(load_competition(file), controllers, trials=trials, workers=workers, trust=trust):
        told = f", ended by {', '.join(rehearsal.faults)}" if rehearsal.faults else ""
        print(
            f"{rehearsal.phase.name}: {rehearsal.controller}: {rehearsal.trials} trials,"
            f" {rehearsal.seconds:.2f} s each{told}",
            flush=True,
        )
        loads[rehearsal.phase.name] = max(loads.get(rehearsal.phase.name, 0.0), teams * rehearsal.load(submissions))
    print(f"With {teams} teams, each with {submissions} submissions to a phase as slow as the slowest of these:")
    for name, seconds in loads.items():
        print(f"  {name}: {_hours(seconds / workers)}")
    print(f"The season's load takes {_hours(sum(loads.values()) / workers)} on {workers} such workers.")


def _hours(seconds: float) -> str:
    for unit, size in (("days", 86400.0), ("hours", 3600.0), ("minutes", 60.0)):
        if seconds >= 2.0 * size:
            return f"{seconds / size:.1f} {unit}"
    return f"{seconds:.0f} s"


def _phase(file: str, name: str) -> Phase:
    from dubins_traffic.competition.competition import load_competition

    return load_competition(file).phase(name)


def _key(phase: Phase, key_file: str | None, *, confirm: bool = False) -> bytes:
    from dubins_traffic.competition.sealing import checked_key, read_key

    if key_file is not None:
        return checked_key(read_key(Path(key_file), phase.folder))
    try:
        os.close(os.open("/dev/tty", os.O_RDWR))  # where a passphrase is asked for
        text: str = typer.prompt("Passphrase", hide_input=True, confirmation_prompt=confirm, err=True)
    except (OSError, typer.Abort) as end:
        if isinstance(end.__context__, KeyboardInterrupt):
            raise KeyboardInterrupt from None
        raise InputError(
            "no passphrase was typed, nor is a key file named",
            file="--key-file",
            expected="KEY, a file outside the folder of the competition, or a terminal to type at",
        ) from None
    return checked_key(text.encode())


def _phase_line(phase: Phase) -> str:
    """Return a phase in a line."""
    names = ", ".join(configuration.name for configuration in phase.configurations)
    parts = [f"{len(phase.numbers)} trials of {names}", f"shows {phase.shows}"]
    parts.append("secret seeds" if phase.secret else f"seed {phase.model.seed}")
    for word, time in (("opens", phase.opens), ("closes", phase.closes)):
        if time is not None:
            parts.append(f"{word} {time:%Y-%m-%d %H:%M:%S} UTC")
    return "; ".join(parts)


def _show(places: list[RankedEntry], phase: Phase) -> None:
    from rich.console import Console
    from rich.table import Table

    table = Table(title=f"{phase.name}: mean {phase.ranking.metric} of {places[0].trials} trials")
    for heading in (
        "place",
        "entry",
        "mean",
        "95 % interval",
        "satisfied",
        "ahead of the next",
        "can't be told from",
    ):
        table.add_column(heading, justify="right" if heading in ("place", "mean", "satisfied") else "left")
    for place in places:
        ahead = place.to_next
        table.add_row(
            str(place.place),
            place.entry,
            f"{place.estimate.mean:.3f}",
            _interval(place.estimate.mean_interval),
            f"{place.satisfied.share:.2f}",
            "" if ahead is None else f"{ahead.mean:.3f} {_interval(ahead.mean_interval)}",
            ", ".join(place.ties),
        )
    Console(highlight=False, markup=False).print(table)


def _interval(ends: tuple[float, float] | None) -> str:
    return "" if ends is None else f"[{ends[0]:.3f}, {ends[1]:.3f}]"
