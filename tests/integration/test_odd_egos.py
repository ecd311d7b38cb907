"""A sample of `benchmarks.odd_egos`, whose bar is 2,000 trials: no odd ego brings a lawful car to a breach."""

import pytest
from benchmarks.odd_egos import NAMES, Oddity, kind_of, trial

SECONDS = 60.0
SAMPLE = tuple(range(28, 28 + len(NAMES)))


@pytest.fixture(scope="module")
def odd() -> list[Oddity]:
    return [trial(number, SECONDS) for number in SAMPLE]


def test_every_kind_of_ego_is_in_the_sample() -> None:
    assert {NAMES[kind_of(number)] for number in SAMPLE} == set(NAMES)
    assert len(NAMES) >= 10


def test_odd_egos_are_clean(odd: list[Oddity]) -> None:
    assert [(one.number, one.own, one.end) for one in odd if not one.counts] == []


def test_no_odd_ego_brings_a_lawful_car_to_a_breach(odd: list[Oddity]) -> None:
    assert [(one.number, one.kind, one.others) for one in odd if one.others] == []
