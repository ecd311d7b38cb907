"""E-agents of the kind `free`: much that E1 to E6 allow and no other kind does.

A free car does as its commands say, or as a random walk does, until one of its clocks says that the law must take over:
those of the referee for E3 to E6, early enough that the law (`policies.rules.policy`) still keeps them. Whatever it
does goes through a shield (`shield.car_shields`), which keeps E1 and E2.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any, Final

import numpy as np

from dubins_traffic.agents.lawful import Lawful
from dubins_traffic.cars.body import Disc
from dubins_traffic.cars.state import Labels, State
from dubins_traffic.errors import InputError
from dubins_traffic.kernels.arrays import Floats, Ints
from dubins_traffic.observations.viewpoints import Viewpoints
from dubins_traffic.problem.instance import EAgent
from dubins_traffic.problem.kinds import FREE, REMOTE, parameters_of
from dubins_traffic.rules.parameters import RuleParameters
from dubins_traffic.rules.propositions import FLAG
from dubins_traffic.rules.referee import Referee
from dubins_traffic.shield.car_shields import CarShields

if TYPE_CHECKING:
    from dubins_traffic.problem.instance import Instance

STREAM: Final = 0xF4EE
"""Apart from all other streams of random numbers that follow from the seed."""
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
"""A free car does not move toward a body that is nearer than this, metres, of its own accord: the law would then wait
for that one to go."""
SHORT, LONG = 0.2, 5.0
"""Seconds for which a whim lasts."""
FIRST: Final = FLAG.STOPPED | FLAG.FIRST | FLAG.CLEAR


@dataclass(slots=True)
class _Whims:
    """What one free car likes to do: its parameters, its random numbers, and the present whim."""

    given: Mapping[str, Any]
    dice: np.random.Generator
    speed: float
    yaw_rate: float
    turns: bool
    """Whether it turns of its own accord: a body that is no disc would stand in the way of others, tilted."""
    until: float = -1.0
    """When the present whim ends, seconds."""
    slows: float = 1.0
    """Share of the law's speed, where it does as the law says."""
    likes: tuple[float, float] | None = None
    """Speed and yaw rate of the present whim, m/s and rad/s; None: as the law says."""
    hold: float = -1.0
    """Seconds of its own turn for which it holds at the line where it has stopped; -1 elsewhere."""

    def ask(self, time: float, law: tuple[float, float]) -> tuple[float, float]:
        """Return what it likes to do at a time, s, if the law says `law`."""
        commands: Sequence[Sequence[float]] = self.given["commands"]
        if commands:
            return self._played(time, commands, law)
        if time >= self.until:
            self._think(time)
        return (law[0] * self.slows, law[1] * self.slows) if self.likes is None else self.likes

    def _played(
        self, time: float, commands: Sequence[Sequence[float]], law: tuple[float, float]
    ) -> tuple[float, float]:
        whole = math.fsum(row[0] for row in commands)
        left = time % whole if self.given["repeat"] and whole > 0.0 else time
        for seconds, speed, yaw_rate in commands:
            if left < seconds:
                return speed, yaw_rate
            left -= seconds
        return law

    def _think(self, time: float) -> None:
        """Draw the next whim."""
        dice = self.dice
        self.until = time + float(dice.uniform(SHORT, LONG))
        self.slows = 1.0
        if dice.random() >= self.given["boldness"]:
            self.likes = None
            return
        kind, share = int(dice.integers(6 if self.turns else 4)), float(dice.random())
        turn = float(dice.uniform(-1.0, 1.0)) * self.yaw_rate
        if kind == 0:
            self.likes = 0.0, 0.0
        elif kind == 1:
            self.likes = -share * self.speed, 0.0
        elif kind == 2:
            self.likes = share * self.speed, 0.0
        elif kind == 3:
            self.likes, self.slows = None, share
        elif kind == 4:
            self.likes = float(dice.uniform(-1.0, 1.0)) * self.speed, turn * share
        else:
            self.likes = 0.0, turn

    def wait(self, longest: float) -> None:
        """Draw for how long it holds at the next line, at most `longest` seconds."""
        self.hold = (
            float(self.dice.uniform(0.0, longest)) if self.dice.random() < self.given["boldness"] else 0.0
        )


