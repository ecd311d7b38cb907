"""Verifies records: whether the frames in a record are those that its instance and commands lead to.

The header, the instance, the bytes of the file and a score sheet that lies beside it are compared here; frames are
simulated again (`resimulate`), or checked against bounds where the world was another program's (`physics_bounds`).
"""

from __future__ import annotations

import json
import os
import struct
import sys
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from io import BytesIO
from itertools import zip_longest
from pathlib import Path, PurePath
from typing import Any, TypeAlias, cast

from dubins_traffic.errors import InputError, RecordError
from dubins_traffic.files import read_text
from dubins_traffic.problem.document import instance_from_document, instance_to_document
from dubins_traffic.problem.files import parse_json
from dubins_traffic.problem.instance import Instance
from dubins_traffic.problem.kinds import REMOTE
from dubins_traffic.record import header, reader, schema
from dubins_traffic.record.chunks import Entry, WholeChunk, is_finished, pieces
from dubins_traffic.record.reader import Record
from dubins_traffic.record.writer import RecordEncoder
from dubins_traffic.scoring.score import score
from dubins_traffic.verification.physics_bounds import world_difference
from dubins_traffic.verification.resimulate import trial_difference
from dubins_traffic.verification.result import OURS, Difference, Verification


def encoded(record: Record, head: bytes | None = None) -> bytes:
    """Return the file that writes what `record` holds after the header `head`, by default its own written anew."""
    stream = BytesIO()
    encoder = RecordEncoder(stream, head or header.encode(record.instance, record.controller, record.versions))
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
    for recorded, made in zip_longest(pieces(data), pieces(expected)):
        difference = _piece_difference(recorded, made)
        if difference is not None:
            return difference
    pairs = zip(data, expected, strict=False)
    at = next((k for k, (one, two) in enumerate(pairs) if one != two), min(len(data), len(expected)))
    difference, wanted = (file[at : at + 8].hex() or "the end of the file" for file in (data, expected))
    return Difference(f"byte {at} of the file", difference, wanted)


def _piece_difference(recorded: WholeChunk | None, made: WholeChunk | None) -> Difference | None:
    if recorded is None or made is None:
        number = recorded.number if recorded is not None else made.number if made is not None else 0
        given, wanted = ("a chunk" if piece is not None else None for piece in (recorded, made))
        return Difference(f"chunk {number}", given, wanted)
    for k, (one, two) in enumerate(zip_longest(recorded.messages, made.messages)):
        if one != two:
            return _message_difference(f"chunk {recorded.number}, message {k}", one, two)
    return None


def _message_difference(place: str, one: Entry | None, two: Entry | None) -> Difference:
    if one is None or two is None or one.topic != two.topic:
        given, wanted = ("a message on " + each.topic if each is not None else None for each in (one, two))
        return Difference(place, given, wanted)
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


BESIDE = "scores.json"
"""Name of a score sheet that is checked, unasked, with the records in its folder."""
Scores: TypeAlias = Sequence[Mapping[str, Any]]


def read_sheet(file: str) -> Scores:
    """Return the scores in a file; InputError if it can't be read, or is no score sheet."""
    trials = parse_json(read_text(file), file).get("trials")
    if isinstance(trials, list):
        entries = cast("list[Any]", trials)
        if all(isinstance(entry, dict) for entry in entries):
            return cast("list[dict[str, Any]]", entries)
    raise InputError("no scores", file=file, field="trials", expected="what `run --json` prints")


def entry_of(record: str, scores: Scores) -> Mapping[str, Any] | None:
    """Return the score that names the file of a record, None if there is none."""
    name = PurePath(record).name
    return next((one for one in scores if PurePath(str(one.get("record"))).name == name), None)


def sheet_beside(record: Path) -> tuple[Path, Scores] | None:
    """Return the score sheet beside a record, and its scores; None if there is none, or it does not name the record.

    InputError if there is a file of that name that is no score sheet.
    """
    path = record.with_name(BESIDE)
    if not path.is_file():
        return None
    scores = read_sheet(str(path))
    return None if entry_of(record.name, scores) is None else (path, scores)


def header_difference(written: bytes, record: Record) -> Difference | None:
    """Return where the header of `record`, as `written`, differs from the document of its instance.

    The instance may be written in more ways than one: what its document leaves out has its default.
    """
    expected = header.document(record.instance, record.controller, record.versions)
    document = json.loads(written)
    different = unlike("header", {**document, "instance": None}, _as_json({**expected, "instance": None}))
    if different is None and header.as_message(document) != written:
        return Difference("header", "other text", "JSON as it is written, each key once")
    return different


def instance_difference(record: Record, expected: Instance) -> Difference | None:
    """Return the first difference between the instance of `record` and the one that should have been run."""
    same = instance_from_document(instance_to_document(expected))  # with what it leaves out at its default
    documents = [_as_json(instance_to_document(instance)) for instance in (record.instance, same)]
    return unlike("instance", documents[0], documents[1])


