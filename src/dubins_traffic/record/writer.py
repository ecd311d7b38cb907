"""Writes a trial to an MCAP file while it runs."""

from __future__ import annotations

import json
import shutil
from collections.abc import Generator
from contextlib import contextmanager
from copy import copy
from pathlib import Path
from typing import BinaryIO

import numpy as np

from dubins_traffic.cars.state import Contact, Event, Frames
from dubins_traffic.errors import InputError
from dubins_traffic.files import require_output
from dubins_traffic.problem.instance import Instance
from dubins_traffic.record import header, schema, wall
from dubins_traffic.record.mcap_file import McapFile, Message
from dubins_traffic.record.sink import Ending

SUFFIX = ".mcap"
"""How names of records end."""


class RecordEncoder:
    """A sink that encodes the record of one trial into a stream, a chunk for each block.

    Parameters
    ----------
    stream : binary stream
        Where the record goes; it stays open.
    head : bytes
        The message on ``/trial``, made by `record.header.encode`.
    """

    def __init__(self, stream: BinaryIO, head: bytes) -> None:
        self._stream = stream
        self._head = head

    def begin(self, instance: Instance) -> None:
        """Write the header, alone in the first chunk."""
        self._cars = len(instance.names)
        self._rate = instance.problem.rate
        self._mcap = McapFile(self._stream, library=f"dubins-traffic record {schema.VERSION}")
        description = json.dumps(schema.header_schema()).encode()
        form = (schema.HEADER_NAME, "jsonschema", description)
        self._channel = {schema.HEADER: self._mcap.register(schema.HEADER, "json", form)}
        for topic, (name, definition) in schema.MESSAGES.items():
            form = (name, "ros1msg", definition.encode())
            self._channel[topic] = self._mcap.register(topic, "ros1", form)
        self._chunk({schema.HEADER: [Message(0, 0, self._head)]})

    def fork(self, stream: BinaryIO) -> RecordEncoder:
        """Return an independent encoder of the same record; `stream` holds a copy of it up to here."""
        twin = copy(self)
        twin._stream, twin._mcap = stream, self._mcap.fork(stream)
        return twin

    def frames(self, frames: Frames) -> None:
        """Write a block of frames as one chunk and flush it."""
        self._chunk(
            {
                schema.FRAMES: encode_frames(frames, self._cars),
                schema.LABELS: encode_labels(frames, self._cars),
                schema.CONTACTS: [encode_contact(contact) for contact in frames.contacts],
                schema.EVENTS: [encode_event(event, self._rate) for event in frames.events],
            }
        )

    def end(self, ending: Ending) -> None:
        """Write the end of the trial and the index of the file."""
        message = schema.pack_strings(ending.end.value, ending.ticks, ending.detail)
        self._chunk({schema.END: [Message(schema.log_time(ending.ticks, self._rate), 0, message)]})
        self._mcap.finish()

    def _chunk(self, messages: dict[str, list[Message]]) -> None:
        self._mcap.chunk({self._channel[topic]: group for topic, group in messages.items()})


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

    def begin(self, instance: Instance) -> None:
        """Make the file and write its header.

        Raises
        ------
        InputError
            If the file exists and may not be replaced, or can't be made.
        """
        head = header.encode(instance, self._controller)
        self._file = self._open()
        self._encoder = RecordEncoder(self._file, head)
        with self._written():
            self._encoder.begin(instance)

    def fork(self, path: Path | str, *, overwrite: bool = False) -> RecordWriter:
        """Return an independent writer at `path` of a copy of this record up to here.

        Raises
        ------
        InputError
            If the file exists and may not be replaced, can't be made, or this record can't be read any more.
        """
        twin = RecordWriter(path, controller=self._controller, overwrite=overwrite)
        if twin.path.exists() and self.path.exists() and twin.path.samefile(self.path):
            raise InputError("is the record of the trial that is forked", file=str(path), expected="another file")
        with self._written():
            before = self.path.open("rb")
        with before:
            file = twin._file = twin._open()
            with twin._written():
                shutil.copyfileobj(before, file)
                file.flush()
        twin._encoder = self._encoder.fork(file)
        return twin

    def frames(self, frames: Frames) -> None:
        """Write a block of frames as one chunk and flush it to the file."""
        with self._written():
            self._encoder.frames(frames)

    def end(self, ending: Ending) -> None:
        """Write the end of the trial and the index, and close the file."""
        with self._written():
            self._encoder.end(ending)
        self.close()

    def close(self) -> None:
        """Close the file as it stands; without an end it stays a record that was cut off."""
        file, self._file = self._file, None
        if file is not None:
            with self._written():
                file.close()

    def _open(self) -> BinaryIO:
        require_output(self.path, "a record", (SUFFIX,), overwrite=self._overwrite)
        with self._written():
            file = self.path.open("wb" if self._overwrite else "xb")
            wall.sidecar(self.path).unlink(missing_ok=True)
            return file

    @contextmanager
    def _written(self) -> Generator[None, None, None]:
        """Turn an error of the operating system into an InputError that names the file."""
        try:
            yield
        except FileExistsError as error:
            expected = "a new name, or --overwrite"
            raise InputError("exists already", file=str(self.path), expected=expected) from error
        except OSError as error:
            raise InputError(f"can't be written: {error.strerror}", file=str(self.path)) from error


