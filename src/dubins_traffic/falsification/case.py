"""A case: an instance in which an ego breaks a rule, judged afresh, as a file that `run` replays, and its page."""

from __future__ import annotations

import json
import os
import tempfile
from collections.abc import Callable, Mapping
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final, cast, get_type_hints

from dubins_traffic.cars.state import EGO
from dubins_traffic.controllers import registry as controllers
from dubins_traffic.errors import InputError
from dubins_traffic.falsification import contract
from dubins_traffic.falsification.contract import first_overdue, limit_of, spare
from dubins_traffic.falsification.coverage import Cell, Manoeuvre
from dubins_traffic.falsification.remote import Remote
from dubins_traffic.falsification.trying import (
    Tried,
    broken_formulas,
    driver_of,
    judged_record,
    name_of,
    tried_of,
)
from dubins_traffic.files import require_output, write_text
from dubins_traffic.problem.document import instance_from_document, instance_to_document
from dubins_traffic.problem.files import DOCUMENTS, parse_json, read_source
from dubins_traffic.record.reader import Record, read
from dubins_traffic.record.sink import BY_CONTROLLER
from dubins_traffic.rules.propositions import FLAG
from dubins_traffic.runs.single import run_trial
from dubins_traffic.scoring.margins import LIVENESS
from dubins_traffic.scoring.score import Score
from dubins_traffic.scoring.verdict import EGO_NAME, EGO_RULES, Place, Ruling, Violation
from dubins_traffic.viewer.replay import write_replay

if TYPE_CHECKING:
    from dubins_traffic.engine.controlled import Maker
    from dubins_traffic.falsification.coverage import Cell
    from dubins_traffic.problem.instance import Instance
    from dubins_traffic.protocols import Controller


KEY: Final = "case"
"""The key of an instance's document under which a case says what it is; a run passes it over."""


@dataclass(frozen=True, slots=True)
class Story:
    """What is known of a case: `rule` is broken by the ego at `time` seconds, frame `tick`.

    `manoeuvre` and `degree` are those of its cell, `controller` drove the ego, and `sentence` tells who did what when.
    """

    rule: str
    manoeuvre: str
    degree: int
    controller: str
    time: float
    tick: int
    sentence: str

    @property
    def cell(self) -> Cell:
        """Its cell."""
        return Cell(self.rule, Manoeuvre[self.manoeuvre.upper()], self.degree)


@dataclass(frozen=True, slots=True)
class Case:
    """An instance and what is known of it."""

    instance: Instance
    story: Story

    def to_text(self) -> str:
        """Return the text of its file; equal cases give equal text."""
        extra = {key: value for key, value in self.instance.extra.items() if key != KEY}
        document = instance_to_document(replace(self.instance, extra={**extra, KEY: asdict(self.story)}))
        return (
            "{\n" + ",\n".join(f" {json.dumps(key)}: {json.dumps(entry)}" for key, entry in document.items()) + "\n}\n"
        )

    def write(self, path: str | os.PathLike[str], *, overwrite: bool = False) -> None:
        """Write its file, whole or not at all; InputError as of `files.require_output`."""
        require_output(path, "a case", DOCUMENTS, overwrite=overwrite)
        write_text(Path(path), self.to_text())


def read_case(path: str | os.PathLike[str]) -> Case:
    """Return the case in a file."""
    name = os.fspath(path)
    document = parse_json(read_source(name).text, name)
    return case_of(instance_from_document(document, name), name)


def case_of(instance: Instance, name: str | None = None) -> Case:
    """Return the case that the document of an instance carries; `name` is the file that errors mention."""
    story_document: Any = instance.extra.get(KEY)
    expected = "an object with rule, manoeuvre, degree, controller, time, tick and sentence"
    if not isinstance(story_document, Mapping):
        raise InputError("not a case", file=name, field=KEY, value=story_document, expected=expected)
    document = cast("Mapping[str, Any]", story_document)
    try:
        story = Story(**document)
        _check_kinds(story, name)
        if story.manoeuvre.upper() not in Manoeuvre.__members__:
            raise InputError("no manoeuvre", file=name, field=f"{KEY}.manoeuvre", value=story.manoeuvre)
    except (TypeError, AttributeError):
        raise InputError("not a case", file=name, field=KEY, value=sorted(document), expected=expected) from None
    return Case(instance, story)


