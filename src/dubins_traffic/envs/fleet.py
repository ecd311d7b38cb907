"""Environments that are stepped together, independent of Gymnasium's interface; each runs one trial after another.

Their trials wait in banks, groups of trials of the engine with observations and rewards.
"""

from __future__ import annotations

from collections import deque
from dataclasses import replace
from typing import TYPE_CHECKING, Any, Final, cast

import numpy as np

from dubins_traffic.cars.state import EGO
from dubins_traffic.engine.batch_kernel import STATUS
from dubins_traffic.engine.group import Group
from dubins_traffic.envs.channel import EgoChannel, FormulaWatch, TrialView
from dubins_traffic.envs.step_kernel import (
    Scale,
    StepTables,
    Stride,
    begin_trials,
    observe_trials,
    step_trials,
    strides,
)
from dubins_traffic.envs.terms import costs_of_rules
from dubins_traffic.errors import DubinsTrafficError, InputError
from dubins_traffic.kernels.arrays import Ints
from dubins_traffic.kernels.calls import bound
from dubins_traffic.kernels.records import table
from dubins_traffic.learning.outlook import new_outlook
from dubins_traffic.problem.draw import check_numbers
from dubins_traffic.protocols import End, Ending

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping, Sequence

    from dubins_traffic.engine.group import Outcome
    from dubins_traffic.envs.settings import Settings
    from dubins_traffic.learning.outlook import OutlookTables
    from dubins_traffic.problem.instance import Instance, Problem
    from dubins_traffic.scoring.formulas import Status
    from dubins_traffic.shield.tables import Overtakes


class Board:
    """The results of a step of all environments, arrays with a row per environment (`envs.step_kernel.StepTables`).

    Parameters
    ----------
    envs : int
        How many there are.
    settings : Settings
        What they have in common.
    cars, terms : int
        Rows of an environment, and terms of the reward, where several cars of each are looked at.
    """

    def __init__(self, envs: int, settings: Settings, cars: int = 1, terms: int | None = None) -> None:
        weights, actions, rows = settings.weights, settings.actions, envs * cars
        terms = len(weights) if terms is None else terms
        scale = table(Scale, 1)
        scale[0].period = 1.0 / settings.sample.problem.rate
        scale[0].pause = 1 if settings.formulas or settings.disturbed else 0
        scale[0].waits = 1 if settings.disturbed else 0
        scale[0].middle = float(actions.middle[0])
        scale[0].speed, scale[0].yaw_rate = actions.half.tolist()
        self.arrays: dict[str, Any] = {
            "scale": scale,
            "asked": np.zeros((rows, 2)),
            "terms": np.zeros((rows, terms)),
            "weighted": np.zeros((rows, terms)),
            "weights": weights,
            "debts": settings.debts,
            "cost_of": costs_of_rules(),
            "reward": np.zeros(rows),
            "status": np.zeros(envs, dtype=np.int64),
            "flat": np.zeros((rows, settings.layout.size), dtype=np.float32),
            "one": np.zeros(1, dtype=np.int64),
        }


