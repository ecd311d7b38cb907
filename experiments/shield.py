"""Random, hostile and broken controllers under the shield among `lawful` e-agents: does the ego keep rules 1 to 3?

    python -m experiments shield
    python -m experiments.shield [TRIALS] [JOBS] [FIRST] [BENT]

Each trial is 60 s on a random network of 6 to 40 intersections with 1 to 6 e-agents. One in four has obstacles in and
beside the lanes, in one in four the ego starts in any direction but backward, in one in eight cars have other bodies
or bounds, one in sixteen has 8 to 12 e-agents on 6 to 8 intersections. The kinds of `experiments.shield_hostile` take
turns. A tenth as many trials are driven by the controller `rules` itself: in how many does the shield step in?
Then the same on networks of which seven in ten segments bend, BENT = 0.7, in a tenth as many trials.
"""

from __future__ import annotations

import sys
from collections.abc import Iterator, Mapping, Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass, replace
from functools import partial
from typing import Any

import numpy as np
from benchmarks.table import Row, show

from dubins_traffic.cars.state import EGO, Pose
from dubins_traffic.cars.tables import pack_obstacles
from dubins_traffic.controllers.shield import Shield
from dubins_traffic.engine.egos import grouped
from dubins_traffic.engine.group import Group
from dubins_traffic.kernels.philox import Draws
from dubins_traffic.kernels.trig import sincos
from dubins_traffic.policies.rules.policy import decide
from dubins_traffic.policies.rules.tables import Traffic, scratch
from dubins_traffic.problem.instance import Instance
from dubins_traffic.roads.packing import pack_distinct
from dubins_traffic.rules.propositions import FLAG
from dubins_traffic.runs.single import run_trial
from dubins_traffic.scoring.score import Score
from dubins_traffic.shield.nearest_command import shield
from dubins_traffic.shield.tables import REASONS, egos, shield_tables
from experiments.drawing import random_roads, random_trial
from experiments.rules import e_agents
from experiments.shield_hostile import KINDS, Hostile

DURATION = 60.0
SEED = 2016
TOGETHER = 240
TRIALS, TRIALS_ON_CURVES = 20000, 2000
BENT = 0.7
"""About this share of the segments bends in the trials on roads that bend."""
BODIES: tuple[dict[str, Any], ...] = (
    {"body": {"rectangle": {"length": 0.4, "width": 0.25}}},
    {"bounds": {"turning_radius": 0.26}},
    {"bounds": {"speed": 1.2, "yaw_rate": 2.5, "speed_min": -0.2}},
    {
        "body": {"rectangle": {"length": 0.35, "width": 0.2}},
        "bounds": {"turning_radius": 0.2, "speed_min": 0.0},
    },
)


@dataclass(frozen=True, slots=True)
class Shielded:
    """One trial: who drove, whether there are obstacles, what the ego and the others broke, collisions and those with
    the ego at fault, in how many ticks the shield stepped in for each reason, how often the ego crossed the centre
    line, and metres driven.
    """

    number: int
    kind: str
    obstacles: bool
    end: str
    own: tuple[str, ...]
    others: tuple[str, ...]
    collisions: int
    at_fault: int
    reasons: Mapping[str, int]
    passed: int
    distance: float


def instance(number: int, seconds: float = DURATION, bent: float = 0.0) -> Instance:
    """Return the random instance of a number; about a share `bent` of its segments bend."""
    draws = Draws(SEED, number, 907)
    crowded, blocked, turned, other = (draws.below(n) == 0 for n in (16, 4, 4, 8))
    network = random_roads(draws, 8 if crowded else 40, 0.5, bent)
    agents = e_agents("lawful", draws.between(8, 12) if crowded else draws.between(1, 6), draws)
    more: dict[str, Any] = {"car": BODIES[draws.below(len(BODIES))]} if other else {}
    if blocked:
        bare = random_trial(network, agents, seconds, SEED, number, rules=True, **more)
        more["obstacles"] = _obstacles(bare, draws)
    drawn = random_trial(network, agents, seconds, SEED, number, rules=True, **more)
    if turned and not other:
        x, y, c, s = drawn.starts[EGO]
        cosine, sine = sincos(draws.uniform(-1.5, 1.5))
        start = Pose(x, y, c * cosine - s * sine, c * sine + s * cosine)
        drawn = replace(drawn, starts=(start, *drawn.starts[1:]))
    return drawn


