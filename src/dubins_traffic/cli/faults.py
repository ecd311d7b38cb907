"""How errors end a command: one line for people, an exit status for machines."""

from __future__ import annotations

import contextlib
import ctypes
import os
import sys
import threading
import traceback
from collections.abc import Callable, Generator, Iterable, Sequence
from itertools import pairwise
from typing import TYPE_CHECKING, Final, NoReturn, TextIO

import typer

from dubins_traffic.controllers.blame import DEBUG
from dubins_traffic.errors import ControllerError, DubinsTrafficError, InputError, WorkerLostError, shown
from dubins_traffic.outside import put_back

if TYPE_CHECKING:
    from dubins_traffic.problem.instance import Instance
    from dubins_traffic.record.sink import Ending

OK: Final = 0
FAILED: Final = 1
WRONG_INPUT: Final = 2

PROGRAM: Final = "dubins-traffic"
_OUTPUT, _ERRORS = 1, 2
"""Descriptors of the standard streams."""
COMPLETION: Final = "_DUBINS_TRAFFIC_COMPLETE"
"""Name of the environment variable by which a shell asks for completions."""


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
        return _hang_up()
    if "--debug" in arguments:
        traceback.print_exception(error)
    text, status = _verdict(error, arguments)
    tell(text)
    return status


def tell(text: str) -> None:
    """Print one line about something wrong on standard error."""
    try:
        print(f"{PROGRAM}: {shown(text)}", file=sys.stderr)
    except BrokenPipeError:  # whoever read it has had enough
        _discard(sys.__stderr__ or sys.stderr)


@contextlib.contextmanager
def interruptible(words: Callable[[], str]) -> Generator[None]:
    """End the command with status 1 if Ctrl-C comes in the body, and tell what is kept then."""
    try:
        yield
    except KeyboardInterrupt:
        tell(words())
        raise typer.Exit(FAILED) from None


def warn(notice: str) -> None:
    """Print a notice on standard error, unless it is empty."""
    if notice:
        tell(notice)


def tell_failed(trials: Iterable[tuple[Instance, Ending]]) -> bool:
    """Tell of each trial that ended by a fault why; return whether none did."""
    from dubins_traffic.record.sink import FAULTS

    failed = [(instance, ending) for instance, ending in trials if ending.end in FAULTS]
    for instance, ending in failed:
        tell(f"trial {instance.trial}: {ending.end}: {ending.detail}")
    return not failed


def fail_if(notice: str) -> None:
    """Tell of trials that ended by a fault, and end the command with status 1; an empty `notice`: there are none."""
    if notice:
        tell(notice)
        raise typer.Exit(FAILED)


def conclude_exit(error: SystemExit, arguments: Sequence[str]) -> int:
    """Return the exit status where something wanted the program to end, as libraries do whose output nobody reads.

    Parameters
    ----------
    error : SystemExit
        What was raised.
    arguments : sequence of str
        The command line; a request to complete one ends so by right.
    """
    if isinstance(error.__context__, BrokenPipeError):
        return _hang_up()
    if COMPLETION in os.environ or any(word.endswith("-completion") for word in arguments):
        return OK if error.code is None else int(error.code)
    tell(f"unexpected SystemExit: {error.code}")
    return FAILED


def _hang_up() -> int:
    """Discard what is still to be printed: the reader of standard output has closed it, which is no error."""
    _discard(sys.__stdout__ or sys.stdout)
    return OK


def _discard(stream: TextIO) -> None:
    """Let a stream that its reader has closed lead nowhere: Python 3.11.2 fails at its end if it can't write to it."""
    with contextlib.suppress(OSError, ValueError):
        os.dup2(os.open(os.devnull, os.O_WRONLY), stream.fileno())


def open_streams() -> None:
    """Let the standard streams of this process that were closed when it began lead nowhere."""
    for name, mode in (("stdin", "r"), ("stdout", "w"), ("stderr", "w")):
        if getattr(sys, name) is None:  # the lowest free descriptor, so that no file of ours takes its place
            setattr(sys, name, os.fdopen(os.open(os.devnull, os.O_RDWR), mode))


def forget_no_width() -> None:
    """Forget a width of the terminal that is none, as of COLUMNS=0, at which nothing would be shown."""
    width = os.environ.get("COLUMNS", "")
    if width and not (width.isdecimal() and int(width)):
        del os.environ["COLUMNS"]


@contextlib.contextmanager
def debugging(wanted: bool) -> Generator[None]:
    """Let whole tracebacks of controllers be shown in the body, if `wanted`, also by processes that begin in it."""
    if not wanted:
        yield
        return
    os.environ[DEBUG] = "1"
    try:
        yield
    finally:
        del os.environ[DEBUG]


@contextlib.contextmanager
def controllers_drive() -> Generator[None]:
    """Let controllers drive in the body: what they do to this process does not outlast it.

    What they print goes to standard error, since results go to standard output; `os._exit` ends a trial; the current
    folder and the standard streams are put back.
    """
    with put_back(), _output_to_errors(), contextlib.redirect_stdout(sys.stderr), _no_silent_end():
        yield


@contextlib.contextmanager
def _output_to_errors() -> Generator[None]:
    """Let what compiled code prints in the body, which knows descriptors alone, go to standard error, too."""
    sys.stdout.flush()
    _flush_c()
    output = os.dup(_OUTPUT)
    os.dup2(_ERRORS, _OUTPUT)
    try:
        yield
    finally:
        _flush_c()
        os.dup2(output, _OUTPUT)
        os.close(output)


def _flush_c() -> None:
    """Let the C library write out what it holds back."""
    ctypes.CDLL(None).fflush(None)


@contextlib.contextmanager
def _no_silent_end() -> Generator[None]:
    """Let `os._exit` in this thread raise SystemExit: a controller that calls it ends its trial, not the program.

    Elsewhere, in other threads and in processes that were forked, it does what it always does.
    """
    real, process, thread = os._exit, os.getpid(), threading.get_ident()

    def leave(status: int) -> NoReturn:
        if (os.getpid(), threading.get_ident()) != (process, thread):
            real(status)
        raise SystemExit(f"os._exit({status})")

    os._exit = leave
    try:
        yield
    finally:
        os._exit = real


def _verdict(error: Exception, arguments: Sequence[str]) -> tuple[str, int]:
    if isinstance(error, InputError):
        return error.on_command_line(), WRONG_INPUT
    if isinstance(error, WorkerLostError | ControllerError):
        return str(error), FAILED
    if isinstance(error, DubinsTrafficError):
        return str(error), WRONG_INPUT
    if isinstance(error, typer.TyperException):
        return error.format_message() + _given(error, arguments), WRONG_INPUT
    if isinstance(error, OSError) and error.strerror:
        names = [os.fsdecode(name) for name in (error.filename, error.filename2) if isinstance(name, str | bytes)]
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
