"""Each mutant of `rules` breaks its clause in a case in which `rules` is clean and all e-agents keep the assumption."""

from __future__ import annotations

import pytest

from dubins_traffic.engine.batch import outcomes
from dubins_traffic.runs.single import run_trial
from dubins_traffic.scoring.verdict import Ruling
from tests.mutants import MUTANTS, case
from tests.mutated import Mutant

CASES = {
    "tie_by_index": (180, 4.0),
    "tie_by_left": (180, 4.0),
    "wide_group": (127, 5.0),
    "forgets_forfeit": (296, 16.0),
    "stops_late": (9, 10.0),
    "stops_short": (22, 4.0),
    "blind_sector": (178, 19.0),
    "clear_early": (2, 9.0),
    "left_long": (16, 16.0),
    "swerves": (130, 14.0),
    "returns_early": (16, 24.0),
    "forgets_standing": (5, 20.0),
}
"""For each mutant the number of a case in which it breaks its clause, and seconds after which it has."""


@pytest.mark.parametrize("name", MUTANTS)
def test_a_mutant_breaks_its_clause_and_nobody_else_breaks_anything(name: str) -> None:
    number, seconds = CASES[name]
    (found,) = outcomes([case(number, seconds)], MUTANTS[name].kind)
    verdict = found.score.verdict
    assert verdict is not None
    assert verdict.verdict is Ruling.VIOLATED
    assert verdict.violations[0].rule in MUTANTS[name].rules
    assert {own.car for own in verdict.violations} == {"ego"}
    (sound,) = outcomes([case(number, seconds)], "rules")
    assert sound.score.verdict is not None
    assert sound.score.verdict.clean


def test_a_mutant_that_changes_nothing_is_rules_alone_and_in_a_batch() -> None:
    own = [case(number, 12.0) for number in (2, 127, 180)]
    rules = [one.score.verdict for one in outcomes(own, "rules")]
    assert [one.score.verdict for one in outcomes(own, Mutant)] == rules
    assert [run_trial(one, Mutant()).score.verdict for one in own] == rules