def _obstacles(bare: Instance, draws: Draws) -> list[dict[str, Any]]:
    """Return discs in and beside lanes, at least two and one for every four lanes."""
    network = bare.problem.network
    found: list[dict[str, Any]] = []
    for _ in range(max(2, network.lanes // 4)):
        lane, left, share = draws.below(network.lanes), draws.uniform(-0.7, 0.1), draws.uniform(0.3, 0.7)
        (x0, y0), (x1, y1) = network.lane_line(lane, left)
        x, y = x0 + share * (x1 - x0), y0 + share * (y1 - y0)
        if network.bent[lane >> 1]:
            (place,), (way,) = network.lane_places(lane, np.array([share * network.lengths[lane >> 1]]))
            x, y = float(place[0] - left * way[1]), float(place[1] + left * way[0])
        found.append({"disc": {"x": x, "y": y, "radius": draws.uniform(0.05, 0.2)}})
    return found


def trials(
    numbers: Sequence[int], seconds: float = DURATION, kinds: Sequence[str] = KINDS, bent: float = 0.0
) -> list[Shielded]:
    """Run trials together, the `kinds` taking turns; about a share `bent` of the segments bend."""
    found: list[Shielded] = []
    for own in grouped([instance(number, seconds, bent) for number in numbers]):
        found += _run(own, [kinds[(one.trial + one.trial // len(kinds)) % len(kinds)] for one in own])
    return found


def _run(own: Sequence[Instance], kinds: Sequence[str]) -> Iterator[Shielded]:
    """Run trials of one control rate and width together."""
    group = Group(own, keeps_rules=False)
    count, places = group.state.x.shape
    problems = [one.problem for one in own]
    roads, net = pack_distinct(
        [problem.network for problem in problems], [problem.car.lane_width for problem in problems]
    )
    bodies = pack_obstacles([problem.obstacles for problem in problems])
    law, drivers = egos(problems, places, net), egos(problems, places, net)
    room = scratch(places, int(np.diff(roads.seg_off).max()), bodies)
    traffic = Traffic(group.state, group.labels, roads, bodies, drivers, room)
    by_law = traffic.replace(drivers=law)
    watch = shield_tables(problems, traffic)
    hostile = Hostile(kinds, law.vehicle, net, roads, SEED + own[0].trial)
    reasons = np.zeros((count, len(REASONS)), dtype=np.int64)
    passed, aside = np.zeros(count, dtype=np.int64), np.zeros(count, dtype=bool)
    while len(active := group.active):
        tick = np.full(count, -1)
        tick[active] = group.ticks[active]
        now = int(tick.max())
        decide(now, group.commands, by_law)
        group.commands[:, EGO] = hostile.ask(now, group.state, group.labels, group.commands[:, EGO].copy())
        shield(tick, False, traffic, watch, group.commands)
        reasons[active, watch.ego["reason"][active]] += 1
        group.advance()
        before, aside = aside, (group.labels.bits[:, EGO] & FLAG.LEFT) != 0
        passed += aside & ~before
    for b, outcome in enumerate(group.outcomes(range(count), "shield")):
        told = {REASONS[k]: int(n) for k, n in enumerate(reasons[b]) if k and n}
        yield _shielded(own[b], kinds[b], outcome.score, told, int(passed[b]))


def _shielded(own: Instance, kind: str, score: Score, reasons: Mapping[str, int], passed: int = 0) -> Shielded:
    verdict = score.verdict
    assert verdict is not None
    return Shielded(
        own.trial,
        kind,
        len(own.problem.obstacles) > 0,
        str(score.end),
        tuple(one.rule for one in verdict.violations if one.car == "ego"),
        tuple(one.rule for one in verdict.violations if one.car != "ego"),
        len(score.collisions),
        sum(one.at_fault for one in score.collisions),
        reasons,
        passed,
        score.driven.distance_m,
    )


def ruled(number: int, seconds: float = DURATION, bent: float = 0.0) -> Shielded:
    """Run a trial of the controller `rules` under the shield."""
    driver, own = Shield("rules"), instance(number, seconds, bent)
    score = run_trial(own, driver).score
    return _shielded(own, "rules", score, {"": driver.shield_filter.count} if driver.shield_filter.count else {})


def bars(found: Sequence[Shielded]) -> list[Row]:
    """Return the table of the bars."""
    hostile = [one for one in found if one.kind != "rules"]
    quiet = [one for one in found if one.kind == "rules"]
    rows = [_breaches("random, hostile and broken", hostile), _breaches("rules", quiet)]
    rows.append(_left_alone("rules: never stepped in", quiet))
    rows.append(_left_alone("the same, without obstacles", [one for one in quiet if not one.obstacles]))
    passed = sum(one.passed for one in hostile)
    rows.append(Row("random, hostile and broken: crossings of the centre line", str(passed), "", True))
    for kind in KINDS:
        own = [one for one in hostile if one.kind == kind]
        ticks = sum(sum(one.reasons.values()) for one in own) / max(len(own), 1) / (30.0 * DURATION)
        driven = sum(one.distance for one in own) / max(len(own), 1)
        rows.append(Row(f"{kind}: ticks stepped in; driven", f"{100 * ticks:.1f} %; {driven:.1f} m", "", True))
    return rows


def _left_alone(name: str, found: Sequence[Shielded]) -> Row:
    alone = sum(1 for one in found if not one.reasons) / max(len(found), 1)
    return Row(name, f"{100 * alone:.2f} % of {len(found)} trials", ">= 95 %", alone >= 0.95)


def _breaches(kind: str, found: Sequence[Shielded]) -> Row:
    broke = sum(1 for one in found if one.own or one.at_fault)
    return Row(f"{kind}, {len(found)} trials: with a breach of rules 1 to 3", str(broke), "0", broke == 0)


def measured(count: int = TRIALS, jobs: int = 2, first: int = 0, bent: float = 0.0) -> list[Shielded]:
    """Run `count` trials of the hostile kinds and a tenth as many of `rules`, in `jobs` processes.

    About a share `bent` of the segments bends.
    """
    numbers = range(first, first + count)
    parts = [numbers[k : k + TOGETHER] for k in range(0, count, TOGETHER)]
    found: list[Shielded] = []
    with ProcessPoolExecutor(jobs) as pool:
        for part in pool.map(partial(trials, bent=bent), parts):
            found += part
            print(f"{len(found)} of {count}", file=sys.stderr, end="\r", flush=True)
        found += pool.map(partial(ruled, bent=bent), range(first, first + max(count // 10, 1)), chunksize=8)
    return found


def measure() -> list[Row]:
    """Run all trials and return the table of the bars."""
    on_curves = bars(measured(TRIALS_ON_CURVES, bent=BENT))
    return bars(measured()) + [replace(row, name=f"on roads that bend: {row.name}") for row in on_curves]


def main() -> None:
    """Print what is remarkable, and the table."""
    found = measured(*(int(argument) for argument in sys.argv[1:4]), bent=float((sys.argv[4:] or ["0"])[0]))
    for one in found:
        if one.own or one.at_fault or (one.kind == "rules" and one.reasons):
            print(one)
    show("shield", bars(found))


if __name__ == "__main__":
    main()
