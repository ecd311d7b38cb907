"""Errors that users of the package may meet; all share one base class."""

from __future__ import annotations

import re
from collections.abc import Callable, Generator
from contextlib import contextmanager
from typing import Final

_ABSENT: Final = object()
_ARGUMENTS: Final = {
    "--append": "append=True",
    "--endless": "endless=True",
    "--gui": "show=True",
    "--jobs 1": "workers=1",
    "--lockstep": "lockstep=True",
    "--map-format": "map_format",
    "--metric": "metrics",
    "--overwrite": "overwrite=True",
    "--overwrite-trial-data": "overwrite_data=True",
    "--resume": "resume=True",
    "--rule": "rules",
    "--trial-data": "data",
    "--overwrite-trial-data (-F)": "overwrite_data=True",
    "-F": "overwrite_data=True",
    "-f": "data",
    **{
        f"--{name}": name
        for name in (
            "assume", "at", "cars", "clock", "controller", "deadline", "event", "factor", "keep",
            "master", "memory", "method", "poses", "ray", "records", "remote", "repeat",
            "rnd", "seed", "simulator", "strategy", "trials", "url", "workers",
        )
    },
}  # fmt: skip
"""Options of commands, and what the functions behind them call the same."""
_LONGEST_FIRST: Final = sorted(map(re.escape, _ARGUMENTS), key=len, reverse=True)
_OPTION: Final = re.compile(rf"(?<![\w./=-])(?:{'|'.join(_LONGEST_FIRST)})(?![\w=./-])")
LONGEST: Final = 300
"""Most characters of each part of a message."""


class DubinsTrafficError(Exception):
    """Base class of every error raised on purpose by this package."""


class InputError(DubinsTrafficError):
    """Something the user gave is wrong.

    Parameters
    ----------
    problem : str
        What is wrong, in a few words.
    file : str, optional
        The file (or ``-``, or an option such as ``--seed``) in which it stands. Options are named as the command line
        has them; `str` of the error names the arguments of Python, `on_command_line` the options.
    field : str, optional
        Path of the field inside the document, such as ``rnd.segments[3]``.
    value : object, optional
        The offending value.
    expected : str, optional
        What would have been right.

    Examples
    --------
    >>> str(InputError("not a length", file="a.json", field="length", value=-1, expected="a number > 0"))
    'a.json: length: not a length: got -1; expected a number > 0'
    """

    def __init__(
        self,
        problem: str,
        *,
        file: str | None = None,
        field: str | None = None,
        value: object = _ABSENT,
        expected: str | None = None,
    ) -> None:
        self.problem = problem
        self.file = file
        self.field = field
        self.value = value
        self.expected = expected
        super().__init__(problem)

    def within(self, *, file: str | None = None, field: str | None = None) -> InputError:
        """Return the same error placed in `file` and below the field `field`."""
        path = self.field
        if field:
            joint = "" if path is None or path.startswith("[") else "."
            path = field if path is None else f"{field}{joint}{path}"
        return InputError(self.problem, file=self.file or file, field=path, value=self.value, expected=self.expected)

    def __str__(self) -> str:
        return self._text(in_python)

    def on_command_line(self) -> str:
        """Return the message for somebody who typed a command: it names options, not the arguments of functions."""
        return self._text(str)

    def _text(self, say: Callable[[str], str]) -> str:
        file = "''" if self.file == "" else self.file
        parts = [shown(say(part), LONGEST) for part in (file, self.field, self.problem) if part]
        text = ": ".join(parts)
        if self.value is not _ABSENT:
            text += f": got {_short(self.value)}"
        if self.expected:
            text += f"; expected {say(self.expected)}"
        return text


class RecordError(InputError):
    """A record can't be read: truncated before its header, not a record, or of an unknown version."""


class ControllerError(DubinsTrafficError):
    """A controller raised, answered nonsense or was too late; `reason` is one of the named ends of a trial."""

    def __init__(self, reason: str, detail: str) -> None:
        self.reason = reason
        self.detail = detail
        super().__init__(f"{reason}: {detail}")


class PeerError(ControllerError):
    """What drives a car from another process ended the trial; `reason` is one of the named ends of a trial."""


class TransportError(DubinsTrafficError):
    """A transport can't be opened: no master, port in use, no route."""


class WorkerLostError(DubinsTrafficError):
    """Processes that ran trials ended before these did; the other trials went on."""


class ClusterLostError(DubinsTrafficError):
    """The cluster on which a campaign ran is gone; what had been finished is kept."""


class MissingExtraError(DubinsTrafficError):
    """A feature needs an optional extra of the package that is not installed."""

    def __init__(self, feature: str, extra: str) -> None:
        super().__init__(f"{feature} needs the extra '{extra}': install dubins-traffic[{extra}]")


@contextmanager
def needs(feature: str, extra: str) -> Generator[None]:
    """Raise MissingExtraError where a library of an extra can't be imported in the body."""
    try:
        yield
    except ImportError as error:
        if (error.name or "").startswith("dubins_traffic"):
            raise
        raise MissingExtraError(feature, extra) from error


def in_python(text: str) -> str:
    """Return a text in which arguments of functions stand for the options of commands that are the same.

    Messages are written with the options, since most are read there; commands to type, and other options, stay.

    Examples
    --------
    >>> in_python("--keep, --records: exists; -F overwrites")
    'keep, records: exists; overwrite_data=True overwrites'
    """
    return _OPTION.sub(lambda match: _ARGUMENTS[match[0]], text)


def shown(text: str, limit: int | None = None) -> str:
    r"""Return `text` as one line that is safe to print: blanks drawn together, control characters escaped, cut.

    Names of files and values of documents are other people's, and could move the cursor or name another command.

    Parameters
    ----------
    text : str
        What is to be shown.
    limit : int, optional
        Most characters; what is cut off leaves three dots.

    Examples
    --------
    >>> print(shown("a\n  b\x1b[31mred"))
    a b\x1b[31mred
    """
    if limit is not None and len(text) > 4 * limit:
        text = text[: 4 * limit] + "..."
    line = " ".join(text.split())
    if not line.isprintable():
        line = "".join(sign if sign.isprintable() else ascii(sign)[1:-1] for sign in line)
    return line if limit is None or len(line) <= limit else line[: max(0, limit - 3)] + "..."


def _short(value: object, limit: int = 60) -> str:
    try:
        text = repr(value)
    except ValueError:  # an integer of more digits than Python prints
        text = f"<{type(value).__name__} too long to print>"
    return shown(text, limit)
