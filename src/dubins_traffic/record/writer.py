"""Writes a trial to an MCAP file while it runs."""

from __future__ import annotations

import json
from collections.abc import Iterator
from pathlib import Path
from typing import BinaryIO

import numpy as np
from mcap.writer import CompressionType, Writer

from dubins_traffic.cars.state import Contact, Event, Frames
from dubins_traffic.errors import InputError
from dubins_traffic.problem.instance import Instance
from dubins_traffic.protocols import Ending
from dubins_traffic.record import header, schema, wall

_NEVER_BY_SIZE = 1 << 62


class RecordWriter:
    """A sink that writes the record of one trial.

    The file is written in place: it is readable at any time up to the last block of frames, so a process that is
    killed loses at most one simulated second. Every block is one chunk, closed and flushed as it arrives; chunks
    never close by size or by the wall clock, so equal trials make equal bytes.

    Parameters
    ----------
    path : Path or str
        The file, made when the trial begins.
    controller : str, optional
        Name of the ego's controller, kept in the header.
    overwrite : bool
        Whether an existing file may be replaced.
    """

    def __init__(self, path: Path | str, *, controller: str | None = None, overwrite: bool = False) -> None:
        self.path = Path(path)
        self._controller = controller
        self._overwrite = overwrite
        self._file: BinaryIO | None = None
        self._cars = 0
        self._rate = 1.0
        self._log_time = 0

    def begin(self, instance: Instance) -> None:
        """Make the file and write its header.

        Raises
        ------
        InputError
            If the file exists and may not be replaced, or can't be made.
        """
        message = header.encode(instance, self._controller)
        self._cars = len(instance.names)
        self._rate = instance.problem.rate
        self._file = self._open()
        self._writer = Writer(self._file, chunk_size=_NEVER_BY_SIZE, compression=CompressionType.NONE)
        self._writer.start(profile="", library=f"dubins-traffic record {schema.VERSION}")
        description = json.dumps(schema.header_schema()).encode()
        number = self._writer.register_schema("dubins_traffic/Trial", "jsonschema", description)
        self._channel = {schema.HEADER: self._writer.register_channel(schema.HEADER, "json", number)}
        for topic, (name, definition) in schema.MESSAGES.items():
            number = self._writer.register_schema(name, "ros1msg", definition.encode())
            self._channel[topic] = self._writer.register_channel(topic, "ros1", number)
        self._add(schema.HEADER, 0, message)
        self._writer.flush()

    def frames(self, frames: Frames) -> None:
        """Write a block of frames as one chunk and flush it to the file."""
        ticks = range(frames.first, frames.first + len(frames))
        for tick, message in zip(ticks, encode_frames(frames, self._cars), strict=True):
            self._add(schema.FRAMES, schema.log_time(tick, self._rate), message, tick)
        for tick, message in encode_labels(frames, self._cars):
            self._add(schema.LABELS, schema.log_time(tick, self._rate), message, tick)
        for contact in frames.contacts:
            self._add(schema.CONTACTS, round(contact.time * 1e9), encode_contact(contact), contact.tick)
        for event in frames.events:
            self._add(schema.EVENTS, schema.log_time(event.tick, self._rate), encode_event(event), event.tick)
        self._writer.flush()

    def end(self, ending: Ending) -> None:
        """Write the end of the trial and the index, and close the file."""
        message = schema.pack_strings(ending.end.value, ending.ticks, ending.detail)
        self._add(schema.END, max(self._log_time, schema.log_time(ending.ticks, self._rate)), message)
        self._writer.finish()
        self.close()

    def close(self) -> None:
        """Close the file as it stands; without an end it stays a record that was cut off."""
        if self._file is not None:
            self._file.close()
            self._file = None

    def _open(self) -> BinaryIO:
        try:
            file = self.path.open("wb" if self._overwrite else "xb")
        except FileExistsError as error:
            raise InputError(
                "the file exists", file=str(self.path), expected="a new name, or leave to overwrite"
            ) from error
        except OSError as error:
            raise InputError(f"can't be written: {error.strerror}", file=str(self.path)) from error
        wall.sidecar(self.path).unlink(missing_ok=True)
        return file

    def _add(self, topic: str, log_time: int, message: bytes, sequence: int = 0) -> None:
        self._log_time = max(self._log_time, log_time)
        self._writer.add_message(self._channel[topic], log_time, message, log_time, sequence)


def encode_frames(frames: Frames, cars: int) -> Iterator[bytes]:
    """Yield each frame of a block as a ``dubins_traffic/Frame``."""
    rows = np.empty(len(frames), dtype=schema.frame_dtype(cars))
    rows["tick"] = np.arange(frames.first, frames.first + len(frames))
    rows["time"] = frames.time
    for name in schema.FRAME_FIELDS:
        rows[f"{name}_length"] = cars
        rows[name] = getattr(frames, name)
    return _split(rows)


def encode_labels(frames: Frames, cars: int) -> Iterator[tuple[int, bytes]]:
    """Yield (tick, ``dubins_traffic/Labels``) for the first frame of a block and for each where a label changes."""
    columns = [np.asarray(getattr(frames, name)) for name in schema.LABEL_FIELDS]
    changed = np.zeros(len(frames), dtype=bool)
    changed[:1] = True
    for column in columns:
        changed[1:] |= (column[1:] != column[:-1]).any(axis=1)
    at = np.flatnonzero(changed)
    rows = np.empty(len(at), dtype=schema.labels_dtype(cars))
    rows["tick"] = at + frames.first
    rows["time"] = frames.time[at]
    for name, column in zip(schema.LABEL_FIELDS, columns, strict=True):
        rows[f"{name}_length"] = cars
        rows[name] = column[at]
    return zip((at + frames.first).tolist(), _split(rows), strict=True)


def encode_contact(contact: Contact) -> bytes:
    """Return a contact as a ``dubins_traffic/Contact``."""
    c = contact
    point = (c.x, c.y, c.nx, c.ny)
    return schema.CONTACT.pack(c.tick, c.time, c.car, c.other, *point, *c.closing, *c.moved, *c.at_fault)


def encode_event(event: Event) -> bytes:
    """Return an event as a ``dubins_traffic/Event``."""
    return schema.pack_strings(event.tick, event.kind, event.car, event.detail)


def _split(rows: np.ndarray) -> Iterator[bytes]:
    data, size = rows.tobytes(), rows.dtype.itemsize
    return (data[i : i + size] for i in range(0, len(data), size))
