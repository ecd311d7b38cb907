"""A digest of all that happened in a trial: equal digests mean equal frames, to the bit."""

from __future__ import annotations

import hashlib
import struct
from dataclasses import fields
from typing import Final

import numpy as np

from dubins_traffic.cars.state import Contact, Frames
from dubins_traffic.problem.instance import Instance
from dubins_traffic.record.sink import Ending

ARRAYS: Final = tuple(
    own.name for own in fields(Frames) if own.name not in ("first", "rate", "contacts", "events")
)
"""The arrays of a block of frames, (F, N)."""


class FramesHash:
    """A sink that digests poses, commands, propositions and contacts, however the frames are cut into blocks.

    Events are left out: they hold words of drivers. So is how the trial ended, but for its number of frames.
    """

    def begin(self, instance: Instance) -> None:
        """Begin anew."""
        self._arrays = {name: hashlib.sha256() for name in ARRAYS}
        self._contacts = hashlib.sha256()
        self._head = f"{len(instance.names)} cars at {instance.problem.rate!r} Hz"

    def frames(self, frames: Frames) -> None:
        """Take a block of frames."""
        for name, found in self._arrays.items():
            array = getattr(frames, name)
            found.update(np.ascontiguousarray(array, dtype=array.dtype.newbyteorder("<")).tobytes())
        for contact in frames.contacts:
            self._contacts.update(_packed(contact))

    def end(self, ending: Ending) -> None:
        """Nothing is left to do."""

    def result(self) -> str:
        """Return the SHA-256 of all frames so far, as hexadecimal digits."""
        lines = [self._head, *(f"{name} {found.hexdigest()}" for name, found in self._arrays.items())]
        lines.append(f"contacts {self._contacts.hexdigest()}")
        return hashlib.sha256("\n".join(lines).encode()).hexdigest()


def _packed(contact: Contact) -> bytes:
    """Return a contact as bytes: integers of 64 bits, floats, switches; little-endian."""
    whole = (contact.tick, contact.car, contact.other)
    parts = (contact.time, contact.x, contact.y, contact.nx, contact.ny, *contact.closing)
    return struct.pack("<3q7d4?", *whole, *parts, *contact.moved, *contact.at_fault)
