"""No false alarm: what a search has found is written as an instance and a record, read again, and judged afresh."""

from __future__ import annotations

import json
import tempfile
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING

from dubins_traffic.cars.state import EGO
from dubins_traffic.controllers import registry as controllers
from dubins_traffic.falsification import contract
from dubins_traffic.falsification.case import Case, Story
from dubins_traffic.falsification.contract import limit_of
from dubins_traffic.falsification.liveness import first_overdue, spare
from dubins_traffic.falsification.remote import Remote
from dubins_traffic.falsification.sentences import sentence_of
from dubins_traffic.falsification.trying import Tried, broken_formulas, judged_record, tried_of
from dubins_traffic.problem.document import instance_from_document, instance_to_document
from dubins_traffic.record.reader import Record, read
from dubins_traffic.runs.single import run_trial
from dubins_traffic.scoring.margins import LIVENESS
from dubins_traffic.scoring.score import Score
from dubins_traffic.scoring.verdict import EGO_NAME, EGO_RULES, Place, Ruling, Violation

if TYPE_CHECKING:
    from dubins_traffic.engine.controlled import Maker
    from dubins_traffic.falsification.cells import Cell
    from dubins_traffic.problem.instance import Instance
    from dubins_traffic.protocols import Controller

Make = Callable[[], "Controller"] | Remote
"""What makes the controller, or drives trials elsewhere."""


@dataclass(frozen=True, slots=True)
class Judged:
    """What the judge has said of a record: the record, its score, and what a search keeps of it."""

    record: Record
    score: Score
    tried: Tried

    def breach(self, rule: str) -> Violation | None:
        """Return the ego's first breach of a rule if the trial is `violated` and all keep E1 to E6, else None.

        Of `contract.CONTRACT` that of the car that is concerned.
        """
        verdict = self.score.verdict
        if rule in contract.CONTRACT:
            return self.first(rule)
        if verdict is None or verdict.assumption_broken:
            return None
        if rule not in EGO_RULES:
            return self.first(rule)
        return self.first(rule) if verdict.verdict is Ruling.VIOLATED else None

    def first(self, rule: str) -> Violation | None:
        """Return the ego's first breach of a rule, formula or goal (`liveness`), whatever others did."""
        verdict, frames = self.score.verdict, self.record.frames
        if rule == LIVENESS:
            return self._overdue()
        if rule in contract.CONTRACT:
            ticks = [tick for cell, tick in self.tried.cells if cell.rule == rule]
            return contract.breach_of(rule, ticks[0], verdict, self.record) if verdict and ticks else None
        own = () if verdict is None else verdict.violations
        for broken in own:
            if broken.car == EGO_NAME and broken.rule == rule:
                return broken
        time = broken_formulas(self.score).get(rule)
        if time is None:
            return None
        tick = round(time * frames.rate)
        place = Place(float(frames.x[tick, EGO]), float(frames.y[tick, EGO]), None, None)
        return Violation(rule, EGO_NAME, time, tick, time, place)

    def _overdue(self) -> Violation | None:
        """Return where the ego was when a goal had not been visited for too long."""
        verdict, frames, problem = self.score.verdict, self.record.frames, self.record.instance.problem
        late = None if verdict is None else spare(problem, verdict, self.record.ending)
        limit = limit_of(problem)
        if limit is None or late is None or late >= 0.0:
            return None
        found = first_overdue(self.record, limit)
        if found is None:
            return None
        x, y = float(frames.x[found.tick, EGO]), float(frames.y[found.tick, EGO])
        times = found.tick / frames.rate, found.tick, found.since / frames.rate
        return Violation(LIVENESS, EGO_NAME, *times, Place(x, y, found.goal, None))


def judge(instance: Instance, make: Make, name: str) -> Judged:
    """Return what the judge says of a trial that has been written, read and run anew.

    Parameters
    ----------
    instance : Instance
        What is run; it goes through its document first.
    make : callable or Remote
        Makes the controller, which is called `name`; or drives the trial.

    Raises
    ------
    InputError
        If the document is of no instance.
    """
    document = json.loads(json.dumps(instance_to_document(instance)))
    again = instance_from_document(document)
    record = make.drive(again) if isinstance(make, Remote) else _recorded(again, make, name)
    found, passages = judged_record(record)
    return Judged(record, found, tried_of(found, record.ending, passages, 0, record.instance))


def _recorded(instance: Instance, make: Maker, name: str) -> Record:
    """Return the record of a trial that is run here."""
    with tempfile.TemporaryDirectory(prefix="dubins-traffic-") as folder:
        path = Path(folder) / "trial.mcap"
        run_trial(instance, controllers.made(make), record=path, name=name, sketch=False)
        return replace(read(path), wall=None, file=None)


def cut_to(instance: Instance, tick: int) -> Instance:
    """Return an instance whose trial ends with frame `tick`."""
    return replace(instance, duration=max(1, tick) / instance.problem.rate)


def confirm(instance: Instance, rule: str, make: Make, name: str) -> Judged | None:
    """Return what the judge says of an instance that is cut to the ego's breach of a rule; None if none stands."""
    first = judge(instance, make, name)
    breach = first.first(rule)
    if breach is None:
        return None
    found = judge(cut_to(instance, breach.tick), make, name)
    return found if found.breach(rule) is not None else None


def case_in(instance: Instance, cell: Cell, make: Make, name: str) -> Case | None:
    """Return an instance as a case of the ego's failure in a cell, judged afresh; None if it does not stand."""
    found = confirm(instance, cell.rule, make, name)
    breach = None if found is None else found.breach(cell.rule)
    if found is None or breach is None:
        return None
    story = Story(
        cell.rule, cell.manoeuvre.name.lower(), cell.degree, name, breach.time, breach.tick,
        sentence_of(found.record, found.score, breach),
    )  # fmt: skip
    return Case(found.record.instance, story)
