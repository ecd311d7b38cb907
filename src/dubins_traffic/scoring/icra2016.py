"""The score of the competition at ICRA 2016, to the letter.

Source: fmrbenchmark 0.0.4, ``evaluation/ICRA2016/icra2016_dubins_traffic.py``, and the description of the benchmark,
*Proposal for a benchmark: Traffic network of Dubins cars*, section II.E. Differences of that program from its
description are kept, since published scores rest on them:

- it counts samples, not visits: at every sample the goals within reach are added to a set; when the set is full a
  round is counted and the set emptied. With one goal each sample inside is a round, with none every sample is;
- a collision is a distance of centres below 0.36 m at a sample, not contact of the bodies;
- e-agents are the models whose names begin with ``agent``; others neither count nor collide;
- the road has no rounded ends: a point is on it if its projection falls within a segment and it is at most 0.6 m
  beside it, whatever the width of the cars;
- the formula needs a grid, and e-agents of that name where there are e-agents: elsewhere the score is not defined;
- time off the road counts when the ego is back on it, from the first sample off to the first on; the last stretch
  does not count if it has not ended.
"""

from __future__ import annotations

import numpy as np

from dubins_traffic.cars.state import EGO, Frames
from dubins_traffic.kernels.arrays import Floats
from dubins_traffic.problem.instance import Instance
from dubins_traffic.record.sink import Ending
from dubins_traffic.roads.network import RoadNetwork
from dubins_traffic.scoring.goals import GoalDiscs, Rounds
from dubins_traffic.scoring.metric import Column, ScoreColumn

COLLISION_DISTANCE = 0.36
"""Centres closer than this are a collision, metres."""
ROAD_HALF_WIDTH = 0.6
"""Largest lateral distance on a road, metres."""
COLLISION_SCORE = -1.0


def counts(name: str) -> bool:
    """Tell whether the e-agent called `name` counts."""
    return name.startswith("agent")


def weight_of(instance: Instance) -> int | None:
    """Return e-agents * rows * columns; None where the formula does not apply.

    That is on a network which is no grid, and where there are e-agents and none of them counts.
    """
    agents = sum(counts(agent.name) for agent in instance.e_agents)
    network = instance.problem.network
    if not network.is_grid or (instance.e_agents and not agents):
        return None
    rows, columns = network.shape
    return agents * rows * columns


class Icra2016:
    """The score of one trial: -1 after a collision, else e-agents * rows * columns * rounds / max(1, s off road).

    None where the formula does not apply.
    """

    def begin(self, instance: Instance) -> None:
        """Start counting."""
        problem = instance.problem
        self._agents = [n for n, name in enumerate(instance.names) if n != EGO and counts(name)]
        self._weight = weight_of(instance)
        self._rate = problem.rate
        self._road = _Road(problem.network)
        self._discs = GoalDiscs(instance)
        self._rounds = Rounds(len(self._discs.goals))
        self._samples = 0
        self._collision = False
        self._off_since: int | None = None
        self._off_ticks = 0

    def frames(self, frames: Frames) -> None:
        """Take a block of frames; each is a sample."""
        if not len(frames):
            return
        self._samples += len(frames)
        self._rounds.add(self._discs.inside(frames))
        if self._agents and not self._collision:
            x = frames.x[:, self._agents] - frames.x[:, EGO, None]
            y = frames.y[:, self._agents] - frames.y[:, EGO, None]
            self._collision = bool((np.sqrt(x * x + y * y) < COLLISION_DISTANCE).any())
        self._count_off_road(frames.first, self._road.holds(frames))

    def end(self, ending: Ending) -> None:
        """Nothing is left to do."""

    @property
    def rounds(self) -> int:
        """X: rounds counted at samples."""
        return self._rounds.count if self._discs.goals else self._samples

    @property
    def off_road_s(self) -> float:
        """Seconds off the road, as counted here."""
        return self._off_ticks / self._rate

    def result(self) -> float | None:
        """Return the score up to the last frame, None where it is not defined."""
        if self._weight is None:
            return None
        if self._collision:
            return COLLISION_SCORE
        return self._weight * self.rounds / max(1.0, self.off_road_s)

    def _count_off_road(self, first: int, on: np.ndarray) -> None:
        was_on = np.concatenate([[self._off_since is None], on[:-1]])
        for at in np.flatnonzero(on != was_on).tolist():
            if self._off_since is None:
                self._off_since = first + at
            else:
                self._off_ticks += first + at - self._off_since
                self._off_since = None


class _Road:
    """All segments as rectangles without ends."""

    def __init__(self, network: RoadNetwork) -> None:
        self._start: Floats = np.asarray(network.points)[np.asarray(network.ends)[:, 0]]
        self._tangent: Floats = np.asarray(network.tangents)
        self._length: Floats = np.asarray(network.lengths)

    def holds(self, frames: Frames) -> np.ndarray:
        """Return whether the ego is on any segment at each frame, (F,): the nearest first, then the rest."""
        point = np.stack([frames.x[:, EGO], frames.y[:, EGO]], axis=1)
        nearest = np.clip(frames.segment[:, EGO], 0, len(self._length) - 1)
        on = self._on(point, nearest)
        rest = np.flatnonzero(~on)
        if len(rest):
            every = np.arange(len(self._length))
            on[rest] = self._on(point[rest, None, :], every).any(axis=1)
        return on

    def _on(self, point: Floats, segment: np.ndarray) -> np.ndarray:
        step = point - self._start[segment]
        tangent = self._tangent[segment]
        along = step[..., 0] * tangent[..., 0] + step[..., 1] * tangent[..., 1]
        beside = step[..., 0] * tangent[..., 1] - step[..., 1] * tangent[..., 0]
        return (along >= 0.0) & (along <= self._length[segment]) & (np.abs(beside) <= ROAD_HALF_WIDTH)


COLUMNS = (
    ScoreColumn(
        Column("icra2016", "ICRA 2016, counts samples", "", 1, bounded=True), lambda score: score.icra2016
    ),
)
