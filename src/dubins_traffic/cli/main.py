"""The program `dubins-traffic`: one line and an exit status, whatever happens, and whenever Ctrl-C comes.

Nothing is loaded here before Ctrl-C is heard; `cli.commands` loads the rest.
"""

from __future__ import annotations

import gc
import sys
from collections.abc import Sequence

from dubins_traffic.cli.signals import hear_no_more, heard_again, listen
from dubins_traffic.runs.processes import end_despite_threads

FAILED = 1
WRONG_SYSTEM = 2
COLLECT_AFTER = 50_000
"""New objects between two garbage collections: a program that begins makes very many, and nearly all of them stay."""
INTERRUPTED = 130
"""What the library returns after Ctrl-C of which no command has told."""


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command line and return its exit status.

    Parameters
    ----------
    arguments : sequence of str, optional
        What follows the program's name; without it, those of this process. SIGTERM is then heard as Ctrl-C is, the
        second of either ends the process, and when this returns neither is heard any more: all that is left to do is
        to end.
    """
    if arguments is not None:
        return _run(arguments)
    listen()
    status = FAILED
    gc.set_threshold(COLLECT_AFTER)
    try:
        status = _run(sys.argv[1:])
        hear_no_more()
    except KeyboardInterrupt:
        hear_no_more()
        status = _interrupted()
    # If Ctrl-C ended code that `exec` ran, Python notes it and would end by the signal in place of `status`;
    # a further `exec` resets that note.
    exec("")
    end_despite_threads(status)
    return status


def _run(arguments: Sequence[str]) -> int:
    try:
        with heard_again():
            return _concluded(list(arguments))
    except KeyboardInterrupt:
        return _interrupted()
    except Exception as error:
        if _is_interrupt(error):
            return _interrupted()
        from dubins_traffic.errors import DubinsTrafficError

        if not isinstance(error, DubinsTrafficError):
            raise
        print(f"dubins-traffic: {error}", file=sys.stderr)  # this system lacks what all commands need
        return WRONG_SYSTEM


def _concluded(arguments: list[str]) -> int:
    """Run a command and tell of what it raised; return its exit status."""
    from dubins_traffic.cli import faults

    faults.open_streams()
    faults.forget_no_width()
    try:
        from dubins_traffic.cli.commands import app

        with faults.debugging("--debug" in arguments):
            status = app(arguments, prog_name=faults.PROGRAM, standalone_mode=False)
        sys.stdout.flush()
    except SystemExit as error:
        return faults.conclude_exit(error, arguments)
    except Exception as error:
        return _interrupted() if _is_interrupt(error) else faults.conclude(error, arguments)
    return _interrupted() if status == INTERRUPTED else int(status or faults.OK)


def _is_interrupt(error: BaseException | None) -> bool:
    """Tell whether an error is Ctrl-C in other words, as Python says of one that comes while it makes a class."""
    return isinstance(error, KeyboardInterrupt) or (error is not None and _is_interrupt(error.__cause__))


def _interrupted() -> int:
    """Tell that Ctrl-C came while there was nothing to keep; return the exit status."""
    print("dubins-traffic: interrupted", file=sys.stderr)
    return FAILED
