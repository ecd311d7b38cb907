"""Two cars that keep the law and meet in a bend: neither is an excuse for the other (E4), and neither needs one."""

from __future__ import annotations

import math

import numpy as np
import pytest

from dubins_traffic.runs.single import run_trial
from tests.unit.test_law import W, car, on_grid, turned
from tests.unit.test_law_company import Stands, Watch, breaches

FREE = 5.0
"""Seconds after which a disc with a free exit must have been left."""


@pytest.mark.parametrize("behind", [0.0, 0.3, 0.6])
def test_cars_that_meet_in_a_bend_both_leave_it_in_time(behind: float) -> None:
    """The bend is at (0, 12) of the grid; one comes to it in the direction of y, the other against that of x."""
    up = car("lawful", "up", turned(W, 9.0, 0.5 * math.pi))
    left = car("lawful", "left", turned(3.0 + behind, 12.0 + W, math.pi))
    instance, watch = on_grid([up, left], 15.0, turned(9.0, -W)), Watch()
    score = run_trial(instance, Stands(), sinks=[watch]).score
    assert breaches(score) == []
    crosses = np.concatenate([block.crosses for block in watch.frames_seen])[:, 1:]
    (met, *_) = np.flatnonzero((crosses[:, 0] >= 0) & (crosses[:, 0] == crosses[:, 1]))
    inside = crosses == crosses[met, 0]
    for own in inside.T:
        assert not own[-1]
        assert 0 < own.sum() < FREE * instance.problem.rate
