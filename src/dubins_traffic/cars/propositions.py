"""The flags in `Labels.bits`: the propositions of docs/rules.md that are true or false of one car at one frame.

The flags of the queue refer to the crossing at the end of the lane of the car's lane state.
"""

from __future__ import annotations

from typing import Final, NamedTuple


class _Flag(NamedTuple):
    """The flags, each a bit of `Labels.bits`."""

    ON_ROAD: int = 1
    """The centre is within 2w of a segment."""
    STILL: int = 2
    """still(stand_time): the centre lies near where it was that long ago."""
    STANDS: int = 4
    """Still or lingers, and not excused by a queue."""
    LEFT: int = 8
    """The body reaches over the centre line (with hysteresis)."""
    OVERTAKING: int = 16
    """Something blocked the lane and has not been passed yet."""
    BLOCKED: int = 32
    """Something that stands ahead leaves too little of the right lane."""
    APPROACH: int = 64
    """Foremost in its lane before a crossing, and near its disc."""
    STOPPED: int = 128
    """Has stopped at the crossing ahead, and holds a ticket there."""
    CLEAR: int = 256
    """No other car crosses the crossing ahead, or, without one ahead, the crossing that the car is in."""
    AHEAD: int = 512
    """Stopped, and another car is before this one in the order of the crossing."""
    IN_CROSSING: int = 1024
    """The body meets the disc of a crossing."""
    BREACH3: int = 2048
    """In the disc of a crossing entered against rule 3, and not left since."""
    FIRST: int = 4096
    """Stopped, and no car is before this one in the order of the crossing."""
    FORFEITED: int = 8192
    """Stopped, and has got a new ticket in this wait: by a forfeit, or by stopping again."""
    EXCUSED: int = 16384
    """Waits at a crossing without a forfeit, or close behind a car of its lane that is excused."""
    TURNED: int = 32768
    """The lane state flipped in this frame: the car has turned round outside the discs."""
    ENTERED: int = 65536
    """The body meets a disc that it did not meet in the frame before (never in frame 0)."""
    LINGERS: int = 131072
    """The largest progress since the lane state was set has grown by less than `linger_distance` in `linger_time`."""
    HEMMED: int = 262144
    """Left and overtaking, with a car near that has not been still all the while: the way back may not be free."""


FLAG: Final = _Flag()
NAMES: Final = {name.lower(): flag for name, flag in FLAG._asdict().items()}
"""The flags by name, lowest first."""


def names(bits: int) -> tuple[str, ...]:
    """Return the names of the flags in `bits`."""
    return tuple(name for name, flag in NAMES.items() if bits & flag)
