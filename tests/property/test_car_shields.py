"""E-agents under shields, driven as they should not: none breaks E1 or E2, whatever all others do."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from experiments.drawing import random_roads, random_trial
from experiments.shield_hostile import KINDS, Hostile
from hypothesis import given, settings
from hypothesis import strategies as st

from dubins_traffic.engine.group import Group
from dubins_traffic.kernels.arrays import Floats
from dubins_traffic.kernels.philox import Draws
from dubins_traffic.observations.senses import Senses
from dubins_traffic.observations.viewpoints import Viewpoints
from dubins_traffic.policies.rules.tables import vehicles_of
from dubins_traffic.problem.instance import EAgent, Instance
from dubins_traffic.problem.kinds import REMOTE
from dubins_traffic.roads.packing import pack_distinct
from dubins_traffic.rules.referee import Breach, accused
from dubins_traffic.shield.car_shields import CarShields
from dubins_traffic.shield.filter import ShieldFilter
from dubins_traffic.shield.tables import REASONS

KEPT = {"1.collision", "1.road", "2.left", "2.return", "3.stop", "3.order", "3.clear", "E2"}
"""Rules that E1 and E2 state."""


def trial(number: int, seconds: float, agents: int = 6, bent: float = 0.0) -> Instance:
    """Return a random trial whose e-agents are driven from outside."""
    draws = Draws(11, number, 0)
    more: dict[str, Any] = {"rules": True}
    if number % 4 == 0:
        more["car"] = {"body": {"rectangle": {"length": 0.4, "width": 0.25}}}
    roads = random_roads(draws, 9, 0.8, bent)
    drawn = random_trial(
        roads, [{"type": "lawful", "name": f"a{k}"} for k in range(agents)], seconds, 5, number, **more
    )
    return outside(drawn)


def outside(instance: Instance) -> Instance:
    agents = tuple(EAgent(REMOTE, own.name, "learned/policy") for own in instance.e_agents)
    return replace(instance, e_agents=agents)


def hostile(instances: Sequence[Instance], views: Viewpoints, first: int) -> Hostile:
    cars = views.state.x.shape[1]
    own = [instance.problem for instance in instances for _ in range(cars)]
    roads, net = pack_distinct([one.network for one in own], [one.car.lane_width for one in own])
    kinds = [KINDS[(first + 7 * k) % len(KINDS)] for k in range(len(own))]
    return Hostile(kinds, vehicles_of(own), net, roads, seed=first)


def all_of(group: Group, b: int) -> list[Breach]:
    """Return all breaches of a trial, those that lie in contacts among them."""
    return [*group.breaches[b], *accused(group.contacts[b])]


def driven(instances: Sequence[Instance], first: int, keeps_ego: bool) -> tuple[list[list[Breach]], set[str]]:
    """Drive all cars of trials badly, the e-agents under shields; return all breaches, and why shields stepped in."""
    group = Group(instances, keeps_rules=False)
    trials, cars = group.state.x.shape
    views = Viewpoints(group.state, group.labels)
    kept = np.arange(cars)[None, :] < group.state.count[:, None]
    kept[:, 0] = keeps_ego
    shields = CarShields([instance.problem for instance in instances], views, kept)
    drivers = hostile(instances, views, first)
    reasons: set[str] = set()
    law = np.zeros((trials * cars, 2))
    while len(group.active):
        tick = int(group.ticks.max())
        law[:, 0] = 0.5
        asked = drivers.ask(tick, views.state, views.labels, law).reshape(trials, cars, 2)
        group.commands[:] = np.where(np.isfinite(asked), asked, 0.0) if not keeps_ego else asked
        group.commands[~kept] = np.nan_to_num(group.commands[~kept], nan=0.0, posinf=1.0, neginf=-1.0)
        found = shields.filter(np.where([one is None for one in group.endings], group.ticks, -1), group.commands)
        reasons |= {REASONS[code] for code in np.unique(found).tolist()}
        group.advance()
        views.look(np.arange(trials))
    assert all(ending is not None and ending.end == "duration" for ending in group.endings)
    return [all_of(group, b) for b in range(trials)], reasons


@pytest.mark.parametrize("keeps_ego", [True, False])
def test_no_e_agent_under_a_shield_breaks_e1_or_e2_however_all_are_driven(keeps_ego: bool) -> None:
    first = 100 * keeps_ego
    found, reasons = driven([trial(first + k, 25.0) for k in range(24)], first, keeps_ego)
    kept = [one for own in found for one in own if one.rule in KEPT and (keeps_ego or one.car > 0)]
    assert kept == []
    assert {"1.collision", "1.road", "2.left", "2.turn", "3.stop"} <= reasons
    assert keeps_ego or any(one.car == 0 for own in found for one in own), "the ego drives well: nothing is tried"


NUMBER = st.floats(-1.0, 1.0)
PHASE = st.tuples(st.integers(1, 40), NUMBER, NUMBER)


@settings(max_examples=25, deadline=None)
@given(st.lists(st.lists(PHASE, min_size=1, max_size=6), min_size=4, max_size=4), st.integers(0, 7))
def test_no_commands_lead_e_agents_under_shields_to_a_breach(
    plans: list[list[tuple[int, float, float]]], seed: int
) -> None:
    names = [{"type": "lawful", "name": f"a{k}"} for k in range(3)]
    drawn = random_trial({"grid": {"rows": 2, "columns": 3}}, names, 10.0, seed, 0, rules=True)
    group = Group([outside(drawn)], keeps_rules=False)
    views = Viewpoints(group.state, group.labels)
    shields = CarShields([drawn.problem], views, np.array([[False, True, True, True]]))
    script = [[(u, w) for ticks, u, w in plan for _ in range(ticks)] for plan in plans]
    bounds = drawn.problem.car.bounds
    while len(group.active):
        tick = int(group.ticks[0])
        for car, own in enumerate(script):
            u, w = own[tick % len(own)]
            group.commands[0, car] = u * bounds.speed, w * bounds.yaw_rate
        shields.filter(group.ticks, group.commands)
        group.advance()
        views.look(np.zeros(1, dtype=np.int64))
    assert [one for one in all_of(group, 0) if one.car > 0 and one.rule in KEPT] == []


def test_a_cars_shield_does_as_that_of_an_ego_which_is_told_the_same() -> None:
    instance = trial(3, 12.0, agents=3)
    group = Group([instance], keeps_rules=False)
    views = Viewpoints(group.state, group.labels)
    cars = len(instance.starts)
    shields = CarShields([instance.problem], views, np.ones((1, cars), dtype=np.bool_))
    senses = [Senses(instance, car) for car in range(cars)]
    filters = [ShieldFilter() for _ in range(cars)]
    for own in filters:
        own.start(instance.problem)
    drivers = hostile([instance], views, 2)
    law = np.full((cars, 2), 0.4)
    stepped_in = 0
    while len(group.active):
        tick = int(group.ticks[0])
        asked: Floats = drivers.ask(tick, views.state, views.labels, law)
        told = [one.observe(tick, group.state, group.labels) for one in senses]
        wanted = [
            own.filter(seen, (float(u), float(w))) for own, seen, (u, w) in zip(filters, told, asked, strict=True)
        ]
        group.commands[0] = asked
        reasons = shields.filter(group.ticks, group.commands)
        assert [tuple(row) for row in group.commands[0].tolist()] == [tuple(own) for own in wanted], tick
        for own, reason in zip(filters, reasons[0].tolist(), strict=True):
            assert (own.intervention is None) == (reason == 0)
            stepped_in += reason != 0
        group.advance()
        views.look(np.zeros(1, dtype=np.int64))
    assert stepped_in > 50
