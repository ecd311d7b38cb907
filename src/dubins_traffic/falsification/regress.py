"""Regression: a folder of cases is run with a controller, and what it still breaks is told."""

from __future__ import annotations

import os
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from dubins_traffic.controllers import registry as controllers
from dubins_traffic.engine.controlled import Maker
from dubins_traffic.errors import InputError
from dubins_traffic.falsification.archive import files
from dubins_traffic.falsification.case import Case, judge, read_case, sentence_of
from dubins_traffic.falsification.remote import Remote
from dubins_traffic.falsification.trying import driver_of, name_of
from dubins_traffic.record.sink import FAULTS
from dubins_traffic.scoring.verdict import EGO_NAME, EGO_RULES, Ruling

if TYPE_CHECKING:
    from dubins_traffic.scoring.verdict import Violation


@dataclass(frozen=True, slots=True)
class CaseOutcome:
    """What a controller did in a case."""

    file: Path
    """The case."""
    case: Case
    """What it was."""
    verdict: str
    """The ruling, or how the trial ended if by a fault."""
    broken: tuple[str, ...]
    """The rules that the ego broke before the assumption fell, in order of time, and the formula, goal or end that
    the case is about.
    """
    sentence: str
    """Who did what when; empty if the ego broke nothing."""
    fault: str = ""
    """The end of a trial that ended by a fault and the reason, ``END: REASON``."""

    @property
    def passed(self) -> bool:
        """Whether the ego broke nothing for which it must answer, and no fault ended the trial."""
        return not self.broken and not self.fault

    def to_json(self) -> dict[str, Any]:
        """Return the outcome as a JSON object."""
        return {
            "file": self.file.name,
            "rule": self.case.story.rule,
            "verdict": self.verdict,
            "broken": list(self.broken),
            "sentence": self.sentence,
            "fault": self.fault,
            "passed": self.passed,
        }


def regress(folder: str | os.PathLike[str], controller: str | Maker | Remote) -> list[CaseOutcome]:
    """Run every case of a folder with a controller.

    Parameters
    ----------
    folder : path
        A folder of cases, or that of a search.
    controller : str, callable or Remote
        As `run_batch` takes it, or a program elsewhere (`falsification.remote.Remote`).

    Raises
    ------
    InputError
        If there is no such folder, it holds no case, or a file in it is none.
    """
    return list(outcomes(cases_in(folder), controller))


def cases_in(folder: str | os.PathLike[str]) -> list[tuple[Path, Case]]:
    """Return the cases of a folder and their files, in order."""
    place = Path(folder)
    if not place.is_dir():
        raise InputError("no such folder", file=str(place), expected="a folder of cases")
    cases = [(path, read_case(path)) for path in files(place)]
    if not cases:
        raise InputError("no case in it", file=str(place), expected="files *.json that `falsify` wrote")
    return cases


def outcomes(cases: Sequence[tuple[Path, Case]], controller: str | Maker | Remote) -> Iterator[CaseOutcome]:
    """Run cases with a controller, and yield what it did in each."""
    name, make = name_of(controller), driver_of(controller)
    if not isinstance(make, Remote):
        controllers.made(make)
    for path, case in cases:
        judged = judge(case.instance, make, name)
        verdict, ending = judged.score.verdict, judged.record.ending
        if verdict is None:
            raise InputError("is not judged by the rules", file=str(path), field="rules", expected="true")
        breaches = [broken for broken in verdict.violations if broken.car == EGO_NAME]
        breaches = breaches if verdict.verdict is Ruling.VIOLATED else []
        if case.story.rule not in EGO_RULES and (asked := judged.breach(case.story.rule)) is not None:
            breaches = [*breaches, asked]
        fault = ending if ending is not None and ending.end in FAULTS else None
        outcome = verdict.verdict.value if fault is None else fault.end.value
        of_it = [broken for broken in breaches if broken.rule == case.story.rule] or breaches
        sentence = sentence_of(judged.record, judged.score, of_it[0]) if breaches else ""
        yield CaseOutcome(path, case, outcome, _rules(breaches), sentence, "" if fault is None else str(fault))


def _rules(breaches: Sequence[Violation]) -> tuple[str, ...]:
    return tuple(dict.fromkeys(broken.rule for broken in breaches))
