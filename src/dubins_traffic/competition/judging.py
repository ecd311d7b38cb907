"""Judging: trials of a phase with a submission in the ego's seat, the same at home and on a server."""

from __future__ import annotations

import hashlib
import io
import struct
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import fields
from pathlib import Path
from typing import Any, Final, Literal, cast

import numpy as np
from pydantic import Field

from dubins_traffic.campaign import rows
from dubins_traffic.cars.state import Contact, Frames
from dubins_traffic.competition.competition import Phase
from dubins_traffic.competition.submission import Submission
from dubins_traffic.controllers import registry
from dubins_traffic.errors import DubinsTrafficError, InputError, MissingExtraError
from dubins_traffic.problem.faults import Strict, parse
from dubins_traffic.problem.instance import Instance
from dubins_traffic.protocols import End
from dubins_traffic.record import header
from dubins_traffic.record.sink import Ending
from dubins_traffic.record.writer import RecordEncoder
from dubins_traffic.runs.single import run_trial
from dubins_traffic.sandbox import boxed_controller, owner_of
from dubins_traffic.sandbox.controller import TRUST
from dubins_traffic.scoring.columns import SECOND

Owner = Literal["submission", "platform"]
_OWN_ENDS = (End.DURATION, End.COLLISION)
OWNERS: Final[Mapping[str, Owner]] = {
    **{end.value: owner_of(end) for end in End if end not in _OWN_ENDS},
    rows.FAILED: "platform",
    rows.CRASHED: "platform",
}
"""Whose fault an end is; the others are nobody's."""


_NUMBERS: Final = ("counted_rounds", SECOND, "icra2016", "collisions", "clean")
"""What ranking reads as numbers."""


class Judged(Strict):
    """What came of one trial of a submission, as a value and as a JSON object.

    Attributes
    ----------
    number : int
        Of the trial in its phase.
    row : dict
        The score by columns (`scoring.columns.SCORES`), with ``number``, ``end`` and ``reason``: what ranking reads.
    end : str
        Why the trial ended: a named end, or ``failed`` if it could not be run.
    owner : str or None
        Whose fault the end was: ``submission``, ``platform``, or nobody's.
    log : str
        The tail of what the submission has printed.
    frames : str or None
        SHA-256 of all frames (`FramesHash`); None if it could not be run.
    ran : str or None
        Where the submission ran (`controllers.registry.ran`): boxed, or trusted with the limits that the machine has.
    recorded : bytes or None
        The record, if it was to be remembered; it is no part of the JSON object.
    """

    number: int
    row: dict[str, Any]
    end: str
    owner: Owner | None
    log: str
    frames: str | None
    ran: str | None = None
    recorded: bytes | None = Field(default=None, exclude=True, repr=False)

    @property
    def counts(self) -> bool:
        """Whether it is a result: what ends by the platform's fault is none, and runs again."""
        return self.owner != "platform"

    def to_json(self) -> dict[str, Any]:
        """Return it as a JSON object, without the record."""
        return self.model_dump()

    @staticmethod
    def from_json(document: object, file: str | None = None) -> Judged:
        """Return what `to_json` gave; InputError if it is anything else."""
        found = parse(Judged, document, file=file)
        try:
            found._check_row()
        except InputError as error:
            raise error.within(file=file) from None
        return found

    def _check_row(self) -> None:
        """Refuse a row of another trial, or one that ranking can't read."""
        for name in rows.RESULT:
            if name not in self.row:
                expected = f"the columns {', '.join(rows.RESULT[:6])}, ..."
                raise InputError("a column is missing", field="row", value=name, expected=expected)
        if (self.row["number"], self.row["end"]) != (self.number, self.end):
            expected = "number and end as in the row"
            raise InputError("a row of another trial", field="number", value=self.number, expected=expected)
        for name in _NUMBERS:
            value = self.row[name]
            if not isinstance(value, float | int | None):
                raise InputError(
                    "not a number", field=f"row.{name}", value=value, expected="a number or null"
                )


