"""Preconditions of problems: for rules 2 and 3 to be defined (docs/rules.md#room), and for segments that bend."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from dubins_traffic.cars.body import Car
from dubins_traffic.errors import InputError
from dubins_traffic.roads.clearance import SEGMENT_SLACK, clearance_faults
from dubins_traffic.roads.network import RoadNetwork

SLACK = 1e-9
"""Tolerance for rounding in these comparisons, metres."""


def check_demands(
    network: RoadNetwork, radius: float, car: Car, sensing_radius: float, rules: Mapping[str, Any]
) -> None:
    """Refuse a problem that asks for the rules where they are not defined.

    Norm: docs/rules.md#room.

    Parameters
    ----------
    network : RoadNetwork
        The roads.
    radius : float
        R, the intersection radius, metres.
    car : Car
        Gives w and rho.
    sensing_radius : float
        Metres.
    rules : Mapping
        The parameters `segment_slack`, `sensing_slack` and `queue_distance`, metres: who waits at another arm of a
        crossing is at most the last from the disc, and has to be seen.

    Raises
    ------
    InputError
        Naming the place: segment, intersection or setting.
    """
    reach = car.body.reach
    sight = 2.0 * (radius + reach + max(rules["sensing_slack"], rules["queue_distance"]))
    if sensing_radius < sight - SLACK:
        raise InputError(
            "the rules are not defined here: sees too little",
            field="sensing_radius",
            value=sensing_radius,
            expected=f"at least {sight:.6g} m, or rules: false (dubins-traffic explain room)",
        )
    faults = clearance_faults(network, radius, reach, car.w, rules["segment_slack"])
    if faults:
        from dubins_traffic.problem.faults import more_faults  # Pydantic, which no box is to load

        first = faults[0]
        more = more_faults(len(faults) - 1) if len(faults) > 1 else ""
        error = InputError(
            f"the rules are not defined here: {first.problem}{more}",
            field=first.field,
            value=first.value,
            expected=f"{first.expected}, or rules: false (dubins-traffic explain room)",
        )
        raise error.within(field=None if first.field == "intersection_radius" else "rnd")


def check_curves(network: RoadNetwork, radius: float, car: Car, rules: Mapping[str, Any]) -> None:
    """Refuse a network with a curve that is too tight, or too near to other roads.

    Raises
    ------
    InputError
        Naming the segment and corner, or the setting.
    """
    slack = float(rules.get("segment_slack", SEGMENT_SLACK))
    for fault in clearance_faults(network, radius, car.body.reach, car.w, slack):
        raise fault.within(field=None if fault.field == "intersection_radius" else "rnd")
