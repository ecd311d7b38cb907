"""The layout of a record: one MCAP file per trial, readable by any MCAP tool.

Topics, in the order in which their channels are registered:

========== ======================================= =====================================================
topic      message                                 when
========== ======================================= =====================================================
/trial     JSON, `header_schema`                   once, alone in the first chunk
/frames    ``dubins_traffic/Frame``, ROS 1 binary  every tick
/labels    ``dubins_traffic/Labels``, likewise     at the first frame of a chunk, then whenever one changes
/contacts  ``dubins_traffic/Contact``, likewise    one per contact
/events    ``dubins_traffic/Event``, likewise      one per event
/end       ``dubins_traffic/End``, likewise        once, last; missing in a record that was cut off
========== ======================================= =====================================================

A chunk holds one block of frames, at most one simulated second, and is flushed to the file when it closes. Chunks
are not compressed, so the bytes do not depend on a compressor. ``log_time`` is simulated time in nanoseconds from
the first frame. Nothing in the file comes from a wall clock, a host, a path or a process.
"""

from __future__ import annotations

import struct
from typing import Final

import numpy as np
import numpy.typing as npt

VERSION: Final = 1
FORMAT: Final = "dubins-traffic record"

HEADER: Final = "/trial"
FRAMES: Final = "/frames"
LABELS: Final = "/labels"
CONTACTS: Final = "/contacts"
EVENTS: Final = "/events"
END: Final = "/end"

FRAME_FIELDS: Final = ("x", "y", "c", "s", "speed", "yaw_rate", "command_speed", "command_yaw_rate")
LABEL_FIELDS: Final = ("segment", "at", "crosses", "lane", "bits")

_FRAME = """\
# Frame k of a trial. Arrays hold one element per car, the ego first. World frame; metres, seconds, radians.
uint32 tick                 # k
float64 time                # k / rate
float64[] x
float64[] y
float64[] c                 # cosine of the heading
float64[] s                 # sine of the heading
float64[] speed             # in force when the frame was reached; 0 for a car that a contact had fixed
float64[] yaw_rate
float64[] command_speed     # clipped command held during the tick that ended in this frame; 0 in frame 0
float64[] command_yaw_rate
"""

_LABELS = """\
# Propositions from frame `tick` on, until the next message of this topic. One element per car, the ego first.
uint32 tick
float64 time
int32[] segment             # nearest segment
int32[] at                  # intersection whose disc holds the centre, -1: none
int32[] crosses             # intersection whose disc the body meets, -1: none
int32[] lane                # lane state, 2 * segment + direction, -1: none
uint32[] bits               # flags
"""

_CONTACT = """\
# Two bodies touched, during the tick that ends in frame `tick`. Of each pair the first element is `car`'s.
uint32 tick
float64 time                # seconds
int32 car
int32 other                 # a car, or -1 - k for obstacle k
float64 x                   # point of contact
float64 y
float64 nx                  # unit normal from `car` toward `other`
float64 ny
float64[2] closing          # speeds of the touching points toward each other, m/s
bool[2] moved               # whether it moved or, being a rectangle, turned in that tick before the contact
bool[2] at_fault
"""

_EVENT = """\
# Something named that happened at one instant.
uint32 tick
string kind
int32 car                   # -1: none
string detail
"""

_END = """\
# The named end of the trial, after `ticks` ticks.
string end
uint32 ticks
string detail
"""

MESSAGES: Final[dict[str, tuple[str, str]]] = {
    FRAMES: ("dubins_traffic/Frame", _FRAME),
    LABELS: ("dubins_traffic/Labels", _LABELS),
    CONTACTS: ("dubins_traffic/Contact", _CONTACT),
    EVENTS: ("dubins_traffic/Event", _EVENT),
    END: ("dubins_traffic/End", _END),
}
"""Name and ROS 1 definition of the message of each binary topic."""

CONTACT: Final = struct.Struct("<Id2i6d4B")

HEADER_NAME: Final = "dubins_traffic/Trial"
_STRING = {"type": "string"}
_NUMBER = {"type": "number"}


def header_schema() -> dict[str, object]:
    """Return the JSON Schema of the message on ``/trial``."""
    properties: dict[str, object] = {
        "format": {"const": FORMAT},
        "version": {"const": VERSION},
        "package": _STRING,
        "libraries": {"type": "object", "additionalProperties": _STRING},
        "seed": {"type": "integer"},
        "trial": {"type": "integer"},
        "controller": {"type": ["string", "null"]},
        "rate": _NUMBER,
        "cars": {"type": "array", "items": _STRING},
        "bounds": {"type": "object", "additionalProperties": _NUMBER},
        "instance": {"type": "object"},
    }
    return {
        "$schema": "https://json-schema.org/draft/2020-12/schema",
        "title": HEADER_NAME,
        "description": "What was run: the version 1 instance document, seeds, versions, bounds, names of the cars.",
        "type": "object",
        "properties": properties,
        "required": list(properties),
    }


def frame_dtype(cars: int) -> npt.DTypeLike:
    """Return the packed layout of a ``dubins_traffic/Frame`` with `cars` cars."""
    return _dtype([(name, "<f8") for name in FRAME_FIELDS], cars)


def labels_dtype(cars: int) -> npt.DTypeLike:
    """Return the packed layout of a ``dubins_traffic/Labels`` with `cars` cars."""
    return _dtype([(name, "<u4" if name == "bits" else "<i4") for name in LABEL_FIELDS], cars)


def log_time(tick: int, rate: float) -> int:
    """Return the simulated time of a frame in nanoseconds."""
    return round(tick * 1e9 / rate)


def pack_strings(*parts: int | str) -> bytes:
    """Pack integers (32 bits) and strings as ROS 1 does."""
    packed: list[bytes] = []
    for part in parts:
        if isinstance(part, str):
            text = part.encode()
            packed += (struct.pack("<I", len(text)), text)
        else:
            packed.append(struct.pack("<i" if part < 0 else "<I", part))
    return b"".join(packed)


def _dtype(fields: list[tuple[str, str]], cars: int) -> npt.DTypeLike:
    layout: list[tuple[str, str] | tuple[str, str, tuple[int]]] = [("tick", "<u4"), ("time", "<f8")]
    for name, kind in fields:
        layout += [(f"{name}_length", "<u4"), (name, kind, (cars,))]
    return np.dtype(layout)
