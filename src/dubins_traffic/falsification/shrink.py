"""Shrinking: what a failure does not need is taken away, until nothing more can be."""

from __future__ import annotations

import os
from collections.abc import Callable
from dataclasses import replace
from typing import TYPE_CHECKING

from dubins_traffic.engine.controlled import Maker
from dubins_traffic.errors import ControllerError, DubinsTrafficError, InputError
from dubins_traffic.falsification.case import Case, Story, read_case
from dubins_traffic.falsification.crew import driver_of
from dubins_traffic.falsification.judging import Judged, Make, confirm, judge, sentence_of
from dubins_traffic.falsification.remote import Remote
from dubins_traffic.falsification.removals import WAYS, Removal, Way, lead, removals
from dubins_traffic.falsification.trying import TrialRunner, in_order
from dubins_traffic.problem.document import instance_from_document, instance_to_document

if TYPE_CHECKING:
    from dubins_traffic.problem.instance import Instance

Progress = Callable[[str], object]


def shrink(
    case: Case | str | os.PathLike[str],
    controller: str | Maker | Remote | None = None,
    progress: Progress | None = None,
) -> Case:
    """Return the smallest case that is found by taking things away from a case: one thing less, and the breach is gone.

    Cars, the beginning of the trial, goals, obstacles, choices and roads are taken away one at a time, as long as the
    ego still breaks the same rule within the assumption, judged afresh each time; the end is cut to the breach.

    Parameters
    ----------
    case : Case or path
        What is shrunk.
    controller : str, callable or Remote, optional
        Who drives; by default the one of the case.
    progress : callable, optional
        Is told what has been taken away.

    Raises
    ------
    InputError
        If the case does not break its rule with that controller.
    ControllerError
        If that is since the controller ends the trial before.
    """
    own = case if isinstance(case, Case) else read_case(case)
    driver = own.story.controller if controller is None else controller
    make = driver_of(driver)
    name = driver if isinstance(driver, str) else own.story.controller
    shrinker = _Shrinker(driver, make, name, own.story.rule)
    found = confirm(own.instance, own.story.rule, make, name)
    if found is None:
        ending = judge(own.instance, make, name).record.ending
        if ending is not None and ending.by_controller:
            raise ControllerError(ending.end.value, f"the case ended by a fault: {ending}")
        file = None if isinstance(case, Case) else os.fspath(case)
        raise InputError(
            "the ego does not break the rule", file=file, field="case.rule", value=own.story.rule,
            expected="a case that fails with this controller",
        )  # fmt: skip
    found = shrinker.shrunk(found, progress)
    return retold(own.story, name, found)


def retold(story: Story, name: str, found: Judged) -> Case:
    """Return a case like one that is known, with what has now been judged of it."""
    breach = found.breach(story.rule)
    if breach is None:
        raise DubinsTrafficError("a case without its breach")
    told = sentence_of(found.record, found.score, breach)
    return Case(
        replace(found.record.instance, extra={}),
        replace(story, controller=name, time=breach.time, tick=breach.tick, sentence=told),
    )


def single_removals(judged: Judged) -> list[Removal]:
    """Return every instance with one thing less than one that has been judged, those that can't be run left out."""
    return [
        (what, instance)
        for what, instance in removals(judged.record.instance, judged.record.frames)
        if _is_sound(instance)
    ]


class _Shrinker:
    """Takes things away while the ego goes on breaking `rule`."""

    def __init__(self, driver: str | Maker | Remote, make: Make, name: str, rule: str) -> None:
        self._runner = TrialRunner(driver)
        self._make, self._name, self._rule = make, name, rule

    def shrunk(self, found: Judged, progress: Progress | None) -> Judged:
        """Return what is left when nothing more can be taken away."""
        smaller = True
        while smaller:
            smaller = False
            for way in WAYS:
                while (less := self._less(found, way)) is not None:
                    what, found = less
                    smaller = True
                    if progress is not None:
                        progress(what)
        return found

    def _less(self, found: Judged, way: Way) -> tuple[str, Judged] | None:
        """Return the first instance with one thing less in which the breach stands."""
        record = found.record
        tried = [(what, own) for what, own in way(record.instance, record.frames) if _is_sound(own)]
        if not tried:
            return None
        findings = in_order(self._runner.attempt([own for _, own in tried]))
        for (what, own), came in zip(tried, findings, strict=True):
            if any(cell.rule == self._rule for cell, _ in came.cells):
                again = confirm(own, self._rule, self._make, self._name)
                if again is not None and self._keeps_lead(again, found):
                    return what, again
        return None

    def _keeps_lead(self, again: Judged, before: Judged) -> bool:
        """Tell whether the breach comes no sooner than it may: what begins with it shows nothing."""
        now, then = again.breach(self._rule), before.breach(self._rule)
        least = lead(again.record.instance)
        return now is not None and then is not None and now.tick >= min(least, then.tick)


def _is_sound(instance: Instance) -> bool:
    """Tell whether an instance is one that its document would give."""
    try:
        instance_from_document(instance_to_document(instance))
    except InputError:
        return False
    return True
