"""E-agents of the kind `free`: much that E1 to E6 allow and no other kind does (compiled).

A free car does as its whims say, drawn at random or given, until one of its clocks says that the law must take over:
those of the referee for E3 to E6, early enough that the law (`policies.rules.policy`) still keeps them. Whatever it
does goes through a shield (`shield.nearest_command`), which keeps E1 and E2.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, Any, Final

import numpy as np

from dubins_traffic.agents.lawful import drivers_of
from dubins_traffic.agents.script import script_rows
from dubins_traffic.cars.body import Disc
from dubins_traffic.cars.state import EGO, Labels, State
from dubins_traffic.cars.tables import pack_obstacles
from dubins_traffic.kernels.arrays import Floats, Ints
from dubins_traffic.kernels.calls import bound
from dubins_traffic.kernels.compile import jit, jit_rare
from dubins_traffic.kernels.random import DRAW, uniform
from dubins_traffic.kernels.records import Rows, record, table
from dubins_traffic.kernels.tables import Tables
from dubins_traffic.observations.viewpoints import show
from dubins_traffic.policies.rules.right_of_way import GOES_NOW
from dubins_traffic.policies.rules.tables import KIND, Driver, Drivers, Traffic, scratch
from dubins_traffic.problem.kinds import FREE, parameters_of
from dubins_traffic.roads.lookup import lane_coordinates, lane_direction_at, lane_start
from dubins_traffic.roads.table import RoadTable
from dubins_traffic.rules.breach_log import RefereeTables
from dubins_traffic.rules.parameters import RuleParameters
from dubins_traffic.rules.propositions import FLAG
from dubins_traffic.rules.referee import Referee
from dubins_traffic.shield.nearest_command import shield_trial
from dubins_traffic.shield.tables import ShieldTables, shield_tables

if TYPE_CHECKING:
    from dubins_traffic.problem.instance import EAgent, Instance

LINGER: Final = 0.06
"""Share of E4's time that a free car may spend as it likes in a stay with a free exit; the law needs the rest."""
DRIVE: Final = 2.5
"""Of the time for a journey (E5) the law gets that in which it drives so many of the longest lanes ..."""
RESERVE: Final = 25.0
"""... and so many seconds."""
WAIT: Final = 0.8
"""Share of E3's time for which a free car may hold at its line."""
CROWD: Final = 0.3
"""After this share of E6's time the law drives whoever comes near a goal that is taken."""
NEAR: Final = 1.5
"""How near that is beyond the disc, metres."""
APART: Final = 0.5
"""A free car does not move toward a body or an obstacle that is nearer than this, metres, of its own accord: the law
would then wait for that one to go, or have no room to pass."""
ASKEW, ALONG = 0.05, 0.99
"""How far from the middle of its lane, metres, and how far from its direction, a cosine, a body that is no disc still
moves as it likes: it needs room to turn, which who stands behind it at a line would not leave."""
SHORT, LONG = 0.2, 5.0
"""Seconds for which a whim lasts."""
AS_THE_LAW: Final = 1.0
NOTHING_GIVEN: Final = -1.0


@record
class Whim:
    """What a free car likes to do for a while."""

    end: float
    """The tick of its list at which it ends."""
    share: float
    """Share of the law's command; negative: `speed` and `yaw_rate` instead."""
    speed: float
    """m/s."""
    yaw_rate: float
    """rad/s."""
    hold: float
    """Share of the time for which it may hold at a line that it does hold there; negative: drawn."""


