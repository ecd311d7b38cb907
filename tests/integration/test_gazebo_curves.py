"""Roads that bend in a real gzserver: their world is loaded whole, and a trial on them is driven on wheels."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import dubins_traffic as dt
from dubins_traffic.cars.body import Disc
from dubins_traffic.errors import InputError
from dubins_traffic.gazebo.link import MessageKind
from dubins_traffic.gazebo.server import Server
from dubins_traffic.gazebo.world import WHEEL_RADIUS, outlook, world
from dubins_traffic.protocols import End
from dubins_traffic.roads.generate import generate
from dubins_traffic.runs.single import run_trial
from tests.batches import pose
from tests.gazebo import installation

pytestmark = pytest.mark.tools

CONFIGURATION = {
    "version": 1,
    "problem_domain": "dubins_traffic",
    "network": {"random": {"intersections": 6, "segments": 7, "bent": 1.0}},
    "e-agents": [{"type": "lawful", "name": "agent", "count": 2}],
    "duration": 20,
    "number_goals_bounds": [2, 2],
    "rules": True,
}
STEP, STEPS, SPEED = 0.005, 200, 0.5


def test_a_world_of_roads_that_bend_is_loaded_whole() -> None:
    """The plugin finds each model that it is told of, and ends the server if one is missing."""
    found, network = installation(), generate(6, 7, 3, bent=1.0)
    scenery = outlook(network)
    names = [each.get("name", "") for each in scenery if each.tag == "model"]
    assert len(names) > 3 * len(network.segments)
    listed = "".join(f"<obstacle>{name}</obstacle>" for name in names)
    text = world([pose(*network.points[0])], Disc(), (), STEP, str(found.plugin), scenery)
    server = Server(found, text.replace("</plugin>", f"{listed}</plugin>"))
    try:
        assert server.ask(MessageKind.HELLO).tolist()[1:3] == [1.0, len(names)]
        rate = SPEED / WHEEL_RADIUS
        moved = server.ask(MessageKind.STEP, np.array([STEPS, rate, rate]))
        assert moved[0] - network.points[0, 0] == pytest.approx(SPEED * STEP * STEPS, abs=0.01)
    finally:
        server.close()
    with pytest.raises(InputError, match="no model road_nowhere"):
        Server(found, text.replace("</plugin>", "<obstacle>road_nowhere</obstacle></plugin>"))


def test_a_trial_on_roads_that_bend_is_driven_on_wheels(tmp_path: Path) -> None:
    installation()
    instance = dt.draw(dt.load_config(CONFIGURATION), 3, 0)
    assert not instance.problem.network.is_straight
    result = run_trial(replace(instance, simulator="gazebo"), "rules", record=tmp_path / "bent.mcap")
    assert result.ending.end is End.DURATION
    assert result.score.driven.distance_m > 5.0
    assert dt.verify(tmp_path / "bent.mcap").verified
