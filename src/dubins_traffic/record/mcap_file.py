"""Writes an MCAP file one whole chunk at a time.

The writer of the library `mcap` adds messages one by one, which costs more than a tick of the simulation; here a chunk
is put together at once from the library's records. Layout: https://mcap.dev/spec. Chunks are not compressed.
"""

from __future__ import annotations

import struct
import zlib
from collections.abc import Iterable, Mapping, Sequence
from copy import copy
from itertools import accumulate
from typing import BinaryIO, NamedTuple

from mcap.data_stream import RecordBuilder
from mcap.opcode import Opcode
from mcap.records import (
    Channel,
    Chunk,
    ChunkIndex,
    DataEnd,
    Footer,
    Header,
    McapRecord,
    Schema,
    Statistics,
    SummaryOffset,
)
from mcap.writer import MCAP0_MAGIC

_MESSAGE = struct.Struct("<BQHIQQ")
_MESSAGE_FIELDS = 22
_INDEX = struct.Struct("<BQHI")


class Message(NamedTuple):
    """A message: time in nanoseconds, sequence number, content."""

    log_time: int
    sequence: int
    data: bytes


class McapFile:
    """An MCAP file being written to `stream`, which stays open."""

    def __init__(self, stream: BinaryIO, library: str) -> None:
        self._stream = stream
        self._at = 0
        self._schemas: list[Schema] = []
        self._channels: list[Channel] = []
        self._chunks: list[ChunkIndex] = []
        self._counts: dict[int, int] = {}
        self._write(MCAP0_MAGIC, _packed([Header(profile="", library=library)]))

    def fork(self, stream: BinaryIO) -> McapFile:
        """Return an independent file in `stream`, which holds a copy of this file up to here."""
        twin = copy(self)
        twin._stream, twin._chunks, twin._counts = stream, list(self._chunks), dict(self._counts)
        return twin

    def register(self, topic: str, encoding: str, schema: tuple[str, str, bytes]) -> int:
        """Return a channel for messages of one kind, to be called before the first chunk.

        Parameters
        ----------
        topic, encoding : str
            Name of the channel, encoding of its messages.
        schema : (str, str, bytes)
            Name of the kind, encoding of its schema, the schema.
        """
        number = len(self._channels) + 1
        name, schema_encoding, data = schema
        self._schemas.append(Schema(id=number, name=name, encoding=schema_encoding, data=data))
        self._channels.append(Channel(id=number, topic=topic, message_encoding=encoding, metadata={}, schema_id=number))
        return number

    def chunk(self, messages: Mapping[int, Sequence[Message]]) -> None:
        """Write a chunk with the messages of each channel and flush it to the file; nothing without messages."""
        times = [message.log_time for group in messages.values() for message in group]
        if not times:
            return
        known = () if self._chunks else (*self._schemas, *self._channels)
        parts: list[bytes] = [_packed(known)]
        size = len(parts[0])
        indexes: dict[int, bytes] = {}
        for channel, group in messages.items():
            if not group:
                continue
            self._counts[channel] = self._counts.get(channel, 0) + len(group)
            pieces, indexes[channel], size = _messages(channel, group, size)
            parts += pieces
        data = b"".join(parts)
        chunk = Chunk(
            compression="",
            data=data,
            message_start_time=min(times),
            message_end_time=max(times),
            uncompressed_crc=zlib.crc32(data),
            uncompressed_size=size,
        )
        start = self._at
        self._write(_packed([chunk]))
        length = self._at - start
        lengths = [len(index) for index in indexes.values()]
        offsets = accumulate(lengths[:-1], initial=self._at)
        self._chunks.append(
            ChunkIndex(
                chunk_start_offset=start,
                chunk_length=length,
                compression="",
                compressed_size=size,
                uncompressed_size=size,
                message_start_time=chunk.message_start_time,
                message_end_time=chunk.message_end_time,
                message_index_offsets=dict(zip(indexes, offsets, strict=True)),
                message_index_length=sum(lengths),
            )
        )
        self._write(*indexes.values())
        self._stream.flush()

    def finish(self) -> None:
        """Write the index of the file."""
        self._write(_packed([DataEnd(data_section_crc=0)]))
        start = self._at
        parts: list[bytes] = []
        offsets: list[SummaryOffset] = []
        groups: list[tuple[Opcode, Sequence[McapRecord]]] = [
            (Opcode.SCHEMA, self._schemas),
            (Opcode.CHANNEL, self._channels),
            (Opcode.STATISTICS, [self._statistics()]),
            (Opcode.CHUNK_INDEX, self._chunks),
        ]
        at = start
        for kind, records in groups:
            parts.append(_packed(records))
            offsets.append(SummaryOffset(group_opcode=kind, group_start=at, group_length=len(parts[-1])))
            at += len(parts[-1])
        summary = b"".join([*parts, _packed(offsets)])
        footer = struct.pack("<BQQQ", Opcode.FOOTER, 20, start, at)
        checksum = zlib.crc32(footer, zlib.crc32(summary))
        end = Footer(summary_start=start, summary_offset_start=at, summary_crc=checksum)
        self._write(summary, _packed([end]), MCAP0_MAGIC)
        self._stream.flush()

    def _statistics(self) -> Statistics:
        return Statistics(
            attachment_count=0,
            channel_count=len(self._channels),
            channel_message_counts=self._counts,
            chunk_count=len(self._chunks),
            message_count=sum(self._counts.values()),
            message_start_time=min((chunk.message_start_time for chunk in self._chunks), default=0),
            message_end_time=max((chunk.message_end_time for chunk in self._chunks), default=0),
            metadata_count=0,
            schema_count=len(self._schemas),
        )

    def _write(self, *parts: bytes) -> None:
        data = b"".join(parts)
        self._stream.write(data)
        self._at += len(data)


def _messages(channel: int, group: Sequence[Message], at: int) -> tuple[list[bytes], bytes, int]:
    """Return the MCAP records of `group`, their index, and where they end if they begin at `at` in the chunk."""
    pieces: list[bytes] = []
    entries: list[int] = []
    pack, head = _MESSAGE.pack, _MESSAGE.size
    for time, sequence, data in group:
        size = len(data)
        pieces.append(pack(Opcode.MESSAGE, _MESSAGE_FIELDS + size, channel, sequence, time, time))
        pieces.append(data)
        entries.append(time)
        entries.append(at)
        at += head + size
    length = 8 * len(entries)
    index = _INDEX.pack(Opcode.MESSAGE_INDEX, 6 + length, channel, length)
    return pieces, index + struct.pack(f"<{len(entries)}Q", *entries), at


def _packed(records: Iterable[McapRecord]) -> bytes:
    builder = RecordBuilder()
    for record in records:
        record.write(builder)
    return builder.end()
