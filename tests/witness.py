"""A metric that tells all that a metric can see, so that two runs of a trial can be compared to the bit."""

from __future__ import annotations

import hashlib
from collections.abc import Mapping
from typing import Any

import dubins_traffic as dt

ARRAYS = (
    "x", "y", "c", "s", "speed", "yaw_rate", "command_speed", "command_yaw_rate",
    "segment", "at", "crosses", "lane", "bits",
)  # fmt: skip


class Witness:
    """Hash of the blocks, their arrays, contacts, events and the ending; how many blocks there were, and events."""

    columns = (
        dt.Column("witness", "hash of all that was seen", kind="string"),
        dt.Column("witness_blocks", "blocks", kind="int64"),
        dt.Column("witness_events", "events", kind="int32", rare=True),
        dt.Column("witness_sum", "sum of the speeds", "m/s"),
        dt.Column("witness_ended", "ended", kind="bool", bounded=True),
    )

    def begin(self, instance: Any) -> None:
        """Start with the instance."""
        self._hash = hashlib.sha256(repr((instance.trial, instance.names)).encode())
        self._size = max(1, int(instance.problem.rate))
        self._sum, self._blocks, self._events, self._ended = 0.0, 0, 0, None

    def frames(self, frames: Any) -> None:
        """Take all of a block, and check that it is one of a second."""
        assert frames.first == self._blocks * self._size
        assert len(frames) <= self._size
        for name in ARRAYS:
            array = getattr(frames, name)
            assert array.flags.c_contiguous
            assert not array.flags.writeable
            self._hash.update(name.encode() + str(array.dtype).encode() + array.tobytes())
        self._hash.update(repr((frames.first, frames.rate, frames.contacts, frames.events)).encode())
        self._sum += float(frames.speed.sum())
        self._events += len(frames.events)
        self._blocks += 1

    def end(self, ending: Any) -> None:
        """Take the ending, but its detail: that of a controller that is closed is added to later."""
        self._hash.update(repr((ending.end, ending.ticks)).encode())
        self._ended = True

    def result(self) -> Mapping[str, Any]:
        """Return all of it."""
        told = (self._hash.hexdigest(), self._blocks, self._events, self._sum, self._ended)
        return {column.name: value for column, value in zip(self.columns, told, strict=True)}
