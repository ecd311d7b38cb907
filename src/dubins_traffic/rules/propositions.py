"""The flags in `Labels.bits`: the propositions of docs/rules.md that are true or false of one car at one frame.

The flags of the queue refer to the crossing at the end of the lane of the car's lane state.
"""

from __future__ import annotations

from typing import Final

ON_ROAD: Final = 1
"""The centre is within 2w of a segment."""
STILL: Final = 2
"""still(stand_time): the centre lies near where it was that long ago."""
STANDS: Final = 4
"""Still or lingers, and not excused by a queue."""
LEFT: Final = 8
"""The body reaches over the centre line (with hysteresis)."""
OVERTAKING: Final = 16
"""Something blocked the lane and has not been passed yet."""
BLOCKED: Final = 32
"""Something that stands ahead leaves too little of the right lane."""
APPROACH: Final = 64
"""Foremost in its lane before a crossing, and near its disc."""
STOPPED: Final = 128
"""Has stopped at the crossing ahead, and holds a ticket there."""
CLEAR: Final = 256
"""No other car crosses the crossing ahead, or, without one ahead, the crossing that the car is in."""
AHEAD: Final = 512
"""Stopped, and somebody is before this car in the order of the crossing."""
IN_CROSSING: Final = 1024
"""The body meets the disc of a crossing."""
BREACH3: Final = 2048
"""In the disc of a crossing entered against rule 3, and not left since."""
FIRST: Final = 4096
"""Stopped, and nobody is before this car in the order of the crossing."""
FORFEITED: Final = 8192
"""Stopped, and has got a new ticket in this wait: by a forfeit, or by stopping again."""
EXCUSED: Final = 16384
"""Waits at a crossing without a forfeit, or close behind a car of its lane that is excused."""
TURNED: Final = 32768
"""The lane state flipped in this frame: the car has turned round outside the discs."""
ENTERED: Final = 65536
"""The body meets a disc that it did not meet in the frame before (never in frame 0)."""

LINGERS: Final = 131072
"""The largest progress since the lane state was set has grown by less than `linger_distance` in `linger_time`."""

NAMES: Final = {
    "on_road": ON_ROAD,
    "still": STILL,
    "stands": STANDS,
    "left": LEFT,
    "overtaking": OVERTAKING,
    "blocked": BLOCKED,
    "approach": APPROACH,
    "stopped": STOPPED,
    "clear": CLEAR,
    "ahead": AHEAD,
    "in_crossing": IN_CROSSING,
    "breach3": BREACH3,
    "first": FIRST,
    "forfeited": FORFEITED,
    "excused": EXCUSED,
    "turned": TURNED,
    "entered": ENTERED,
    "lingers": LINGERS,
}
"""The flags by name, lowest first."""


def names(bits: int) -> tuple[str, ...]:
    """Return the names of the flags in `bits`."""
    return tuple(name for name, flag in NAMES.items() if bits & flag)