class Bank:
    """A group of trials, each of which waits in its first frame until an environment steps it.

    Parameters
    ----------
    group : Group
        The trials, of one configuration.
    outlook : OutlookTables
        From what they are observed.
    board : Board
        What their steps are written to.
    each : sequence of Problem
        That of each row of `outlook`.
    shown : int
        Other cars that a flat observation shows, at most.

    Attributes
    ----------
    watches : dict
        Who judges formulas on the trials that are watched, by their rows.
    between : dict
        What stands between environments and their egos, of trials that are disturbed or under a shield, by their rows.
    """

    def __init__(self, group: Group, outlook: OutlookTables, board: Board, each: Sequence[Problem], shown: int) -> None:
        self._shown = shown
        self.group, self.outlook = group, outlook
        self.steps = StepTables(stride=strides(each), **board.arrays)
        self._step, self._observe = bound(step_trials), bound(observe_trials)
        self.watches: dict[int, FormulaWatch] = {}
        self.between: dict[int, EgoChannel] = {}
        begin_trials(outlook, self.steps)

    @staticmethod
    def of(instances: Sequence[Instance], board: Board, shown: int) -> Bank:
        """Return the bank of trials of egos, one an instance."""
        group = Group(instances, keeps_rules=False)
        world, problems = group.world, [instance.problem for instance in instances]
        nets: Ints = np.ascontiguousarray(world.rules["net"])
        around = world.state, world.labels, world.cars, world.obstacles
        return Bank(group, new_outlook(problems, nets, world.roads, around, shown), board, problems, shown)

    def observe(self, rows: Ints, envs: Ints) -> None:
        """Write the observations of the egos of some trials as those of the environments `envs`."""
        self._observe(rows, envs, self.outlook, self.steps)
        self._look(rows, envs)

    def step(self, rows: Ints, envs: Ints, ticks: int) -> bool:
        """Step some trials by up to `ticks` ticks, with the actions on the board.

        Returns
        -------
        bool
            Whether some have ended.
        """
        group, ended = self.group, False
        while status := self._step(rows, envs, ticks, group.commands, group.world, self.outlook, self.steps):
            if status < 0:
                raise InputError("not an action", field="action", expected="finite numbers")
            self._settle(rows)
            if self.between:
                self._pass_on(rows, envs, begins=ticks > 0)
            ended, ticks = True, 0
        if self.watches or self.between:
            self._settle(rows)
            self._look(rows, envs)
        return ended

    def stand_between(self, row: int, shield: Overtakes | None) -> None:
        """Put what disturbs a trial, and a shield, between its environment and its ego, from its first frame on."""
        self.between[row] = EgoChannel(TrialView(self.group, row), self._shown, shield)

    def watch(self, row: int, formulas: Mapping[str, str]) -> None:
        """Judge formulas on the frames of a trial, from its first one on."""
        self.watches[row] = FormulaWatch(TrialView(self.group, row), formulas)

    def _look(self, rows: Ints, envs: Ints) -> None:
        """Write the observations of the present frames as disturbances change them."""
        for row, env in zip(rows.tolist(), envs.tolist(), strict=True) if self.between else ():
            if row in self.between:
                self.between[row].look(self.steps.flat[env])

    def _pass_on(self, rows: Ints, envs: Ints, *, begins: bool) -> None:
        """Replace the egos' commands for the coming tick by what disturbances and shields make of them."""
        self._look(rows, envs)
        for row in rows.tolist():
            channel, stride = self.between.get(row), cast(Stride, self.steps.stride[row])
            if channel is not None and stride.left > 0:
                command = self.group.commands[row, EGO]
                command[:] = channel.command(command if begins else None)

    def _settle(self, rows: Ints) -> None:
        self.group.settle(rows)
        for row in rows.tolist() if self.watches else ():
            self.watches[row].look()


AHEAD: Final = 4
"""Most trials that are drawn ahead for each environment."""
TOGETHER: Final = 16
"""So many trials that are drawn ahead make a bank: more would take long at once, and fewer would make many banks."""
AT_ONCE: Final = 4
"""For so many environments are trials drawn ahead in a step."""


