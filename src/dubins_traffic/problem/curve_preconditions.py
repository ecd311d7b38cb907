"""Preconditions of instances on segments that bend."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from dubins_traffic.cars.body import Car
from dubins_traffic.roads.clearance import SEGMENT_SLACK, clearance_faults
from dubins_traffic.roads.network import RoadNetwork


def check_curves(
    network: RoadNetwork,
    radius: float,
    car: Car,
    rules: Mapping[str, Any],
) -> None:
    """Refuse a network with a curve that is too tight, or too near to other roads.

    Raises
    ------
    InputError
        Naming the segment and corner, or the setting.
    """
    slack = float(rules.get("segment_slack", SEGMENT_SLACK))
    for fault in clearance_faults(network, radius, car.body.reach, car.w, slack):
        raise fault.within(field=None if fault.field == "intersection_radius" else "rnd")
