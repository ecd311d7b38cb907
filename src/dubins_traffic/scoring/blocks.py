"""Blocks of frames put together, since metrics cost less on few long blocks than on many short ones."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from dubins_traffic.cars.state import Frames

_ARRAYS = (
    "x",
    "y",
    "c",
    "s",
    "speed",
    "yaw_rate",
    "command_speed",
    "command_yaw_rate",
    "segment",
    "at",
    "crosses",
    "lane",
    "bits",
)


def joined(blocks: Sequence[Frames]) -> Frames:
    """Return consecutive blocks of one trial, at least one, as one block."""
    first = blocks[0]
    if len(blocks) == 1:
        return first
    arrays: dict[str, Any] = {
        name: np.concatenate([getattr(block, name) for block in blocks]) for name in _ARRAYS
    }
    contacts = tuple(contact for block in blocks for contact in block.contacts)
    events = tuple(event for block in blocks for event in block.events)
    return Frames(first.first, first.rate, **arrays, contacts=contacts, events=events)
