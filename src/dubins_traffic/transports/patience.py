"""How long peers are waited for."""

from __future__ import annotations

import math
from dataclasses import dataclass

from dubins_traffic.errors import InputError


@dataclass(frozen=True, slots=True)
class Patience:
    """How long peers are waited for, in seconds of wall clock, and how much they may send.

    `begin`: for the first command after the announcement. `silence`: in real time, without any command. `absence`:
    for a peer that went to come back. `settle`: in lockstep without tags, for further answers to the first frame,
    which is shown until it is answered. `flood`: commands a second of one car. `at_once`:
    whether a trial's time begins with its announcement; else it begins with the ego's first command, if that is remote.

    Raises
    ------
    InputError
        If `begin` or `silence` is no positive, finite number.
    """

    begin: float = 60.0
    silence: float = 5.0
    absence: float = 2.0
    settle: float = 0.2
    flood: int = 1000
    at_once: bool = False

    def __post_init__(self) -> None:
        """Refuse what is no time, such as `nan`, for which nobody would ever be silent."""
        seconds(self.begin, "--begin")
        seconds(self.silence, "--silence")


def seconds(value: float, name: str) -> float:
    """Return `value`, of the option `name`; InputError if it is not a positive finite number."""
    if not 0.0 < value < math.inf:
        raise InputError("not a positive number", file=name, value=value, expected="a number > 0")
    return value
