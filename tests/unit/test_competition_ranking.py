"""The ranking of a phase: means, what parts equal ones, intervals, ties, and what is no result."""

from __future__ import annotations

import numpy as np
import pytest

from dubins_traffic.campaign.report.statistics import estimate
from dubins_traffic.campaign.rows import RESULT
from dubins_traffic.competition.judging import Judged
from dubins_traffic.competition.ranking import differences, missing, rank
from dubins_traffic.errors import InputError
from tests.competitions import PRACTICE, ROAD, competition, judged, results


def phase(trials: int, ties: str = "satisfied"):
    phases = {"practice": {**PRACTICE, "trials": trials}}
    return competition(phases=phases, ranking={"ties": ties}).phase("practice")


def test_places_follow_the_means_and_carry_the_intervals_of_reports() -> None:
    rng = np.random.default_rng(1)
    values = {name: rng.poisson(mean, 40).astype(float) for name, mean in (("a", 3), ("b", 9), ("c", 1))}
    places = rank({name: results(own.tolist()) for name, own in values.items()}, phase(40))
    assert [(own.place, own.entry) for own in places] == [(1, "b"), (2, "a"), (3, "c")]
    assert [own.estimate for own in places] == [estimate(values[name], median=False) for name in "bac"]
    assert places[0].to_next == estimate(values["b"] - values["a"], median=False)
    assert places[-1].to_next is None
    assert all(own.ties == () for own in places)


def test_entries_whose_differences_hold_zero_are_ties() -> None:
    first = [1.0, 2.0, 3.0, 4.0] * 5
    close = [2.0, 1.0, 4.0, 3.0] * 4 + [1.0, 2.0, 3.0, 5.0]
    places = rank({"first": results(first), "close": results(close), "none": results([0.0] * 20)}, phase(20))
    assert [(own.place, own.entry, own.ties) for own in places] == [
        (1, "close", ("first",)),
        (2, "first", ("close",)),
        (3, "none", ()),
    ]
    one = next(own for own in differences({"first": results(first), "close": results(close)}, phase(20)))
    assert (one.larger, one.smaller) == (8, 9)


def test_one_trial_tells_no_two_entries_apart() -> None:
    places = rank({"a": results([5]), "b": results([1])}, phase(1))
    assert [(own.place, own.ties) for own in places] == [(1, ("b",)), (2, ("a",))]


def test_the_share_of_satisfied_trials_parts_equal_means() -> None:
    good = [judged(k) for k in range(4)]
    less = [judged(k, verdict="unfinished" if k == 2 else "satisfied") for k in range(4)]
    cut = [judged(k, end="collision" if k < 2 else "duration") for k in range(4)]
    entries = {"cut": cut, "less": less, "good": good, "good too": good[::-1]}
    places = rank(entries, phase(4))
    assert [(own.place, own.entry) for own in places] == [
        (1, "good"),
        (1, "good too"),
        (3, "less"),
        (4, "cut"),
    ]
    assert [own.place for own in rank(entries, phase(4, "none"))] == [1, 1, 1, 1]


def test_rounds_before_the_first_breach_part_equal_means() -> None:
    entries = {
        "satisfied": [judged(k, counted_rounds=0, rounds_before_breach=0.25) for k in range(4)],
        "farther": [
            judged(k, counted_rounds=0, rounds_before_breach=0.5 * (k == 0) + 0.25, verdict="violated")
            for k in range(4)
        ],
    }
    assert [(own.place, own.entry, own.second) for own in rank(entries, phase(4))] == [
        (1, "farther", 0.375),
        (2, "satisfied", 0.25),
    ]


def test_the_order_of_entries_and_trials_does_not_matter() -> None:
    entries = {"a": results([1, 2, 3]), "b": results([3, 2, 1]), "c": results([0, 0, 9])}
    turned = {name: entries[name][::-1] for name in "cba"}
    assert rank(entries, phase(3)) == rank(turned, phase(3))
    rows = {name: [one.row for one in own] for name, own in entries.items()}
    assert rank(rows, phase(3)) == rank(entries, phase(3))


def test_what_is_no_result_can_not_be_ranked() -> None:
    whole = results([1, 1, 1])
    ours = [*whole[:2], judged(2, end="failed", owner="platform", counted_rounds=None)]
    assert missing(ours, phase(3)) == [2]
    for bad in (whole[:2], ours, [*whole, whole[0]], [*whole[:2], judged(7)], []):
        with pytest.raises(InputError, match="not one result of each trial"):
            rank({"good": whole, "bad": bad}, phase(3))


def test_the_score_of_2016_counts_a_trial_that_did_not_run_whole_as_a_collision() -> None:
    road = {**ROAD, "e-agents": [{"type": "lawful", "name": "agent", "count": 1}]}
    found = competition(
        ranking={"metric": "icra2016"},
        configurations=[{"name": "road", "document": road}],
        phases={"practice": {**PRACTICE, "trials": 2}},
    ).phase("practice")
    drives = [judged(0, icra2016=4.0), judged(1, icra2016=-1.0)]
    stands = [judged(k, icra2016=0.0) for k in range(2)]
    quits = [judged(k, icra2016=9.0, end="gave_up") for k in range(2)]
    places = rank({"quits": quits, "stands": stands, "drives": drives}, found)
    assert [(own.entry, own.estimate.mean) for own in places] == [
        ("drives", 1.5),
        ("stands", 0.0),
        ("quits", -1.0),
    ]


def test_a_trial_without_rules_is_clean_if_nothing_was_touched() -> None:
    free = [judged(0, clean=None, verdict=None), judged(1, clean=None, verdict=None, collisions=1)]
    (place,) = rank({"free": free}, phase(2))
    assert (place.clean.count, place.satisfied.count) == (1, 0)


@pytest.mark.parametrize(
    "change", [{"number": 7}, {"row": {"number": 0}}, {"end": "collision"}, {"owner": "me"}, {"seed": 3}]
)
def test_a_result_is_read_as_it_was_written_or_refused(change: dict[str, object]) -> None:
    row = {**dict.fromkeys(RESULT), **judged(0).row}
    own = Judged(number=0, row=row, end="duration", owner=None, log="said", frames="00")
    assert Judged.from_json(own.to_json()) == own
    with pytest.raises(InputError):
        Judged.from_json({**own.to_json(), **change})
    with pytest.raises(InputError, match="not a number"):
        Judged.from_json({**own.to_json(), "row": {**row, "counted_rounds": "many"}})
