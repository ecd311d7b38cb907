"""Reads the chunks of a record's file, whole or cut off; tells damage from a missing end.

A file that ends with a footer and the closing magic has been finished: then its summary must match its checksum, the
index in it must name the very chunks that are there, and every length must lead from one MCAP record to the next.
Any other file has been cut off: it is read up to its last whole chunk.
"""

from __future__ import annotations

import struct
import zlib
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Final, NamedTuple

from mcap.opcode import Opcode
from mcap.writer import MCAP0_MAGIC

from dubins_traffic.errors import RecordError

_HEAD = struct.Struct("<BQ")
_CHUNK = struct.Struct("<QQQII")
_MESSAGE = struct.Struct("<HIQQ")
_FOOTER = struct.Struct("<BQQQI")
_INDEX = struct.Struct("<QQQQ")
_SIZE = struct.Struct("<Q")
_CHECKED_BEFORE: Final = len(MCAP0_MAGIC) + 4
"""Bytes at the end of a finished file that its checksum does not cover: the checksum itself and the magic."""
_BESIDE: Final = (Opcode.MESSAGE_INDEX, Opcode.ATTACHMENT, Opcode.METADATA)
"""MCAP records that may stand beside chunks in the data section; other programs add the last two."""


class Entry(NamedTuple):
    """A message as it stands in a chunk."""

    topic: str
    data: bytes
    log_time: int
    publish_time: int
    sequence: int


@dataclass(frozen=True, slots=True)
class WholeChunk:
    """A whole chunk: its number from 0, the bytes of the file that it takes, and its messages in their order."""

    number: int
    first: int
    end: int
    messages: tuple[Entry, ...]


@dataclass(frozen=True, slots=True)
class _Footer:
    summary: int
    spans: tuple[tuple[int, int], ...]


class _DamageError(Exception):
    """The content of a chunk is damaged; the message says how."""


def is_finished(data: bytes) -> bool:
    """Tell whether the file ends as a finished one does, with a footer and the closing magic."""
    at = len(data) - len(MCAP0_MAGIC) - _FOOTER.size
    if at < len(MCAP0_MAGIC) or not data.endswith(MCAP0_MAGIC):
        return False
    return data[at : at + _HEAD.size] == _HEAD.pack(Opcode.FOOTER, _FOOTER.size - _HEAD.size)


def pieces(data: bytes, file: str | None = None) -> Iterator[WholeChunk]:
    """Yield the whole chunks of a record's file, in order.

    Raises
    ------
    RecordError
        If it is no MCAP file, or is damaged; names the byte.
    """
    if not data.startswith(MCAP0_MAGIC):
        raise RecordError("not a record", file=file, expected="an MCAP file, NAME.mcap")
    footer = _footer(data, file)
    topics: dict[int, str] = {}
    torn: RecordError | None = None
    spans: list[tuple[int, int]] = []
    for kind, first, end in _walk(data, footer, file):
        if kind != Opcode.CHUNK:
            continue
        if torn is not None:
            raise torn
        spans.append((first, end - first))
        try:
            messages = _content(data[first + _HEAD.size : end], topics)
        except (_DamageError, UnicodeDecodeError, struct.error) as error:
            torn = _damaged(file, f"chunk {len(spans) - 1}, from byte {first} on", str(error))
            if footer is not None:
                raise torn from None
            continue  # the last chunk of a file that was cut off may be torn; any other may not
        yield WholeChunk(len(spans) - 1, first, end, messages)
    if footer is not None and footer.spans != tuple(spans):
        raise _damaged(file, None, "the index at its end names other chunks than there are")


def _damaged(file: str | None, place: str | None, why: str) -> RecordError:
    return RecordError(f"damaged record ({why})", file=file, field=place, expected="a record as it was written")


def _footer(data: bytes, file: str | None) -> _Footer | None:
    """Return the footer of a finished file, None for a file that was cut off."""
    if not is_finished(data):
        return None
    at = len(data) - len(MCAP0_MAGIC) - _FOOTER.size
    _, _, summary, _, checksum = _FOOTER.unpack_from(data, at)
    if not len(MCAP0_MAGIC) <= summary <= at:
        raise _damaged(file, f"byte {at}", "its footer points elsewhere")
    if zlib.crc32(data[summary : len(data) - _CHECKED_BEFORE]) != checksum:
        raise _damaged(file, f"from byte {summary} on", "its summary does not match its checksum")
    spans: list[tuple[int, int]] = []
    while summary < at:
        kind, length = _HEAD.unpack_from(data, summary)
        if kind == Opcode.CHUNK_INDEX and length >= _INDEX.size:
            _, _, first, size = _INDEX.unpack_from(data, summary + _HEAD.size)
            spans.append((first, size))
        summary += _HEAD.size + length
    return _Footer(_FOOTER.unpack_from(data, at)[2], tuple(spans))