def _check_kinds(story: Story, file: str | None) -> None:
    """Refuse numbers where words are to stand, and the other way round."""
    for name, kind in get_type_hints(Story).items():
        value = getattr(story, name)
        allowed = (int, float) if kind is float else kind
        if not isinstance(value, allowed) or isinstance(value, bool):
            raise InputError("of the wrong kind", file=file, field=f"{KEY}.{name}", value=value, expected=kind.__name__)


def sentence_of(record: Record, score: Score, breach: Violation) -> str:
    """Return who did what when in a trial in which the ego broke a rule.

    Parameters
    ----------
    record, score
        The trial, up to the breach or farther.
    """
    when = f"At {breach.time:.2f} s the ego"
    match breach.rule:
        case "1.collision":
            return f"{when} {_collision(record, score, breach)}."
        case "1.road":
            return f"{when} left the road near ({breach.where.x:.1f}, {breach.where.y:.1f}) m."
        case "2.left":
            return f"{when} crossed the centre line of {_road(breach)} though nothing stood in its lane."
        case "2.return":
            since = f"as it had been since {breach.since:.2f} s"
            return f"{when} was still left of the centre line of {_road(breach)}, {since}."
        case "2.turn":
            return f"{when} turned round on {_road(breach)}."
        case rule if rule in contract.CONTRACT:
            return contract.sentence_of(score.verdict, breach)
        case "1.goal":
            since = f"since {breach.since:.2f} s" if breach.since > 0.0 else "yet"
            return f"{when} had not visited the goal {_crossing(breach)} {since}, which is longer than a gap may be."
        case rule if rule.startswith("formula "):
            place = f"({breach.where.x:.1f}, {breach.where.y:.1f}) m"
            return f"At {breach.time:.2f} s the formula became false, the ego being at {place}."
        case "3.stop" | "3.order" | "3.clear":
            return f"{when} entered the crossing at {_crossing(breach)} {_entry(record, breach)}."
        case rule if rule in BY_CONTROLLER:
            return f"At {breach.time:.2f} s the controller ended the trial: {record.ending}."
        case rule:
            return f"{when} broke {rule} near ({breach.where.x:.1f}, {breach.where.y:.1f}) m."


def _collision(record: Record, score: Score, breach: Violation) -> str:
    hits = [hit for hit in score.collisions if abs(hit.time - breach.time) <= 1.5 / record.frames.rate]
    other = hits[0].partner if hits else "something"
    place = f"at {_crossing(breach)}" if breach.where.intersection else f"on {_road(breach)}"
    speed = float(record.frames.speed[max(0, breach.tick - 1), EGO])
    how = "standing" if abs(speed) < 0.01 else f"driving at {speed:.2f} m/s"
    return f"touched {other} {place}, {how}"


def _entry(record: Record, breach: Violation) -> str:
    before = max(0, breach.tick - 1)
    bits, crosses = record.frames.bits[before], record.frames.crosses[before]
    names = record.instance.names
    if breach.rule == "3.stop":
        return "without having stopped at its line"
    vertex = _vertex(record, breach)
    if breach.rule == "3.clear":
        inside = [names[n] for n in range(1, len(names)) if crosses[n] == vertex]
        return f"while {' and '.join(inside) or 'another car'} was in it"
    waiting = [names[n] for n in range(1, len(names)) if bits[n] & FLAG.STOPPED and _heads(record, n, before) == vertex]
    return f"before its turn, while {' and '.join(waiting) or 'another car'} waited there"


def _heads(record: Record, car: int, frame: int) -> int:
    """Return the intersection at the end of a car's lane, -1 without lane state."""
    lane = int(record.frames.lane[frame, car])
    return -1 if lane < 0 else record.instance.problem.network.lane_ends(lane)[1]


def _vertex(record: Record, breach: Violation) -> int:
    where = breach.where.intersection
    return -1 if where is None else record.instance.problem.network.vertex(where)


