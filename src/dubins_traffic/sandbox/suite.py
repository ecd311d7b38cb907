"""Runs attacks on boxes, and says of each what stopped it."""

from __future__ import annotations

import os
import signal
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Final

from dubins_traffic.protocols import End
from dubins_traffic.sandbox.attacks import ATTACKS, Attack
from dubins_traffic.sandbox.attacks.baits import Baits
from dubins_traffic.sandbox.box import Box, BoxOverError
from dubins_traffic.sandbox.layers import Layers
from dubins_traffic.sandbox.limits import MIB, Limits
from dubins_traffic.sandbox.submission import script
from dubins_traffic.transports.answers import AnswerError, command_in, message_in
from dubins_traffic.transports.lines import as_line

LIMITS: Final = Limits(
    start_seconds=3.0,
    decision_seconds=0.5,
    bank_seconds=0.5,
    wall_seconds=120.0,
    memory=256 * MIB,
    processes=48,
    files=16 * MIB,
    output=MIB,
)
"""What attacks may use; an attack that is stopped by the wall clock waits less."""
PRELUDE: Final = "sandbox/attacks/prelude.py"


@dataclass(frozen=True, slots=True)
class Strike:
    """What came of an attack.

    Parameters
    ----------
    attack : Attack
        The attack.
    stopped : bool
        Whether it was stopped.
    words : str
        By what, or what it got hold of.
    """

    attack: Attack
    stopped: bool
    words: str


def strikes(layers: Layers, attacks: Sequence[Attack] = ATTACKS) -> Iterator[Strike]:
    """Run attacks on boxes with these layers, one after another, and yield what came of each.

    Raises
    ------
    BoxOverError
        If a box can't be made.
    """
    with Baits() as baits:
        for attack in attacks:
            yield strike(attack, layers, baits)


def strike(attack: Attack, layers: Layers, baits: Baits) -> Strike:
    """Run one attack in a box of its own."""
    limits = replace(LIMITS, **dict(attack.limits))
    box = Box(script(PRELUDE), limits, layers)
    try:
        if message_in(box.ask(as_line({"hello": 1}))) != {"ready": "yes"}:
            raise box.fault(End.BOX_FAILED, "the box does not run what it shall")
        stopped, words = (_said if attack.end else _reached)(box, attack, baits)
    finally:
        box.close()
    left = baits.daemons()
    for process in left:
        os.kill(process, signal.SIGKILL)
    if left:
        return Strike(attack, False, f"left process {left[0]} behind")
    return Strike(attack, stopped, words)


def _answer(box: Box, attack: Attack, baits: Baits) -> bytes:
    return box.ask(as_line({"source": attack.source, "bait": baits.document()}))


def _reached(box: Box, attack: Attack, baits: Baits) -> tuple[bool, str]:
    """Return whether an attack that says what it got was stopped, and by what."""
    try:
        message = message_in(_answer(box, attack, baits))
    except BoxOverError as error:
        return _ended(error)
    words = str(message.get("stopped") or message.get("got"))
    return "stopped" in message, words


def _said(box: Box, attack: Attack, baits: Baits) -> tuple[bool, str]:
    """Return whether an attack ended as it must that is asked for a command, and how it ended."""
    ends = attack.end if isinstance(attack.end, tuple) else (attack.end,)
    try:
        line = _answer(box, attack, baits)
        command_in(line, 0)
        return False, "its answer was taken"
    except AnswerError as error:
        return error.end in ends, f"{error.end}: {error.detail}"
    except BoxOverError as error:
        return _ended(error, ends)


def _ended(error: BoxOverError, ends: Sequence[End] = tuple(End)) -> tuple[bool, str]:
    end = End(error.end.name)
    if end is End.BOX_FAILED:
        raise error
    return end in ends, f"{error.end.name}: {error.end.detail}"
