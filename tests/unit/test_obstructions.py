"""Obstacles that leave a goal, or the only way to it, without room for a car are refused by name."""

from __future__ import annotations

from typing import Any

import pytest

from dubins_traffic.errors import InputError
from dubins_traffic.problem.configuration import load_config
from dubins_traffic.problem.document import instance_from_document, instance_to_document
from dubins_traffic.problem.draw import draw
from dubins_traffic.problem.instance import Instance

LENGTH = 6.0


def disc(x: float, y: float, radius: float) -> dict[str, Any]:
    return {"disc": {"x": x, "y": y, "radius": radius}}


def drawn(rows: int, columns: int, goals: list[list[int]], *obstacles: dict[str, Any], **more: Any) -> Instance:
    document = {
        "version": 1,
        "problem_domain": "dubins_traffic",
        "network": {"grid": {"rows": rows, "columns": columns, "length": LENGTH}},
        "e-agents": [],
        "obstacles": list(obstacles),
        "goals": goals,
        "number_trials": 1,
        "duration": 10.0,
        "rules": True,
        **more,
    }
    return draw(load_config(document), 0, 0)


BEYOND_A_DEAD_END = disc(1.5, -0.3, 0.2)
"""In the lane out of the dead end at (0, 0) of a road along x."""


def test_a_goal_whose_only_exit_is_too_narrow_is_refused() -> None:
    with pytest.raises(InputError, match=r"the goal \[0, 0\] no exit") as caught:
        drawn(1, 3, [[0, 0], [2, 0]], disc(9.0, 0.9, 0.1), BEYOND_A_DEAD_END)
    assert caught.value.field == "obstacles[1]"


@pytest.mark.parametrize(
    "obstacle",
    [disc(1.5, 0.3, 0.2), disc(1.5, -0.6, 0.1), disc(2.1, -0.3, 0.2), disc(1.5, -0.9, 0.25)],
    ids=["in the other lane", "beside", "beyond", "off the road"],
)
def test_a_goal_with_an_exit_is_not(obstacle: dict[str, Any]) -> None:
    assert drawn(1, 3, [[0, 0], [2, 0]], obstacle).problem.obstacles


def test_without_rules_nothing_is_refused() -> None:
    assert drawn(1, 3, [[0, 0], [2, 0]], BEYOND_A_DEAD_END, rules=False).problem.obstacles


def test_without_goals_nothing_is_barred() -> None:
    document = instance_to_document(drawn(1, 2, [[0, 0]], disc(3.0, 5.0, 0.2)))
    assert instance_from_document(document | {"goals": []}).problem.goals == ()


def test_the_way_back_is_no_exit_of_a_bend() -> None:
    beyond = disc(0.3, 1.5, 0.2)
    """In the lane out of the bend at (0, 0) along y: who comes by the other road has no other exit."""
    with pytest.raises(InputError, match=r"the goal \[0, 0\] no exit"):
        drawn(2, 2, [[0, 0], [1, 1]], beyond)
    assert drawn(2, 2, [[0, 1], [1, 0]], beyond).problem.obstacles
    assert drawn(2, 2, [[0, 0], [1, 1]], beyond, rules={"crossing_degree": 1}).problem.obstacles


def test_an_obstacle_over_the_only_road_to_a_goal_is_refused() -> None:
    across = disc(9.0, 0.0, 0.4)
    with pytest.raises(InputError, match=r"bars the only way to the goal \[2, 0\]") as caught:
        drawn(1, 3, [[0, 0], [2, 0]], across)
    assert caught.value.field == "obstacles[0]"
    assert drawn(1, 3, [[0, 0], [1, 0]], across).problem.obstacles
    assert drawn(2, 3, [[0, 0], [2, 0]], across).problem.obstacles


def test_a_document_is_refused_as_its_drawing_is() -> None:
    document = instance_to_document(drawn(1, 3, [[0, 0], [2, 0]]))
    document["obstacles"] = [BEYOND_A_DEAD_END]
    with pytest.raises(InputError, match="no exit as wide as a car"):
        instance_from_document(document)


def test_who_waits_beyond_the_sensing_radius_is_no_order_to_keep() -> None:
    rules = {"approach_distance": 1.4, "queue_distance": 1.4}
    with pytest.raises(InputError, match="sees too little"):
        drawn(1, 3, [[0, 0]], rules=rules, sensing_radius=5.1)
    assert drawn(1, 3, [[0, 0]], rules=rules, sensing_radius=5.2).problem.rules
