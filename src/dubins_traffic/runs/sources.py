"""Loads what a path holds, told by its content: a road network, a trials configuration, an instance or a record."""

from __future__ import annotations

import os
import sys
from io import BufferedReader

from dubins_traffic.errors import InputError
from dubins_traffic.files import is_stream, read_bytes
from dubins_traffic.problem.configuration import Configuration, find_source
from dubins_traffic.problem.document import instance_from_document
from dubins_traffic.problem.files import (
    MCAP_MAGIC,
    STANDARD_INPUT,
    FileKind,
    detect,
    is_record,
    parse_json,
    source_of,
)
from dubins_traffic.problem.instance import Instance
from dubins_traffic.record import reader
from dubins_traffic.record.reader import Record
from dubins_traffic.roads.formats import registry as formats
from dubins_traffic.roads.formats.registry import MapFormat
from dubins_traffic.roads.network import RoadNetwork

KINDS = "a road network, a trials configuration, a problem instance or a record"


def load(
    source: str | os.PathLike[str],
    *,
    rnd: str | os.PathLike[str] | None = None,
    seed: int = 0,
    map_format: str | MapFormat | None = None,
) -> RoadNetwork | Configuration | Instance | Record:
    """Return what `source` holds, told by its content.

    Parameters
    ----------
    source : path or str
        A file, the name of a shipped configuration, or ``-`` for standard input.
    rnd : path, optional
        A road network description that overrides that of a configuration.
    seed : int
        Seed of what an instance document leaves out and is therefore drawn.
    map_format : str or MapFormat, optional
        A map format that is tried before the registered ones: ``module:Class``, ``path/to/file.py:Class``, or an
        object (docs/extending/map-format.md).

    Raises
    ------
    InputError
        If `source` does not exist, is of no known kind or is wrong, or `rnd` is given with anything other than a
        configuration.
    """
    form = formats.load(map_format) if isinstance(map_format, str) else map_format
    loaded = _load(source, rnd, seed, form)
    if rnd is not None and not isinstance(loaded, Configuration):
        raise InputError(
            "a road network can replace that of a configuration only",
            file=os.fspath(source),
            field="--rnd",
            value=os.fspath(rnd),
            expected="a trials configuration",
        )
    return loaded


def load_record(source: str | os.PathLike[str]) -> Record:
    """Return the record at `source`, a file or ``-`` for standard input.

    Raises
    ------
    RecordError
        If it can't be read or is no record.
    """
    if os.fspath(source) == STANDARD_INPUT:
        return reader.from_bytes(reader.take_bytes(sys.stdin.buffer, STANDARD_INPUT), STANDARD_INPUT)
    return reader.read(os.fspath(source))


def _load(
    source: str | os.PathLike[str],
    rnd: str | os.PathLike[str] | None,
    seed: int,
    map_format: MapFormat | None,
) -> RoadNetwork | Configuration | Instance | Record:
    name = os.fspath(source)
    if _holds_record(source):
        return load_record(source)
    if is_stream(name):
        data = read_bytes(name)
        if data.startswith(MCAP_MAGIC):
            return reader.from_bytes(data, name)
        source_text = source_of(data, name)
    else:
        source_text = find_source(source)
    if map_format is not None and formats.sniffs(map_format, source_text.text):
        return RoadNetwork.from_text(source_text.text, source_text.name, map_format)
    if formats.is_map(source_text.text):
        return RoadNetwork.from_text(source_text.text, source_text.name)
    if source_text.text.lstrip()[:1] not in ("", "{", "["):
        raise InputError("of no known kind", file=source_text.name, value=source_text.text[:20], expected=KINDS)
    document = parse_json(source_text.text, source_text.name)
    try:
        kind = detect(document, source_text.name)
    except InputError:
        if (other := formats.of_other_package(source_text.text)) is None:
            raise
        return RoadNetwork.from_text(source_text.text, source_text.name, other)
    match kind:
        case FileKind.NETWORK:
            return RoadNetwork.from_document(document, source_text.name)
        case FileKind.CONFIGURATION:
            return Configuration.from_document(document, source_text.name, source_text.folder, rnd)
        case FileKind.INSTANCE:
            return instance_from_document(document, source_text.name, seed)
        case _:
            raise InputError(f"holds {kind}", file=source_text.name, expected=KINDS)


def _holds_record(source: str | os.PathLike[str]) -> bool:
    if os.fspath(source) != STANDARD_INPUT:
        return is_record(source)
    stream = sys.stdin.buffer
    return isinstance(stream, BufferedReader) and stream.peek(len(MCAP_MAGIC)).startswith(MCAP_MAGIC)