@record
class FreeCar:
    """A free car: its parameters and its memory; times are in ticks."""

    boldness: float
    """Share of its time in which it does not do as the law says."""
    fastest: float
    """m/s."""
    yaw_most: float
    """rad/s."""
    turns: int
    """1 if it turns of its own accord: a body that is no disc would stand in the way of others, tilted."""
    repeat: int
    """1 if its whims begin again after the last."""
    first: int
    """Its first row of `Free.whim`."""
    last: int
    """The row after its last one; without any they are drawn."""
    rate: float
    """Ticks of a second."""
    apart: float
    """It does not move of its own accord toward who is nearer than this, metres."""
    near: float
    """How near to a goal that has been taken for long the law drives it, metres."""
    stay: int
    """For how long it does as it likes in a disc with a free exit."""
    start: int
    """E5's first ticks of a journey."""
    journey: int
    """After how long on a journey the law drives."""
    crowded: int
    """After how long that a goal is taken the law drives who is near."""
    wait: int
    """For how long it may hold at its line."""
    place: int
    """The row of its present whim, where they are given."""
    until: int
    """When the present whim ends, where they are drawn."""
    share: float = AS_THE_LAW
    """The present whim: as `Whim.share`, `Whim.speed` and `Whim.yaw_rate`."""
    speed: float
    """m/s."""
    yaw_rate: float
    """rad/s."""
    patience: float = NOTHING_GIVEN
    """As `Whim.hold`."""
    hold: int = -1
    """For how long of its own turn it holds at the line where it has stopped; -1 elsewhere."""
    stopped_in: int = -1
    """The lane in which it has stopped at the line, -1 if it has not in this one."""


class Free(Tables):
    """The F free cars of a batch.

    `row` (B, N): which of them a car is, -1 for none; `car` (F,); `whim` (W,): what is given, one car's after
    another's; `traffic`: F rows, each what one of them sees, in the ego's place; `shields` and `commands` (F, N, 2).
    """

    row: Ints
    car: Rows[FreeCar]
    whim: Rows[Whim]
    traffic: Traffic
    shields: ShieldTables
    commands: Floats


@jit_rare
def decide_free(b: int, tick: int, commands: Floats, drivers: Drivers, judging: RefereeTables, free: Free) -> None:
    """Replace the commands of the free cars of trial b, which are those of the law, by what they like and may do.

    `drivers` has the trial's seed; frame `tick` has been labelled and judged.
    """
    state, labels = judging.state, judging.labels
    for n in range(EGO + 1, state.count[b]):
        f = int(free.row[b, n])
        if f < 0:
            continue
        _like(b, n, tick, commands, drivers, judging, free)
        show(b, n, f, state, labels, free.traffic.state, free.traffic.labels)
        free.commands[f, EGO, 0], free.commands[f, EGO, 1] = commands[b, n, 0], commands[b, n, 1]
        sight2 = float(free.shields.ego[f].sight2)
        shield_trial(f, tick, sight2, free.traffic, free.shields, free.commands)
        commands[b, n, 0], commands[b, n, 1] = free.commands[f, EGO, 0], free.commands[f, EGO, 1]


@jit
def _like(b: int, n: int, tick: int, commands: Floats, drivers: Drivers, judging: RefereeTables, free: Free) -> None:
    """Replace the command of car n, which is the law's, by what it likes to do, as far as its clocks allow that."""
    car = free.car[int(free.row[b, n])]
    if car.first < car.last:
        _play(tick, car, free.whim)
    elif tick >= car.until:
        _think(b, n, tick, car, drivers)
    owes = _owes(b, n, tick, car, judging)
    if _holds(b, n, tick, car, drivers, judging):
        commands[b, n, 0] = commands[b, n, 1] = 0.0
    elif not owes and car.share >= 0.0:
        commands[b, n, 0] *= car.share
        commands[b, n, 1] *= car.share
    elif not owes and _may(b, n, car, judging, free):
        commands[b, n, 0], commands[b, n, 1] = car.speed, car.yaw_rate


@jit
def _play(tick: int, car: FreeCar, whims: Rows[Whim]) -> None:
    """Set the present whim to that which is given for a tick; after the last one the law drives."""
    total = int(whims[car.last - 1].end)
    if total == 0 or (tick >= total and car.repeat == 0):
        car.share, car.patience = AS_THE_LAW, 0.0
        return
    now = tick % total
    row = car.place
    if row < car.first or (row > car.first and whims[row - 1].end > now):
        row = car.first
    while whims[row].end <= now:
        row += 1
    car.place = row
    car.share, car.speed, car.yaw_rate = whims[row].share, whims[row].speed, whims[row].yaw_rate
    car.patience = whims[row].hold


