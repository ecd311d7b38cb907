"""Who is at fault in a collision: every clause of the rule, and that the frame before the tick decides."""

from __future__ import annotations

import numpy as np
import pytest

from dubins_traffic.cars.state import Contact, State
from dubins_traffic.rules.fault import with_fault
from dubins_traffic.rules.labeller import Labeller
from dubins_traffic.rules.propositions import FLAG
from tests.rules_scripts import STAR, fill, instance, on_lane


def contact(closing: tuple[float, float], moved: tuple[bool, bool], other: int = 1, tick: int = 1) -> Contact:
    """Return a contact of car 0."""
    return Contact(tick, 0.05, 0, other, 0.0, 0.0, 1.0, 0.0, closing, moved)


def fault(
    closing: tuple[float, float] = (0.5, 0.5),
    moved: tuple[bool, bool] = (True, True),
    bits: tuple[int, int] = (0, 0),
) -> tuple[bool, bool]:
    """Return who is at fault between two cars."""
    return with_fault(contact(closing, moved), np.array(bits, dtype=np.uint32)).at_fault


@pytest.mark.parametrize("closing", [(0.5, 0.5), (0.5, 1e-3)])
def test_all_that_closed_without_a_breach(closing: tuple[float, float]) -> None:
    assert fault(closing) == (True, True)


def test_not_who_stood_or_moved_away() -> None:
    assert fault((0.5, 0.0), (True, False)) == (True, False)
    assert fault((0.5, 0.0), (True, False), (0, FLAG.LEFT)) == (True, False)
    assert fault((0.5, -0.2)) == (True, False)
    assert fault((0.5, -0.2), bits=(0, FLAG.LEFT)) == (True, False)
    assert fault((0.0, 0.5), (False, True), (FLAG.BREACH3, 0)) == (False, True)


@pytest.mark.parametrize(
    "breach", [FLAG.LEFT, FLAG.BREACH3, FLAG.LEFT | FLAG.BREACH3, FLAG.LEFT | FLAG.OVERTAKING | FLAG.BREACH3]
)
def test_of_those_that_closed_those_in_breach(breach: int) -> None:
    assert fault(bits=(breach, FLAG.ON_ROAD)) == (True, False)
    assert fault(bits=(FLAG.ON_ROAD, breach)) == (False, True)
    assert fault(bits=(breach, breach)) == (True, True)


def test_overtaking_is_no_breach() -> None:
    assert fault(bits=(FLAG.LEFT | FLAG.OVERTAKING, 0)) == (True, True)
    assert fault(bits=(FLAG.LEFT | FLAG.OVERTAKING, FLAG.LEFT)) == (False, True)


def test_who_hits_an_obstacle_is_at_fault() -> None:
    hit = contact((0.3, 0.0), (True, False), other=-1)
    assert with_fault(hit, np.zeros(1, dtype=np.uint32)).at_fault == (True, False)
    slid = contact((0.0, 0.0), (False, False), other=-1)
    assert with_fault(slid, np.zeros(1, dtype=np.uint32)).at_fault == (False, False)


def test_the_frame_at_the_beginning_of_the_tick_decides() -> None:
    state = State.zeros(1, 2)
    labeller = Labeller([instance(STAR, 2)])
    right, left = (on_lane(STAR, 0, 2.0, lateral) for lateral in (-0.3, 0.2))
    fill(state, 0, [left, right])
    labeller.reset(state)
    fill(state, 0, [right, left])
    assert labeller.update(1, state, [[contact((0.5, 0.5), (True, True))]])[0][0].at_fault == (True, False)
    assert labeller.update(2, state, [[contact((0.5, 0.5), (True, True), tick=2)]])[0][0].at_fault == (
        False,
        True,
    )


def test_each_trial_is_judged_by_its_own_flags() -> None:
    state = State.zeros(2, 2)
    labeller = Labeller([instance(STAR, 2)] * 2)
    right, left = (on_lane(STAR, 0, 2.0, lateral) for lateral in (-0.3, 0.2))
    fill(state, 0, [left, right])
    fill(state, 1, [right, left])
    labeller.reset(state)
    hit = contact((0.5, 0.5), (True, True))
    found = labeller.update(1, state, [(hit,), (hit,)])
    assert [own[0].at_fault for own in found] == [(True, False), (False, True)]
