"""Reads records, whole or cut off at any byte, and hands them to sinks again."""

from __future__ import annotations

import struct
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, BinaryIO, Final

import numpy as np
import numpy.typing as npt
from mcap.writer import MCAP0_MAGIC

from dubins_traffic.cars.state import NONE, Contact, Event, Frames
from dubins_traffic.display import Pictured
from dubins_traffic.errors import RecordError
from dubins_traffic.problem.instance import Instance
from dubins_traffic.record import header, schema, wall
from dubins_traffic.record.chunks import Entry, pieces
from dubins_traffic.record.header import Header
from dubins_traffic.record.sink import End, Ending, Sink

LARGEST: Final = 2**31
"""Most bytes of a record; a longer stream is taken to be endless."""


@dataclass(frozen=True)
class Record(Pictured):
    """All that happened in a trial.

    `frames` is one block of the whole trial; `blocks` are its parts as the trial pushed them. `ending` is None in a
    record that was cut off. `versions` are those of the package and of the encoding libraries that wrote it;
    `wall` is what its sidecar says, None without one; `file` the name it was read from.
    """

    instance: Instance
    frames: Frames
    blocks: tuple[Frames, ...]
    ending: Ending | None
    controller: str | None
    versions: Mapping[str, str]
    wall: wall.Wall | None = None
    file: str | None = None

    def __repr__(self) -> str:
        end = "cut off" if self.ending is None else f"end: {self.ending.end.value}"
        span = max(0, len(self.frames) - 1) / self.frames.rate
        parts = [self.instance.title, self.controller or "no controller named", f"{span:.4g} s", end]
        return f"<Record{f' {self.file}' if self.file else ''}: {', '.join(parts)}>"


@dataclass(frozen=True, slots=True)
class _Block:
    frames: list[bytes]
    labels: list[bytes]
    contacts: tuple[Contact, ...]
    events: tuple[Event, ...]


def read(path: Path | str) -> Record:
    """Read the record at `path` and, if there is one, its sidecar.

    Raises
    ------
    RecordError
        If the file can't be read, is no record, ends before its first frame could have been written, is damaged,
        or is of an unknown version.
    """
    return replace(from_bytes(read_bytes(path), file=str(path)), wall=wall.read(path))


def read_bytes(path: Path | str) -> bytes:
    """Return the bytes of the record at `path`, which is opened and read once: it may be a pipe.

    Raises
    ------
    RecordError
        If the file can't be read, does not begin as a record or does not end.
    """
    try:
        with Path(path).open("rb") as stream:
            return take_bytes(stream, str(path))
    except (OSError, ValueError) as error:
        problem = f"can't be read: {getattr(error, 'strerror', None) or error}"
        raise RecordError(problem, file=str(path), expected="a record, NAME.mcap") from error


def take_bytes(stream: BinaryIO, file: str) -> bytes:
    """Return the bytes of the record in `stream`; the errors are those of `read_bytes`."""
    first = stream.read(len(MCAP0_MAGIC))
    if first != MCAP0_MAGIC:
        raise RecordError("not a record", file=file, expected="an MCAP file, NAME.mcap")
    data = first + stream.read(LARGEST)
    if len(data) > LARGEST:
        raise RecordError("does not end", file=file, expected=f"a record of at most {LARGEST} bytes")
    return data


def from_bytes(data: bytes, file: str | None = None) -> Record:
    """Read a record from the bytes of its file; see `read`. `file` is the name that errors mention."""
    chunks = (piece.messages for piece in pieces(data, file))
    first = next(chunks, None)
    if not first:
        raise RecordError("cut off before its first frame", file=file, expected="a record, NAME.mcap")
    if first[0].topic != schema.HEADER:
        raise RecordError("not a record of a trial", file=file, expected=f"an MCAP file with {schema.HEADER}")
    head = header.decode(first[0].data, file)
    try:
        return _assemble(head, chunks, file)
    except (struct.error, ValueError) as error:
        raise RecordError(f"damaged record ({error})", file=file) from error


def replay(record: Record, sinks: Sequence[Sink]) -> None:
    """Hand a record to `sinks` in the blocks of the trial; `end` is not called if the record has no ending."""
    for sink in sinks:
        sink.begin(record.instance)
    for block in record.blocks:
        for sink in sinks:
            sink.frames(block)
    if record.ending is not None:
        for sink in sinks:
            sink.end(record.ending)


