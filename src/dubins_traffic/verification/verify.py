"""Verifies records: whether the frames in a record are those that its instance and commands lead to."""

from __future__ import annotations

import os
import sys
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

from dubins_traffic.errors import InputError, RecordError
from dubins_traffic.problem.instance import Instance
from dubins_traffic.problem.kinds import REMOTE
from dubins_traffic.record import header, reader
from dubins_traffic.record.chunks import pieces
from dubins_traffic.record.reader import Record
from dubins_traffic.verification.again import trial_difference
from dubins_traffic.verification.elsewhere import world_difference
from dubins_traffic.verification.likeness import header_difference, instance_difference, score_difference
from dubins_traffic.verification.result import OURS, Difference, Verification
from dubins_traffic.verification.sheet import sheet_beside
from dubins_traffic.verification.written import encoded, written_difference

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
    path, own = beside
    return replace(_verified(reader.from_bytes(data, name), data, instance, own), sheet=str(path))


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
    found = other or header_difference(head, record) or _earlier(record)
    return found or written_difference(data, head, record)


def _earlier(record: Record) -> Difference | None:
    """Return the earlier of two differences: from the bounds of another world, or from simulating again."""
    found = [
        None if record.instance.simulator == OURS else world_difference(record),
        trial_difference(record),
    ]
    return min((one for one in found if one is not None), key=lambda one: one.tick or 0, default=None)


def _unchecked(record: Record) -> tuple[str, ...]:
    """Return what is taken from the record unchecked."""
    remote = [agent.name for agent in record.instance.e_agents if agent.kind == REMOTE]
    taken = ["commands of the ego", *(f"commands of {name}" for name in remote)]
    taken.append("what the controller reported")
    if record.instance.simulator != OURS:
        taken.append(f"poses within the bounds: the world is {record.instance.simulator}")
    return (*taken, "the controller's name and the versions", "the sidecar")
