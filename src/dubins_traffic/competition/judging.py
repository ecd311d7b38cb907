"""Judging: trials of a phase with a submission in the ego's seat, the same at home and on a server.

At home seeds are known, and results are kept as they come, so that an evaluation can go on.

The folder of an evaluation holds ``results.jsonl``: a first line that says what was evaluated, then a line a trial.
"""

from __future__ import annotations

import contextlib
import errno
import hashlib
import io
import json
import os
import pickle
import struct
from collections.abc import Callable, Generator, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, fields
from functools import lru_cache, partial
from pathlib import Path
from typing import Any, Final, Literal, cast

import numpy as np
from pydantic import Field

from dubins_traffic.campaign import rows
from dubins_traffic.campaign.columns import SECOND
from dubins_traffic.cars.state import Contact, Frames
from dubins_traffic.competition.competition import Phase
from dubins_traffic.competition.submission import Submission
from dubins_traffic.controllers import registry
from dubins_traffic.errors import DubinsTrafficError, InputError, MissingExtraError, WorkerLostError
from dubins_traffic.files import locked, read_text, replace_file
from dubins_traffic.problem.faults import Strict, parse
from dubins_traffic.problem.instance import Instance
from dubins_traffic.protocols import End
from dubins_traffic.record import header
from dubins_traffic.record.sink import Ending
from dubins_traffic.record.writer import RecordEncoder
from dubins_traffic.runs.crew import Cancelled, Processes, carry_out
from dubins_traffic.runs.single import run_trial
from dubins_traffic.sandbox import boxed_controller, owner_of
from dubins_traffic.sandbox.controller import TRUST

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
    """What came of one trial of a submission, as a value and as a JSON object."""

    number: int
    """Of the trial in its phase."""
    row: dict[str, Any]
    """The score by columns (`campaign.columns.SCORES`), with ``number``, ``end`` and ``reason``: what ranking reads."""
    end: str
    """Why the trial ended: a named end, or ``failed`` if it could not be run."""
    owner: Owner | None
    """Whose fault the end was: ``submission``, ``platform``, or nobody's."""
    log: str
    """The tail of what the submission has printed."""
    frames: str | None
    """SHA-256 of all frames (`FramesHash`); None if it could not be run."""
    ran: str | None = None
    """Where the submission ran (`controllers.registry.ran`): boxed, or trusted with the limits that the machine has."""
    recorded: bytes | None = Field(default=None, exclude=True, repr=False)
    """The record, if it was to be remembered; it is no part of the JSON object."""

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
        judged = parse(Judged, document, file=file)
        try:
            judged._check_row()
        except InputError as error:
            raise error.within(file=file) from None
        return judged

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
                raise InputError("not a number", field=f"row.{name}", value=value, expected="a number or null")


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
    numbers : iterable of int
        Which of its trials.
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
    seat = boxed_controller(str(submission.path), phase.limits(instance), trust=trust)
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
    kept_row = {name: _plain(row[name]) for name in rows.RESULT}
    return Judged(
        number=number, row=kept_row, end=end, owner=OWNERS.get(end), log=seat.log_tail, frames=digest.result(),
        ran=registry.ran(name), recorded=recorded.getvalue() or None,
    )  # fmt: skip


def _failed(number: int, reason: str) -> Judged:
    row = rows.failure(number, rows.FAILED, reason)
    kept_row = {name: row[name] for name in rows.RESULT}
    return Judged(number=number, row=kept_row, end=rows.FAILED, owner="platform", log="", frames=None)


def _plain(value: object) -> Any:
    """Return a value of a score as JSON has it."""
    return str(value) if isinstance(value, str) else cast("Any", value)


def _make(folder: Path) -> None:
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise InputError(f"can't hold records ({error.strerror})", file=str(folder)) from None


