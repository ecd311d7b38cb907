"""Judging: trials of a phase with a submission in the ego's seat, the same at home and on a server."""

from __future__ import annotations

import io
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Final, Literal, cast

from pydantic import model_validator

from dubins_traffic.campaign import rows
from dubins_traffic.competition.boxed import boxed
from dubins_traffic.competition.competition import Phase
from dubins_traffic.competition.frames_hash import FramesHash
from dubins_traffic.competition.submission import Submission
from dubins_traffic.controllers import registry
from dubins_traffic.errors import DubinsTrafficError, InputError, MissingExtraError
from dubins_traffic.problem.faults import Strict, fault, parse
from dubins_traffic.protocols import End
from dubins_traffic.record import header
from dubins_traffic.record.writer import RecordEncoder
from dubins_traffic.runs.single import run_trial
from dubins_traffic.sandbox import owner_of
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


@dataclass(frozen=True, slots=True)
class Judged:
    """What came of one trial of a submission.

    Attributes
    ----------
    number : int
        Of the trial in its phase.
    row : Mapping
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
        The record, if it was to be remembered.
    """

    number: int
    row: Mapping[str, Any]
    end: str
    owner: Owner | None = None
    log: str = ""
    frames: str | None = None
    ran: str | None = None
    recorded: bytes | None = field(default=None, compare=False, repr=False)

    @property
    def counts(self) -> bool:
        """Whether it is a result: what ends by the platform's fault is none, and runs again."""
        return self.owner != "platform"

    def to_json(self) -> dict[str, Any]:
        """Return it as a JSON object, without the record."""
        return {
            "number": self.number,
            "row": dict(self.row),
            "end": self.end,
            "owner": self.owner,
            "log": self.log,
            "frames": self.frames,
            "ran": self.ran,
        }

    @staticmethod
    def from_json(document: object, file: str | None = None) -> Judged:
        """Return what `to_json` gave; InputError if it is anything else."""
        return Judged(**parse(_Judged, document, file=file).model_dump())


class _Judged(Strict):
    number: int
    row: dict[str, Any]
    end: str
    owner: Owner | None
    log: str
    frames: str | None
    ran: str | None = None

    @model_validator(mode="after")
    def _whole(self) -> _Judged:
        lacking = [name for name in rows.RESULT if name not in self.row]
        if lacking:
            raise fault(
                "a column is missing", f"the columns {', '.join(rows.RESULT[:6])}, ...", "row", lacking[0]
            )
        if (self.row["number"], self.row["end"]) != (self.number, self.end):
            raise fault("a row of another trial", "number and end as in the row", "number", self.number)
        for name in _NUMBERS:
            if not isinstance(self.row[name], float | int | None):
                raise fault("not a number", "a number or null", f"row.{name}", self.row[name])
        return self


_NUMBERS: Final = ("counted_rounds", SECOND, "icra2016", "collisions", "clean")
"""What ranking reads as numbers."""


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
    seat = boxed(submission, phase.limits, trust=trust)
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
    log, frames, kept = seat.log_tail, digest.result(), recorded.getvalue() or None
    return Judged(number, own, end, OWNERS.get(end), log, frames, registry.ran(name), kept)


def _failed(number: int, reason: str) -> Judged:
    row = rows.failure(number, rows.FAILED, reason)
    return Judged(number, {name: row[name] for name in rows.RESULT}, rows.FAILED, "platform")


def _plain(value: object) -> Any:
    """Return a value of a score as JSON has it."""
    return str(value) if isinstance(value, str) else cast("Any", value)


def _make(folder: Path) -> None:
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise InputError(f"can't hold records ({error.strerror})", file=str(folder)) from None
