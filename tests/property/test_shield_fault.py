"""What the looks of the shield and of the law let through brings about no contact in which the car is at fault."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from dubins_traffic.cars.body import Body, Car, Disc, Rectangle
from dubins_traffic.cars.state import Command, Labels, Pose
from dubins_traffic.cars.tables import pack_obstacles
from dubins_traffic.kernels.boxes import separation
from dubins_traffic.kernels.trig import advance
from dubins_traffic.policies.rules.tables import Traffic, scratch, vehicles_of
from dubins_traffic.policies.safety import body_at, may_meet, travel_of
from dubins_traffic.problem.configuration import load_config
from dubins_traffic.problem.draw import draw
from dubins_traffic.roads.packing import pack
from dubins_traffic.shield.checks import gather_close, may_touch
from dubins_traffic.shield.tables import egos
from dubins_traffic.simulators.embedded import Embedded

PAIRS, WORST = 3000, 40


def pairs(body: Body, seed: int) -> list[Any]:
    """Return trials of two cars that stand side by side anyhow, at gaps of up to five centimetres."""
    document = {
        "version": 1, "problem_domain": "dubins_traffic", "network": {"grid": {"rows": 2, "columns": 2}},
        "e-agents": [{"type": "lawful"}], "number_trials": 1, "duration": 5, "rules": True,
    }  # fmt: skip
    one = draw(load_config(document), 1, 0)
    problem = replace(one.problem, car=Car(body=body))
    vehicle: Any = vehicles_of([problem])[0]
    chance = np.random.default_rng(seed)
    found: list[Any] = []
    while len(found) < PAIRS:
        turn, bearing, apart = chance.uniform(0.0, 2.0 * np.pi, 3)
        apart = 2.0 * body.reach * (0.45 + 0.65 * apart / (2.0 * np.pi))
        own = Pose(0.0, 0.0, 1.0, 0.0)
        other = Pose(apart * np.cos(bearing), apart * np.sin(bearing), np.cos(turn), np.sin(turn))
        if 0.0 < separation(body_at(own, vehicle), body_at(other, vehicle))[0] < 0.05:
            found.append(replace(one, problem=problem, starts=(own, other)))
    return found


@pytest.mark.parametrize("looks", ["the shield", "the law"])
@pytest.mark.parametrize("body", [Rectangle(0.4, 0.25), Rectangle(0.5, 0.2), Disc(0.177)])
def test_whatever_the_other_does_in_the_tick_the_car_is_at_fault_in_no_contact(body: Body, looks: str) -> None:
    chance = np.random.default_rng(3)
    trials = pairs(body, 5)
    problem = trials[0].problem
    state = Embedded().reset(trials)
    bodies = pack_obstacles([()] * PAIRS)
    traffic = Traffic(
        state, Labels.zeros(PAIRS, 2), pack([problem.network], [0.6]), bodies,
        egos([one.problem for one in trials], 2, np.zeros(PAIRS, dtype=np.int64)), scratch(2, 8, bodies),
    )  # fmt: skip
    vehicle: Any = vehicles_of([problem])[0]
    bounds, travel = problem.car.bounds, travel_of(vehicle)
    asked = chance.uniform(-1.0, 1.0, (PAIRS, 2)) * chance.choice([0.1, 1.0], (PAIRS, 2)) * (0.7, bounds.yaw_rate)
    asked[chance.random(PAIRS) < 0.3, 1] = 0.0
    let = []
    for b, (speed, yaw_rate) in enumerate(asked.tolist()):
        near = gather_close(b, state, -1.0, vehicle, traffic.scratch)
        own, other = trials[b].starts
        if looks == "the law":
            touches = may_meet(own, Command(speed, yaw_rate), vehicle, other, travel)
        else:
            touches = may_touch(b, speed, yaw_rate, near, traffic, vehicle)
        if near and not touches:
            let.append(b)
    assert len(let) > 30
    touched = 0
    for _ in range(WORST):
        simulator = Embedded()
        simulator.reset([trials[b] for b in let])
        worst = chance.choice([-1.0, 0.0, 1.0], (len(let), 2)) * (0.7, bounds.yaw_rate)
        commands = np.stack([asked[let], worst], axis=1)
        for b, contacts in zip(let, simulator.step(commands), strict=True):
            for one in contacts:
                touched += one.time > 0.0
                k = (one.car, one.other).index(0)
                assert one.time == 0.0 or not (one.moved[k] and one.closing[k] > 0.0), (
                    asked[b],
                    trials[b].starts,
                )
    assert touched > 10


@pytest.mark.parametrize("rate", [6.5, 10.0, 30.0])
def test_a_disc_that_turns_as_it_leads_away_is_at_fault_in_no_contact(rate: float) -> None:
    """At 10 Hz and less the other one can come round to where the car has turned by then.

    Drawn is a contact, at any time of the tick: from it follows where the other one was at the beginning.
    """
    chance = np.random.default_rng(7)
    document = {
        "version": 1,
        "problem_domain": "dubins_traffic",
        "network": {"grid": {"rows": 2, "columns": 2}},
    }
    one = draw(load_config(document | {"number_trials": 1, "duration": 5, "rate": rate}), 1, 0)
    vehicle: Any = vehicles_of([one.problem])[0]
    period, most, radius, travel = 1.0 / rate, vehicle.yaw_most, vehicle.reach, travel_of(vehicle)
    let = closes = 0
    for _ in range(20_000):
        command = Command(0.7 * chance.uniform() ** 4 * chance.choice([-1.0, 1.0]), most * chance.choice([-1.0, 1.0]))
        at = period * chance.uniform(0.2, 1.0)
        x, y, c, s = advance(0.0, 0.0, 1.0, 0.0, command.speed, command.yaw_rate, at)
        ahead = 0.0 if command.speed > 0.0 else np.pi
        bearing = np.arctan2(s, c) + ahead + chance.choice([-1.0, 1.0]) * chance.uniform(0.4, 0.6) * np.pi
        far, whence = at / period * travel * chance.uniform(0.9, 1.0), chance.uniform(0.0, 2.0 * np.pi)
        other = Pose(
            x + 2.0 * radius * np.cos(bearing) + far * np.cos(whence),
            y + 2.0 * radius * np.sin(bearing) + far * np.sin(whence), 1.0, 0.0,
        )  # fmt: skip
        own = Pose(0.0, 0.0, 1.0, 0.0)
        gap = separation(body_at(own, vehicle), body_at(other, vehicle))[0]
        if gap < 0.0 or may_meet(own, command, vehicle, other, travel):
            continue
        let += 1
        closing = command.speed * (np.cos(bearing) * c + np.sin(bearing) * s)
        closes += closing > 0.0
    assert let > 300
    assert closes == 0
