"""Instants of a trial worth pointing at: contacts, events, visits of goals, and whatever a caller adds."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from dubins_traffic.cars.state import EGO, NONE, Contact, Event, Frames
from dubins_traffic.problem.instance import Instance, Problem
from dubins_traffic.rules.explained import RULE_WORDS
from dubins_traffic.scoring.formulas import FormulaVerdict
from dubins_traffic.scoring.verdict import EGO_NAME, Ruling, Verdict, Violation
from dubins_traffic.viewer.scene import short


@dataclass(frozen=True, slots=True)
class Mark:
    """A mark on the timeline of a replay.

    `kind` sets its colour: ``contact``, ``goal``, ``event``, ``breach``; others look like an event. `time` is in
    seconds; a mark that lasts began at `since`. `car` is the index of the car it is about (-1: none), `point` where
    it happened, world frame, metres; `rule` names what was broken.
    """

    time: float
    kind: str
    text: str
    car: int = NONE
    point: tuple[float, float] | None = None
    since: float | None = None
    rule: str | None = None


def contact_mark(instance: Instance, contact: Contact) -> Mark:
    """Return the mark of a contact, which names both and who is at fault."""
    names = instance.names
    other = names[contact.other] if contact.other >= 0 else f"obstacle {-1 - contact.other}"
    guilty = [name for name, fault in zip((names[contact.car], other), contact.at_fault, strict=True) if fault]
    text = f"{names[contact.car]} touches {other}"
    if guilty:
        text += f" ({' and '.join(guilty)} at fault)"
    return Mark(contact.time, "contact", text, contact.car, (contact.x, contact.y))


def event_mark(instance: Instance, rate: float, event: Event) -> Mark:
    """Return the mark of an event."""
    words = [event.kind.replace("_", " ")]
    if event.car >= 0:
        words.append(instance.names[event.car])
    text = ": ".join(words)
    return Mark(event.tick / rate, "event", f"{text} ({event.detail})" if event.detail else text, event.car)


def event_marks(instance: Instance, frames: Frames) -> list[Mark]:
    """Return the marks of events; a run of one kind, of one car, tick by tick, is marked where it begins."""
    marks: list[Mark] = []
    latest: dict[tuple[str, int], int] = {}
    for event in frames.events:
        key = (event.kind, event.car)
        if latest.get(key) != event.tick - 1:
            marks.append(event_mark(instance, frames.rate, event))
        latest[key] = event.tick
    return marks


def breach_marks(instance: Instance, violations: Sequence[Violation]) -> list[Mark]:
    """Return the marks of breaches of the rules, which name who broke which, where, and since when it came."""
    return [
        Mark(
            violation.time,
            "breach",
            breach_text(violation),
            instance.names.index(violation.car),
            (violation.where.x, violation.where.y),
            violation.since if violation.since < violation.time else None,
            violation.rule,
        )
        for violation in violations
    ]


def breach_text(violation: Violation) -> str:
    """Return in words who broke which rule, and how: ``agent0 breaks E4: stays in a disc with a free exit``."""
    words = RULE_WORDS.get(violation.rule)
    text = f"{violation.car} breaks {violation.rule}"
    return text if words is None else f"{text}: {words.deed}"


def verdict_text(verdict: Verdict) -> str:
    """Return in words why a trial has its verdict: what the ego broke first, and what excused it."""
    first = next((one for one in verdict.violations if one.car == EGO_NAME), None)
    if verdict.verdict is Ruling.UNTOLD:
        known = 100.0 * (verdict.tolerance or 0.0)
        return f"What the ego did can't be told from poses that are known to {known:.1f} cm."
    if first is None and verdict.cut:
        return "The ego broke nothing until the trial was cut short."
    if first is None and not verdict.clean:
        return "The ego broke nothing, but its controller ended the trial."
    if first is None:
        task = "and did its task" if verdict.verdict is Ruling.SATISFIED else "and did not do all of its task"
        return f"The ego broke nothing {task}."
    breach = f"The ego broke {first.rule} at {first.time:.2f} s"
    excuse = verdict.excuse
    if excuse is None:
        return f"{breach}, while the others had kept their part."
    fall = excuse.violation
    when = "at the same instant" if fall.tick == first.tick else f"at {fall.time:.2f} s"
    place = fall.where.intersection
    where = "" if place is None else f" near ({place[0]}, {place[1]})"
    words = RULE_WORDS[fall.rule].deed if fall.rule in RULE_WORDS else "a rule broken"
    seen = "the ego sensed it" if excuse.sensed else "the ego did not sense it"
    return f"{breach}. It is excused by {fall.car}, which broke {fall.rule} {when}{where} ({words}); {seen}."


def excuse_mark(instance: Instance, verdict: Verdict) -> Mark | None:
    """Return the mark of the breach that excuses the ego, equal to that among `breach_marks`; None without one."""
    return None if verdict.excuse is None else breach_marks(instance, [verdict.excuse.violation])[0]


def formula_marks(verdicts: Sequence[FormulaVerdict]) -> list[Mark]:
    """Return the marks of the instants in which verdicts on formulas became definite."""
    return [
        Mark(verdict.time, "formula", f"{verdict.name} is {verdict.verdict}")
        for verdict in verdicts
        if verdict.time is not None
    ]


def goal_numbers(problem: Problem) -> dict[int, str]:
    """Return the goals' intersections with the numbers that pictures give them: from 1, in the problem's order."""
    order: dict[int, list[str]] = {}
    for number, vertex in enumerate(problem.goal_vertices):
        order.setdefault(vertex, []).append(str(number + 1))
    return {vertex: "+".join(numbers) for vertex, numbers in order.items()}


def goal_visits(instance: Instance, frames: Frames) -> list[tuple[int, int]]:
    """Return the ego's visits of goals as (frame of the block, number of the goal's intersection), in order.

    A visit is an entry of the centre into the goal's disc; being in it in the first frame counts.
    """
    at = frames.at[:, EGO]
    entry = np.concatenate([[True], at[1:] != at[:-1]])[: len(at)] & np.isin(at, instance.problem.goal_vertices)
    return [(int(frame), int(at[frame])) for frame in np.flatnonzero(entry)]


def visit_mark(problem: Problem, time: float, vertex: int) -> Mark:
    """Return the mark of a visit of the goal at intersection `vertex`, by its number there."""
    network = problem.network
    x, y = network.intersections[vertex]
    place = (float(network.points[vertex, 0]), float(network.points[vertex, 1]))
    text = f"ego visits goal {goal_numbers(problem)[vertex]} at ({short(x)}, {short(y)})"
    return Mark(time, "goal", text, EGO, place)


def marks_of(instance: Instance, frames: Frames, more: Sequence[Mark] = ()) -> list[Mark]:
    """Return all marks of a trial in order of time: contacts, events, visits of goals and `more`."""
    marks = [contact_mark(instance, contact) for contact in frames.contacts]
    marks += event_marks(instance, frames)
    for frame, vertex in goal_visits(instance, frames):
        marks.append(visit_mark(instance.problem, (frames.first + frame) / frames.rate, vertex))
    marks += more
    return sorted(marks, key=lambda mark: mark.time)
