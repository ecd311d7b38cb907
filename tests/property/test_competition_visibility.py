"""What participants see: in a secret phase nothing that depends on its seeds, before it has closed."""

from __future__ import annotations

import json
from datetime import UTC, datetime
from typing import get_args

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from dubins_traffic.competition.competition import Phase
from dubins_traffic.competition.judging import OWNERS, Judged
from dubins_traffic.competition.visibility import State, SubmissionState, visible
from tests.competitions import VALIDATION, competition, judged

WITHIN = datetime(2026, 1, 15, tzinfo=UTC)
AFTER = datetime(2026, 2, 1, tzinfo=UTC)
FOUND = competition()
ENDS = ["duration", "collision", "gave_up", *(end for end, owner in OWNERS.items() if owner == "submission")]


def one(number: int) -> st.SearchStrategy[Judged]:
    """Return what may come of a trial that the platform did not fail, whatever its seed."""
    return st.builds(
        lambda end, rounds, verdict, log, reason: judged(
            number,
            end=end,
            owner=OWNERS.get(end),
            counted_rounds=rounds,
            verdict=verdict,
            reason=reason,
            log=log,
            frames=f"{rounds:064x}",
        ),
        st.sampled_from(ENDS),
        st.integers(0, 50),
        st.sampled_from(["satisfied", "violated", "excused", "unfinished"]),
        st.text(max_size=200),
        st.none() | st.text(max_size=40),
    )


trials = st.integers(0, 6).flatmap(lambda count: st.tuples(*map(one, range(count)))).map(list)
states = st.sampled_from(get_args(State))


def state_of(name: State, reason: str) -> SubmissionState:
    return SubmissionState(name, reason, None, "2026-01-10T00:00:00+00:00", 3)


@settings(deadline=None, derandomize=True)
@given(states, trials, trials, st.text(max_size=30), st.text(max_size=30))
def test_other_seeds_change_no_byte_of_a_secret_phase(
    name: State, first: list[Judged], second: list[Judged], one_reason: str, other_reason: str
) -> None:
    phase = FOUND.phase("test")
    if name in ("rejected", "cancelled"):  # no trial has come to that
        other_reason = one_reason
    seen = json.dumps(visible(phase, state_of(name, one_reason), first, now=WITHIN))
    assert seen == json.dumps(visible(phase, state_of(name, other_reason), second, now=WITHIN))


@settings(deadline=None, derandomize=True)
@given(trials, trials)
def test_how_a_submission_ended_is_not_seen_of_a_secret_phase(first: list[Judged], second: list[Judged]) -> None:
    phase = FOUND.phase("test")
    done = visible(phase, SubmissionState("done"), first, now=WITHIN)
    failed = visible(phase, SubmissionState("failed", "crashed in trial 3", "submission"), second, now=WITHIN)
    assert done == failed
    assert done["state"] == "finished"


def test_queued_and_running_look_alike_and_faults_of_ours_are_told() -> None:
    phase = FOUND.phase("test")
    seen = {name: visible(phase, SubmissionState(name), (), now=WITHIN)["state"] for name in get_args(State)}
    assert set(seen.values()) == {"received", "queued", "finished", "rejected", "cancelled"}
    ours = [judged(0, end="failed", owner="platform", reason="seed 7 can't be drawn")]
    told = visible(phase, SubmissionState("running"), ours, now=WITHIN)
    assert told["owner"] == "platform"
    assert "seed" not in json.dumps(told)


@settings(deadline=None, derandomize=True)
@given(trials)
def test_aggregates_are_rounded_and_told_of_enough_finished_trials_alone(found: list[Judged]) -> None:
    phase = FOUND.phase("validation")
    told = visible(phase, SubmissionState("done"), found, now=WITHIN)
    assert "trials" not in told
    if len(found) < 6:
        assert told["summary"] is None
    else:
        numbers = [told["summary"][name] for name in ("counted_rounds", "satisfied", "clean")]
        assert numbers == [round(value, 1) for value in numbers]
    assert len(told["log"].splitlines()) <= 2
    assert visible(phase, SubmissionState("running"), found, now=WITHIN)["summary"] is None


def test_too_few_trials_have_no_aggregates_and_the_log_has_a_tail() -> None:
    phases = {"validation": {**VALIDATION, "least_trials": 7}}
    few: Phase = competition(phases=phases).phase("validation")
    found = [judged(k, log="one\ntwo\nthree") for k in range(6)]
    told = visible(few, SubmissionState("done"), found, now=WITHIN)
    assert (told["summary"], told["log"]) == (None, "two\nthree")


def test_the_log_of_the_first_fault_is_shown() -> None:
    phase = FOUND.phase("validation")
    found = [judged(k, log=f"trial {k}") for k in range(6)]
    found[2] = judged(2, end="controller_fault", owner="submission", log="ZeroDivisionError")
    told = visible(phase, SubmissionState("done"), found, now=WITHIN)
    assert (told["log"], told["faults"]) == ("ZeroDivisionError", ["controller_fault"])


@pytest.mark.parametrize("name", ["validation", "test"])
def test_all_is_shown_once_a_phase_has_closed(name: str) -> None:
    found = [judged(k) for k in (3, 1, 0, 2)]
    told = visible(FOUND.phase(name), SubmissionState("done"), found, now=AFTER)
    assert [own["number"] for own in told["trials"]] == [0, 1, 2, 3]
    assert told["summary"]["counted_rounds"] == 1.0
    assert visible(FOUND.phase("practice"), SubmissionState("running"), found)["done"] == 4