class FreeCars:
    """Drives the e-agents of kind `free` of one trial (a `protocols.Driver`); all others are left alone."""

    def reset(self, instances: Sequence[Instance], state: State) -> None:
        """Begin a trial whose first frame is `state`.

        Raises
        ------
        InputError
            If there are several trials, or the cars can't keep the law.
        """
        if len(instances) != 1:
            raise InputError(
                "such e-agents are not batched", field="type", value=FREE, expected="one trial at a time"
            )
        (instance,) = instances
        problem = instance.problem
        self._instance = instance
        rules = RuleParameters.from_mapping(problem.rules)
        self._rate = problem.rate
        self._cars = [n for n, agent in enumerate(instance.e_agents, start=1) if agent.kind == FREE]
        self._whims = [self._begun(n, instance.seed) for n in self._cars]
        self._state, self._labels = State.zeros(*state.x.shape), Labels.zeros(*state.x.shape)
        _copy(state, self._state)
        law = _as_lawful(instance)
        self._law = Lawful()
        self._law.reset([law], self._state)
        judged = replace(problem, rules=rules.to_mapping())
        self._referee = Referee([replace(instance, problem=judged)])
        self._views = Viewpoints(self._state, self._labels)
        which = np.zeros(state.x.shape, dtype=np.bool_)
        which[0, self._cars] = True
        self._shields = CarShields([judged], self._views, which)
        longest = float(problem.network.lengths.max()) / problem.car.bounds.speed
        journey = rules.rest_time + rules.journey_lengths * longest - DRIVE * longest - RESERVE
        self._journey = math.floor(max(journey, 0.0) * self._rate)
        self._start = math.ceil(rules.journey_start_time * self._rate)
        self._stay = math.floor(LINGER * rules.exit_time * self._rate)
        self._crowded = math.floor(CROWD * rules.goal_time * self._rate)
        self._wait = WAIT * (
            rules.enter_time if rules.tickets > 0 else min(rules.enter_time, rules.forfeit_time)
        )
        self._points: Floats = np.asarray(problem.network.points)
        self._near = problem.intersection_radius + NEAR
        self._bent = np.asarray(problem.network.bent, dtype=bool)
        self._apart = 2.0 * problem.car.body.reach + APART
        self._waited: Ints = np.full(state.x.shape[1], -1)
        self._asked = np.zeros((*state.x.shape, 2))

    def _begun(self, car: int, seed: int) -> _Whims:
        agent = self._instance.e_agents[car - 1]
        bounds = self._instance.problem.car.bounds
        words = [STREAM, seed & 0xFFFFFFFF, seed >> 32, self._instance.trial, car]
        dice = np.random.Generator(np.random.PCG64(np.random.SeedSequence(words)))
        given = {**parameters_of(FREE, {}), **agent.parameters}
        round_body = isinstance(self._instance.problem.car.body, Disc)
        return _Whims(given, dice, bounds.speed, bounds.yaw_rate, round_body)

    def reseed(self, seed: int) -> None:
        """Let what is drawn from now on follow from another seed."""
        self._law.reseed(seed)
        for car, own in zip(self._cars, self._whims, strict=True):
            own.dice = self._begun(car, seed).dice

    def decide(self, tick: int, state: State, labels: Labels, commands: Floats) -> None:
        """Write the commands of these cars for [t_k, t_k+1) into `commands` (1, N, 2)."""
        _copy(state, self._state)
        _copy(labels, self._labels)
        if tick == 0:
            self._referee.reset(self._state)
        else:
            self._referee.update(tick, self._state, [()])
        asked = self._asked
        asked[:] = 0.0
        self._law.decide(tick, self._state, self._labels, asked)
        owes = self._owes(tick)
        time = tick / self._rate
        for car, own in zip(self._cars, self._whims, strict=True):
            law = float(asked[0, car, 0]), float(asked[0, car, 1])
            likes = own.ask(time, law)
            if self._holds(tick, car, own):
                asked[0, car] = 0.0
            elif not owes[car] and (own.likes is None or self._may(car, likes, own)):
                asked[0, car] = likes
        self._views.look(np.zeros(1, dtype=np.int64))
        self._shields.filter(np.array([tick]), asked)
        commands[0, self._cars] = asked[0, self._cars]

    def _may(self, car: int, likes: tuple[float, float], own: _Whims) -> bool:
        """Tell whether a car may do what it likes: it stays apart from others, and straight unless it turns."""
        state, speed = self._state, likes[0]
        if not own.turns and (self._labels.at[0, car] >= 0 or self._bent[self._labels.segment[0, car]]):
            return speed == 0.0
        x, y = state.x[0] - state.x[0, car], state.y[0] - state.y[0, car]
        toward = (x * state.c[0, car] + y * state.s[0, car]) * speed > 0.0
        return not bool((toward & (np.hypot(x, y) < self._apart)).any())

    def _owes(self, tick: int) -> np.ndarray[Any, np.dtype[np.bool_]]:
        """Tell which cars the law has to take over, (N,)."""
        clocks, labels = self._referee.clocks, self._labels
        lane, bits = labels.lane[0], labels.bits[0].astype(np.int64)
        stays = labels.crosses[0] >= 0
        since = clocks["exit_since"][0]
        run = np.where(since >= 0, tick - since - clocks["exit_paused"][0], 0)
        found = stays & (clocks["exit_spent"][0] + run >= self._stay)
        long = np.minimum(tick - clocks["journey_since"][0], self._start) + clocks["journey_spent"][0]
        found |= long >= self._journey
        stopped = bits & FLAG.STOPPED != 0
        self._waited = np.where(stopped, lane, np.where(self._waited == lane, self._waited, -1))
        found |= stopped | ((self._waited >= 0) & (self._waited == lane))
        found |= bits & FLAG.LEFT != 0
        goals = self._referee.goals
        for v, taken in zip(goals["vertex"].tolist(), goals["since"].tolist(), strict=True):
            found |= labels.at[0] == v
            if 0 <= taken <= tick - self._crowded:
                x, y = self._points[v]
                found |= np.hypot(self._state.x[0] - x, self._state.y[0] - y) < self._near
        return found

    def _holds(self, tick: int, car: int, own: _Whims) -> bool:
        """Tell whether a car holds at its line, where it is its turn."""
        bits = int(self._labels.bits[0, car])
        if bits & FLAG.STOPPED == 0:
            own.hold = -1.0
            return False
        if own.hold < 0.0:
            own.wait(self._wait)
        since = int(self._referee.clocks["first_since"][0, car])
        if bits & FIRST != FIRST or bits & FLAG.FORFEITED != 0 or since < 0:
            return False
        return (tick - since) / self._rate < own.hold


def _copy(source: State | Labels, to: State | Labels) -> None:
    """Copy all arrays of a frame."""
    for old, new in zip(source, to, strict=True):
        new[...] = old


def _as_lawful(instance: Instance) -> Instance:
    """Return an instance in which the law drives the free cars, at top speed, and nobody else."""
    speed = instance.problem.car.bounds.speed
    own = parameters_of("lawful", {"speed": speed})
    agents = [
        EAgent("lawful", agent.name, "lawful", own)
        if agent.kind == FREE
        else EAgent(REMOTE, agent.name, agent.type)
        for agent in instance.e_agents
    ]
    return replace(instance, e_agents=tuple(agents))