def judge(
    phase: Phase,
    numbers: Iterable[int],
    submission: Submission,
    *,
    seeds: Mapping[int, int] | None = None,
    trust: bool = False,
    records: Path | None = None,
    remember: bool = False,
) -> Iterator[Judged]:
    """Run trials of a phase with a submission, one after the other, and yield what came of each.

    A trial depends on its number, its seed and the submission alone: neither on other trials nor on their order.

    Parameters
    ----------
    phase : Phase
        Of a competition.
    numbers : iterable of int
        Which of its trials.
    submission : Submission
        Who drives.
    seeds : Mapping, optional
        The seeds by number; left out: those of the phase, which must be known then.
    trust : bool
        Whether the submission may run with fewer limits than asked for, where this machine can't enforce them all.
    records : Path, optional
        A folder for records, ``trial-NUMBER.mcap``, made if missing.
    remember : bool
        Whether results have their records in memory; nothing of them is written then.

    Raises
    ------
    InputError
        If there is no such trial, its seed is secret, or this machine can't hold the submission in its box.
    """
    known = dict(enumerate(phase.seeds())) if seeds is None else seeds
    if records is not None:
        _make(records)
    for number in numbers:
        if number not in known:
            raise InputError("no seed for this trial", field=f"phases.{phase.name}", value=number)
        yield _judged(phase, number, known[number], submission, trust, records, remember)


def _judged(
    phase: Phase,
    number: int,
    seed: int,
    submission: Submission,
    trust: bool,
    records: Path | None,
    remember: bool,
) -> Judged:
    path = None if records is None else records / f"trial-{number:06d}.mcap"
    digest = FramesHash()
    phase.place(number)
    try:
        instance = phase.instance(number, seed)
    except InputError as error:
        return _failed(number, f"it can't be drawn: {error}")
    seat = boxed_controller(str(submission.path), phase.limits, trust=trust)
    name = registry.sandboxed(submission.digest[:12], TRUST if trust else "")
    recorded = io.BytesIO()
    memory = (RecordEncoder(recorded, header.encode(instance, name)),) if remember else ()
    try:
        result = run_trial(
            instance, seat, record=path, overwrite=True, sinks=(digest, *memory), sketch=False, name=name
        )
    except (InputError, MissingExtraError):
        raise
    except DubinsTrafficError as error:
        return _failed(number, str(error))
    row = rows.row(number, result.ending, result.score, {})
    end = result.ending.end.value
    own = {name: _plain(row[name]) for name in rows.RESULT}
    return Judged(
        number=number, row=own, end=end, owner=OWNERS.get(end), log=seat.log_tail, frames=digest.result(),
        ran=registry.ran(name), recorded=recorded.getvalue() or None,
    )  # fmt: skip


def _failed(number: int, reason: str) -> Judged:
    row = rows.failure(number, rows.FAILED, reason)
    own = {name: row[name] for name in rows.RESULT}
    return Judged(number=number, row=own, end=rows.FAILED, owner="platform", log="", frames=None)


def _plain(value: object) -> Any:
    """Return a value of a score as JSON has it."""
    return str(value) if isinstance(value, str) else cast("Any", value)


def _make(folder: Path) -> None:
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise InputError(f"can't hold records ({error.strerror})", file=str(folder)) from None


ARRAYS: Final = tuple(
    own.name for own in fields(Frames) if own.name not in ("first", "rate", "contacts", "events")
)
"""The arrays of a block of frames, (F, N)."""


class FramesHash:
    """A sink that digests poses, commands, propositions and contacts, however the frames are cut into blocks.

    Events are left out: they hold words of drivers. So is how the trial ended, but for its number of frames.
    """

    def begin(self, instance: Instance) -> None:
        """Begin anew."""
        self._arrays = {name: hashlib.sha256() for name in ARRAYS}
        self._contacts = hashlib.sha256()
        self._head = f"{len(instance.names)} cars at {instance.problem.rate!r} Hz"

    def frames(self, frames: Frames) -> None:
        """Take a block of frames."""
        for name, found in self._arrays.items():
            array = getattr(frames, name)
            found.update(np.ascontiguousarray(array, dtype=array.dtype.newbyteorder("<")).tobytes())
        for contact in frames.contacts:
            self._contacts.update(_packed(contact))

    def end(self, ending: Ending) -> None:
        """Nothing is left to do."""

    def result(self) -> str:
        """Return the SHA-256 of all frames so far, as hexadecimal digits."""
        lines = [self._head, *(f"{name} {found.hexdigest()}" for name, found in self._arrays.items())]
        lines.append(f"contacts {self._contacts.hexdigest()}")
        return hashlib.sha256("\n".join(lines).encode()).hexdigest()


def _packed(contact: Contact) -> bytes:
    """Return a contact as bytes: integers of 64 bits, floats, switches; little-endian."""
    whole = (contact.tick, contact.car, contact.other)
    parts = (contact.time, contact.x, contact.y, contact.nx, contact.ny, *contact.closing)
    return struct.pack("<3q7d4?", *whole, *parts, *contact.moved, *contact.at_fault)