def score_difference(record: Record, scores: Sequence[Mapping[str, Any]]) -> Difference | None:
    """Return where the printed score of `record`, the one in `scores` that names its file, differs from its score.

    What was measured on a wall clock is left out, and so are further metrics, which code from elsewhere may compute.
    """
    name = PurePath(record.file or "").name
    printed = entry_of(name, scores)
    if printed is None:
        return Difference("score", None, f"a score of {name}")
    shown_score, expected = dict(printed), _as_json(score(record).to_json())
    shown_score.pop("metrics", None)
    for left_out in ("record", "time_to_begin_s"):
        shown_score[left_out] = expected[left_out] = None
    return unlike("score", shown_score, expected)


def unlike(path: str, recorded: object, expected: object) -> Difference | None:
    """Return the first place in which two JSON values differ; numbers are equal if they are written alike."""
    if isinstance(recorded, dict) and isinstance(expected, dict):
        one, two = cast("dict[str, object]", recorded), cast("dict[str, object]", expected)
        for name in [*two, *(name for name in one if name not in two)]:
            difference = unlike(f"{path}.{name}", one.get(name), two.get(name))
            if difference is not None or (name in one) != (name in two):
                return difference or Difference(f"{path}.{name}", one.get(name), two.get(name))
        return None
    if isinstance(recorded, list) and isinstance(expected, list):
        rows = zip_longest(cast("list[object]", recorded), cast("list[object]", expected))
        return next((difference for k, pair in enumerate(rows) if (difference := unlike(f"{path}[{k}]", *pair))), None)
    if json.dumps(recorded) == json.dumps(expected):
        return None
    return Difference(path, recorded, expected)


def _as_json(document: dict[str, Any]) -> Any:
    return json.loads(json.dumps(document))


STANDARD_INPUT = "-"


def verify(
    record: Record | str | os.PathLike[str],
    *,
    instance: Instance | Callable[[Record], Instance] | None = None,
    scores: Sequence[Mapping[str, Any]] | None = None,
) -> Verification:
    """Run a recorded trial again and compare everything with its record, bit for bit.

    Where the world is ours the trial is simulated again from its instance and its recorded commands, and the e-agents
    that it drives by itself are decided again. Of other worlds it is checked that frames fit the bounds and contacts
    the poses (docs/records.md has the tolerances); labels, faults, commands of e-agents and ends are compared as well.

    Parameters
    ----------
    record : path or Record
        What to verify; of a path (``-``: standard input) also that the file is written as a trial writes it.
    instance : Instance or callable, optional
        The instance that was to be run, or a function that returns it for the record; by default the record's own is
        taken to be it.
    scores : sequence of mapping, optional
        Scores that were printed as JSON (`Score.to_json`); the one that names the record's file must be the record's.
        By default those of a file ``scores.json`` beside a record, if it names the record.

    Raises
    ------
    RecordError
        If the file can't be read as a record.

    Examples
    --------
    >>> verify("out/trial-0000.mcap").verified     # doctest: +SKIP
    True
    """
    if isinstance(record, Record):
        return _verified(record, encoded(record), instance, scores)
    name = os.fspath(record)
    stdin = name == STANDARD_INPUT
    data = reader.take_bytes(sys.stdin.buffer, name) if stdin else reader.read_bytes(Path(name))
    beside = None if stdin or scores is not None else sheet_beside(Path(name))
    if beside is None:
        return _verified(reader.from_bytes(data, name), data, instance, scores)
    path, sheet = beside
    return replace(_verified(reader.from_bytes(data, name), data, instance, sheet), sheet=str(path))


def _verified(
    record: Record,
    data: bytes,
    instance: Instance | Callable[[Record], Instance] | None,
    scores: Sequence[Mapping[str, Any]] | None,
) -> Verification:
    expected = instance(record) if callable(instance) else instance
    try:
        difference = _first_difference(record, data, expected)
        if difference is None and scores is not None:
            difference = score_difference(record, scores)
    except InputError as error:
        raise RecordError(
            f"its instance can't be run ({error.problem})",
            file=record.file,
            field=error.field,
            expected=error.expected,
        ) from error
    return Verification(
        record=record.file,
        difference=difference,
        world=record.instance.simulator,
        ticks=max(0, len(record.frames) - 1),
        cars=len(record.instance.names),
        end=None if record.ending is None else record.ending.end.value,
        written_by=record.versions[header.PACKAGE],
        unchecked=_unchecked(record),
    )


def _first_difference(record: Record, data: bytes, expected: Instance | None) -> Difference | None:
    other = None if expected is None else instance_difference(record, expected)
    head = next(pieces(data)).messages[0].data
    difference = other or header_difference(head, record) or _earlier(record)
    return difference or written_difference(data, head, record)


def _earlier(record: Record) -> Difference | None:
    """Return the earlier of two differences: from the bounds of another world, or from simulating again."""
    differences = [
        None if record.instance.simulator == OURS else world_difference(record),
        trial_difference(record),
    ]
    return min((one for one in differences if one is not None), key=lambda one: one.tick or 0, default=None)


def _unchecked(record: Record) -> tuple[str, ...]:
    """Return what is taken from the record unchecked."""
    remote = [agent.name for agent in record.instance.e_agents if agent.kind == REMOTE]
    taken = ["commands of the ego", *(f"commands of {name}" for name in remote)]
    taken.append("what the controller reported")
    if record.instance.simulator != OURS:
        taken.append(f"poses within the bounds: the world is {record.instance.simulator}")
    return (*taken, "the controller's name and the versions", "the sidecar")