@jit_rare
def _think(b: int, n: int, tick: int, car: FreeCar, drivers: Drivers) -> None:
    """Draw the next whim."""
    seed, trial = drivers.seed[b], drivers.trial[b]
    seconds = SHORT + (LONG - SHORT) * uniform(seed, trial, n, tick, DRAW.FREE)
    car.until = tick + max(1, int(seconds * car.rate))
    car.share = AS_THE_LAW
    if uniform(seed, trial, n, tick, DRAW.FREE + 1) >= car.boldness:
        return
    kind = int((6.0 if car.turns != 0 else 4.0) * uniform(seed, trial, n, tick, DRAW.FREE + 2))
    share = uniform(seed, trial, n, tick, DRAW.FREE + 3)
    if kind == 0:
        car.share = share
        return
    turn = (2.0 * uniform(seed, trial, n, tick, DRAW.FREE + 4) - 1.0) * car.yaw_most
    car.share, car.speed, car.yaw_rate = NOTHING_GIVEN, 0.0, 0.0
    if kind == 2:
        car.speed = -share * car.fastest
    elif kind == 3:
        car.speed = share * car.fastest
    elif kind == 4:
        car.speed = (2.0 * uniform(seed, trial, n, tick, DRAW.FREE + 5) - 1.0) * car.fastest
        car.yaw_rate = turn * share
    elif kind == 5:
        car.yaw_rate = turn


@jit
def _may(b: int, n: int, car: FreeCar, judging: RefereeTables, free: Free) -> bool:
    """Tell whether a car may do what it likes: it stays apart from others, and along its lane unless it turns.

    In a disc it only stands, since from elsewhere than its way the law might not leave the disc in time (E4).
    """
    state, labels, roads, rules = judging.state, judging.labels, judging.roads, judging.rules[b]
    x, y, c, s = state.x[b, n], state.y[b, n], state.c[b, n], state.s[b, n]
    if car.speed == 0.0 and car.yaw_rate == 0.0:
        return True
    if labels.at[b, n] >= 0 or (car.speed < 0.0 and _backs_in(b, n, car, judging)):
        return False
    if car.turns == 0 and car.speed != 0.0:
        lane = labels.lane[b, n]
        segment = roads.segment[int(roads.seg_off[rules.net]) + int(labels.segment[b, n])]
        if lane < 0 or segment.piece >= 0:
            return False
        tx, ty = lane_direction_at(roads, rules.net, lane, x, y)
        _, lateral = lane_coordinates(roads, rules.net, lane, x, y)
        if c * tx + s * ty < ALONG or abs(lateral + judging.terms[b].lane_middle) > ASKEW:
            return False
    for k in range(state.count[b]):
        dx, dy = state.x[b, k] - x, state.y[b, k] - y
        if (dx * c + dy * s) * car.speed > 0.0 and dx * dx + dy * dy < car.apart * car.apart:
            return False
    f, obstacles = int(free.row[b, n]), free.traffic.obstacles
    for p in range(obstacles.off[f], obstacles.off[f + 1]):
        part = obstacles.parts[p]
        dx, dy, far = part.x - x, part.y - y, part.reach + car.apart
        if (dx * c + dy * s) * car.speed > 0.0 and dx * dx + dy * dy < far * far:
            return False
    return True


@jit
def _backs_in(b: int, n: int, car: FreeCar, judging: RefereeTables) -> bool:
    """Tell whether a car that backs up brings its centre into the disc from which it came."""
    roads, rules, lane = judging.roads, judging.rules[b], judging.labels.lane[b, n]
    if lane < 0:
        return True
    corner = roads.vertex[int(roads.vert_off[rules.net]) + lane_start(roads, rules.net, lane)]
    dx, dy = judging.state.x[b, n] - corner.x, judging.state.y[b, n] - corner.y
    far = rules.radius - car.speed / car.rate
    return bool(dx * dx + dy * dy < far * far)


