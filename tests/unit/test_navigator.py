"""What a driver asks of the road: propositions by name, the line to follow, the stop line, who goes before."""

from __future__ import annotations

import json
import subprocess
import sys
from itertools import pairwise
from math import hypot, inf
from typing import Any

import numpy as np
import pytest

import dubins_traffic as dt
from dubins_traffic.cars.state import Propositions
from dubins_traffic.rules.propositions import FLAG, NAMES, renews_ticket
from dubins_traffic.transports.line_messages import observation_from_document, observation_to_document
from tests.minute import a_minute


@pytest.mark.parametrize("name", NAMES)
def test_a_proposition_has_a_name_beside_its_bit(name: str) -> None:
    assert getattr(Propositions(0, -1, -1, -1, NAMES[name]), name) is True
    assert getattr(Propositions(0, -1, -1, -1, ~NAMES[name]), name) is False


def test_propositions_show_names_and_no_bits() -> None:
    seen = Propositions(3, -1, -1, 6, FLAG.ON_ROAD | FLAG.STOPPED)
    assert repr(seen) == "<Propositions: segment=3, at=-1, crosses=-1, lane=6; on_road, stopped>"
    assert repr(Propositions(3, -1, -1, 6, 0)).endswith("; none>")
    assert seen == (3, -1, -1, 6, FLAG.ON_ROAD | FLAG.STOPPED)


WAITS, FIRST, AGAIN = FLAG.STOPPED | FLAG.AHEAD, FLAG.STOPPED | FLAG.FIRST, FLAG.FORFEITED


@pytest.mark.parametrize(
    ("before", "now", "renewed"),
    [
        (FIRST, WAITS | AGAIN, True),
        (FIRST | AGAIN, WAITS | AGAIN, True),
        (FIRST, FIRST | AGAIN, True),
        (FIRST, WAITS, False),  # a car on the right has joined the group
        (WAITS, FIRST, False),
        (WAITS | AGAIN, FIRST | AGAIN, False),
        (WAITS | AGAIN, WAITS | AGAIN, False),
    ],
)
def test_another_ticket_shows_in_the_flags(before: int, now: int, renewed: bool) -> None:
    assert renews_ticket(before, now) is renewed


class Asks:
    """Drives as `rules` does, and keeps what a navigator says of each frame."""

    def __init__(self, problem: dt.Problem) -> None:
        from dubins_traffic.controllers.rules import Rules

        self.driver, self.navigator = Rules(), dt.Navigator(problem)
        self.over_lines = dt.Navigator(problem)
        self.problem = problem
        self.told: list[tuple[dt.Observation, dt.Situation]] = []

    def start(self, problem: dt.Problem) -> None:
        self.driver.start(problem)

    def act(self, observation: dt.Observation) -> Any:
        self.told.append((observation, self.navigator.look(observation)))
        document = json.loads(json.dumps(observation_to_document(observation)))
        again = self.over_lines.look(observation_from_document(document, self.problem))
        assert facts(again) == facts(self.told[-1][1])
        return self.driver.act(observation)


def facts(here: dt.Situation) -> tuple[Any, ...]:
    names = [field for field in here.__dataclass_fields__ if not field.startswith("_")]
    return (*(getattr(here, name) for name in names), here.line(0.5))


@pytest.fixture(scope="module", params=["junction", "town"])
def trial(request: pytest.FixtureRequest) -> Asks:
    instance = dt.draw(a_minute(request.param), seed=3, trial=1)
    asks = Asks(instance.problem)
    dt.run_trial(instance, asks)
    assert len(asks.told) == instance.ticks
    return asks


def test_who_is_before_the_ego_is_so_by_the_order_of_arrival(trial: Asks) -> None:
    stopped = [(own, here) for own, here in trial.told if own.propositions.stopped]
    assert stopped
    for own, here in stopped:
        assert bool(here.before) == own.propositions.ahead
        firsts = [car.index for car in own.others if car.propositions.first and car in here.before]
        assert firsts == [car.index for car in here.before[:1]]


def test_the_line_runs_on_the_right_without_a_jump(trial: Asks) -> None:
    problem = trial.problem
    w = problem.car.w
    for _, here in trial.told[::10]:
        places = [here.line(0.05 * k) for k in range(30)]
        for one, other in pairwise(places):
            assert hypot(other.x - one.x, other.y - one.y) == pytest.approx(0.05, abs=2e-3)
            assert one.c * (other.x - one.x) + one.s * (other.y - one.y) > 0.045
        points = np.array([place[:2] for place in places])
        assert problem.network.on_road(points, 2.0 * w).all()
        far = problem.network.nearest_intersection(points)[1] > problem.intersection_radius
        for (x, y), outside in zip(points, far, strict=True):
            if outside:
                offsets = [
                    abs(float(problem.network.lane_coordinates(lane, (x, y))[1]) + w)
                    for lane in (here.lane, here.next_lane)
                ]
                assert min(offsets) < 1e-6


def test_the_stop_line_is_where_the_body_meets_the_disc(trial: Asks) -> None:
    entries = 0
    for (before, here), (after, _) in pairwise(trial.told):
        if before.propositions.crosses < 0 and after.propositions.crosses >= 0:
            entries += 1
            assert after.propositions.crosses == here.intersection
            assert 0.0 <= here.stop_line < 0.05
            assert here.crossing == (trial.problem.network.degrees[here.intersection] >= 3)
        elif before.propositions.crosses == here.intersection:
            assert here.stop_line < 0.02
    assert entries > 3


def test_the_way_leads_to_every_goal(trial: Asks) -> None:
    goals = {here.goal for _, here in trial.told}
    assert goals <= {*trial.problem.goal_vertices}
    assert all(0.0 <= here.to_goal < inf for _, here in trial.told)
    for (_, here), (after, then) in pairwise(trial.told):
        if here.goal != then.goal:
            assert after.propositions.at == here.goal


def test_a_leader_is_ahead_in_the_lane(trial: Asks) -> None:
    led = [(own, here) for own, here in trial.told if here.leader is not None]
    for own, here in led:
        assert here.leader is not None
        dx, dy = here.leader.pose.x - own.pose.x, here.leader.pose.y - own.pose.y
        assert here.gap > 0.0
        assert hypot(dx, dy) < here.gap + 0.7
    assert all(here.gap == inf for _, here in trial.told if here.leader is None)


def test_a_box_loads_no_pydantic_for_it() -> None:
    code = "import sys, dubins_traffic as dt; dt.Navigator, dt.Situation; assert 'pydantic' not in sys.modules"
    subprocess.run([sys.executable, "-c", code], check=True)
