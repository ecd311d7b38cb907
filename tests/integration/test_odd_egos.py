"""A sample of `experiments.odd_egos`, whose bar is 2,000 trials: no odd ego brings a lawful car to a breach."""

import pytest
from experiments.odd_egos import NAMES, Oddity, kind_of, trial

SECONDS = 60.0
SAMPLE = tuple(range(28, 28 + len(NAMES)))
FELL = (135, 560, 686, 933, 990, 998, 1244, 1256, 1403, 1573, 1581, 1848)
FELL_LATER = (2145, 2324, 2419, 2528, 2644, 2725, 3239, 3351, 3393, 3741, 3835, 3934)
"""Trials in which an e-agent once broke a rule: of those of the bar, and of others.

Lawful cars stood for ever before obstacles which leave room (in 990 two of them), chose another exit late for one who
only passed an obstacle or swayed in his own lane (560, 1403, 1573, 1581), or came out of a disc on the left after that
(998). They chose another exit late for one who drove in the next disc (933, 2725), swung or turned behind theirs (2419,
3741); stuck to an obstacle that they passed (1244, 1256, 3393, 3835) or stood before one behind the next bend (1848);
entered a full lane, though another led on to an obstacle (2528, 3351), or one with an obstacle just behind the disc
(2324, 3239); waited to turn round in a bend (2145, 3934); and followed one another through a goal without end (2644).
"""


@pytest.fixture(scope="module")
def odd() -> list[Oddity]:
    return [trial(number, SECONDS) for number in SAMPLE]


def test_every_kind_of_ego_is_in_the_sample() -> None:
    assert {NAMES[kind_of(number)] for number in SAMPLE} == set(NAMES)


def test_odd_egos_are_clean(odd: list[Oddity]) -> None:
    assert [(one.number, one.own, one.end) for one in odd if not one.counts] == []


def test_no_odd_ego_brings_a_lawful_car_to_a_breach(odd: list[Oddity]) -> None:
    assert [(one.number, one.kind, one.others) for one in odd if one.others] == []


@pytest.mark.parametrize("number", FELL + FELL_LATER)
def test_what_once_was_a_breach_is_none(number: int) -> None:
    one = trial(number)
    assert one.counts
    assert one.others == ()
