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

from typing import TYPE_CHECKING

from dubins_traffic.problem.instance import Instance
from dubins_traffic.scoring.metric import Column, ScoreColumn

if TYPE_CHECKING:
    from dubins_traffic.scoring.counts import TrialCounts

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


def icra2016_of(instance: Instance, counts: TrialCounts, rounds: int, samples: int) -> float | None:
    """Return the score of a trial: -1 after a collision, else e-agents * rows * columns * rounds / max(1, s off road).

    None where the formula does not apply.

    Parameters
    ----------
    instance : Instance
        What was run.
    counts : TrialCounts
        The counts of the trial.
    rounds, samples : int
        Rounds counted at samples, and the number of samples: without goals each is a round.
    """
    weight = weight_of(instance)
    if weight is None:
        return None
    if counts.collided:
        return COLLISION_SCORE
    rounds = rounds if counts.last_goal > counts.first_goal else samples
    return weight * rounds / max(1.0, counts.off_ticks / instance.problem.rate)


COLUMNS = (
    ScoreColumn(Column("icra2016", "ICRA 2016, counts samples", "", 1, bounded=True), lambda score: score.icra2016),
)
