"""The score of the paper: the formula in the benchmark's description, to the letter.

Source: *Proposal for a benchmark: Traffic network of Dubins cars*, section II.E: -1 if the ego collides with another
vehicle, else

    (e-agents * size of the network * X) / max(1, seconds that the ego is not on some road)

with X the unique visits to all goal intersections. The program that scored the competition differs
(`dubins_traffic.scoring.icra2016`). How the words are read here, so that the score is defined for every instance:

- X counts rounds: a round is one visit to each goal, a visit as the rules of the road define it
  (`dubins_traffic.scoring.goals`). Staying in a goal's disc adds nothing.
- The size of a network is rows * columns of a grid, and the number of intersections of any other network.
- Every e-agent counts, whatever its name. A collision is contact of the bodies, with any other car.
- Off the road means farther than 2w from every segment, at the end of a tick, the last stretch included.
"""

from __future__ import annotations

from collections.abc import Sequence

from dubins_traffic.problem.instance import Instance
from dubins_traffic.roads.network import RoadNetwork
from dubins_traffic.scoring.collisions import Collision
from dubins_traffic.scoring.metric import Column, ScoreColumn

COLLISION_SCORE = -1.0


def network_size(network: RoadNetwork) -> int:
    """Return the size of a network: rows times columns of a grid, else the number of intersections."""
    rows, columns = network.shape
    return rows * columns if network.is_grid else len(network.intersections)


def paper_score(instance: Instance, collisions: Sequence[Collision], rounds: int, off_road_s: float) -> float:
    """Return the paper's score of a trial.

    Parameters
    ----------
    instance : Instance
        What was run.
    collisions : sequence of Collision
        Those of the ego.
    rounds : int
        Rounds by visits.
    off_road_s : float
        Seconds that the ego was off the road.
    """
    agents = instance.e_agents
    if collisions:
        names = {agent.name for agent in agents}
        if any(collision.partner in names for collision in collisions):
            return COLLISION_SCORE
    return len(agents) * network_size(instance.problem.network) * rounds / max(1.0, off_road_s)


COLUMNS = (ScoreColumn(Column("paper_score", "score of the paper", "", 1), lambda score: score.paper_score),)
