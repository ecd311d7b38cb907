"""What an instance on segments that bend must give, and what is not to be had there."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from dubins_traffic.cars.body import Car
from dubins_traffic.errors import InputError
from dubins_traffic.roads.clearance import SEGMENT_SLACK, clearance_faults
from dubins_traffic.roads.network import RoadNetwork

STRAIGHT_ONLY = frozenset({"wander", "loop", "follow", "counter"})
"""Kinds of e-agents that know straight segments only."""


def check_bends(
    network: RoadNetwork,
    radius: float,
    car: Car,
    obstacles: bool,
    kinds: Sequence[str],
    rules: Mapping[str, Any],
) -> None:
    """Refuse a network that bends where the roads are too tight, there are obstacles, or e-agents can't drive there.

    Raises
    ------
    InputError
        Naming the segment and corner, or the setting.
    """
    slack = float(rules.get("segment_slack", SEGMENT_SLACK))
    for fault in clearance_faults(network, radius, car.body.reach, car.w, slack):
        raise fault.within(field=None if fault.field == "intersection_radius" else "rnd")
    if obstacles:
        raise InputError(
            "no obstacles where segments bend", field="obstacles", expected="none, or straight segments"
        )
    for k, kind in enumerate(kinds):
        if kind in STRAIGHT_ONLY:
            raise InputError(
                "an e-agent of this kind can't drive on segments that bend",
                field=f"e-agents[{k}].type",
                value=kind,
                expected="lawful, nemesis, parked or scripted, or straight segments",
            )
