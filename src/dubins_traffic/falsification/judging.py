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
from dubins_traffic.falsification.trying import EgoTrace, Tried, broken_formulas, tried_of
from dubins_traffic.problem.document import instance_from_document, instance_to_document
from dubins_traffic.record.reader import Record, read, replay
from dubins_traffic.runs.single import run_trial
from dubins_traffic.scoring.score import Score, score
from dubins_traffic.scoring.verdict import EGO_NAME, EGO_RULES, Place, Ruling, Violation

if TYPE_CHECKING:
    from dubins_traffic.problem.instance import Instance
    from dubins_traffic.protocols import Controller

Make = Callable[[], "Controller"]


@dataclass(frozen=True, slots=True)
class Judged:
    """What the judge has said of a record: the record, its score, and what a search keeps of it."""

    record: Record
    score: Score
    tried: Tried

    def breach(self, rule: str) -> Violation | None:
        """Return the ego's first breach of a rule if the trial is `violated` and all keep E1 to E6, else None."""
        verdict = self.score.verdict
        if verdict is None or verdict.assumption_broken:
            return None
        if rule not in EGO_RULES:
            return self.first(rule)
        return self.first(rule) if verdict.verdict is Ruling.VIOLATED else None

    def first(self, rule: str) -> Violation | None:
        """Return the ego's first breach of a rule, or where a formula became false, whatever others did."""
        verdict, frames = self.score.verdict, self.record.frames
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


def judge(instance: Instance, make: Make, name: str) -> Judged:
    """Return what the judge says of a trial that has been written, read and run anew.

    Parameters
    ----------
    instance : Instance
        What is run; it goes through its document first.
    make : callable
        Makes the controller, which is called `name`.

    Raises
    ------
    InputError
        If the document is of no instance.
    """
    document = json.loads(json.dumps(instance_to_document(instance)))
    again = instance_from_document(document)
    with tempfile.TemporaryDirectory(prefix="dubins-traffic-") as folder:
        path = Path(folder) / "trial.mcap"
        run_trial(again, controllers.made(make), record=path, name=name, sketch=False)
        record = replace(read(path), wall=None, file=None)
    trace = EgoTrace()
    replay(record, [trace])
    found = score(record)
    return Judged(record, found, tried_of(found, record.ending, trace.passages(), 0, record.frames.rate))


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
