"""Joins and cuts blocks of frames: metrics cost less on few long blocks than on many short ones."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
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
    arrays: dict[str, Any] = {name: np.concatenate([getattr(block, name) for block in blocks]) for name in _ARRAYS}
    contacts = tuple(contact for block in blocks for contact in block.contacts)
    events = tuple(event for block in blocks for event in block.events)
    return Frames(first.first, first.rate, **arrays, contacts=contacts, events=events)


class Seconds:
    """Cuts the frames of a trial, whatever blocks they come in, into blocks of ``int(rate)`` frames with their events.

    A block is ready when a later frame has come, since events of its last frame come before that. Its arrays are
    copies in C order that can't be written to.
    """

    def __init__(self, rate: float) -> None:
        self._size = max(1, int(rate))
        self._waiting: list[Frames] = []
        self._count = 0

    def take(self, frames: Frames) -> Iterator[Frames]:
        """Take the next frames; yield the blocks that are ready."""
        self._waiting.append(frames)
        self._count += len(frames)
        if self._count <= self._size:
            return
        whole = joined(self._waiting)
        begin = 0
        while self._count > self._size:
            yield cut(whole, begin, begin + self._size)
            begin += self._size
            self._count -= self._size
        self._waiting = [cut(whole, begin, len(whole))]

    def rest(self) -> Frames | None:
        """Return the remaining frames as a block, None if there are none."""
        waiting, self._waiting, self._count = self._waiting, [], 0
        if not waiting:
            return None
        whole = joined(waiting)
        return cut(whole, 0, len(whole)) if len(whole) or whole.events else None


def cut(frames: Frames, begin: int, end: int) -> Frames:
    """Return the frames from place `begin` up to before `end` of a block, with their contacts and events.

    Events before the block's first frame go to the part with that frame, events after its last to the part with that.
    """
    low = -math.inf if begin == 0 else frames.first + begin
    high = math.inf if end >= len(frames) else frames.first + end
    arrays: dict[str, Any] = {name: np.array(getattr(frames, name)[begin:end], order="C") for name in _ARRAYS}
    for array in arrays.values():
        array.flags.writeable = False
    contacts = tuple(contact for contact in frames.contacts if low <= contact.tick < high)
    events = tuple(event for event in frames.events if low <= event.tick < high)
    return Frames(frames.first + begin, frames.rate, **arrays, contacts=contacts, events=events)
