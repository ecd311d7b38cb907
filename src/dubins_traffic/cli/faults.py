"""What becomes of an error: one line for people, an exit status for machines."""

from __future__ import annotations

import os
import sys
import traceback
from collections.abc import Sequence
from itertools import pairwise
from typing import Final

import typer

from dubins_traffic.errors import DubinsTrafficError, InputError

OK: Final = 0
FAILED: Final = 1
WRONG_INPUT: Final = 2

PROGRAM: Final = "dubins-traffic"


def conclude(error: Exception, arguments: Sequence[str]) -> int:
    """Tell the user about `error` on standard error and return the exit status.

    Parameters
    ----------
    error : Exception
        What a command raised.
    arguments : sequence of str
        The command line; with ``--debug`` in it, the traceback is shown before.

    Returns
    -------
    int
        2 where the input is wrong, 0 where the reader of our output had enough, 1 otherwise.
    """
    if isinstance(error, BrokenPipeError):
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return OK
    if "--debug" in arguments:
        traceback.print_exception(error)
    text, status = _verdict(error, arguments)
    tell(text)
    return status


def tell(text: str) -> None:
    """Print one line about something wrong on standard error."""
    print(f"{PROGRAM}: {' '.join(text.split())}", file=sys.stderr)


def _verdict(error: Exception, arguments: Sequence[str]) -> tuple[str, int]:
    if isinstance(error, InputError):
        return error.on_command_line(), WRONG_INPUT
    if isinstance(error, DubinsTrafficError):
        return str(error), WRONG_INPUT
    if isinstance(error, typer.TyperException):
        return error.format_message() + _given(error, arguments), WRONG_INPUT
    if isinstance(error, OSError) and error.strerror:
        names = [
            os.fsdecode(name) for name in (error.filename, error.filename2) if isinstance(name, str | bytes)
        ]
        return ": ".join([*names, error.strerror]), WRONG_INPUT
    hint = f"`{PROGRAM} --debug ...` shows where; please report it"
    return f"unexpected {type(error).__name__}: {error} ({hint})", FAILED


def _given(error: typer.TyperException, arguments: Sequence[str]) -> str:
    """Return which value of an option was wrong; the library's message does not say."""
    names = getattr(getattr(error, "param", None), "opts", ())
    for option, value in pairwise(arguments):
        if option in names and value not in error.format_message():
            return f": got {value!r}"
    return ""
