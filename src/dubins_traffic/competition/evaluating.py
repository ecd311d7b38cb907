"""Evaluating a submission at home: trials of a phase whose seeds are known, kept as they come, so that it can go on.

The folder of an evaluation holds ``results.jsonl``: a first line that says what was evaluated, then a line a trial.
"""

from __future__ import annotations

import contextlib
import errno
import json
import os
import pickle
from collections.abc import Callable, Generator, Sequence
from dataclasses import dataclass
from functools import lru_cache, partial
from pathlib import Path
from typing import Any, cast

from dubins_traffic.competition.competition import Phase
from dubins_traffic.competition.judging import Judged, judge
from dubins_traffic.competition.submission import Submission
from dubins_traffic.errors import InputError, WorkerLostError
from dubins_traffic.files import locked, read_text, replace_file
from dubins_traffic.runs.crew import Cancelled, Processes, carry_out

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
        return {**self.head, "trials": [own.to_json() for own in self.results]}

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
    submission : Submission
        Who drives.
    folder : Path
        What comes of each trial is kept here as soon as it is known; made if missing.
    workers : int
        Processes; the results are the same with any number.
    trust : bool
        As for `judge`.
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
    _make(folder)
    with locked(folder):
        known = _begun(phase, submission, folder)
        found = {own.number: own for own in known.results if own.counts}
        left = [number for number in phase.numbers if number not in found]
        work = _Work(phase, submission, seeds, trust, folder / "records" if records else None)
        if progress is not None:
            progress(len(found), len(phase.numbers))
        with contextlib.closing(_run(work, left, workers)) as results:
            for own in results:
                found[own.number] = own
                _append(folder / RESULTS, _line(own.to_json()))
                if progress is not None:
                    progress(len(found), len(phase.numbers))
        done = Evaluation(phase.name, phase.rules, submission.digest, tuple(found[k] for k in sorted(found)))
        _write(done, folder)
    return done


def load_evaluation(place: Path) -> Evaluation:
    """Return what there is of an evaluation: of its folder or its file.

    A last line that was cut off is left out, and of a trial that ran twice the last result counts.

    Raises
    ------
    InputError
        If there is none, or a line is no result.
    """
    path = place / RESULTS if place.is_dir() else place
    text = read_text(path)
    lines = text.split("\n")[:-1]
    if not lines:
        raise InputError("no results", file=str(path), expected="what `dubins-traffic evaluate` keeps")
    head = _json(lines[0], path, 1)
    if not _is_head(head):
        raise InputError(
            "not results", file=str(path), value=head, expected="version, phase, rules, submission"
        )
    found: dict[int, Judged] = {}
    for k, line in enumerate(lines[1:], 2):
        own = Judged.from_json(_json(line, path, k), f"{path}: line {k}")
        found[own.number] = own
    results = tuple(found[number] for number in sorted(found))
    return Evaluation(head["phase"], head["rules"], head["submission"], results)


def kept(folder: Path) -> int:
    """Return how many trials an evaluation has results of."""
    return sum(own.counts for own in load_evaluation(folder).results)


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
    found: dict[str, tuple[Judged, ...]] = {}
    for text in places:
        name, equals, place = text.rpartition("=")
        name = name if equals else Path(place).resolve().name
        own = load_evaluation(Path(place))
        if (own.phase, own.rules) != (phase.name, phase.rules):
            raise InputError(
                "results of another phase, or under other rules",
                file=place,
                value=own.phase,
                expected=phase.name,
            )
        if name in found:
            raise InputError("name taken", file=place, value=name, expected="NAME=DIR, each name once")
        found[name] = own.results
    return found


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
        (found,) = judge(
            self.phase, [number], self.submission, seeds=seeds, trust=self.trust, records=self.records
        )
        return found


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
        for errand, found in carry_out(crew, errands):
            if found is None:
                raise WorkerLostError(
                    f"the process ended in the middle of trial {errand.number}, each time it was run; the same command "
                    "goes on"
                )
            yield found


def _begun(phase: Phase, submission: Submission, folder: Path) -> Evaluation:
    """Return what has been evaluated in a folder before, having begun the file and mended its last line."""
    path = folder / RESULTS
    made = Evaluation(phase.name, phase.rules, submission.digest, ())
    if path.is_file() and path.stat().st_size:
        found = load_evaluation(path)
        if found.head != made.head:
            raise InputError(
                "holds another evaluation",
                file=str(folder),
                value=f"{found.phase} of {found.submission[:12]}",
                expected="a new folder, or that of the same submission, phase and rules",
            )
        made = found
    _write(made, folder)
    return made


def _write(found: Evaluation, folder: Path) -> None:
    """Write the results in the order of their numbers: the same bytes whatever the order in which they came."""
    text = _line(found.head) + "".join(_line(own.to_json()) for own in found.results)
    replace_file(folder / RESULTS, lambda neighbour: neighbour.write_text(text, encoding="utf-8"))


def _append(path: Path, line: str) -> None:
    """Write a line to the end of a file; InputError if it is not held whole, and the next to read leaves it out."""
    try:
        with path.open("ab", buffering=0) as file:
            if file.write(line.encode()) != len(line.encode()):
                raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
    except OSError as error:
        raise InputError(
            f"can't be written ({error.strerror}); what is finished is kept", file=str(path)
        ) from None


def _line(document: dict[str, Any]) -> str:
    return json.dumps(document, separators=(",", ":"), allow_nan=False) + "\n"


def _json(line: str, path: Path, number: int) -> dict[str, Any]:
    try:
        found: object = json.loads(line)
    except (ValueError, RecursionError) as error:
        raise InputError(f"line {number} is not JSON ({error})", file=str(path)) from None
    if not isinstance(found, dict):
        raise InputError(f"line {number} is not a JSON object", file=str(path))
    return cast("dict[str, Any]", found)


def _is_head(head: dict[str, Any]) -> bool:
    texts = [head.get(name) for name in ("phase", "rules", "submission")]
    return head.get("version") == 1 and all(isinstance(text, str) for text in texts)


def _make(folder: Path) -> None:
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise InputError(f"can't hold results ({error.strerror})", file=str(folder)) from None
