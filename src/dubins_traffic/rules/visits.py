"""Visits of intersections, and rounds of goals: the one place that tells when one begins, and when one is complete.

The tally of a trial, a driver that seeks goals and the propositions of formulas all count by these.
"""

from __future__ import annotations

from typing import Protocol

import numpy as np

from dubins_traffic.kernels.arrays import Ints
from dubins_traffic.kernels.compile import jit, jit_inline
from dubins_traffic.kernels.records import Rows, record, table


class Visited(Protocol):
    """What is remembered of an intersection that may be visited: fields of a row."""

    vertex: int
    """Its number."""
    inside: int
    """1 if the centre was in its disc in the frame before."""
    fresh: int
    """1 if coming into its disc is a visit: there was none yet, or the centre has been in another disc since."""


class Rounds(Protocol):
    """A count of rounds: fields of a row."""

    rounds: int
    """Rounds completed."""
    goals: int
    """Goals done in the round that has begun."""


@record
class VisitedPlace:
    """An intersection, as `Visited`."""

    vertex: int
    """Its number."""
    inside: int
    """1 if the centre was in its disc in the frame before."""
    fresh: int = 1
    """1 if coming into its disc is a visit."""


@jit_inline
def come_by(at: int, place: Visited) -> None:
    """Note that the centre is in the disc of intersection `at` (index), before `begins_visit` is asked."""
    if at != place.vertex:
        place.fresh = 1


@jit_inline
def begins_visit(inside: bool, place: Visited) -> bool:
    """Tell whether a visit of a place begins in this frame, in which the centre is `inside` (bool) its disc or not.

    Norm: docs/rules.md#1.goal, docs/rules.md#visit.
    """
    begins = inside and place.inside == 0 and place.fresh != 0
    place.inside = 1 if inside else 0
    if begins:
        place.fresh = 0
    return begins


@jit_inline
def do_goal(g: int, done: Ints, rounds: Rounds) -> None:
    """Note that goal `g` (row) is done; `done` (G,) is 1 for those of the round that has begun."""
    rounds.goals += 1 - done[g]
    done[g] = 1


@jit_inline
def finish_round(first: int, last: int, done: Ints, rounds: Rounds) -> None:
    """Count a round if all goals, `first` (row) to the one before `last` (row), are `done` (G,); all become undone.

    Norm: docs/rules.md#round.
    """
    if rounds.goals != 0 and rounds.goals == last - first:
        rounds.rounds += 1
        rounds.goals = 0
        for g in range(first, last):
            done[g] = 0


def visited_place(vertex: int) -> Rows[VisitedPlace]:
    """Return what `mark_visits` remembers of an intersection, before the first frame."""
    place = table(VisitedPlace, 1)
    place["vertex"] = vertex
    return place


@jit
def mark_visits(at: Ints, place: Rows[VisitedPlace], visits: Ints) -> None:
    """Write to `visits` (F,) 1 for each frame in which a visit begins; `at` (F,) are the discs that hold the centre."""
    first = place[0]
    for f in range(at.shape[0]):
        if at[f] >= 0:
            come_by(at[f], first)
        visits[f] = 1 if begins_visit(at[f] == first.vertex, first) else 0


def visits_in(at: Ints, place: Rows[VisitedPlace]) -> Ints:
    """Return for each of the next frames, (F,), 1 if a visit begins; as `mark_visits`."""
    visits = np.zeros(len(at), dtype=np.int64)
    mark_visits(np.ascontiguousarray(at), place, visits)
    return visits
