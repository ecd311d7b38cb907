"""What stands for ever, stands for a while or moves up is never a reason for `rules` to break a rule."""

from __future__ import annotations

import math
import random
from typing import Any

import pytest

from dubins_traffic.errors import InputError
from dubins_traffic.problem.instance import Instance
from dubins_traffic.protocols import End
from dubins_traffic.runs.single import run_trial
from tests.unit.test_law import W, broken, car, on_grid, turned

ROAD = 6.0
REACH = 1.177
STOP = [[0.1, 0.0, 0.0]]


def before_disc(gap: float) -> float:
    """Return how far along its first road a car on the right lane is whose body is `gap` from the crossing's disc."""
    return ROAD - math.sqrt((REACH + gap) ** 2 - W * W)


def queue(gap: float, commands: list[list[float]], others: list[dict[str, Any]], seconds: float) -> Instance:
    """Return a trial in which the ego comes up behind a scripted car and `others`."""
    stands = car("scripted", "stands", turned(before_disc(gap), -W), commands=commands, repeat=True)
    return on_grid([stands, *others], seconds, turned(1.3, -W))


@pytest.mark.parametrize("gap", [0.02, 0.3, 0.49])
def test_who_has_lost_its_place_at_the_stop_line_is_not_overtaken(gap: float) -> None:
    """It counts as standing from its first new ticket on, but there is no way back into the lane before the disc."""
    behind = [car("lawful", f"c{k}", turned(before_disc(gap) - 0.5 * (k + 1), -W)) for k in range(3)]
    for others in ([], behind):
        instance = queue(gap, STOP, others, 40.0)
        score = run_trial(instance, "rules").score
        assert broken(score, "stands") == {"E3.tickets", "E3.enter"}
        assert all(broken(score, name) == set() for name in instance.names if name != "stands")
        assert score.driven.distance_m < 3.5


@pytest.mark.parametrize("gap", [0.7, 1.0])
def test_who_pulls_out_of_a_queue_when_those_ahead_do_stays_lawful(gap: float) -> None:
    """Those ahead drive off while the ego pulls out; what blocks the lane then is too far ahead to be a reason."""
    others = [car("lawful", f"c{k}", turned(before_disc(gap) - 0.5 * (k + 1), -W)) for k in range(3)]
    score = run_trial(queue(gap, STOP, others, 60.0), "rules").score
    assert score.verdict is not None
    assert score.verdict.violations == ()
    assert score.driven.distance_m > 20.0


@pytest.mark.parametrize("seed", range(8))
def test_what_moves_up_while_it_is_passed_traps_nobody(seed: int) -> None:
    """It waits, moves a little and waits again, while up to three pass."""
    dice = random.Random(seed)
    gap = dice.uniform(0.8, 2.4)
    creeps = [[dice.choice([8, 15, 25]), 0.0, 0.0], [dice.uniform(0.1, 0.5), 0.3, 0.0], [4.0, 0.0, 0.0]]
    place, others = before_disc(gap), list[dict[str, Any]]()
    for k in range(3):
        place -= dice.uniform(0.5, 0.8)
        if place > 1.8:
            others.append(car("lawful", f"c{k}", turned(place, -W), speed=dice.choice([0.3, 0.5, 0.7])))
    instance = queue(gap, creeps, others, 60.0)
    score = run_trial(instance, "rules").score
    assert all(broken(score, name) == set() for name in instance.names if name != "stands")
    assert not any(one.at_fault for one in score.collisions)


@pytest.mark.parametrize(
    ("place", "rule"),
    [(0.5, "E4"), (1.3, "E5"), (4.3, "E5"), (4.8, "E3.tickets"), (5.6, "E4"), (6.5, "E4")],
)
def test_who_parks_for_ever_where_it_cannot_be_passed_breaks_the_assumption(place: float, rule: str) -> None:
    """So the ego owes nothing more than to wait, and it breaks nothing."""
    parked = car("parked", "parked", turned(place, -W), vacates_after=None)
    score = run_trial(on_grid([parked], 100.0, turned(6.0 - W, 12.0 - W)), "rules").score
    assert rule in broken(score, "parked")
    assert broken(score, "ego") == set()
    assert score.verdict is not None
    assert score.verdict.verdict.value == "unfinished"


CARS: dict[str, dict[str, Any]] = {
    "rectangle": {"body": {"rectangle": {"length": 0.4, "width": 0.25}}},
    "broad": {"body": {"rectangle": {"length": 0.25, "width": 0.45}}},
    "arcs": {"bounds": {"turning_radius": 0.26}},
    "rectangle on arcs": {
        "body": {"rectangle": {"length": 0.4, "width": 0.25}},
        "bounds": {"turning_radius": 0.2, "speed_min": 0.0},
    },
}


@pytest.mark.parametrize("body", CARS.values(), ids=CARS)
def test_cars_of_other_shapes_keep_the_rules_and_pass_what_stands(body: dict[str, Any]) -> None:
    parked = car("parked", "parked", turned(3.2, -W), vacates_after=None)
    others = [car("lawful", f"c{k}", goes=goes) for k, goes in enumerate(("wander", "loop", "places"))]
    instance = on_grid([parked, *others], 60.0, turned(1.3, -W), car=body)
    score = run_trial(instance, "rules").score
    assert all(broken(score, name) == set() for name in instance.names if name != "parked")
    assert score.collisions == ()
    passes = body.get("bounds", {}).get("speed_min") is None
    assert score.driven.distance_m > 18.0 if passes else score.driven.distance_m < 3.0


UNFIT: dict[str, dict[str, Any]] = {
    "speed_min": {"bounds": {"speed_min": 0.1, "turning_radius": 0.2}},
    "turning_radius": {"bounds": {"turning_radius": 0.6}},
    "rectangle.width": {"body": {"rectangle": {"length": 0.3, "width": 0.52}}},
    "disc.radius": {"body": {"disc": {"radius": 0.25}}},
    "rectangle.length": {"body": {"rectangle": {"length": 0.8, "width": 0.4}}},
    "bounds.speed": {"bounds": {"speed": 0.4}},
    "yaw_rate": {"bounds": {"yaw_rate": 0.9}},
}


@pytest.mark.parametrize(("field", "body"), UNFIT.items(), ids=UNFIT)
def test_cars_that_cannot_keep_the_rules_are_refused_by_name(field: str, body: dict[str, Any]) -> None:
    alone = on_grid([], 5.0, turned(1.3, -W), car=body)
    with_other = on_grid([car("lawful", "other")], 5.0, turned(1.3, -W), car=body)
    with pytest.raises(InputError, match=rf"^car\..*{field}"):
        run_trial(with_other, "simple")
    ended = run_trial(alone, "rules").ending
    if field in ("bounds.speed", "yaw_rate"):
        assert ended.end is End.DURATION
    else:
        assert ended.end is End.CONTROLLER_FAULT
        assert field in ended.detail
