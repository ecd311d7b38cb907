"""What the law derives from a car's size and bounds: turning round, distances that matter, speed in discs."""

from __future__ import annotations

from typing import TYPE_CHECKING

from dubins_traffic.cars.body import Car
from dubins_traffic.kernels.compile import jit_inline
from dubins_traffic.policies.safety import GUARD, NEAR
from dubins_traffic.rules.parameters import RuleParameters

if TYPE_CHECKING:
    from dubins_traffic.problem.instance import Problem

LONGEST_WAY = 2.21
"""Length of the longest way through a disc, in units of R + rho."""
PROMPT = 0.8
"""Share of the time that E4 allows in which a car drives the longest way."""
ROUND = 0.9
"""Largest turning radius with which a car turns round from lane to lane, in units of w."""
SIGHT, WIDE_SIGHT = 3.0, 10.0
"""Distance up to which other bodies matter to a car's next tick: the greater of metres and units of w."""


PATIENT = 0.5
"""An e-agent that has waited for this share of the time that E5 allows dares more: before a bend or dead end it enters
as soon as an exit is free, even if cars in it may stop; before an obstacle it passes what stands beyond."""
DAWDLE = 0.12
"""Speed at which a nemesis drives in front of the ego, m/s, where E5 allows it."""
IN_TIME = 0.9
"""Share of the time that E5 allows for a journey in which a car drives the longest segment at its least speed."""


@jit_inline
def turns_within_road(tightest: float, middle: float) -> bool:
    """Tell whether a car can turn round from lane to lane in a disc, and comes back at once into a lane it has left.

    Its turning radius is `tightest` (m), and lanes are driven `middle` (m) right of the centre line.
    """
    return tightest <= ROUND * middle


def near_of(car: Car, period: float) -> float:
    """Return the gap between two cars, metres, beyond which no tick of `period` (s) brings them together."""
    return max(NEAR, 2.0 * car.point_speed * period + GUARD)


def sight_of(w: float) -> float:
    """Return the distance up to which other bodies matter to the next tick of a car of width `w` (m), metres."""
    return max(SIGHT, WIDE_SIGHT * w)


def through_speed(problem: Problem) -> float:
    """Return the speed at which the longest way through a disc takes PROMPT of the time that E4 allows, m/s."""
    longest = LONGEST_WAY * (problem.intersection_radius + problem.car.body.reach)
    allowed = RuleParameters.from_mapping(problem.rules).exit_time
    return longest / (PROMPT * allowed) if allowed > 0.0 else problem.car.bounds.speed


def least_speed(problem: Problem) -> float:
    """Return the speed at which the longest segment takes IN_TIME of the time that E5 allows for a journey, m/s."""
    rules = RuleParameters.from_mapping(problem.rules)
    longest = float(problem.network.lengths.max())
    allowed = rules.rest_time + rules.journey_lengths * longest / problem.car.bounds.speed
    return longest / (IN_TIME * allowed) if allowed > 0.0 else problem.car.bounds.speed
