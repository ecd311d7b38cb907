"""Whose turn it is at the crossing ahead, in words for who drives or looks on."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

from dubins_traffic.cars.state import Propositions
from dubins_traffic.controllers.navigator import Situation

NEAR: Final = 1.5
"""Metres before the line from which a driver is told of a crossing."""


@dataclass(frozen=True, slots=True)
class Turn:
    """What the ego has to do at the crossing ahead, in a word (free, stop, wait, go) and in a sentence."""

    state: str
    text: str


FREE: Final = Turn("free", "")
"""Nothing: there is no crossing near."""


def turn_of(propositions: Propositions, here: Situation) -> Turn:
    """Return whose turn it is (docs/rules.md#queue), as far as the ego can see."""
    if here.stop_line <= 0.0 or not here.crossing or here.stop_line > NEAR:
        return FREE
    if not propositions.stopped:
        return Turn("stop", "Stop at the line before the crossing")
    if propositions.ahead:
        names = ", ".join(car.name for car in here.before) or "another car"
        return Turn("wait", f"Wait: {names} before you")
    if not propositions.clear:
        names = ", ".join(car.name for car in here.inside) or "another car"
        return Turn("wait", f"Wait: {names} in the crossing")
    return Turn("go", "Your turn: go")