def _walk(data: bytes, footer: _Footer | None, file: str | None) -> Iterator[tuple[int, int, int]]:
    """Yield opcode, first byte and end of each MCAP record of the data section, its end left out."""
    at = len(MCAP0_MAGIC)
    end = len(data) if footer is None else footer.summary
    while at < end:
        first = at
        torn = at + _HEAD.size > end
        kind, length = (0, 0) if torn else _HEAD.unpack_from(data, at)
        at += _HEAD.size + length
        if torn or at > end:
            _check_torn(data, first, footer, file)
            return
        if kind == Opcode.DATA_END:
            if footer is not None and at != end:
                raise _damaged(file, f"byte {first}", "the data end before the summary begins")
            return
        if not _is_sound(data, kind, first, length):
            if footer is None and not any(data[first:]):
                return  # a file system that lost power leaves zeros
            raise _damaged(file, f"byte {first}", "neither a chunk nor what stands beside one")
        yield kind, first, at
    if footer is not None:
        raise _damaged(file, f"byte {end}", "the data have no end")


def _is_sound(data: bytes, kind: int, first: int, length: int) -> bool:
    """Tell whether an MCAP record at `first` may stand in the data section, and its lengths agree."""
    if kind == Opcode.HEADER:
        return first == len(MCAP0_MAGIC)
    if kind == Opcode.CHUNK:
        return _fits(data, first, length)
    if kind == Opcode.MESSAGE_INDEX:
        return length >= 6 and struct.unpack_from("<I", data, first + _HEAD.size + 2)[0] == length - 6
    return kind in _BESIDE


def _fits(data: bytes, first: int, length: int) -> bool:
    """Tell whether the lengths inside a chunk, as far as the data go, agree with its own, `length`."""
    at = first + _HEAD.size
    if at + _CHUNK.size > len(data):
        return True
    _, _, size, _, name = _CHUNK.unpack_from(data, at)
    at += _CHUNK.size + name
    inner = length - _CHUNK.size - name - _SIZE.size
    if name > 16 or inner < 0:
        return False
    if at + _SIZE.size > len(data):
        return True
    return _SIZE.unpack_from(data, at)[0] == inner and (name > 0 or size == inner)


def _check_torn(data: bytes, first: int, footer: _Footer | None, file: str | None) -> None:
    """Refuse an MCAP record that ends after the end of the data, unless the file was cut off in it."""
    if footer is not None:
        raise _damaged(file, f"byte {first}", "a length that leads past the end of the data")
    if first + _HEAD.size > len(data):
        return
    kind, length = _HEAD.unpack_from(data, first)
    known = kind in (Opcode.HEADER, Opcode.CHUNK, Opcode.DATA_END, *_BESIDE)
    if known and kind == Opcode.CHUNK:
        known = _fits(data, first, length)
    elif known and kind == Opcode.MESSAGE_INDEX and first + _HEAD.size + 6 <= len(data):
        known = struct.unpack_from("<I", data, first + _HEAD.size + 2)[0] == length - 6
    if not known:
        raise _damaged(file, f"byte {first}", "a length that can't be right")


def _content(body: bytes, topics: dict[int, str]) -> tuple[Entry, ...]:
    """Return the messages of a chunk; `topics` holds the names of channels by their numbers, and grows."""
    _, _, size, checksum, name = _CHUNK.unpack_from(body)
    if name:
        raise _DamageError("a compressed chunk, and records are not compressed")
    data = body[_CHUNK.size + _SIZE.size :]
    if len(data) != size or zlib.crc32(data) != checksum:
        raise _DamageError("it does not match its checksum")
    entries: list[Entry] = []
    at = 0
    while at < size:
        if at + _HEAD.size > size:
            raise _DamageError("its last message is not whole")
        kind, length = _HEAD.unpack_from(data, at)
        at += _HEAD.size
        if at + length > size:
            raise _DamageError("a message is longer than its chunk")
        if kind == Opcode.MESSAGE:
            channel, sequence, log_time, publish_time = _MESSAGE.unpack_from(data, at)
            content = data[at + _MESSAGE.size : at + length]
            entries.append(Entry(topics.get(channel, ""), content, log_time, publish_time, sequence))
        elif kind == Opcode.CHANNEL:
            number, _, text = struct.unpack_from("<HHI", data, at)
            topics[number] = data[at + 8 : at + 8 + text].decode()
        at += length
    return tuple(entries)