@jit
def _owes(b: int, n: int, tick: int, free_car: FreeCar, judging: RefereeTables) -> bool:
    """Tell whether the law has to drive a car now, so that it keeps E3 to E6."""
    labels, log, terms = judging.labels, judging.log, judging.terms[b]
    car = log.car[b, n]
    lane, bits = labels.lane[b, n], np.int64(labels.bits[b, n])
    stopped = bits & FLAG.STOPPED != 0
    if stopped:
        free_car.stopped_in = lane
    elif free_car.stopped_in != lane:
        free_car.stopped_in = -1
    run = tick - car.exit_since - car.exit_paused if car.exit_since >= 0 else 0
    owes = labels.crosses[b, n] >= 0 and car.exit_spent + run >= free_car.stay
    owes = owes or min(tick - car.journey_since, free_car.start) + car.journey_spent >= free_car.journey
    owes = owes or free_car.stopped_in >= 0 or bits & FLAG.LEFT != 0
    for g in range(terms.goals_begin, terms.goals_end):
        goal = log.goal[g]
        owes = owes or labels.at[b, n] == goal.vertex
        if 0 <= goal.since <= tick - free_car.crowded:
            corner = judging.roads.vertex[int(judging.roads.vert_off[judging.rules[b].net]) + goal.vertex]
            dx, dy = judging.state.x[b, n] - corner.x, judging.state.y[b, n] - corner.y
            owes = owes or dx * dx + dy * dy < free_car.near * free_car.near
    return owes


@jit
def _holds(b: int, n: int, tick: int, car: FreeCar, drivers: Drivers, judging: RefereeTables) -> bool:
    """Tell whether a car holds at its line, where it is its turn."""
    bits = np.int64(judging.labels.bits[b, n])
    if bits & FLAG.STOPPED == 0:
        car.hold = -1
        return False
    if car.hold < 0:
        car.hold = int(car.wait * _patience(b, n, tick, car, drivers))
    since = judging.log.car[b, n].first_since
    if bits & GOES_NOW != GOES_NOW or bits & FLAG.FORFEITED != 0 or since < 0:
        return False
    return tick - since < car.hold


@jit_rare
def _patience(b: int, n: int, tick: int, car: FreeCar, drivers: Drivers) -> float:
    """Return for which share of the time that it may a car holds at the next line, as given or drawn."""
    if car.patience >= 0.0:
        return car.patience
    seed, trial = drivers.seed[b], drivers.trial[b]
    bold = uniform(seed, trial, n, tick, DRAW.FREE + 6) < car.boldness
    return uniform(seed, trial, n, tick, DRAW.FREE + 7) if bold else 0.0


def free_tables(instances: Sequence[Instance], cars: int, roads: RoadTable, net: Ints) -> Free:
    """Return the free cars of a batch with `cars` places a trial, before the first tick.

    `net` (B,) are the numbers of the trials' networks in `roads`.
    """
    places = [
        (b, n)
        for b, instance in enumerate(instances)
        for n, agent in enumerate(instance.e_agents, start=1)
        if agent.kind == FREE
    ]
    row = np.full((len(instances), cars), -1)
    for f, place in enumerate(places):
        row[place] = f
    free_instances = [instances[b] for b, _ in places] or list(instances[:1])
    problems = [instance.problem for instance in free_instances]
    nets = np.array([net[b] for b, _ in places] or [net[0]])
    bodies = pack_obstacles([problem.obstacles for problem in problems])
    shielded = table(Driver, (len(free_instances), cars))
    shielded["kind"][:, EGO] = KIND.ROUND
    shielded["speed"][:, EGO] = [problem.car.bounds.speed for problem in problems]
    traffic = Traffic(
        State.zeros(len(free_instances), cars),
        Labels.zeros(len(free_instances), cars),
        roads,
        bodies,
        drivers_of(free_instances, nets, shielded, np.zeros(0, dtype=np.int64), np.zeros((0, 0))),
        scratch(cars, int(np.diff(roads.seg_off).max()), bodies),
    )
    rows, whims = table(FreeCar, len(free_instances)), list[tuple[float, ...]]()
    for f, (b, n) in enumerate(places):
        _describe(instances[b], instances[b].e_agents[n - 1], rows[f], whims)
    given = table(Whim, len(whims))
    for name, values in zip(("end", "share", "speed", "yaw_rate", "hold"), zip(*whims, strict=True), strict=False):
        given[name] = values
    return Free(row, rows, given, traffic, shield_tables(problems, traffic), np.zeros((len(free_instances), cars, 2)))


