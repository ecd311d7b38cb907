"""A crew: trials in which learners drive some or all cars, stepped together, with observations and costs per car.

Whose breaches count follows from who broke first. The rules are an agreement: the e-agents keep E1 to E6, and the ego
then keeps rules 1 to 3 (docs/rules.md). Within a frame the e-agents move first, as in a verdict.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Any, Final

import numpy as np
import numpy.typing as npt

from dubins_traffic.cars.state import EGO
from dubins_traffic.cars.tables import pack_cars, pack_obstacles
from dubins_traffic.engine.egos import Egos, Way
from dubins_traffic.engine.group import Group
from dubins_traffic.envs.about_ego import NAMES, count_cars, tell_cars
from dubins_traffic.envs.fleet import Board
from dubins_traffic.envs.step_kernel import StepTables, begin_trials, strides
from dubins_traffic.envs.terms import AT_FAULT, PARTS, TERM
from dubins_traffic.errors import InputError
from dubins_traffic.kernels.arrays import Floats, Ints
from dubins_traffic.kernels.calls import bound
from dubins_traffic.learning.outlook import new_outlook
from dubins_traffic.observations.viewpoints import Viewpoints
from dubins_traffic.problem.instance import EAgent, Instance, Problem
from dubins_traffic.problem.kinds import REMOTE
from dubins_traffic.rules.breach_log import RULE, RULES
from dubins_traffic.rules.exceptions import Exceptions
from dubins_traffic.rules.parameters import RuleParameters
from dubins_traffic.rules.referee import Breach, accused, order
from dubins_traffic.scoring.duration import early_rounds
from dubins_traffic.scoring.verdict import assumed, assumption_of
from dubins_traffic.shield.car_shields import CarShields

if TYPE_CHECKING:
    from dubins_traffic.cars.state import Contact
    from dubins_traffic.envs.settings import Settings
    from dubins_traffic.shield.tables import Overtakes

Bools = npt.NDArray[np.bool_]
WINDOW: Final = "window"
EXCUSED_FOR: Final = 1.0
"""Seconds for which a breach excuses the other side where `WINDOW` is asked for: it may have brought about so much."""


class Blame:
    """Decides for the breaches of one trial, as they come, which count.

    - A breach by an e-agent counts if the problem assumes the part of E1 to E6 that it breaks, if it is beyond the
      exceptions that are allowed, and if no breach by the ego has counted in an earlier frame.
    - A breach by the ego counts if no breach by an e-agent has counted, up to and including its frame.

    All others are excused. With a window only what has counted in so many seconds before excuses.

    Parameters
    ----------
    excuses : bool, str or float
        Whether what has counted of one side's excuses the other for the rest of the trial; or the window, seconds;
        `WINDOW` is one of `EXCUSED_FOR`. False: each side answers for all that it breaks.

    Attributes
    ----------
    first : int or None
        The car whose breach was the first that counted; None so far.

    Raises
    ------
    InputError
        If `excuses` is none of these.
    """

    def __init__(self, problem: Problem, *, excuses: bool | str | float = True) -> None:
        self._window = _seconds_excused(excuses) * problem.rate
        rules = RuleParameters.from_mapping(problem.rules)
        self._assumed = assumed(rules)
        self._exceptions = Exceptions(rules, problem.rate)
        self._last = dict.fromkeys((True, False), -math.inf)
        self.first: int | None = None

    def of(self, breaches: Sequence[Breach]) -> list[tuple[Breach, str]]:
        """Return the breaches since the last call that count, each with the part that it breaks.

        That is ``E1`` to ``E6`` of an e-agent's, and the rule itself of the ego's.
        """
        counted: list[tuple[Breach, str]] = []
        for breach in sorted(breaches, key=lambda one: (one.tick, one.car == EGO, *order(one))):
            part = breach.rule if breach.car == EGO else assumption_of(breach.rule)
            if self._counts(breach, part):
                counted.append((breach, part))
                self._last[breach.car == EGO] = breach.tick
                self.first = breach.car if self.first is None else self.first
        return counted

    def excused(self, cars: int, tick: int) -> Bools:
        """Return which of so many cars break nothing that counts in the frame `tick`, (N,)."""
        return np.array([self._is_excused(tick, ego=car == EGO) for car in range(cars)])

    def _is_excused(self, tick: int, *, ego: bool) -> bool:
        since = tick - self._last[not ego]
        soon = self._window > 0.0 and since <= self._window and since < math.inf
        return soon and since >= (0 if ego else 1)

    def _counts(self, breach: Breach, part: str) -> bool:
        if breach.car == EGO:
            return not self._is_excused(breach.tick, ego=True)
        allowed = part == "E1" and not self._exceptions.exceeded(breach)
        return part in self._assumed and not allowed and not self._is_excused(breach.tick, ego=False)


def _seconds_excused(excuses: bool | str | float) -> float:
    """Return for how many seconds what one side breaks excuses the other."""
    if excuses == WINDOW:
        return EXCUSED_FOR
    if isinstance(excuses, bool):
        return math.inf if excuses else 0.0
    if isinstance(excuses, str) or not excuses >= 0.0:
        raise InputError(
            "no excuses", field="excuses", value=excuses, expected=f"True, False, {WINDOW} or seconds"
        )
    return excuses


LEARNER: Final = "learner/policy"
"""The type of an e-agent that a learner drives."""


@dataclass
class Roles:
    """Which cars learners drive in the trials of a crew."""

    learned: Sequence[int]
    """Numbers of the cars that learners drive."""
    ego: str | None = None
    """The controller that drives the ego, by its name; None if a learner does."""
    shields: dict[int, Overtakes] = field(default_factory=dict[int, "Overtakes"])
    """Of cars under a shield, by number, when they may cross the centre line."""
    excuses: bool | str | float = True
    """Whether what one side breaks after the other costs nothing, or for how many seconds (`Blame`)."""


class MultiAgentTrials:
    """Some trials of one configuration, from their first frames on.

    Parameters
    ----------
    instances : sequence of Instance
        One a trial; all have as many cars.

    Attributes
    ----------
    broken : (B, N, P)
        How often each car has broken each of `PARTS` in the last step, where that counts (`Blame`).
    stepped_in : (B, N)
        In how many ticks of the last step a shield has changed each car's command.
    given : list of (B, N, 2)
        The commands of all cars in each tick so far.
    blame : list of Blame
        Of each trial, whose breaches count.
    """

    def __init__(self, instances: Sequence[Instance], roles: Roles, settings: Settings) -> None:
        with_roles = [with_learners(instance, roles.learned) for instance in instances]
        if roles.ego is None:
            self.group = Group(with_roles, keeps_rules=False)
        else:
            egos = Egos(roles.ego, apart=True)
            is_kernel = egos.is_compiled and not settings.disturbed
            self.group = egos.group(with_roles, Way.COMPILED if is_kernel else Way.ASKED)
        self._cars = len(instances[0].starts)
        trials, places = self.group.state.x.shape
        problems = [instance.problem for instance in instances]
        self._views = Viewpoints(self.group.state, self.group.labels)
        each = [problem for problem in problems for _ in range(places)]
        nets: Ints = np.repeat(np.ascontiguousarray(self.group.world.rules["net"]), places)
        bodies = pack_cars([problem.car for problem in each]), pack_obstacles([one.obstacles for one in each])
        around = self._views.state, self._views.labels, *bodies
        self.outlook = new_outlook(each, nets, self.group.world.roads, around, settings.layout.cars)
        board: dict[str, Any] = Board(len(each), settings).arrays
        self._steps = StepTables(stride=strides(each), **board)
        self._flat, self._told = board["flat"], np.zeros((len(each), len(NAMES)), dtype=np.float32)
        self.broken: Ints = np.zeros((trials, places, len(PARTS)), dtype=np.int64)
        self.stepped_in: Ints = np.zeros((trials, places), dtype=np.int64)
        self.given: list[Floats] = []
        self.blame = [Blame(problem, excuses=roles.excuses) for problem in problems]
        self._known = [(0, 0)] * trials
        self._learned = list(roles.learned)
        self._shields = self._shielded(problems, roles)
        self._count, self._tell = bound(count_cars), bound(tell_cars)
        begin_trials(self.outlook, self._steps)
        self._charge(np.arange(trials, dtype=np.int64))
        self.broken[:] = 0
        self._observe(np.arange(trials, dtype=np.int64))

    def _shielded(self, problems: Any, roles: Roles) -> list[CarShields]:
        shields_of_cars: list[CarShields] = []
        for overtakes in dict.fromkeys(roles.shields.values()):
            cars: Bools = np.zeros(self.group.state.x.shape, dtype=np.bool_)
            cars[:, [car for car, shield in roles.shields.items() if shield == overtakes]] = True
            shields_of_cars.append(CarShields(problems, self._views, cars, overtakes=overtakes))
        return shields_of_cars

    def step(self, asked: Floats, ticks: int) -> None:
        """Step all trials that have not ended by up to `ticks` ticks.

        Parameters
        ----------
        asked : (B, N, 2)
            What the cars that learners drive are to do, speed, m/s, and yaw rate, rad/s.
        """
        self.terms[:] = 0.0
        self.broken[:] = 0
        self.stepped_in[:] = 0
        begun, early = self.group.active, self._early()
        for _ in range(ticks):
            if not len(self.group.active):
                break
            self._tick(asked)
        self.terms[:, EGO, TERM.EARLY] = self._early() - early
        self._observe(begun)

    def _tick(self, asked: Floats) -> None:
        group, commands = self.group, self.group.commands
        commands[:, self._learned] = asked[:, self._learned]
        group.decide()
        running = group.active
        for shields in self._shields:
            ticks: Ints = np.full(len(group.instances), -1)
            ticks[running] = group.ticks[running]
            self.stepped_in += shields.filter(ticks, commands) != 0
        before = group.ticks.copy()
        group.advance()
        self.given.append(commands.copy())
        moved: Ints = np.flatnonzero(group.ticks > before)
        if not len(moved):
            return
        self._views.look(moved)
        lasting: Floats = self.terms[..., TERM.OFF_ROAD : TERM.BREACHES].copy()
        self._count(self._rows(moved), int(group.ticks[moved[0]]), self.outlook, self._steps)
        self._charge(moved)
        for b in map(int, moved):
            excused = self.blame[b].excused(self.terms.shape[1], int(group.ticks[b]))
            self.terms[b, excused, TERM.OFF_ROAD : TERM.BREACHES] = lasting[b, excused]

    def _early(self) -> Floats:
        """Return the rounds of each trial before the ego's first breach so far, (B,)."""
        tally = self.group.world.tally
        goals: Ints = tally.trial["last_goal"] - tally.trial["first_goal"]
        return np.array([early_rounds(tally.early[b], each, None) for b, each in enumerate(goals.tolist())])

    def _rows(self, trials: Ints) -> Ints:
        places = self.group.state.x.shape[1]
        return (trials[:, None] * places + np.arange(self._cars)).reshape(-1)

    def _charge(self, trials: Ints) -> None:
        """Count the breaches since the last call that count."""
        for b in map(int, trials):
            breaches, contacts = self.group.breaches[b], self.group.contacts[b]
            seen, met = self._known[b]
            if len(breaches) == seen and len(contacts) == met:
                continue
            self._known[b] = len(breaches), len(contacts)
            fresh = contacts[met:]
            for breach, part in self.blame[b].of([*breaches[seen:], *accused(fresh)]):
                self.broken[b, breach.car, PARTS.index(part)] += 1
                if breach.car == EGO and breach.rule == RULES[RULE.COLLISION]:
                    self.broken[b, EGO, AT_FAULT] += _guilty(breach, fresh)

    def _observe(self, trials: Ints) -> None:
        self._tell(self._rows(trials), self.group.state.x.shape[1], self._told, self.outlook, self._steps)

    @property
    def terms(self) -> Floats:
        """Terms of `envs.terms` of each car in the last step, but for breaches, (B, N, T)."""
        return self._steps.terms.reshape(*self.group.state.x.shape, -1)

    @property
    def observed(self) -> npt.NDArray[np.float32]:
        """The observation of each car, (B, N, F)."""
        whole = np.concatenate([self._flat, self._told], axis=1)
        return whole.reshape(*self.group.state.x.shape, -1)


def with_learners(instance: Instance, learned: Sequence[int]) -> Instance:
    """Return an instance in which learners drive the e-agents of these numbers."""
    agents = tuple(
        EAgent(REMOTE, agent.name, LEARNER) if car in learned else agent
        for car, agent in enumerate(instance.e_agents, start=1)
    )
    return replace(instance, e_agents=agents)


def _guilty(breach: Breach, contacts: Sequence[Contact]) -> int:
    """Return the number of contacts in the tick of a collision in which the ego is at fault."""
    at_tick = [one for one in contacts if one.tick == breach.tick]
    return sum(
        guilty and car == EGO
        for one in at_tick
        for car, guilty in zip((one.car, one.other), one.at_fault, strict=True)
    )
