"""The suite `towns-2026`: parts of towns, made from maps of OpenStreetMap that come with SUMO.

    python -m scripts.towns_suite FILE

The maps are © OpenStreetMap contributors, under the Open Database License (ODbL) 1.0, and so are the road networks in
the suite. `scripts/crosscheck-tools.sh` installs SUMO.
"""

from __future__ import annotations

import json
import sys
from pathlib import Path
from typing import Any, NamedTuple

from dubins_traffic.files import read_text, write_text
from dubins_traffic.maps.part import Clip, Part
from dubins_traffic.maps.settings import ImportSettings
from dubins_traffic.maps.sumo import SumoNet

ROOT = Path(__file__).resolve().parents[1]
GAMES = "build/crosscheck/sumo/lib/python*/site-packages/sumo/tools/game"
PAIRS = 25.0
"""One-way roads at most so many metres apart become one."""
CARS: list[dict[str, Any]] = [{"type": "lawful", "name": "car"}]
CONTROLLERS = ["lanes", "lanes+shield", "rules", "rules+shield", "simple", "simple+shield"]


class Town(NamedTuple):
    """A map, the part of it that is taken, and how many lawful cars drive on it; with a nemesis or without."""

    name: str
    file: str
    part: Part | None
    cars: int
    nemesis: bool = False


TOWNS = (
    Town("Braunschweig", "bs3d/bs.net.xml", None, 6),
    Town("Braunschweig, a nemesis", "bs3d/bs.net.xml", None, 3, nemesis=True),
    Town("Berlin, north", "DRT/osm.net.xml", Clip(1200.0, 850.0, 2100.0, 1550.0), 6),
    Town("Berlin, west", "DRT/osm.net.xml", Clip(440.0, 700.0, 1300.0, 1480.0), 6),
    Town("Berlin, south, a nemesis", "DRT/osm.net.xml", Clip(1150.0, 100.0, 2350.0, 900.0), 5, nemesis=True),
    Town("Berlin", "DRT/osm.net.xml", None, 24),
)


def configuration(town: Town) -> dict[str, Any]:
    """Return the configuration of a town: two or three goals apart but within reach, ten minutes."""
    folder = next(ROOT.glob(GAMES))
    settings = ImportSettings(pairs=PAIRS)
    document, _ = SumoNet().reduced(read_text(str(folder / town.file)), town.file, settings, part=town.part)
    others = [{"type": "nemesis", "name": "nemesis"}] if town.nemesis else []
    return {
        "version": 1,
        "problem_domain": "dubins_traffic",
        "rnd": document,
        "e-agents": [{**CARS[0], "count": town.cars}, *others],
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
