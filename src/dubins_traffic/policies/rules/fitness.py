"""Which cars can keep the law of the road (`policies.rules.policy`) at all; others are refused by name."""

from __future__ import annotations

from functools import cache
from math import inf, pi
from typing import TYPE_CHECKING

from dubins_traffic.cars.body import Disc
from dubins_traffic.cars.dynamics import require_dubins
from dubins_traffic.errors import InputError
from dubins_traffic.policies.rules.abilities import LONGEST_WAY, ROUND, least_speed
from dubins_traffic.policies.rules.tables import Vehicle
from dubins_traffic.policies.rules.wide_turns import check_wide_turns
from dubins_traffic.policies.safety import travel_of
from dubins_traffic.problem.kinds import COUNTER, KEEP_RULES, parameters_of
from dubins_traffic.roads.clearance import clearance_faults
from dubins_traffic.rules.parameters import RuleParameters

if TYPE_CHECKING:
    from dubins_traffic.problem.instance import Instance, Problem

KEPT = "the rules of the road and the shield are kept by standing at once, with no stopping distance,"
"""Why other cars than the Dubins car are refused."""
LONG = 1.2
"""Largest rho, in units of w, with which cars in one disc can turn beside each other."""
BESIDE = 0.05
"""What a body keeps from the middle of the road, metres, beyond its half width from the middle of its lane."""
LATE = 1.05
"""Share of the time that E4 allows for a way through a disc that the longest way may be reckoned to take."""
FORESEEN_DISC, FORESEEN_BOX = 0.62, 0.75
"""How far another car may get until the tick of a command is over, in units of w: more brings e-agents to breaches."""
BEGIN, SHARE = 0.2, 0.8
"""Turning round begins this share of R inside the disc, and takes this share of the largest yaw rate."""


def check_fit(problem: Problem, owes: bool) -> None:
    """Refuse a car that can't keep the rules whatever it does.

    Parameters
    ----------
    problem : Problem
        Gives the car, the roads and the parameters of the rules.
    owes : bool
        Whether the car has to leave discs in time (E4), which e-agents owe.

    Raises
    ------
    InputError
        Naming the field of the car, or the place in the roads.
    """
    car, bounds = problem.car, problem.car.bounds
    require_dubins(car, KEPT)
    if bounds.speed_low > 0.0:
        raise _refuse("can't stop", "bounds.speed_min", bounds.speed_low, "at most 0")
    if bounds.turning_radius > ROUND * car.w:
        check_wide_turns(problem)
    width = car.body.width
    if 0.5 * width + BESIDE >= car.w:
        name = "body.disc.radius" if isinstance(car.body, Disc) else "body.rectangle.width"
        shown, least = (0.5 * width, 1.0) if isinstance(car.body, Disc) else (width, 2.0)
        expected = f"less than {least * (car.w - BESIDE):.6g} m"
        raise _refuse("is too wide for its lane", name, shown, expected)
    if car.body.reach > LONG * car.w:
        expected = f"a diagonal of at most {2.0 * LONG * car.w:.6g} m"
        raise _refuse("is too long to turn", "body.rectangle.length", 2.0 * car.body.reach, expected)
    if owes:
        _check_times(problem)
    if not problem.rules:
        for fault in clearance_faults(problem.network, problem.intersection_radius, car.body.reach, car.w):
            raise fault


def check_speeds(instance: Instance) -> None:
    """Refuse e-agents of ours that are too slow for what E5 gives every car, by the top speed of the problem's cars.

    Raises
    ------
    InputError
        Naming the e-agent's speed.
    """
    problem = instance.problem
    if not problem.rules or not RuleParameters.from_mapping(problem.rules).assume_e5:
        return
    least = min(least_speed(problem), problem.car.bounds.speed)
    for n, agent in enumerate(instance.e_agents):
        driver = agent.driver
        if driver.kind not in KEEP_RULES and driver.kind != COUNTER:
            continue
        speed = driver.parameters.get("speed", _usual_speed(driver.kind))
        if speed < least:
            raise InputError(
                f"{agent.name} is too slow to come to an intersection in time (E5)",
                field=f"e-agents[{n}].parameters.speed",
                value=speed,
                expected=f"at least {least:.6g} m/s on these roads",
            )


def check_foresight(instance: Instance, vehicle: Vehicle) -> None:
    """Refuse e-agents of ours that can't foresee enough: commands too late, ticks too long, poses too noisy.

    Nobody may be within reach of where a car drives, and there is no room for more between two lanes.

    Raises
    ------
    InputError
        Naming the disturbances.
    """
    most = (FORESEEN_DISC if vehicle.half_length == 0.0 else FORESEEN_BOX) * instance.problem.car.w
    travel = travel_of(vehicle)
    if travel > most:
        raise InputError(
            "others may get too far until commands of e-agents have taken effect: they can't keep the rules so",
            field="disturbances",
            value=f"{travel:.3g} m",
            expected=f"at most {most:.3g} m: a shorter delay, less noise, a higher control rate",
        )


@cache
def _usual_speed(kind: str) -> float:
    return parameters_of(kind, {})["speed"]


def _check_times(problem: Problem) -> None:
    """Refuse a car that takes longer through a disc than E4 allows."""
    bounds, radius, reach = problem.car.bounds, problem.intersection_radius, problem.car.body.reach
    allowed = LATE * RuleParameters.from_mapping(problem.rules).exit_time
    least = LONGEST_WAY * (radius + reach) / allowed if allowed > 0.0 else inf
    if bounds.speed < least:
        raise _refuse(
            "takes too long through an intersection",
            "bounds.speed",
            bounds.speed,
            f"at least {least:.6g} m/s",
        )
    straight = 2.0 * (BEGIN * radius + reach) / bounds.speed
    slowest = pi / (SHARE * max(allowed - straight, 1e-9))
    if bounds.yaw_rate < slowest:
        expected = f"at least {slowest:.6g} rad/s"
        raise _refuse("takes too long to turn round", "bounds.yaw_rate", bounds.yaw_rate, expected)


def _refuse(problem: str, field: str, value: float, expected: str) -> InputError:
    return InputError(
        f"no car for the rules of the road: it {problem}",
        field=f"car.{field}",
        value=value,
        expected=expected,
    )
