"""The metrics of goals: visits, gaps between them, and completed rounds."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from dubins_traffic.cars.state import EGO, Frames
from dubins_traffic.kernels.arrays import Floats, Ints
from dubins_traffic.problem.instance import Instance
from dubins_traffic.record.sink import Ending
from dubins_traffic.scoring.duration import planned_ticks
from dubins_traffic.scoring.metric import Column, ScoreColumn

RECURRENT = 2
"""Visits of each goal after frame 0 that `satisfied` asks for (docs/rules.md#satisfied)."""

Mask = np.ndarray[tuple[int, int], np.dtype[np.bool_]]


class GoalDiscs:
    """The discs of a problem's goals, each goal once, in the order of the document."""

    def __init__(self, instance: Instance) -> None:
        problem = instance.problem
        self.goals = tuple(dict.fromkeys(problem.goals))
        self._network = problem.network
        self.vertices = [problem.network.vertex(goal) for goal in self.goals]
        self._centres: Floats = np.asarray(problem.network.points)[self.vertices].reshape(-1, 2)
        self._radius = problem.intersection_radius

    def inside(self, frames: Frames) -> Mask:
        """Return whether the ego's centre lies in each disc at each frame, (F, goals)."""
        x = frames.x[:, EGO, None] - self._centres[:, 0]
        y = frames.y[:, EGO, None] - self._centres[:, 1]
        return np.sqrt(x * x + y * y) < self._radius

    def at_start(self, instance: Instance) -> list[bool]:
        """Return for each goal whether the ego starts in its disc."""
        start = instance.starts[EGO]
        x, y = start.x - self._centres[:, 0], start.y - self._centres[:, 1]
        return (np.sqrt(x * x + y * y) < self._radius).tolist()

    def at(self, frames: Frames) -> Ints:
        """Return the intersection whose disc holds the ego's centre at each frame, goal or not, (F,); -1: none."""
        places = np.column_stack([frames.x[:, EGO], frames.y[:, EGO]])
        nearest = self._network.nearest_intersection(places)[0]
        x, y = (places - self._network.points[nearest]).T
        return np.where(x * x + y * y < self._radius * self._radius, nearest, -1)


class Rounds:
    """Counts rounds: when all of `goals` goals are done, a round is counted and all become undone.

    Norm: docs/rules.md#round.
    """

    def __init__(self, goals: int) -> None:
        self.count = 0
        self._all = (1 << goals) - 1
        self._done = 0

    def add(self, done: Mask) -> None:
        """Take the goals done at each of some consecutive frames, (F, goals)."""
        rows = done[done.any(axis=1)]
        for row in np.packbits(rows, axis=1, bitorder="little"):
            self._done |= int.from_bytes(row.tobytes(), "little")
            if self._done == self._all:
                self.count += 1
                self._done = 0


@dataclass(frozen=True, slots=True)
class GoalVisits:
    """Visits of one goal; `longest_gap_s` is the longest time without one, from frame 0 to the planned end."""

    goal: tuple[float, float]
    visits: int
    longest_gap_s: float


@dataclass(frozen=True, slots=True)
class Visits:
    """Visits of all goals, each goal once.

    `visited` is the share of them visited, 1 without goals; `recurrent` tells whether each was visited in at least
    `RECURRENT` frames after frame 0.
    """

    goals: tuple[GoalVisits, ...]
    visited: float
    rounds: int
    recurrent: bool


class Visiting:
    """Visits: entries of the ego's centre into a goal's disc, a start inside included (docs/rules.md#visit).

    Between two visits of a goal its centre has been in the disc of another intersection. A round is complete when every
    goal has been visited since the last round; without goals there are none.

    Norm: docs/rules.md#1.goal, docs/rules.md#visit.
    """

    def begin(self, instance: Instance) -> None:
        """Start counting."""
        self._discs = GoalDiscs(instance)
        count = len(self._discs.goals)
        self._rounds = Rounds(count)
        self._inside = np.zeros(count, dtype=bool)
        self._elsewhere = np.full(count, -1, dtype=np.int64)
        self._visits = np.zeros(count, dtype=np.int64)
        self._last = np.zeros(count, dtype=np.int64)
        self._gap = np.zeros(count, dtype=np.int64)
        self._order: list[tuple[int, int]] = []
        self._end = planned_ticks(instance)
        self._rate = instance.problem.rate
        self._last_frame = -1

    def frames(self, frames: Frames) -> None:
        """Take a block of frames."""
        if not len(frames):
            return
        inside = self._discs.inside(frames)
        entered = self._visits_among(inside & ~np.vstack([self._inside, inside[:-1]]), frames)
        self._inside = inside[-1]
        self._end = max(self._end, frames.first + len(frames) - 1)
        self._rounds.add(entered)
        self._last_frame = frames.first + len(frames) - 1

    def _visits_among(self, entered: Mask, frames: Frames) -> Mask:
        """Count the visits of each goal; return which of the entries of its disc, (F, goals), are visits."""
        at = self._discs.at(frames)
        for goal, vertex in enumerate(self._discs.vertices):
            elsewhere = frames.first + np.flatnonzero((at >= 0) & (at != vertex))
            for row in np.flatnonzero(entered[:, goal]).tolist():
                entered[row, goal] = self._visit(goal, frames.first + row, elsewhere)
            if len(elsewhere):
                self._elsewhere[goal] = elsewhere[-1]
        return entered

    def _visit(self, goal: int, tick: int, elsewhere: Ints) -> bool:
        """Count the entry of a goal's disc in frame `tick` if it is a visit; return whether it is.

        `elsewhere` are the frames of this block in which the ego is in another disc, in order.
        """
        before = int(np.searchsorted(elsewhere, tick, side="right"))
        last = elsewhere[before - 1] if before else self._elsewhere[goal]
        if self._visits[goal] and last <= self._last[goal]:
            return False
        self._visits[goal] += 1
        self._gap[goal] = max(self._gap[goal], tick - self._last[goal])
        self._last[goal] = tick
        self._order.append((tick, goal))
        return True

    @property
    def now(self) -> list[bool]:
        """For each goal whether a visit began in the last frame."""
        return [
            bool(count) and last == self._last_frame
            for count, last in zip(self._visits, self._last, strict=True)
        ]

    def end(self, ending: Ending) -> None:
        """Nothing is left to do."""

    def rounds_until(self, last: int | None) -> float:
        """Return the rounds of the visits in frames 1 to `last`, with the share of the goals of the round begun.

        None stands for the last frame (docs/rules.md#before-breach).
        """
        rounds, done = 0, set[int]()
        for tick, goal in sorted(self._order):
            if tick == 0 or (last is not None and tick > last):
                continue
            done.add(goal)
            if len(done) == len(self._visits):
                rounds += 1
                done.clear()
        return rounds_with_share(rounds, len(done), len(self._visits))

    def result(self) -> Visits:
        """Return the visits up to the last frame; gaps run to the planned end, whenever the trial ended."""
        gaps = np.maximum(self._gap, self._end - self._last) / self._rate
        rows = zip(self._discs.goals, self._visits.tolist(), gaps.tolist(), strict=True)
        visited = float((self._visits > 0).mean()) if len(self._visits) else 1.0
        at_start = {goal for tick, goal in self._order if tick == 0}
        later = [count - (goal in at_start) for goal, count in enumerate(self._visits.tolist())]
        found = tuple(GoalVisits(*row) for row in rows)
        return Visits(found, visited, self._rounds.count, min(later, default=RECURRENT) >= RECURRENT)


def rounds_with_share(rounds: int, done: int, goals: int) -> float:
    """Return rounds, and the share of `goals` goals that is `done` in the round begun; 0 without goals."""
    return rounds + done / goals if goals else 0.0


COLUMNS = (
    ScoreColumn(Column("rounds", "rounds", "", 1, "int32"), lambda score: score.rounds),
    ScoreColumn(
        Column("rounds_before_breach", "rounds before the first breach", "", 1),
        lambda score: score.rounds_before_breach,
    ),
    ScoreColumn(Column("goals_visited", "goals visited", "share", 1), lambda score: score.goals_visited),
    ScoreColumn(
        Column("longest_gap_s", "longest gap between visits", "s", -1),
        lambda score: max((goal.longest_gap_s for goal in score.goals), default=None),
    ),
)
