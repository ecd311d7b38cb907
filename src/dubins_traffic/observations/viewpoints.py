"""Trials as each of their cars sees them: a batch with a row for each car, in which that car is the ego.

So kernels that are written for egos, such as the shield and flat observations, serve any car: in its row the car comes
first, then the others by index, as in an observation (`observations.senses`).
"""

from __future__ import annotations

import numpy as np

from dubins_traffic.cars.state import Labels, State
from dubins_traffic.kernels.arrays import Ints
from dubins_traffic.kernels.calls import bound
from dubins_traffic.kernels.compile import jit
from dubins_traffic.kernels.tables import Tables


class ViewTables(Tables):
    """The frame of a batch, (B, N), and what each car sees of it: row ``b N + n`` is trial b as car n sees it."""

    state: State
    labels: Labels
    own_state: State
    """(B N, N)."""
    own_labels: Labels
    """(B N, N)."""


@jit
def turn_round(trials: Ints, views: ViewTables) -> None:
    """Fill the rows of all cars of some `trials` (K,) from the present frame."""
    for k in range(trials.shape[0]):
        b: int = trials[k]
        count = views.state.count[b]
        for n in range(count):
            row = b * views.state.x.shape[1] + n
            show(b, n, row, views.state, views.labels, views.own_state, views.own_labels)


@jit
def show(b: int, n: int, row: int, state: State, labels: Labels, seen_state: State, named: Labels) -> None:
    """Fill row `row` (row) of `seen_state` and `named` with the cars of trial b, car n first."""
    seen_state.count[row] = state.count[b]
    for car in range(state.count[b]):
        place = 0 if car == n else (car + 1 if car < n else car)
        seen_state.x[row, place] = state.x[b, car]
        seen_state.y[row, place] = state.y[b, car]
        seen_state.c[row, place] = state.c[b, car]
        seen_state.s[row, place] = state.s[b, car]
        seen_state.speed[row, place] = state.speed[b, car]
        seen_state.yaw_rate[row, place] = state.yaw_rate[b, car]
        named.segment[row, place] = labels.segment[b, car]
        named.at[row, place] = labels.at[b, car]
        named.crosses[row, place] = labels.crosses[b, car]
        named.lane[row, place] = labels.lane[b, car]
        named.bits[row, place] = labels.bits[b, car]


class Viewpoints:
    """The present frame of some trials as each car sees it.

    Parameters
    ----------
    state, labels : State, Labels
        The frame of the trials, (B, N), which its owner updates in place.

    Attributes
    ----------
    state, labels : State, Labels
        The same as each car sees it, (B N, N), as of the last `look`; rows of cars that a trial does not have are
        empty.
    """

    def __init__(self, state: State, labels: Labels) -> None:
        trials, cars = state.x.shape
        self.state, self.labels = State.zeros(trials * cars, cars), Labels.zeros(trials * cars, cars)
        self._tables = ViewTables(state, labels, self.state, self.labels)
        self._turn = bound(turn_round)
        every: Ints = np.arange(trials, dtype=np.int64)
        self.look(every)

    def look(self, trials: Ints) -> None:
        """Update the rows of some trials, (K,), to their present frame."""
        self._turn(trials, self._tables)
