"""How many files know one of each: what a further e-agent, metric, transport or map format of the package touches.

docs/extending says it for who writes one; from outside the package it is one file each, which the conformance suites
load. Rules are looked at in test_rules, car models in tests/conformance/test_car_models.
"""

from __future__ import annotations

import re

import pytest

from tests.architecture.house import modules

TOUCHED = {
    "e-agent": (r'"parked"|\bParked\b', {"agents.kinds", "problem.kinds"}),
    "metric": (
        r"surrogates\.time_to_collision|TimeToCollision\b",
        {"surrogates.time_to_collision"},  # and its line in pyproject.toml
    ),
    "transport": (r"sessions\.stdio|run_over_stdio\b", {"sessions.registry", "sessions.stdio"}),
    "map format": (
        r"maps\.commonroad:|class CommonRoad\b",
        {"", "maps.commonroad"},
    ),
}
"""Of one of each: how files know it, and which do, two at most."""
KNOW_IT_BY_NAME = {
    "e-agent": {"synthesis.game", "synthesis.queues"},
}
"""What has the same word for something else: cars that are parked in a game."""


@pytest.mark.parametrize("seam", sorted(TOUCHED))
def test_one_more_touches_two_files(seam: str) -> None:
    pattern, files = TOUCHED[seam]
    known = {module.name for module in modules() if re.search(pattern, module.text)}
    assert known - KNOW_IT_BY_NAME.get(seam, set()) == files
    assert len(files) <= 2
