"""Messages in JSON lines: observations, whose numbers keep their bits, and what a program may answer.

Two plain numbers and a tick are a command, and nothing else is.
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, cast

import numpy as np

from dubins_traffic.cars.state import Observation, Pose, Propositions, SensedCar, Twist
from dubins_traffic.errors import shown
from dubins_traffic.protocols import End

if TYPE_CHECKING:
    from dubins_traffic.problem.instance import Problem

LONGEST = 1 << 16
"""Bytes of a line above which it is no message."""
WORDS = 900
"""Characters that are kept of what a program says of itself."""
MOST_REPORTS = 100


class AnswerError(Exception):
    """A line that ends the driving: `end` names why."""

    def __init__(self, end: End, detail: str) -> None:
        self.end, self.detail = end, detail
        super().__init__(detail)


@dataclass(frozen=True, slots=True)
class Answer:
    """What answers a frame: speed in m/s, yaw rate in rad/s, the tick, and what the controller reports."""

    speed: float
    yaw_rate: float
    tick: int
    reports: tuple[tuple[str, str], ...] = ()


def message_in(line: bytes) -> dict[str, Any]:
    """Return the message of a line; AnswerError if it is none, or says that the controller has given up or failed."""
    try:
        message: Any = json.loads(line)
    except (ValueError, RecursionError):
        raise garbage(line) from None
    if type(message) is not dict:
        raise garbage(line)
    fields = cast("dict[str, Any]", message)
    for key, end in (("bye", End.GAVE_UP), ("fault", End.CONTROLLER_FAULT)):
        if type(fields.get(key)) is str:
            raise AnswerError(end, words(fields[key]))
    return fields


def command_of(message: dict[str, Any]) -> Answer | None:
    """Return the command that a message is, None if it is none.

    A truth value, a text or a whole number beyond all floats is no number. One that is not finite is passed on: it
    is the controller's fault, and the trial says so.
    """
    match message:
        case {"command": [speed, yaw_rate], "tick": tick} if _plain(speed) and _plain(yaw_rate) and type(tick) is int:
            try:
                return Answer(float(speed), float(yaw_rate), tick, _reports(message.get("reports", [])))
            except OverflowError:
                return None
        case _:
            return None


def command_in(line: bytes, tick: int) -> Answer:
    """Return the command that answers frame `tick`.

    AnswerError if the line is anything else, or says that the controller has given up or failed.
    """
    answer = command_of(message_in(line))
    if answer is None:
        raise garbage(line)
    if answer.tick != tick:
        detail = f"it answered tick {shown(str(answer.tick), 30)} when it was asked for tick {tick}"
        raise AnswerError(End.PEER_GARBAGE, detail)
    return answer


def garbage(line: bytes) -> AnswerError:
    """Return the error that a line is no message."""
    text = line[:60].decode(errors="replace")
    return AnswerError(End.PEER_GARBAGE, f"not a message: {text!r}")


def words(text: str) -> str:
    """Return what a program says of itself as a line that a record can hold."""
    return shown(text.encode(errors="replace").decode(), WORDS)


def _plain(value: object) -> bool:
    return type(value) is float or type(value) is int


def _reports(reports: Any) -> tuple[tuple[str, str], ...]:
    """Return kinds and details of events."""
    if type(reports) is not list or len(cast("list[Any]", reports)) > MOST_REPORTS:
        raise AnswerError(End.PEER_GARBAGE, "its reports are not a short list")
    pairs: list[tuple[str, str]] = []
    for each in cast("list[Any]", reports):
        match each:
            case [str(kind), str(detail)]:
                pairs.append((words(kind), words(detail)))
            case _:
                raise AnswerError(End.PEER_GARBAGE, "a report is not a kind and a detail")
    return tuple(pairs)


def observation_to_document(seen: Observation) -> dict[str, Any]:
    """Return `seen` as lists of numbers; bodies are left out, since all cars of a problem are alike."""
    return {
        "tick": seen.tick,
        "time": seen.time,
        "pose": list(seen.pose),
        "twist": list(seen.twist),
        "propositions": list(seen.propositions),
        "others": [
            [car.name, car.index, list(car.pose), list(car.twist), list(car.propositions)] for car in seen.others
        ],
        "scan": None if seen.scan is None else seen.scan.tolist(),
    }


def observation_from_document(document: Mapping[str, Any], problem: Problem) -> Observation:
    """Return the observation, equal to the one that was written."""
    body = problem.car.body
    others = [
        SensedCar(name, index, Pose(*pose), Twist(*twist), body, Propositions(*propositions))
        for name, index, pose, twist, propositions in document["others"]
    ]
    scan = document["scan"]
    return Observation(
        document["tick"],
        document["time"],
        Pose(*document["pose"]),
        Twist(*document["twist"]),
        Propositions(*document["propositions"]),
        tuple(others),
        None if scan is None else np.array(scan, dtype=np.float64),
    )