def _crossing(breach: Violation) -> str:
    where = breach.where.intersection
    return "its place" if where is None else f"({where[0]}, {where[1]})"


def _road(breach: Violation) -> str:
    segment = breach.where.segment
    return (
        "its road" if segment is None else f"the road from ({segment[0]}, {segment[1]}) to ({segment[2]}, {segment[3]})"
    )


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
        """Return the ego's first breach of a rule, formula or goal (`liveness`), or the end that it brought about."""
        verdict, frames = self.score.verdict, self.record.frames
        if rule == LIVENESS:
            return self._overdue()
        if rule in contract.CONTRACT:
            ticks = [tick for cell, tick in self.tried.cells if cell.rule == rule]
            return contract.breach_of(rule, ticks[0], verdict, self.record) if verdict and ticks else None
        violations = () if verdict is None else verdict.violations
        for broken in violations:
            if broken.car == EGO_NAME and broken.rule == rule:
                return broken
        ending = self.record.ending
        if ending is not None and ending.by_controller and ending.end == rule:
            time = ending.ticks / frames.rate
        else:
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
        overdue = first_overdue(self.record, limit)
        if overdue is None:
            return None
        x, y = float(frames.x[overdue.tick, EGO]), float(frames.y[overdue.tick, EGO])
        times = overdue.tick / frames.rate, overdue.tick, overdue.since / frames.rate
        return Violation(LIVENESS, EGO_NAME, *times, Place(x, y, overdue.goal, None))


def judge(instance: Instance, make: Make, name: str) -> Judged:
    """Return what the judge says of a trial that has been written, read and run anew.

    Parameters
    ----------
    instance : Instance
        What is run; it goes through its document first.
    make : callable or Remote
        Makes the controller, which is called `name`; or drives the trial.
    """
    document = json.loads(json.dumps(instance_to_document(instance)))
    again = instance_from_document(document)
    record = make.drive(again) if isinstance(make, Remote) else _recorded(again, make, name)
    judged_score, passages = judged_record(record)
    return Judged(record, judged_score, tried_of(judged_score, record.ending, passages, 0, record.instance))


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
    """Return what the judge says of an instance that is cut to the ego's breach of a rule; None if none stands.

    An end that the ego's controller brings about comes in the tick after its frame.
    """
    first = judge(instance, make, name)
    breach = first.first(rule)
    if breach is None:
        return None
    last = min(breach.tick + 1, instance.ticks) if rule in BY_CONTROLLER else breach.tick
    cut = judge(cut_to(instance, last), make, name)
    return cut if cut.breach(rule) is not None else None


def case_in(instance: Instance, cell: Cell, make: Make, name: str) -> Case | None:
    """Return an instance as a case of the ego's failure in a cell, judged afresh; None if it does not stand."""
    confirmed = confirm(instance, cell.rule, make, name)
    breach = None if confirmed is None else confirmed.breach(cell.rule)
    if confirmed is None or breach is None:
        return None
    story = Story(
        cell.rule, cell.manoeuvre.name.lower(), cell.degree, name, breach.time, breach.tick,
        sentence_of(confirmed.record, confirmed.score, breach),
    )  # fmt: skip
    return Case(confirmed.record.instance, story)


def write_page(
    case: Case,
    path: str | os.PathLike[str],
    controller: str | Remote | None = None,
    *,
    overwrite: bool = False,
) -> None:
    """Write the page that replays a case, driven by its controller or another; equal cases give equal bytes."""
    driver = case.story.controller if controller is None else controller
    name = name_of(driver)
    judged = judge(case.instance, driver_of(driver), name)
    record, verdict = judged.record, judged.score.verdict
    rules = [] if verdict is None else [broken.rule for broken in verdict.violations if broken.car == EGO_NAME]
    summary = {
        "rule": case.story.rule,
        "what happens": case.story.sentence,
        "controller": name,
        "broken by the ego": ", ".join(dict.fromkeys(rules)) or "nothing",
    }
    write_replay(path, record.instance, record.frames, record.ending, summary, (), verdict, overwrite=overwrite)
