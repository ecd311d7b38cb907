"""What independent runs of splitting say together, and when they send to Monte Carlo."""

from itertools import starmap

import pytest

from dubins_traffic.campaign.report.statistics import clopper_pearson, korn_graubard
from dubins_traffic.falsification.estimate import Replicas, combined
from dubins_traffic.falsification.splitting import Split


def _runs(*found: tuple[float, int], branches: int = 200, repeated: int = 0) -> Replicas:
    def one(probability: float, counted: int) -> Split:
        return Split(probability, 100 + branches, counted, branches, repeated, (0.5,))

    return combined(list(starmap(one, found)), 100)


def test_runs_that_all_die_out_give_a_bound_and_say_so() -> None:
    found = _runs(*[(0.0, 0)] * 10)
    assert found.probability == 0.0
    assert found.interval == clopper_pearson(0, 1_000)
    assert (found.extinct, found.worth, found.better) == (10, None, "monte-carlo")
    assert found.advice[0].startswith("no run got there: that does not say that it can't happen")
    assert "at most 0.0037 (95 %), by the first 1000 trials" in found.advice[0]
    assert found.advice[1].startswith("Monte Carlo is better here: 3000 trials without the event")


def test_where_most_runs_die_out_the_interval_reaches_around_that_of_the_first_trials() -> None:
    values = [1e-6] + [0.0] * 9
    found = _runs(*[(value, 0) for value in values])
    assert korn_graubard(values)[1] < 1e-4
    assert found.interval == (0.0, clopper_pearson(0, 1_000)[1])
    assert found.advice[0].startswith("9 of 10 runs ended without the event; the interval reaches around")
    assert found.better == "monte-carlo"


def test_equal_estimates_make_no_narrow_interval() -> None:
    """Estimates lie on a grid, so few of them are often equal; their spread of 0 says nothing."""
    found = _runs((0.08, 8), (0.08, 9))
    low, high = clopper_pearson(17, 200)
    assert found.interval == (low, high)
    assert low < 0.06
    assert high > 0.12
    assert found.better == "monte-carlo"


def test_runs_that_agree_are_worth_more_trials_than_they_took() -> None:
    found = _runs(*[(value, 0) for value in (0.001, 0.0011, 0.0009, 0.001, 0.001)])
    assert found.interval[0] > 0.0009
    assert found.worth is not None
    assert found.worth > found.trials
    assert found.better == "splitting"
    assert found.advice == (f"Monte Carlo would need about {found.worth:.0f} trials to vary as little",)


def test_runs_that_differ_more_than_a_count_of_as_many_trials_send_to_monte_carlo() -> None:
    found = _runs((0.02, 1), (0.001, 0), (0.0, 0), (0.03, 2), (0.002, 0), repeated=190)
    assert found.worth is not None
    assert found.worth < found.trials
    assert found.better == "monte-carlo"
    assert found.advice[0] == "1 of 5 runs ended without the event"
    assert found.advice[1].startswith("95% of the trials that were branched off came to the margin")
    assert found.advice[2].startswith(f"Monte Carlo is better here: about {found.worth:.0f} trials of it")


@pytest.mark.parametrize("counted", [100, 30])
def test_runs_that_branched_nothing_off_are_a_count_of_trials(counted: int) -> None:
    found = _runs(*[(counted / 100, counted)] * 4, branches=0)
    assert found.interval == clopper_pearson(4 * counted, 400)
    assert found.worth == found.trials == 400
