"""The suite `towns-2026`: parts of towns, made from maps of OpenStreetMap that come with SUMO.

    python -m scripts.towns_suite FILE

The maps are © OpenStreetMap contributors, under the Open Database License (ODbL) 1.0, and so are the road networks in
the suite. `scripts/crosscheck-tools.sh` installs SUMO.
"""

from __future__ import annotations

import json
import sys
from typing import Any, NamedTuple

from experiments.towns import text_of

from dubins_traffic.files import write_text
from dubins_traffic.maps.part import Clip, Part
from dubins_traffic.maps.settings import ImportSettings
from dubins_traffic.maps.sumo import SumoNet

PAIRS = 25.0
"""One-way roads at most so many metres apart become one."""
CONTROLLERS = ["lanes", "lanes+shield", "rules", "rules+shield", "simple", "simple+shield"]


class Town(NamedTuple):
    """A map of `experiments.towns`, the part of it that is taken, the lawful cars there, and whether a nemesis is."""

    name: str
    map: str
    part: Part | None
    cars: int
    nemesis: bool = False


TOWNS = (
    Town("Braunschweig", "bs3d", None, 6),
    Town("Braunschweig, a nemesis", "bs3d", None, 3, nemesis=True),
    Town("Berlin, north", "DRT", Clip(1200.0, 850.0, 2100.0, 1550.0), 6),
    Town("Berlin, west", "DRT", Clip(440.0, 700.0, 1300.0, 1480.0), 6),
    Town("Berlin, south, a nemesis", "DRT", Clip(1150.0, 100.0, 2350.0, 900.0), 5, nemesis=True),
    Town("Berlin", "DRT", None, 24),
)


def configuration(town: Town) -> dict[str, Any]:
    """Return the configuration of a town: two or three goals apart but within reach, ten minutes."""
    document, _ = SumoNet().reduced(text_of(town.map), town.map, ImportSettings(pairs=PAIRS), part=town.part)
    others = [{"type": "nemesis", "name": "nemesis"}] if town.nemesis else []
    return {
        "version": 1,
        "problem_domain": "dubins_traffic",
        "rnd": document,
        "e-agents": [{"type": "lawful", "name": "car", "count": town.cars}, *others],
        "duration": 600,
        "number_goals_bounds": [2, 3],
        "goal_segments_apart": 2,
        "goal_round_share": 0.4,
        "rules": True,
    }


def suite() -> dict[str, Any]:
    """Return the document of the suite."""
    return {
        "version": 0,
        "name": "towns-2026",
        "title": "Towns with lawful cars and a nemesis; maps © OpenStreetMap contributors, ODbL 1.0",
        "metric": "counted_rounds",
        "campaign": {
            "version": 0,
            "seed": 2026,
            "trials": 4,
            "controllers": CONTROLLERS,
            "configurations": [{"name": town.name, "document": configuration(town)} for town in TOWNS],
        },
    }


if __name__ == "__main__":
    write_text(sys.argv[1], json.dumps(suite(), ensure_ascii=False, indent=1) + "\n")
