"""What a program may say in lines: strictly one answer to one frame."""

from __future__ import annotations

import json
from dataclasses import dataclass
from typing import Any, NoReturn, cast

from dubins_traffic.errors import shown
from dubins_traffic.protocols import End

LONGEST = 1 << 16
"""Bytes of a line above which it is no message."""
WORDS = 300
"""Characters that are kept of what a program says of itself."""
MOST_REPORTS = 100


class AnswerError(Exception):
    """A line that ends the driving: `end` names why."""

    def __init__(self, end: End, detail: str) -> None:
        self.end, self.detail = end, detail
        super().__init__(detail)


@dataclass(frozen=True, slots=True)
class Answer:
    """What answers a frame: speed in m/s, yaw rate in rad/s, and what the controller reports."""

    speed: float
    yaw_rate: float
    reports: tuple[tuple[str, str], ...] = ()


def command_in(line: bytes, tick: int) -> Answer:
    """Return the command that answers frame `tick`.

    Raises
    ------
    AnswerError
        If the line is anything else, or says that the controller has given up or failed.
    """
    message = message_in(line)
    match message:
        case {"command": [speed, yaw_rate], "tick": answered} if (
            plain(speed) and plain(yaw_rate) and type(answered) is int
        ):
            given = speed, yaw_rate
        case _:
            raise _garbage(line)
    if answered != tick:
        detail = f"it answered tick {shown(str(answered), 30)} when it was asked for tick {tick}"
        raise AnswerError(End.PEER_GARBAGE, detail)
    try:
        return Answer(float(given[0]), float(given[1]), _reports(message.get("reports", [])))
    except OverflowError:
        raise _garbage(line) from None


def message_in(line: bytes) -> dict[str, Any]:
    """Return the message of a line.

    Raises
    ------
    AnswerError
        If it is none, or says that the controller has given up or failed.
    """
    try:
        message: Any = json.loads(line, parse_constant=_no_number)
    except (ValueError, RecursionError):
        raise _garbage(line) from None
    if type(message) is not dict:
        raise _garbage(line)
    found = cast("dict[str, Any]", message)
    for key, end in (("bye", End.GAVE_UP), ("fault", End.CONTROLLER_FAULT)):
        if type(found.get(key)) is str:
            raise AnswerError(end, words(found[key]))
    return found


def plain(value: object) -> bool:
    """Tell whether a value is a plain number: no truth value, no text."""
    return type(value) is float or type(value) is int


def words(text: str) -> str:
    """Return what a program says of itself as a line that a record can hold."""
    return shown(text.encode(errors="replace").decode(), 3 * WORDS)


def _no_number(name: str) -> NoReturn:
    raise ValueError(f"{name} is not JSON")


def _garbage(line: bytes) -> AnswerError:
    text = line[:60].decode(errors="replace")
    return AnswerError(End.PEER_GARBAGE, f"not a message: {text!r}")


def _reports(found: Any) -> tuple[tuple[str, str], ...]:
    """Return kinds and details of events."""
    if type(found) is not list or len(cast("list[Any]", found)) > MOST_REPORTS:
        raise AnswerError(End.PEER_GARBAGE, "its reports are not a short list")
    pairs: list[tuple[str, str]] = []
    for each in cast("list[Any]", found):
        match each:
            case [str(kind), str(detail)]:
                pairs.append((words(kind), words(detail)))
            case _:
                raise AnswerError(End.PEER_GARBAGE, "a report is not a kind and a detail")
    return tuple(pairs)
