"""The project's own cases: what its drivers break, and what mutants of `rules` break and `rules` does not."""

from pathlib import Path

import pytest
from experiments.free_egos import Free

from dubins_traffic.falsification.regress import cases_in, outcomes
from tests.contract_drivers import AsEgo, Stands

CASES = Path(__file__).parents[1] / "cases"
CONTRACT = CASES / "contract"
"""What broke the contract once: who blocked `rules`, and who was provoked by an ego that stands, or that does
anything under the shield."""

WIDE = CASES.parent / "wide_cases"
"""What did so among so many cars, none of which could be left out."""


def test_rules_passes_the_cases_of_its_mutants() -> None:
    assert [own.file.name for own in outcomes(cases_in(CASES / "rules"), "rules") if not own.passed] == []


def test_the_shield_passes_the_cases_of_lanes() -> None:
    assert [own.file.name for own in outcomes(cases_in(CASES / "lanes"), "lanes+shield") if not own.passed] == []


def test_rules_gets_past_who_stands_askew_beside_it() -> None:
    """It waited for good beside a car that moved while it was being passed, behind it or where it would return.

    Or it had stopped, still left of its lane, where it could only go straight to the right before a disc, or a little
    back; or it did not lean past who stood in a bend, or leaned there to the inner corner of the road, where nothing is
    open to it, or turned to its line and back for ever; or who stood there owed no exit, since it came in later.

    Or who stood before an obstacle just out of a bend was excused by the ego that waited in the bend behind it; or it
    did not fall back behind who had moved up beside it, to a bend or into a dead end, or too flat to get away from it,
    or stood before a bend off the middle of its lane, right of the centre line, where it could have driven on.
    """
    assert [own.file.name for own in outcomes(cases_in(CONTRACT / "blocked"), "rules") if not own.passed] == []


def test_who_keeps_the_law_is_not_brought_to_a_breach_by_an_ego_that_stands() -> None:
    """It waited so far before a full crossing that E5 asked it to come on (`crossing_degree` 1).

    Or it had come up to an obstacle beside its way, which it no longer thought of as ahead, and stood there (E4).
    """
    found = list(outcomes(cases_in(CONTRACT / "provoked"), lambda: AsEgo(Stands())))
    assert [own.file.name for own in found if not own.passed] == []


def test_who_keeps_the_law_leaves_discs_in_time_beside_an_ego_that_does_as_it_likes() -> None:
    """It kept 0.8 m from an ego that turned beyond its exit, or waited for who stood beside its way (E4).

    Or it turned toward its way, where an ego stood in a bend, and not on beside it (E6), or where one stood behind it
    (E4).
    """
    found = list(outcomes(cases_in(CONTRACT / "egos"), Free))
    assert len(found) == 11
    assert [own.file.name for own in found if not own.passed] == []


def test_who_keeps_the_law_leaves_in_time_among_many() -> None:
    """Its exit taken late, it turned back across the whole crossing; it stood beside an ego that turned on the spot.

    Or behind one that stood at the outer edge of a bend, or came a little over the line beside its exit; or it turned
    toward its way, which an ego barred, and there to its line and back for ever; or it came a hair into a bend and kept
    a gap to who stood there, past whom it could lean, or waited for an ego that it could pass outside; or one beside it
    shifted by 3 mm, or beyond the corner, and it waited; or it did not go aside where its way was too near.
    """
    found = list(outcomes(cases_in(WIDE), Free))
    assert [own.file.stem for own in found] == [
        "drives_on_in_a_bend_beside_an_ego", "drives_on_where_an_ego_bars_its_line", "leaves_a_crossing_late",
        "leaves_beside_who_comes_over_the_line", "leaves_beside_who_stands_at_the_edge", "leaves_beside_who_turns",
        "leaves_left_of_who_turns", "leaves_past_the_corner_beside_who_shifts", "passes_outside_in_a_bend",
        "turns_to_its_line_and_back", "waits_at_the_edge_of_a_disc", "waits_beside_who_shifts",
    ]  # fmt: skip
    assert [own.file.name for own in found if not own.passed] == []


@pytest.mark.parametrize("controller", ["lanes", "simple"])
def test_a_known_case_is_told_in_the_same_words_again(controller: str) -> None:
    found = list(outcomes(cases_in(CASES / controller), controller))
    assert len(found) >= 3
    for own in found:
        assert not own.passed
        assert own.case.story.rule in own.broken
        assert own.sentence == own.case.story.sentence


def test_most_cases_are_small() -> None:
    folders = [folder for folder in CASES.rglob("*") if any(folder.glob("*.json"))]
    cases = [case for folder in folders for _, case in cases_in(folder)]
    small = [case for case in cases if len(case.instance.starts) <= 3]
    assert len(small) >= 0.8 * len(cases)
