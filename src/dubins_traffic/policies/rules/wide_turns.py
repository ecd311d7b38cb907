"""Whether roads are wide enough for a car that can't turn round from lane to lane, having too large a turning radius.

Such a car drives every way through every disc but the one back, and passes nothing. So the network must have no dead
ends, and every turn, and every arc of a road, must be wide enough for it.
"""

from __future__ import annotations

from collections.abc import Sequence
from math import sqrt
from typing import TYPE_CHECKING

from dubins_traffic.errors import InputError
from dubins_traffic.policies.rules.turn_arcs import BEGIN, STRAIGHT
from dubins_traffic.roads.network import RoadNetwork

if TYPE_CHECKING:
    from dubins_traffic.problem.instance import Problem

SPARE = 1.05
"""A turn is wide enough for a car whose turning radius is so much smaller, as a ratio: it steers back to its way."""


def check_wide_turns(problem: Problem) -> None:
    """Refuse roads that are not wide enough for the turning radius of the car.

    Parameters
    ----------
    problem : Problem
        Gives the car, the roads and the obstacles.

    Raises
    ------
    InputError
        Naming the place: an intersection, a turn at one, a corner of a segment, or the obstacles.
    """
    radius, network = problem.car.bounds.turning_radius, problem.network
    if problem.obstacles:
        raise InputError(
            f"a car with a turning radius of {radius:.6g} m passes no obstacles",
            field="obstacles",
            value=len(problem.obstacles),
            expected="none",
        )
    least = SPARE * radius
    for v in range(len(network.intersections)):
        _check_intersection(network, v, least, problem)
    for s in range(len(network.segments)):
        if network.is_straight or not network.bent[s]:
            continue
        for corner, (_, _, given) in enumerate(network.corners[s]):
            inner = given * network.length - problem.car.w
            if inner < least:
                place = f"segments[{s}]: corner {corner}"
                raise _too_tight(f"{place} is", inner, least, radius)


def _check_intersection(network: RoadNetwork, v: int, least: float, problem: Problem) -> None:
    """Refuse a dead end, or a turn at intersection `v` (index) of which the lane's middle is tighter than `least` (m).

    The turn is the arc that `turn_arcs.way_between` drives.
    """
    radius, w, name = problem.car.bounds.turning_radius, problem.car.w, list(network.intersections[v])
    arms = network.arms(v)
    if len(arms) == 1:
        raise InputError(
            f"a car with a turning radius of {radius:.6g} m can't turn round in the dead end at {name}",
            field=f"segments[{arms[0] >> 1}]",
            expected="no dead ends",
        )
    for lane in arms:
        for out in arms:
            if lane == out:
                continue
            tightest = _radius(_away(network, lane), _away(network, out), problem.intersection_radius, w)
            if tightest < least:
                turn = f"the turn from segments[{lane >> 1}] to segments[{out >> 1}] at {name}"
                raise _too_tight(f"{turn} is", tightest, least, radius)


def _away(network: RoadNetwork, lane: int) -> Sequence[float]:
    """Return the unit direction in which a lane leaves the intersection where it begins."""
    segment = lane >> 1
    step = -network.end_tangents[segment] if lane & 1 else network.tangents[segment]
    x, y = step.tolist()
    far = sqrt(x * x + y * y)
    return x / far, y / far


def _radius(back: Sequence[float], out: Sequence[float], disc: float, w: float) -> float:
    """Return the radius of the arc from the lane against `back` to the lane along `out`, metres; large if straight."""
    sine = back[1] * out[0] - back[0] * out[1]
    cosine = -back[0] * out[0] - back[1] * out[1]
    if abs(sine) < STRAIGHT and cosine > 0.0:
        return float("inf")
    side = 1.0 if sine > 0.0 else -1.0
    return BEGIN * disc * abs(sine) / (1.0 - cosine) + side * w


def _too_tight(place: str, tightest: float, least: float, radius: float) -> InputError:
    return InputError(
        f"{place} too tight for a turning radius of {radius:.6g} m",
        field="car.bounds.turning_radius",
        value=round(tightest, 6),
        expected=f"a lane's middle of a radius of at least {least:.6g} m: "
        "a larger intersection_radius, wider angles or a smaller turning radius",
    )
