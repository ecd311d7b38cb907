"""What a controller in a box may use, and how a trial ends that uses more."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, fields
from typing import Final, Literal

from dubins_traffic.errors import InputError
from dubins_traffic.protocols import End
from dubins_traffic.record.sink import BY_CONTROLLER

Fault = Literal["submission", "platform"]

KIB: Final = 1 << 10
MIB: Final = 1 << 20


@dataclass(frozen=True, slots=True)
class Limits:
    """What a controller in a box may use in one trial. Processor time is that of all its processes together.

    InputError if a limit is not a positive number; `bank_seconds` may be 0.
    """

    start_seconds: float = 60.0
    """Processor time until it is ready to drive: interpreter, imports, its own `start`."""
    decision_seconds: float = 1.0
    """Processor time a decision; what a decision takes beyond it comes out of the bank."""
    bank_seconds: float = 60.0
    """Processor time of a trial beyond that of its decisions; a trial ends when the bank is empty."""
    wall_seconds: float = 300.0
    """Wall-clock time that a trial may wait for answers beyond five times the processor time that they take, in all:
    for those who sleep. It is generous, since a busy machine keeps programs waiting.
    """
    memory: int = 2048 * MIB
    """Bytes of memory, what it writes to files among it."""
    processes: int = 64
    """Processes and threads at a time."""
    files: int = 64 * MIB
    """Bytes that all files together may hold; there may be as many files as these are KiB."""
    output: int = MIB
    """Bytes that it may print in a trial."""

    def __post_init__(self) -> None:
        """Refuse what is no limit."""
        for each in fields(self):
            value: object = getattr(self, each.name)
            whole = each.type == "int"
            fits = type(value) is int or (type(value) is float and not whole)
            least = 0.0 if each.name == "bank_seconds" else math.nextafter(0.0, 1.0)
            if not fits or not least <= float(str(value)) < math.inf:
                expected = "a whole number > 0" if whole else "a number > 0"
                raise InputError("not a limit", file="--limits", field=each.name, value=value, expected=expected)

    @property
    def most_files(self) -> int:
        """How many files there may be: an empty one costs the kernel's memory, about a KiB."""
        return max(1, self.files // 1024)

    @classmethod
    def from_text(cls, text: str) -> Limits:
        """Return the limits that ``decision_seconds=0.5,memory=512M`` tells, the others as they usually are.

        Raises
        ------
        InputError
            If there is no such limit, or its value is none. K, M and G stand for powers of 1024.
        """
        kinds = {each.name: str(each.type) for each in fields(cls)}
        given: dict[str, float] = {}
        for part in filter(None, text.split(",")):
            name, _, value = part.partition("=")
            if name not in kinds:
                raise InputError("no such limit", file="--limits", value=name, expected=f"one of {', '.join(kinds)}")
            given[name] = _number(name, value, whole=kinds[name] == "int")
        return cls(**given)  # pyright: ignore[reportArgumentType]  # whole where it must be

    def text(self) -> str:
        """Return what `from_text` reads: the limits that are not the usual ones."""
        usual = Limits()
        triples = ((each.name, getattr(self, each.name), getattr(usual, each.name)) for each in fields(self))
        return ",".join(f"{name}={value!r}" for name, value, other in triples if value != other)


_UNITS: Final = {"K": 1 << 10, "M": 1 << 20, "G": 1 << 30}


def _number(name: str, text: str, *, whole: bool) -> float:
    factor = _UNITS.get(text[-1:].upper(), 1) if whole else 1
    digits = text[:-1] if factor > 1 else text
    try:
        return int(digits) * factor if whole else float(digits)
    except ValueError:
        expected = "a whole number, perhaps with K, M or G" if whole else "a number"
        raise InputError("not a limit", file="--limits", field=name, value=text, expected=expected) from None


@dataclass(frozen=True, slots=True)
class BoxEnd:
    """How the driving of a controller in a box ended, if not with its trial."""

    name: str
    """One of the named ends of a trial (`protocols.End`)."""
    fault: Fault
    """Whose fault it was: ``submission`` or ``platform``."""
    detail: str
    """A line for people; it stands in the record as the detail of the trial's ending."""
    log_tail: str = ""
    """The last that the controller printed."""


OWNERS: Final[Mapping[End, Fault]] = {
    end: "submission" if end in BY_CONTROLLER | {End.COLLISION, End.DURATION} else "platform" for end in End
}
"""Who answers for each end of a trial whose ego drives in a box."""


def owner_of(end: End | str) -> Fault:
    """Return who answers for an end of a trial."""
    return OWNERS[End(end)]