def _assemble(head: Header, chunks: Iterator[Sequence[Entry]], file: str | None) -> Record:
    blocks: list[_Block] = []
    ending: Ending | None = None
    for messages in chunks:
        by_topic: dict[str, list[bytes]] = {}
        for message in messages:
            by_topic.setdefault(message.topic, []).append(message.data)
        if ending is not None:
            raise ValueError("something follows its end")
        if schema.END in by_topic:
            ending = _ending(by_topic[schema.END][0])
        blocks.append(
            _Block(
                by_topic.get(schema.FRAMES, []),
                by_topic.get(schema.LABELS, []),
                tuple(_contact(data) for data in by_topic.get(schema.CONTACTS, [])),
                tuple(_event(data) for data in by_topic.get(schema.EVENTS, [])),
            )
        )
    cars = len(head.instance.names)
    if any(max(c.car, c.other) >= cars or c.car < 0 for block in blocks for c in block.contacts):
        raise ValueError("a contact of an unknown car")
    if any(not NONE <= event.car < cars for block in blocks for event in block.events):
        raise ValueError("an event of an unknown car")
    blocks = [block for block in blocks if block.frames or block.contacts or block.events]
    frames = _frames(head.instance, blocks)
    parts: list[Frames] = []
    first = 0
    for block in blocks:
        parts.append(_part(frames, first, first + len(block.frames), block))
        first += len(block.frames)
    return Record(head.instance, frames, tuple(parts), ending, head.controller, head.versions, None, file)


def _frames(instance: Instance, blocks: Sequence[_Block]) -> Frames:
    cars = len(instance.names)
    rows = _rows([data for block in blocks for data in block.frames], schema.frame_dtype(cars), cars)
    labels = _rows([data for block in blocks for data in block.labels], schema.labels_dtype(cars), cars)
    if not np.array_equal(rows["tick"], np.arange(len(rows))):
        raise ValueError("frames are missing")
    if not all(np.isfinite(rows[name]).all() for name in schema.FRAME_FIELDS):
        raise ValueError("a frame holds what is not finite")
    last = np.searchsorted(labels["tick"], rows["tick"], side="right") - 1
    if len(last) and last[0] < 0:
        raise ValueError("labels are missing")
    columns: dict[str, Any] = {name: rows[name].astype(np.float64) for name in schema.FRAME_FIELDS}
    for name in schema.LABEL_FIELDS:
        columns[name] = labels[name][last].astype(np.uint32 if name == "bits" else np.int64)
    return Frames(
        0,
        instance.problem.rate,
        **columns,
        contacts=tuple(contact for block in blocks for contact in block.contacts),
        events=tuple(event for block in blocks for event in block.events),
    )


def _rows(messages: Sequence[bytes], layout: npt.DTypeLike, cars: int) -> np.ndarray:
    size = np.dtype(layout).itemsize
    if any(len(message) != size for message in messages):
        raise ValueError(f"a message is not {size} bytes long")
    rows = np.frombuffer(b"".join(messages), dtype=layout)
    names = rows.dtype.names or ()
    if any((rows[name] != cars).any() for name in names if name.endswith("_length")):
        raise ValueError(f"a message does not tell of {cars} cars")
    return rows


def _part(frames: Frames, first: int, end: int, block: _Block) -> Frames:
    columns = {name: getattr(frames, name)[first:end] for name in schema.FRAME_FIELDS + schema.LABEL_FIELDS}
    return Frames(first, frames.rate, **columns, contacts=block.contacts, events=block.events)


def _contact(data: bytes) -> Contact:
    tick, time, car, other, x, y, nx, ny, closing, closing2, *flags = schema.CONTACT.unpack(data)
    moved, moved2, fault, fault2 = (bool(flag) for flag in flags)
    pairs = ((closing, closing2), (moved, moved2), (fault, fault2))
    return Contact(tick, time, car, other, x, y, nx, ny, *pairs)


def _event(data: bytes) -> Event:
    (tick,) = struct.unpack_from("<I", data)
    kind, at = _string(data, 4)
    (car,) = struct.unpack_from("<i", data, at)
    detail, end = _string(data, at + 4)
    _check_end(data, end)
    return Event(tick, kind, car, detail)


def _ending(data: bytes) -> Ending:
    name, at = _string(data, 0)
    (ticks,) = struct.unpack_from("<I", data, at)
    detail, end = _string(data, at + 4)
    _check_end(data, end)
    return Ending(End(name), ticks, detail)


def _string(data: bytes, at: int) -> tuple[str, int]:
    (length,) = struct.unpack_from("<I", data, at)
    end = at + 4 + length
    if end > len(data):
        raise ValueError("a text is longer than its message")
    return data[at + 4 : end].decode(), end


def _check_end(data: bytes, end: int) -> None:
    if end != len(data):
        raise ValueError("something follows in a message")
