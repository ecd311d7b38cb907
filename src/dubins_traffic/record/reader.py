"""Reads records, whole or cut off at any byte, and feeds them to sinks again."""

from __future__ import annotations

import struct
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from io import BytesIO
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
from mcap.data_stream import ReadDataStream
from mcap.exceptions import McapError
from mcap.opcode import Opcode
from mcap.records import Channel, Chunk, McapRecord, Message
from mcap.stream_reader import breakup_chunk
from mcap.writer import MCAP0_MAGIC

from dubins_traffic.cars.state import Contact, Event, Frames
from dubins_traffic.display import Pictured
from dubins_traffic.errors import RecordError
from dubins_traffic.problem.instance import Instance
from dubins_traffic.record import header, schema, wall
from dubins_traffic.record.header import Header
from dubins_traffic.record.sink import End, Ending, Sink

_DAMAGE = (struct.error, ValueError, McapError, RuntimeError, OverflowError, MemoryError)


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
    try:
        data = Path(path).read_bytes()
    except OSError as error:
        problem = f"can't be read: {error.strerror}"
        raise RecordError(problem, file=str(path), expected="a record, NAME.mcap") from error
    record = from_bytes(data, file=str(path))
    return replace(record, wall=wall.read(path))


def from_bytes(data: bytes, file: str | None = None) -> Record:
    """Read a record from the bytes of its file; see `read`. `file` is the name that errors mention."""
    messages = _chunks(data, file)
    first = next(messages, None)
    if not first:
        raise RecordError("cut off before its first frame", file=file, expected="a record, NAME.mcap")
    topic, message = first[0]
    if topic != schema.HEADER:
        raise RecordError("not a record of a trial", file=file, expected=f"an MCAP file with {schema.HEADER}")
    head = header.decode(message, file)
    try:
        return _assemble(head, messages, file)
    except (struct.error, ValueError) as error:
        raise RecordError(f"damaged record ({error})", file=file) from error


def replay(record: Record, sinks: Sequence[Sink]) -> None:
    """Feed a record to `sinks` in the blocks in which the trial did; without an ending, `end` is not called."""
    for sink in sinks:
        sink.begin(record.instance)
    for block in record.blocks:
        for sink in sinks:
            sink.frames(block)
    if record.ending is not None:
        for sink in sinks:
            sink.end(record.ending)


def _chunks(data: bytes, file: str | None) -> Iterator[list[tuple[str, bytes]]]:
    """Yield (topic, message) of each whole chunk in order; stop where the file was cut off."""
    if not data.startswith(MCAP0_MAGIC):
        raise RecordError("not a record", file=file, expected="an MCAP file, NAME.mcap")
    topics: dict[int, str] = {}
    damaged = False
    for body in _bodies(data, Opcode.CHUNK):
        if damaged:
            raise RecordError("damaged record", file=file, expected="chunks that match their checksums")
        try:
            parts = breakup_chunk(Chunk.read(ReadDataStream(BytesIO(body))), validate_crc=True)
        except _DAMAGE:
            damaged = True  # the last chunk of a file that was cut off may be torn; any other may not
            continue
        yield _messages(parts, topics)


def _bodies(data: bytes, opcode: Opcode) -> Iterator[bytes]:
    """Yield the content of every whole MCAP record of one kind in the data section."""
    at = len(MCAP0_MAGIC)
    while at + 9 <= len(data):
        kind, length = struct.unpack_from("<BQ", data, at)
        at += 9
        if at + length > len(data) or kind == Opcode.DATA_END:
            return
        if kind == opcode:
            yield data[at : at + length]
        at += length


def _messages(parts: Sequence[McapRecord], topics: dict[int, str]) -> list[tuple[str, bytes]]:
    found: list[tuple[str, bytes]] = []
    for part in parts:
        if isinstance(part, Channel):
            topics[part.id] = part.topic
        elif isinstance(part, Message):
            found.append((topics.get(part.channel_id, ""), part.data))
    return found


def _assemble(head: Header, chunks: Iterator[list[tuple[str, bytes]]], file: str | None) -> Record:
    blocks: list[_Block] = []
    ending: Ending | None = None
    for messages in chunks:
        by_topic: dict[str, list[bytes]] = {}
        for topic, message in messages:
            by_topic.setdefault(topic, []).append(message)
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
    rows = _rows([data for block in blocks for data in block.frames], schema.frame_dtype(cars))
    labels = _rows([data for block in blocks for data in block.labels], schema.labels_dtype(cars))
    if not np.array_equal(rows["tick"], np.arange(len(rows))):
        raise ValueError("frames are missing")
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


def _rows(messages: Sequence[bytes], layout: npt.DTypeLike) -> np.ndarray:
    size = np.dtype(layout).itemsize
    if any(len(message) != size for message in messages):
        raise ValueError(f"a message is not {size} bytes long")
    return np.frombuffer(b"".join(messages), dtype=layout)


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
    detail, _ = _string(data, at + 4)
    return Event(tick, kind, car, detail)


def _ending(data: bytes) -> Ending:
    end, at = _string(data, 0)
    (ticks,) = struct.unpack_from("<I", data, at)
    detail, _ = _string(data, at + 4)
    return Ending(End(end), ticks, detail)


def _string(data: bytes, at: int) -> tuple[str, int]:
    (length,) = struct.unpack_from("<I", data, at)
    end = at + 4 + length
    return data[at + 4 : end].decode(), end
