"""Drawing goals: anywhere, so many segments apart, or so that a round through them takes no longer than it may."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from math import inf
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from dubins_traffic.errors import InputError
from dubins_traffic.kernels.philox import Draws
from dubins_traffic.roads.network import RoadNetwork

if TYPE_CHECKING:
    from dubins_traffic.routing.tours import Round

MOST_STEPS = 10_000
"""Intersections that are tried as goals before goals count as not found."""
MOST_ROUNDS = 2_000
"""Rounds that may prove too long before goals count as not found."""


class Reach(NamedTuple):
    """How long the free-flow round through drawn goals may be, metres: what a car drives in a share of the trial."""

    share: float
    longest: float


class DrawnGoals(NamedTuple):
    """Goals as numbers of intersections, and the free-flow round through them where that was to be within reach."""

    vertices: tuple[int, ...]
    round: Round | None = None


def draw_goals(
    network: RoadNetwork, bounds: tuple[int, int], draws: Draws, apart: int = 1, reach: Reach | None = None
) -> DrawnGoals:
    """Return goals, their number drawn from `bounds` (both included); they differ as far as intersections suffice.

    With `apart` of 2 or more every two goals are at least so many segments apart along the roads: each is drawn evenly
    among the intersections that are far enough from those before it, and others are tried where that leads nowhere.
    With `reach` the free-flow round through the goals (`tours.free_round`) is not longer than that; where no goals of
    the number that was drawn allow it, there are fewer, but not fewer than the lower bound.

    Raises
    ------
    InputError
        If no such goals are found.
    """
    count = draws.between(*bounds)
    places = len(network.intersections)
    if reach is not None:
        return _within_reach(network, (bounds[0], count), draws.shuffled(places), apart, reach)
    if apart > 1:
        picks = _search(network, count, apart, draws.shuffled(places))
        if not picks:
            raise InputError(
                f"{count} goals so far apart are not found on a road network of {places} intersections",
                field="goal_segments_apart",
                value=apart,
                expected="a smaller number, or fewer goals (number_goals_bounds)",
            )
    else:
        picks = draws.sample(min(count, places), places)
        picks += [draws.below(places) for _ in range(count - places)]
    return DrawnGoals(tuple(picks))


def _within_reach(
    network: RoadNetwork, bounds: tuple[int, int], order: Sequence[int], apart: int, reach: Reach
) -> DrawnGoals:
    """Return as many goals as may be within `bounds` with a round that is not too long."""
    from dubins_traffic.routing.tours import free_round, lane_graph  # compiles; only where it is asked for

    graph = lane_graph(network)
    low, high = bounds
    for count in range(high, low - 1, -1):

        def fits(vertices: Sequence[int], count: int = count) -> bool:
            if len(vertices) < min(2, count):
                return True  # a goal alone has a round of its own, which says nothing of rounds through more
            way = free_round(graph, vertices)
            return way is not None and way.length <= reach.longest

        picks = _search(network, count, apart, order, 0.5 * reach.longest, fits)
        if picks or not count:
            return DrawnGoals(tuple(picks), free_round(graph, picks))
    raise InputError(
        f"no round through {low} goals is as short as {reach.longest:.1f} m on this road network",
        field="goal_round_share",
        value=reach.share,
        expected="a larger share, longer trials, or fewer goals (number_goals_bounds)",
    )


def _search(
    network: RoadNetwork,
    count: int,
    apart: int,
    order: Sequence[int],
    straight: float = inf,
    fits: Callable[[Sequence[int]], bool] = lambda _vertices: True,
) -> list[int]:
    """Return `count` vertices, the first ones in `order` of which every two are `apart` segments apart; else none.

    Every two are at most `straight` metres from each other as the crow flies, and `fits` holds of them and of each of
    their beginnings.
    """
    ranks, points = np.array(order), network.points
    barred = np.zeros(len(order), dtype=np.int64)
    places: list[int] = []
    place = steps = long = 0
    while len(places) < count:
        for following in (place + np.flatnonzero(barred[ranks[place:]] == 0)).tolist():
            if fits([order[k] for k in (*places, following)]):
                place = following
                break
            long += 1
        else:
            place = len(order)
        steps += 1
        if steps > MOST_STEPS or long > MOST_ROUNDS or (place == len(order) and not places):
            return []
        change = -1 if place == len(order) else 1
        chosen = places.pop() if change < 0 else place
        latest = order[chosen]
        barred[list(_within(network, latest, apart - 1))] += change
        if straight < inf:
            barred[np.hypot(*(points - points[latest]).T) > straight] += change
        if change > 0:
            places.append(chosen)
        place = chosen + 1
    return [order[k] for k in places]


def _within(network: RoadNetwork, start: int, most: int) -> set[int]:
    """Return the vertices at most `most` segments from `start` along the roads, itself included."""
    reached = latest = {start}
    for _ in range(most):
        latest = {network.lane_ends(lane)[1] for v in latest for lane in network.arms(v)} - reached
        if not latest:
            break
        reached = reached | latest
    return reached