def _describe(instance: Instance, agent: EAgent, car: FreeCar, whims: list[tuple[float, ...]]) -> None:
    """Fill the row of a free car, and append what is given for it to `whims`."""
    problem = instance.problem
    rules, rate, bounds = RuleParameters.from_mapping(problem.rules), problem.rate, problem.car.bounds
    given = {**parameters_of(FREE, {}), **agent.parameters}
    car.boldness, car.repeat, car.rate = given["boldness"], given["repeat"], rate
    car.fastest, car.yaw_most = bounds.speed, bounds.yaw_rate
    car.turns = isinstance(problem.car.body, Disc)
    car.apart = 2.0 * problem.car.body.reach + APART
    car.near = problem.intersection_radius + NEAR
    longest = float(problem.network.lengths.max()) / bounds.speed
    journey = rules.rest_time + rules.journey_lengths * longest - DRIVE * longest - RESERVE
    car.journey = math.floor(max(journey, 0.0) * rate)
    car.start = math.ceil(rules.journey_start_time * rate)
    car.stay = math.floor(LINGER * rules.exit_time * rate)
    car.crowded = math.floor(CROWD * rules.goal_time * rate)
    longest_turn = rules.enter_time if rules.tickets > 0 else min(rules.enter_time, rules.forfeit_time)
    car.wait = math.floor(WAIT * longest_turn * rate)
    rows: Sequence[Sequence[float]] = given["whims"] or [
        (seconds, NOTHING_GIVEN, speed, yaw_rate, NOTHING_GIVEN) for seconds, speed, yaw_rate in given["commands"]
    ]
    car.first = car.place = len(whims)
    whims += script_rows(rows, rate)
    car.last = len(whims)


class FreeCars:
    """Lets the free cars of a batch do as they like (after `lawful.Lawful`, whose commands for them it replaces).

    Parameters
    ----------
    instances : sequence of Instance
        One a trial.
    roads, net
        The trials' networks, and their numbers there, (B,).
    """

    def __init__(self, instances: Sequence[Instance], cars: int, roads: RoadTable, net: Ints) -> None:
        judged = [replace(instance, problem=_judged(instance.problem)) for instance in instances]
        self._trials = [
            b for b, instance in enumerate(instances) if any(agent.kind == FREE for agent in instance.e_agents)
        ]
        self._referee = Referee(judged)
        self._free = free_tables(instances, cars, roads, net)
        self._decide = bound(decide_free)
        self._nothing = [()] * len(instances)

    def decide(self, tick: int, state: State, drivers: Drivers, commands: Floats) -> None:
        """Replace the commands of these cars for [t_k, t_k+1) in `commands` (B, N, 2); `drivers` are the law's."""
        if tick == 0:
            self._referee.reset(state)
        else:
            self._referee.update(tick, state, self._nothing)
        judging = self._referee.tables(state)
        for b in self._trials:
            self._decide(b, tick, commands, drivers, judging, self._free)


def _judged(problem: Any) -> Any:
    """Return a problem that is judged by the rules, whether it says so or not."""
    return replace(problem, rules=RuleParameters.from_mapping(problem.rules).to_mapping())
