"""Records altered as somebody who knows the format would: all checksums, counts and indexes are right again."""

from __future__ import annotations

import json
import struct
from collections.abc import Callable
from io import BytesIO
from typing import Any

import numpy as np

from dubins_traffic.record import schema
from dubins_traffic.record.chunks import Entry, pieces
from dubins_traffic.record.mcap_file import McapFile, Message

Chunks = list[list[Entry]]


def rebuilt(data: bytes, change: Callable[[Chunks], object], *, finish: bool = True) -> bytes:
    """Return the file whose chunks hold what `change` has made of them."""
    chunks: Chunks = [list(piece.messages) for piece in pieces(data)]
    change(chunks)
    stream = BytesIO()
    file = McapFile(stream, library=f"dubins-traffic record {schema.VERSION}")
    form = (schema.HEADER_NAME, "jsonschema", json.dumps(schema.header_schema()).encode())
    channels = {schema.HEADER: file.register(schema.HEADER, "json", form)}
    for topic, (name, definition) in schema.MESSAGES.items():
        channels[topic] = file.register(topic, "ros1", (name, "ros1msg", definition.encode()))
    for chunk in chunks:
        groups: dict[int, list[Message]] = {number: [] for number in channels.values()}
        for entry in chunk:
            groups[channels[entry.topic]].append(Message(entry.log_time, entry.sequence, entry.data))
        file.chunk(groups)
    if finish:
        file.finish()
    return stream.getvalue()


def find(chunks: Chunks, topic: str, nth: int = 0) -> tuple[int, int]:
    """Return chunk and place of the nth message on a topic."""
    places = [(m, k) for m, chunk in enumerate(chunks) for k, entry in enumerate(chunk) if entry.topic == topic]
    return places[nth]


def edit(chunks: Chunks, topic: str, nth: int, change: Callable[[bytes], bytes]) -> None:
    """Change the content of the nth message on a topic."""
    m, k = find(chunks, topic, nth)
    chunks[m][k] = chunks[m][k]._replace(data=change(chunks[m][k].data))


def put(topic: str, nth: int, name: str, car: int, value: Any, cars: int) -> Callable[[Chunks], None]:
    """Return a change of one number of a frame or of labels."""
    layout = schema.frame_dtype(cars) if topic == schema.FRAMES else schema.labels_dtype(cars)

    def change(data: bytes) -> bytes:
        row = np.frombuffer(data, dtype=layout).copy()
        if name == "time":
            row["time"] = value
        else:
            row[name][0, car] = value(row[name][0, car]) if callable(value) else value
        return row.tobytes()

    return lambda chunks: edit(chunks, topic, nth, change)


def heading(change: Callable[[dict[str, Any]], object]) -> Callable[[Chunks], None]:
    """Return a change of the header."""

    def changed(data: bytes) -> bytes:
        document = json.loads(data)
        change(document)
        return json.dumps(document, separators=(",", ":"), ensure_ascii=False).encode()

    return lambda chunks: edit(chunks, schema.HEADER, 0, changed)


def cut(frames: int, end: str | None, ticks: int | None = None) -> Callable[[Chunks], None]:
    """Return a change that keeps so many frames and puts another end after them."""

    def change(chunks: Chunks) -> None:
        for m, chunk in enumerate(chunks):
            chunks[m] = [entry for entry in chunk if entry.topic == schema.HEADER or entry.sequence < frames]
            chunks[m] = [entry for entry in chunks[m] if entry.topic != schema.END]
        chunks[:] = [chunk for chunk in chunks if chunk]
        if end is not None:
            last = frames - 1 if ticks is None else ticks
            data = schema.pack_strings(end, last, "")
            chunks.append([Entry(schema.END, data, schema.log_time(last, 30.0), 0, 0)])

    return change


def contact_with(index: int, value: Any) -> Callable[[bytes], bytes]:
    """Return a change of one number of a contact."""

    def change(data: bytes) -> bytes:
        fields = list(schema.CONTACT.unpack(data))
        fields[index] = value(fields[index]) if callable(value) else value
        return schema.CONTACT.pack(*fields)

    return change


def damaged(data: bytes, first: int, noise: bytes) -> bytes:
    """Return the file with other bytes from `first` on."""
    return data[:first] + noise + data[first + len(noise) :]


def length_at(data: bytes, at: int, length: int) -> bytes:
    """Return the file with another length in the MCAP record that begins at `at`."""
    return damaged(data, at + 1, struct.pack("<Q", length))
