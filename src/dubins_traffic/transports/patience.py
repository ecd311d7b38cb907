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
        for name in ("begin", "silence"):
            value = getattr(self, name)
            if not 0.0 < value < math.inf:
                raise InputError(
                    "not a time", file=f"--{name}", value=value, expected="seconds, a number > 0"
                )