ARRAYS: Final = tuple(
    array.name for array in fields(Frames) if array.name not in ("first", "rate", "contacts", "events")
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
        for name, digest in self._arrays.items():
            array = getattr(frames, name)
            digest.update(np.ascontiguousarray(array, dtype=array.dtype.newbyteorder("<")).tobytes())
        for contact in frames.contacts:
            self._contacts.update(_packed(contact))

    def end(self, ending: Ending) -> None:
        """Nothing is left to do."""

    def result(self) -> str:
        """Return the SHA-256 of all frames so far, as hexadecimal digits."""
        lines = [self._head, *(f"{name} {digest.hexdigest()}" for name, digest in self._arrays.items())]
        lines.append(f"contacts {self._contacts.hexdigest()}")
        return hashlib.sha256("\n".join(lines).encode()).hexdigest()


def _packed(contact: Contact) -> bytes:
    """Return a contact as bytes: integers of 64 bits, floats, switches; little-endian."""
    whole = (contact.tick, contact.car, contact.other)
    parts = (contact.time, contact.x, contact.y, contact.nx, contact.ny, *contact.closing)
    return struct.pack("<3q7d4?", *whole, *parts, *contact.moved, *contact.at_fault)


RESULTS = "results.jsonl"


@dataclass(frozen=True, slots=True)
class Evaluation:
    """What there is of an evaluation: `results` by number, of `phase` with the submission of digest `submission`."""

    phase: str
    rules: str
    submission: str
    results: tuple[Judged, ...]

    def to_json(self) -> dict[str, Any]:
        """Return the evaluation as a JSON object."""
        return {**self.head, "trials": [result.to_json() for result in self.results]}

    @property
    def head(self) -> dict[str, Any]:
        """What the first line of the file says."""
        return {"version": 1, "phase": self.phase, "rules": self.rules, "submission": self.submission}


def evaluate(
    phase: Phase,
    submission: Submission,
    folder: Path,
    *,
    workers: int = 1,
    trust: bool = False,
    records: bool = False,
    progress: Callable[[int, int], object] | None = None,
) -> Evaluation:
    """Judge a submission in all trials of a phase whose seeds are known; those that `folder` holds are not run again.

    Parameters
    ----------
    phase : Phase
        Of a competition; its seeds must be known.
    folder : Path
        What comes of each trial is kept here as soon as it is known; made if missing.
    workers : int
        Processes; the results are the same with any number.
    records : bool
        Whether records are kept, in ``folder/records``.
    progress : callable, optional
        Is told how many trials are done, and how many there are.

    Raises
    ------
    InputError
        If the folder holds another evaluation, the seeds are secret, or nothing can be run here.
    WorkerLostError
        If a process ended in the middle of a trial.
    """
    seeds = dict(enumerate(phase.seeds()))
    _make_results(folder)
    with locked(folder):
        known = _begun(phase, submission, folder)
        by_number = {result.number: result for result in known.results if result.counts}
        left = [number for number in phase.numbers if number not in by_number]
        work = _Work(phase, submission, seeds, trust, folder / "records" if records else None)
        if progress is not None:
            progress(len(by_number), len(phase.numbers))
        with contextlib.closing(_run(work, left, workers)) as results:
            for judged in results:
                by_number[judged.number] = judged
                _append(folder / RESULTS, _line(judged.to_json()))
                if progress is not None:
                    progress(len(by_number), len(phase.numbers))
        done = Evaluation(phase.name, phase.rules, submission.digest, tuple(by_number[k] for k in sorted(by_number)))
        _write(done, folder)
    return done


def load_evaluation(place: Path) -> Evaluation:
    """Return what there is of an evaluation: of its folder or its file.

    A last line that was cut off is left out, and of a trial that ran twice the last result counts.

    InputError if there is none, or a line is no result.
    """
    path = place / RESULTS if place.is_dir() else place
    text = read_text(path)
    lines = text.split("\n")[:-1]
    if not lines:
        raise InputError("no results", file=str(path), expected="what `dubins-traffic evaluate` keeps")
    head = _json(lines[0], path, 1)
    if not _is_head(head):
        raise InputError("not results", file=str(path), value=head, expected="version, phase, rules, submission")
    by_number: dict[int, Judged] = {}
    for k, line in enumerate(lines[1:], 2):
        judged = Judged.from_json(_json(line, path, k), f"{path}: line {k}")
        by_number[judged.number] = judged
    results = tuple(by_number[number] for number in sorted(by_number))
    return Evaluation(head["phase"], head["rules"], head["submission"], results)


def kept(folder: Path) -> int:
    """Return how many trials an evaluation has results of."""
    return sum(result.counts for result in load_evaluation(folder).results)


def load_entries(places: Sequence[str], phase: Phase) -> dict[str, tuple[Judged, ...]]:
    """Return the results of several evaluations by the names of entries.

    Parameters
    ----------
    places : sequence of str
        Folders, each with a name before it, ``NAME=DIR``, or called as the folder is.
    phase : Phase
        Of which they must be.

    Raises
    ------
    InputError
        If one holds no results, those of another phase or of other rules, or a name stands twice.
    """
    results_of: dict[str, tuple[Judged, ...]] = {}
    for text in places:
        name, equals, place = text.rpartition("=")
        name = name if equals else Path(place).resolve().name
        evaluation = load_evaluation(Path(place))
        if (evaluation.phase, evaluation.rules) != (phase.name, phase.rules):
            raise InputError(
                "results of another phase, or under other rules",
                file=place,
                value=evaluation.phase,
                expected=phase.name,
            )
        if name in results_of:
            raise InputError("name taken", file=place, value=name, expected="NAME=DIR, each name once")
        results_of[name] = evaluation.results
    return results_of


@dataclass(frozen=True, slots=True)
class _Work:
    phase: Phase
    submission: Submission
    seeds: dict[int, int]
    trust: bool
    records: Path | None

    def judged(self, number: int) -> Judged:
        """Return what comes of one trial."""
        seeds = {number: self.seeds[number]}
        (judged_trial,) = judge(
            self.phase, [number], self.submission, seeds=seeds, trust=self.trust, records=self.records
        )
        return judged_trial


@dataclass(frozen=True, slots=True)
class _Errand:
    """A trial for a worker; `work` is the same for all, pickled once."""

    number: int
    work: bytes

    def run(self, cancelled: Cancelled) -> Judged:  # noqa: ARG002  # a trial in a box is run to its end
        return _work(self.work).judged(self.number)


@lru_cache(maxsize=1)
def _work(pickled: bytes) -> _Work:
    return pickle.loads(pickled)


def _run(work: _Work, numbers: Sequence[int], workers: int) -> Generator[Judged]:
    if workers == 1 or len(numbers) < 2:
        yield from map(work.judged, numbers)
        return
    errands = map(partial(_Errand, work=pickle.dumps(work)), numbers)
    with contextlib.closing(Processes(min(workers, len(numbers)))) as crew:
        for errand, judged in carry_out(crew, errands):
            if judged is None:
                raise WorkerLostError(
                    f"the process ended in the middle of trial {errand.number}, each time it was run; the same command "
                    "goes on"
                )
            yield judged


def _begun(phase: Phase, submission: Submission, folder: Path) -> Evaluation:
    """Return what has been evaluated in a folder before, having begun the file and mended its last line."""
    path = folder / RESULTS
    made = Evaluation(phase.name, phase.rules, submission.digest, ())
    if path.is_file() and path.stat().st_size:
        before = load_evaluation(path)
        if before.head != made.head:
            raise InputError(
                "holds another evaluation",
                file=str(folder),
                value=f"{before.phase} of {before.submission[:12]}",
                expected="a new folder, or that of the same submission, phase and rules",
            )
        made = before
    _write(made, folder)
    return made


def _write(evaluation: Evaluation, folder: Path) -> None:
    """Write the results in the order of their numbers: the same bytes whatever the order in which they came."""
    text = _line(evaluation.head) + "".join(_line(result.to_json()) for result in evaluation.results)
    replace_file(folder / RESULTS, lambda neighbour: neighbour.write_text(text, encoding="utf-8"))


def _append(path: Path, line: str) -> None:
    """Write a line to the end of a file; InputError if it is not held whole, and the next to read leaves it out."""
    try:
        with path.open("ab", buffering=0) as file:
            if file.write(line.encode()) != len(line.encode()):
                raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
    except OSError as error:
        raise InputError(f"can't be written ({error.strerror}); what is finished is kept", file=str(path)) from None


def _line(document: dict[str, Any]) -> str:
    return json.dumps(document, separators=(",", ":"), allow_nan=False) + "\n"


def _json(line: str, path: Path, number: int) -> dict[str, Any]:
    try:
        document: object = json.loads(line)
    except (ValueError, RecursionError) as error:
        raise InputError(f"line {number} is not JSON ({error})", file=str(path)) from None
    if not isinstance(document, dict):
        raise InputError(f"line {number} is not a JSON object", file=str(path))
    return cast("dict[str, Any]", document)


def _is_head(head: dict[str, Any]) -> bool:
    texts = [head.get(name) for name in ("phase", "rules", "submission")]
    return head.get("version") == 1 and all(isinstance(text, str) for text in texts)


def _make_results(folder: Path) -> None:
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise InputError(f"can't hold results ({error.strerror})", file=str(folder)) from None
