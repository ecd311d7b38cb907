"""Options that several commands share."""

from __future__ import annotations

import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Annotated

import typer

from dubins_traffic.errors import InputError, shown


def examples(*lines: str) -> str:
    """Return the section of examples of a help text: `lines` as commands, each on its own line."""
    keep_line_breaks = "\b"
    return "\n".join([keep_line_breaks, "[b]Examples[/b]", *(f"$ dubins-traffic {line}" for line in lines)])


def shipped(incomplete: str) -> Sequence[str]:
    """Complete the name of a shipped configuration."""
    from dubins_traffic.problem.configuration import shipped_names

    return [name for name in shipped_names() if name.startswith(incomplete)]


def controllers(incomplete: str) -> Sequence[str]:
    """Complete the name of a built-in controller."""
    from dubins_traffic.controllers.registry import names

    return [name for name in names() if name.startswith(incomplete)]


def simulators(incomplete: str) -> Sequence[str]:
    """Complete the name of a simulator."""
    from dubins_traffic.simulators.registry import names

    return [name for name in names() if name.startswith(incomplete)]


def metrics(incomplete: str) -> Sequence[str]:
    """Complete the name of a metric."""
    from dubins_traffic.scoring.registry import names

    return [name for name in names() if name.startswith(incomplete)]


Config = Annotated[
    str,
    typer.Argument(
        metavar="CONFIG",
        help="A trials configuration: a file, the name of a shipped one, or `-`.",
        show_default=False,
        autocompletion=shipped,
    ),
]
Trials = Annotated[
    int | None,
    typer.Option("--trials", metavar="N", min=1, help="Trials 0 to N-1.", show_default="as the configuration says"),
]
Controller = Annotated[
    str,
    typer.Option(
        "--controller",
        metavar="C",
        help="A built-in name, module:Class or path/to/file.py:Class; `rules` runs compiled.",
        autocompletion=controllers,
    ),
]
Seed = Annotated[int, typer.Option("--seed", metavar="S", min=0, help="Seed of all random numbers.")]
Output = Annotated[
    str | None,
    typer.Option("--output", "-o", metavar="FILE", help="Write here instead of to standard output."),
]
Replace = Annotated[bool, typer.Option("--overwrite", help="Replace a file that exists; by default it is refused.")]
Shield = Annotated[
    bool,
    typer.Option("--shield", help="Change the ego's commands as little as needed for it to keep rules 1 to 3."),
]
Sandbox = Annotated[
    bool, typer.Option("--sandbox", help="Run the controller in a box; none of its code is loaded here.")
]
Limits = Annotated[
    str,
    typer.Option(
        "--limits",
        metavar="LIMITS",
        help="Limits of the box, as memory=512M,decision_seconds=0.1; implies --sandbox.",
        show_default="as `sandbox check` shows",
    ),
]
Trust = Annotated[
    bool, typer.Option("--trust-submissions", help="Run it even if this machine can't enforce all limits.")
]
Metrics = Annotated[
    list[str] | None,
    typer.Option(
        "--metric",
        metavar="M",
        help="A further metric: its name, module:Class or path/to/file.py:Class; may be given several times.",
        autocompletion=metrics,
    ),
]
Workers = Annotated[
    int | None,
    typer.Option("--workers", metavar="N", min=1, max=1024, help="Processes.", show_default="one for each core"),
]
Resume = Annotated[bool, typer.Option("--resume", help="Go on with the run that was begun in DIR.")]
Json = Annotated[bool, typer.Option("--json", help="Print JSON for machines instead of a table.")]
Data = Annotated[
    str | None,
    typer.Option(
        "--trial-data",
        "-f",
        metavar="DATA",
        help="Write the trial data file of 2016; one that exists is refused.",
    ),
]
DataOver = Annotated[
    str | None,
    typer.Option("--overwrite-trial-data", "-F", metavar="DATA", help="The same, overwriting one that exists."),
]
Network = Annotated[
    str | None,
    typer.Option("--rnd", metavar="FILE", help="A road network that replaces the configuration's."),
]
Records = Annotated[
    str | None, typer.Option("--records", metavar="DIR", help="Folder for the records, made if missing.")
]
Overwrite = Annotated[
    bool,
    typer.Option("--overwrite", help="Remove the records that DIR holds first; by default such a DIR is refused."),
]
Append = Annotated[
    bool,
    typer.Option(
        "--append",
        help="Keep the records in DIR, which must be of the same run, and run the trials that have none.",
    ),
]
Source = Annotated[
    str,
    typer.Argument(
        metavar="CONFIG|INSTANCE|RECORD",
        help="A trials configuration (file or shipped name), an instance or a record; told by its content.",
        show_default=False,
        autocompletion=shipped,
    ),
]
Pace = Annotated[float, typer.Option("--pace", metavar="X", help="Seconds of the trial in a second, in the page.")]
Port = Annotated[
    int,
    typer.Option(
        "--port",
        metavar="P",
        min=0,
        max=65535,
        help="Port of the page, on this machine only.",
        show_default="one that is free",
    ),
]
NoBrowser = Annotated[bool, typer.Option("--no-browser", help="Print the address of the page, and open no browser.")]
Record = Annotated[str, typer.Argument(metavar="RECORD", help="A record, `*.mcap`.", show_default=False)]


def boxes(sandbox: bool, limits: str, trust: bool) -> str | None:
    """Return the limits of the box in which controllers drive (`controllers.registry.sandboxed`), None without a box.

    Raises
    ------
    InputError
        If the limits can't be read, or `trust` is given without a box.
    """
    if not sandbox and not limits:
        if trust:
            raise InputError("nothing to trust", file="--trust-submissions", expected="--sandbox beside it")
        return None
    from dubins_traffic.sandbox.limits import Limits

    Limits.from_text(limits)
    return ",".join(filter(None, (limits, "trust" if trust else "")))


def trial_data(data: str | None, data_over: str | None) -> str | None:
    """Return the one trial data file of the options -f and -F, None without either.

    Raises
    ------
    InputError
        If both are given.
    """
    if data is not None and data_over is not None:
        raise InputError("two trial data files", file="-F", value=data_over, expected="either -f or -F")
    return data_over if data is None else data


def require(
    output: str | None,
    what: str,
    suffixes: Sequence[str],
    *,
    overwrite: bool,
    apart_from: Sequence[str | None] = (),
    standard: bool = False,
) -> None:
    """Refuse an output as `files.require_output` does; ``-`` is none but where `standard` output is one."""
    if output is None or (standard and output == "-"):
        return
    from dubins_traffic.files import require_output

    require_output(output, what, suffixes, overwrite=overwrite, apart_from=apart_from)


def write(text: str, output: str | None) -> None:
    """Print `text`, or write it to the file `output`, whole or not at all, and name the file on standard error."""
    if output is None or output == "-":
        sys.stdout.write(text)
        return
    from dubins_traffic.files import write_text

    write_text(output, text)
    tell(output)


def beside(file: str, suffix: str) -> str:
    """Return the default name of an output: `file` with another suffix.

    Raises
    ------
    InputError
        If `file` is standard input or a folder such as ``.``, which have no name.
    """
    if file == "-" or not Path(file).name:
        raise InputError("missing", file="--output", expected=f"a file to write, such as out{suffix}")
    return str(Path(file).with_suffix(suffix))


def tell(*outputs: str) -> None:
    """Name the files that have been written on standard error, a line each; standard output is for results."""
    for output in outputs:
        print(shown(output), file=sys.stderr)