def record_paths(output: Path, count: int, *, overwrite: bool) -> list[Path]:
    """Return the paths of the records of several trials, `output` and ``-1``, ``-2``, ... of it.

    Raises
    ------
    InputError
        If one of them is refused (`files.require_output`).
    """
    paths = [output, *(output.with_stem(f"{output.stem}-{number}") for number in range(1, count))]
    for path in paths:
        require_output(path, "a record", (SUFFIX,), overwrite=overwrite)
    return paths


def encode_frames(frames: Frames, cars: int) -> list[Message]:
    """Return each frame of a block as a ``dubins_traffic/Frame``."""
    rows = np.empty(len(frames), dtype=schema.frame_dtype(cars))
    for name in schema.FRAME_FIELDS:
        rows[f"{name}_length"] = cars
        rows[name] = getattr(frames, name)
    return _messages(rows, np.arange(frames.first, frames.first + len(frames)), frames.rate)


def encode_labels(frames: Frames, cars: int) -> list[Message]:
    """Return a ``dubins_traffic/Labels`` for the first frame of a block and for each where a label changes."""
    columns = [getattr(frames, name) for name in schema.LABEL_FIELDS]
    changed = np.zeros(len(frames), dtype=bool)
    changed[:1] = True
    for column in columns:
        changed[1:] |= (column[1:] != column[:-1]).any(axis=1)
    at = np.flatnonzero(changed)
    rows = np.empty(len(at), dtype=schema.labels_dtype(cars))
    for name, column in zip(schema.LABEL_FIELDS, columns, strict=True):
        rows[f"{name}_length"] = cars
        rows[name] = column[at]
    return _messages(rows, at + frames.first, frames.rate)


def encode_contact(contact: Contact) -> Message:
    """Return a contact as a ``dubins_traffic/Contact``."""
    c = contact
    point = (c.x, c.y, c.nx, c.ny)
    data = schema.CONTACT.pack(c.tick, c.time, c.car, c.other, *point, *c.closing, *c.moved, *c.at_fault)
    return Message(round(c.time * 1e9), c.tick, data)


def encode_event(event: Event, rate: float) -> Message:
    """Return an event as a ``dubins_traffic/Event``."""
    data = schema.pack_strings(event.tick, event.kind, event.car, event.detail)
    return Message(schema.log_time(event.tick, rate), event.tick, data)


def _messages(rows: np.ndarray, ticks: np.ndarray, rate: float) -> list[Message]:
    """Fill in tick and time of `rows` and return each as a message."""
    rows["tick"] = ticks
    rows["time"] = ticks / rate
    data, size = rows.tobytes(), rows.dtype.itemsize
    starts = range(0, len(data), size)
    return [
        Message(schema.log_time(tick, rate), tick, data[at : at + size])
        for tick, at in zip(ticks.tolist(), starts, strict=True)
    ]