class Fleet:
    """Some environments.

    Parameters
    ----------
    settings : Settings
        What they have in common.
    envs : int
        How many there are.

    Attributes
    ----------
    board : Board
        What the last step has given.
    ended : (E,) bool
        Which environments are in a trial that has ended, or in none yet.
    waiting : bool
        Whether there are any such.
    draws_ahead : bool
        Whether next trials are drawn while others run; else all trials of a bank begin at once.
    is_eager : bool
        Whether trials are drawn ahead from the first ones of a seed on, not only once these have ended.
    """

    is_eager = False
    draws_ahead = True

    def __init__(self, settings: Settings, envs: int) -> None:
        self.settings = settings
        self.board = Board(envs, settings)
        self.ended = np.ones(envs, dtype=np.bool_)
        self.waiting = True
        self._who: list[tuple[int, int]] = [(0, env) for env in range(envs)]
        self._next = [0] * envs
        self._is_fresh = [True] * envs
        self._ready: list[deque[tuple[Bank, int]]] = [deque() for _ in range(envs)]
        self._lacking: deque[int] = deque()
        self._drawn: list[tuple[int, Instance]] = []
        self._seats: list[tuple[Bank, int] | None] = [None] * envs
        self._parts: list[tuple[Bank, Ints, Ints]] | None = None
        self._shield: Overtakes | None = None

    def __len__(self) -> int:
        return len(self._next)

    def seed(self, env: int, who: tuple[int, int], episode: int = 0) -> None:
        """Let the next trial of an environment be `episode` of `who`: a base seed, and a number under it."""
        check_numbers(who[0], 0)
        self._who[env], self._next[env] = who, episode
        self._is_fresh[env] = True
        self._ready[env].clear()
        self._drawn = [waiting for waiting in self._drawn if waiting[0] != env]

    def keep(self, shield: Overtakes) -> None:
        """Keep all egos under shields from their next trials on, which may cross the centre line when `shield` says."""
        self._shield = shield
        scale = self.board.arrays["scale"][0]
        scale.pause = scale.waits = 1

    def begin(self, envs: Iterable[int]) -> None:
        """Begin the next trials of environments, and observe their first frames."""
        some = list(envs)
        if any(not self._ready[env] for env in some):
            self._seat()
            self._draw([env for env in some if not self._ready[env]], 1)
            self._seat()
        for env in some:
            bank, row = self._seats[env] = self._ready[env].popleft()
            # Who has seeded environments may well run one episode of each, and seed them anew.
            if not self._ready[env] and (self.is_eager or not self._is_fresh[env]):
                self._lacking.append(env)
            self._is_fresh[env] = False
            if self.settings.formulas:
                bank.watch(row, self.settings.formulas)
            if self.settings.disturbed or self._shield is not None:
                bank.stand_between(row, self._shield)
            self.ended[env] = False
            self.board.arrays["status"][env] = STATUS.RUNNING
        self.waiting = bool(self.ended.any())
        self._parts = None
        for bank, rows, places in self._grouped(some):
            bank.observe(rows, places)

    def step(self, actions: Any) -> None:
        """Step all environments whose trials have not ended.

        Parameters
        ----------
        actions : (E, ...)
            One each, elements of the space of actions.
        """
        self._put(actions)
        self.advance()

    def advance(self) -> None:
        """Step all environments whose trials have not ended, with the actions on the board."""
        if self._parts is None:
            self._parts = self._grouped(np.flatnonzero(~self.ended).tolist())
        ended = False
        for bank, rows, places in self._parts:
            ended |= bank.step(rows, places, self.settings.frame_skip)
        if ended:
            self.ended |= self.board.arrays["status"] != STATUS.RUNNING
            self.waiting = bool(self.ended.any())
            self._parts = None
        if self._lacking and self.draws_ahead:
            self._prepare()

    def draw_anew(self) -> None:
        """Forget trials that have been drawn ahead, so that the next ones are drawn as things stand then."""
        drawn = [env for env, _ in self._drawn]
        for env, ready in enumerate(self._ready):
            self._next[env] -= len(ready) + drawn.count(env)
            ready.clear()
        self._drawn.clear()

    def expect(self, envs: Sequence[int]) -> None:
        """Draw the next trials of environments in this order, in which their episodes are going to end."""
        self._lacking = deque(envs)

    def cut(self, envs: Sequence[int]) -> None:
        """End the episodes of environments, though their trials have not ended."""
        self.ended[envs] = self.waiting = True
        self._parts = None

    def _put(self, actions: Any) -> None:
        """Write the actions of a step onto the board."""
        self.settings.actions.put(actions, self.board.arrays["asked"])

    def seat(self, env: int) -> tuple[Bank, int]:
        """Return the bank and the row in it of an environment's trial.

        Raises
        ------
        DubinsTrafficError
            If it is in none.
        """
        seat = self._seats[env]
        if seat is None:
            raise DubinsTrafficError("an environment has to be reset before it is used")
        return seat

    def instance(self, env: int) -> Instance:
        """Return the instance of an environment's trial."""
        bank, row = self.seat(env)
        return bank.group.instances[row]

    def states(self, env: int) -> dict[str, Status]:
        """Return the verdict on each formula in the present frame of an environment's trial."""
        bank, row = self.seat(env)
        return bank.watches[row].states

    def between(self, env: int) -> EgoChannel:
        """Return the disturbances and shield of an environment's ego, if there are any."""
        bank, row = self.seat(env)
        return bank.between[row]

    def ending(self, env: int) -> Ending | None:
        """Return how an environment's trial has ended, None while it runs."""
        bank, row = self.seat(env)
        return bank.group.endings[row]

    def is_terminal(self, env: int) -> bool:
        """Tell whether an environment's trial has ended before its time."""
        ending = self.ending(env)
        return ending is not None and ending.end is End.COLLISION

    def outcomes(self, envs: Sequence[int]) -> list[Outcome]:
        """Return the outcomes of the trials of environments, which have ended."""
        by_env: dict[int, Outcome] = {}
        for bank, rows, places in self._grouped(envs):
            by_env.update(zip(places.tolist(), bank.group.outcomes(rows.tolist(), "env"), strict=True))
            for row, env in zip(rows.tolist(), places.tolist(), strict=True) if bank.between else ():
                score = replace(by_env[env].score, interventions=bank.between[row].interventions)
                by_env[env] = replace(by_env[env], score=score)
        return [by_env[env] for env in envs]

    def _grouped(self, envs: Sequence[int]) -> list[tuple[Bank, Ints, Ints]]:
        """Return the banks of some environments, with the rows and environments of each."""
        by_bank: dict[int, tuple[Bank, list[int], list[int]]] = {}
        for env in envs:
            bank, row = self.seat(env)
            _, rows, places = by_bank.setdefault(id(bank), (bank, [], []))
            rows.append(row)
            places.append(env)
        return [(bank, np.array(rows), np.array(places)) for bank, rows, places in by_bank.values()]

    def _prepare(self) -> None:
        """Draw next trials of some environments that have none; put them into a bank once there are enough."""
        each = max(1, min(AHEAD, TOGETHER // len(self)))
        some = dict.fromkeys(self._lacking.popleft() for _ in range(min(AT_ONCE, len(self._lacking))))
        self._draw([env for env in some if not self._ready[env]], each)
        if len(self._drawn) >= min(TOGETHER, each * len(self)):
            self._seat()

    def _draw(self, envs: Sequence[int], each: int) -> None:
        """Draw the next trials of environments, `each` of every one."""
        wanted = [(env, self._next[env] + k) for env in envs for k in range(each)]
        for env in envs:
            self._next[env] += each
        drawn = self.settings.episodes.draw([(*self._who[env], episode) for env, episode in wanted])
        self._drawn += zip([env for env, _ in wanted], drawn, strict=True)

    def _seat(self) -> None:
        """Put all trials that have been drawn into a bank, in which they wait."""
        if self._drawn:
            seats = self._seated([instance for _, instance in self._drawn])
            for (env, _), seat in zip(self._drawn, seats, strict=True):
                self._ready[env].append(seat)
            self._drawn = []

    def _seated(self, drawn: Sequence[Instance]) -> list[tuple[Bank, int]]:
        """Return a bank, and the row in it, for each of some trials."""
        bank = Bank.of(drawn, self.board, self.settings.layout.cars)
        return [(bank, row) for row in range(len(drawn))]


def masked(envs: int, mask: Any) -> list[int]:
    """Return the environments that a mask names, (E,) bool; all without one."""
    return list(range(envs)) if mask is None else np.flatnonzero(np.asarray(mask, dtype=bool)).tolist()
