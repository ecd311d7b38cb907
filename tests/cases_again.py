"""Cases of searches, judged afresh: whether they stand, and whether anything more can be taken away from them."""

from __future__ import annotations

from dubins_traffic.engine.controlled import Maker
from dubins_traffic.falsification.case import Case, Judged, confirm, judge
from dubins_traffic.falsification.shrink import lead, single_removals
from dubins_traffic.falsification.trying import TrialRunner, in_order, maker, name_of
from dubins_traffic.scoring.verdict import Ruling
from tests.mutants import MUTANTS

BY_NAME = {planted.kind.__name__: planted.kind for planted in MUTANTS.values()}


def driver_of(case: Case) -> str | Maker:
    """Return who drives in a case: a driver by name, or a mutant."""
    return BY_NAME.get(case.story.controller, case.story.controller)


def judged_afresh(case: Case, driver: str | Maker) -> Judged:
    """Return what the judge says of the record of a case; the ego is to answer for it."""
    judged = judge(case.instance, maker(driver), name_of(driver))
    verdict, breach = judged.score.verdict, judged.breach(case.story.rule)
    assert verdict is not None
    assert verdict.verdict is Ruling.VIOLATED
    assert not verdict.assumption_broken
    assert not [own for own in verdict.violations if own.car != "ego"]
    assert {part: verdict.formulas[part] for part in verdict.formulas if part.startswith("E")}.keys() == {
        "E1", "E2", "E3", "E4", "E5", "E6",
    }  # fmt: skip
    assert breach is not None
    assert breach.tick == case.story.tick == case.instance.ticks
    return judged


def still_broken(case: Case, driver: str | Maker) -> list[str]:
    """Return what can be taken away from a case without its breach being lost, or coming as soon as it may."""
    judged = judged_afresh(case, driver)
    left = single_removals(judged)
    assert left or not case.instance.e_agents
    rule, found = case.story.rule, []
    tried = in_order(TrialRunner(driver).attempt([instance for _, instance in left]))
    for (what, instance), came in zip(left, tried, strict=True):
        if not any(cell.rule == rule for cell, _ in came.cells):
            continue
        again = confirm(instance, rule, maker(driver), name_of(driver))
        breach = None if again is None else again.breach(rule)
        if breach is not None and breach.tick >= min(lead(instance), case.story.tick):
            found.append(what)
    return found
