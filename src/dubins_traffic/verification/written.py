"""Checks that a record's file has exactly the bytes that this package writes for its frames."""

from __future__ import annotations

import struct
from io import BytesIO
from itertools import zip_longest

from dubins_traffic.record import header, schema
from dubins_traffic.record.chunks import Entry, Piece, is_finished, pieces
from dubins_traffic.record.reader import Record
from dubins_traffic.record.writer import RecordEncoder
from dubins_traffic.verification.result import Difference


def encoded(record: Record, head: bytes | None = None) -> bytes:
    """Return the file that writes what `record` holds after the header `head`, by default its own written anew."""
    stream = BytesIO()
    encoder = RecordEncoder(
        stream, head or header.encode(record.instance, record.controller, record.versions)
    )
    encoder.begin(record.instance)
    for block in record.blocks:
        encoder.frames(block)
    if record.ending is not None:
        encoder.end(record.ending)
    return stream.getvalue()


def written_difference(data: bytes, head: bytes, record: Record) -> Difference | None:
    """Return where the bytes of a record's file are not those that it is written with after its header `head`.

    A file that was cut off is compared as far as its last whole chunk.
    """
    expected = encoded(record, head)
    if record.ending is None and is_finished(data):
        return Difference("end of the file", "a finished file without an end", "an end, or a file cut off")
    whole = len(expected) if is_finished(data) or len(data) > len(expected) else len(data)
    if data[:whole] == expected[:whole] and (record.ending is None or len(data) <= len(expected)):
        return None
    for own, other in zip_longest(pieces(data), pieces(expected)):
        found = _piece_difference(own, other)
        if found is not None:
            return found
    pairs = zip(data, expected, strict=False)
    at = next((k for k, (one, two) in enumerate(pairs) if one != two), min(len(data), len(expected)))
    found, wanted = (file[at : at + 8].hex() or "the end of the file" for file in (data, expected))
    return Difference(f"byte {at} of the file", found, wanted)


def _piece_difference(own: Piece | None, other: Piece | None) -> Difference | None:
    if own is None or other is None:
        number = own.number if own is not None else other.number if other is not None else 0
        found, wanted = ("a chunk" if piece is not None else None for piece in (own, other))
        return Difference(f"chunk {number}", found, wanted)
    for k, (one, two) in enumerate(zip_longest(own.messages, other.messages)):
        if one != two:
            return _message_difference(f"chunk {own.number}, message {k}", one, two)
    return None


def _message_difference(place: str, one: Entry | None, two: Entry | None) -> Difference:
    if one is None or two is None or one.topic != two.topic:
        found, wanted = ("a message on " + each.topic if each is not None else None for each in (one, two))
        return Difference(place, found, wanted)
    place = f"{place} on {one.topic}"
    for name in ("sequence", "log_time", "publish_time"):
        recorded, expected = getattr(one, name), getattr(two, name)
        if recorded != expected:
            return Difference(f"{name} of {place}", recorded, expected)
    if one.topic in (schema.FRAMES, schema.LABELS) and len(one.data) == len(two.data):
        recorded, expected = (struct.unpack_from("<d", entry.data, 4)[0] for entry in (one, two))
        if recorded != expected:
            return Difference(f"time of {place}", recorded, expected)
    return Difference(place, one.data.hex()[:64], two.data.hex()[:64])
