"""Crews: trials in which learners drive some or all cars, on the seats of a fleet; each car has its own results."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Any, Final, get_args

import numpy as np
import numpy.typing as npt
from gymnasium import spaces

from dubins_traffic.cars.state import EGO
from dubins_traffic.cars.tables import pack_cars, pack_obstacles
from dubins_traffic.engine.batch_kernel import STATUS
from dubins_traffic.engine.egos import Egos, Way
from dubins_traffic.engine.group import Group
from dubins_traffic.envs.about_ego import NAMES
from dubins_traffic.envs.blame import blame_tables, charge_first
from dubins_traffic.envs.crew_kernel import Before, CrewTables, observe_crews, step_crews
from dubins_traffic.envs.fleet import Bank, Board, Fleet
from dubins_traffic.envs.terms import PAID, Pay
from dubins_traffic.errors import InputError
from dubins_traffic.kernels.arrays import Floats, Ints
from dubins_traffic.kernels.calls import bound
from dubins_traffic.kernels.records import table
from dubins_traffic.learning.outlook import SIZE, new_outlook
from dubins_traffic.observations.viewpoints import Viewpoints, ViewTables
from dubins_traffic.problem.instance import EAgent, Instance
from dubins_traffic.problem.kinds import KEEP_RULES, REMOTE
from dubins_traffic.protocols import End
from dubins_traffic.rules.breach_log import RULES
from dubins_traffic.rules.referee import order
from dubins_traffic.shield.car_shields import CarShields
from dubins_traffic.shield.tables import Overtakes, check_overtakes

if TYPE_CHECKING:
    from dubins_traffic.envs.settings import Settings
    from dubins_traffic.problem.instance import Problem

Bools = npt.NDArray[np.bool_]
LEARNER: Final = "learner/policy"
"""The type of an e-agent that a learner drives."""
OF_A_CAR: Final = 6 + SIZE.FLAGS
"""Numbers of a car in the state of all cars."""


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
    """Whether what one side breaks after the other costs nothing, or for how many seconds (`envs.blame`)."""
    keeps_commands: bool = False
    """Whether the commands of all cars in each tick are kept."""

    @staticmethod
    def of(settings: Settings, learned: Sequence[str] | None, ego: str | None, excuses: bool | str | float) -> Roles:
        """Return the roles in which learners drive the e-agents called `learned`, or all, and the ego if `ego` is None.

        Raises
        ------
        InputError
            If there is no such e-agent, nobody learns, or somebody can't drive beside learners.
        """
        sample = settings.sample
        if settings.disturbed and ego is None:
            value = sample.disturbances
            raise InputError("no agent", field="disturbances", value=value, expected="none, or an ego's controller")
        names = sample.names
        for name in learned or ():
            if name not in names[1:]:
                raise no_agent("learned", name, names[1:])
        cars = [EGO] if ego is None else []
        for car, agent in enumerate(sample.e_agents, start=1):
            if learned is None or agent.name in learned:
                cars.append(car)
            elif agent.kind not in KEEP_RULES:
                known = ", ".join(sorted(KEEP_RULES))
                raise InputError("an e-agent beside learners", field="e-agents", value=agent.kind, expected=known)
        if not cars:
            raise InputError("nobody learns", field="learned", value=learned, expected="at least one car")
        return Roles(cars, ego, excuses=excuses)


def agent_name(car: int) -> str:
    """Return the name of the agent that drives a car, by the car's number."""
    return f"car_{car}" if car > EGO else f"ego_{EGO}"


def no_agent(field: str, name: str, known: Sequence[str]) -> InputError:
    """Return the error of a name that is not among the `known`."""
    return InputError("no such agent", field=field, value=name, expected=", ".join(known) or "none")


class CrewBank(Bank):
    """A group of trials, of which learners drive several cars, each of which waits until an environment steps it.

    Parameters
    ----------
    instances : sequence of Instance
        One a trial, of one configuration and with as many cars.
    fleet : CrewFleet
        Whose trials they are: on its board their steps are written, with a row for each car of each environment.
    """

    def __init__(self, instances: Sequence[Instance], fleet: CrewFleet) -> None:
        roles, settings = fleet.roles, fleet.settings
        with_roles = [with_learners(instance, roles.learned) for instance in instances]
        if roles.ego is None:
            group, self._asks = Group(with_roles, keeps_rules=False), False
        else:
            egos = Egos(roles.ego, apart=True)
            self._asks = settings.disturbed or not egos.is_compiled
            group = egos.group(with_roles, Way.ASKED if self._asks else Way.COMPILED)
        trials, places = group.state.x.shape
        problems = [instance.problem for instance in instances]
        views, world = Viewpoints(group.state, group.labels), group.world
        each = [problem for problem in problems for _ in range(places)]
        nets: Ints = np.repeat(np.ascontiguousarray(world.rules["net"]), places)
        bodies = pack_cars([problem.car for problem in each]), pack_obstacles([one.obstacles for one in each])
        around = views.state, views.labels, *bodies
        shown = settings.layout.cars
        super().__init__(group, new_outlook(each, nets, world.roads, around, shown), fleet.board, each, shown)
        longest = max(instance.ticks for instance in instances) if roles.keeps_commands else 0
        self.tables = CrewTables(
            views=ViewTables(group.state, group.labels, views.state, views.labels),
            blame=blame_tables(problems, places, roles.excuses), lasting=np.zeros((places, 3)),
            played=np.zeros((trials, longest, places, 2)), outlook=self.outlook, commands=group.commands,
            before=table(Before, 1), **fleet.given,
        )  # fmt: skip
        first = [
            (b, breach.car, RULES.index(breach.rule))
            for b, breaches in enumerate(group.breaches)
            for breach in sorted(breaches, key=lambda own: (own.car == EGO, *order(own)))
        ]
        whose, cars, rules = np.array(first, dtype=np.int64).reshape(-1, 3).T.copy()
        charge_first(whose, cars, rules, self.tables.blame)
        self._learned, self._cars = list(roles.learned), len(instances[0].starts)
        self._ticks: Ints = np.full(trials, -1)
        self._shields = self._shielded(problems, views, roles) if roles.shields else None
        self._commands, self._stepped_in = fleet.commands, fleet.stepped_in
        self._crews, self._look_at = bound(step_crews), bound(observe_crews)

    @staticmethod
    def _shielded(problems: Sequence[Problem], views: Viewpoints, roles: Roles) -> CarShields:
        places = views.state.x.shape[1]
        cars: Bools = np.zeros((len(problems), places), dtype=np.bool_)
        cars[:, list(roles.shields)] = True
        return CrewShields(problems, views, cars, roles.shields)

    def observe(self, rows: Ints, envs: Ints) -> None:
        """Write the observations of the cars of some trials as those of the environments `envs`."""
        self._look_at(rows, envs, self.group.state.x.shape[1], self.tables, self.steps)

    def step(self, rows: Ints, envs: Ints, ticks: int) -> bool:
        """Step some trials by up to `ticks` ticks, with the commands on the board; tell whether some have ended.

        All ticks are one call, unless somebody in Python drives the egos, or there are shields.
        """
        group = self.group
        self._stepped_in[envs] = 0
        if not self._asks and self._shields is None:
            group.commands[rows[:, None], self._learned] = self._commands[envs]
            self._go(rows, envs, ticks, begins=True)
            return bool((self.steps.status[envs] != STATUS.RUNNING).any())
        self._go(rows, envs, 0, begins=True)
        for _ in range(ticks):
            going = self._going(rows)
            self._tick(rows[going], envs[going])
        ended = ~self._going(rows)
        self.steps.status[envs[ended]] = STATUS.ENDED
        return bool(ended.any())

    def _going(self, rows: Ints) -> Bools:
        """Return which of some trials have not ended."""
        return np.array([self.group.endings[row] is None for row in rows.tolist()], dtype=np.bool_)

    def _tick(self, rows: Ints, envs: Ints) -> None:
        """Step some trials by a tick, with what the egos' controllers say, as the shields let it through."""
        group = self.group
        group.commands[rows[:, None], self._learned] = self._commands[envs]
        if self._asks:
            group.decide()
            going = self._going(rows)
            rows, envs = rows[going], envs[going]
        if self._shields is not None:
            self._ticks[:] = -1
            self._ticks[rows] = group.ticks[rows]
            changed: Any = self._shields.filter(self._ticks, group.commands) != 0
            self._stepped_in[envs] += changed[rows, : self._cars]
        self._go(rows, envs, 1, begins=False)
        if self._asks:
            group.advance(0)  # by no tick: it closes the controllers of trials that have ended

    def _go(self, rows: Ints, envs: Ints, ticks: int, *, begins: bool) -> None:
        group = self.group
        while self._crews(rows, envs, ticks, begins, group.world, self.tables, self.steps):
            group.settle(rows)
            ticks, begins = 0, False
        if self._asks or self._shields is not None:
            group.settle(rows)

    def played(self, row: int) -> Floats:
        """Return the commands of all cars of a trial in each tick so far, (K, N, 2), m/s and rad/s."""
        return self.tables.played[row, : int(self.group.ticks[row]), : self._cars].copy()


class CrewShields(CarShields):
    """The shields of some cars, each of which may cross the centre line when its own says."""

    def __init__(
        self, problems: Sequence[Problem], views: Viewpoints, cars: Bools, overtakes: dict[int, Overtakes]
    ) -> None:
        super().__init__(problems, views, cars)
        modes = self._shields.ego["mode"].reshape(cars.shape)
        for car, overtake in overtakes.items():
            modes[:, car] = get_args(Overtakes).index(overtake)


class CrewFleet(Fleet):
    """Environments that are stepped together, in each of which learners drive several cars.

    Parameters
    ----------
    settings : Settings
        What they have in common.
    envs : int
        How many there are, E.
    roles : Roles
        Who drives the cars.
    pay : Pay
        What they are paid for.

    Attributes
    ----------
    learned : list of int
        The cars that learners drive, A of N.
    agents : list of str
        The names of their drivers, A.
    observation_space : gymnasium.spaces.Box
        What one of them observes: `learning.flat`, then `envs.about_ego.NAMES`.
    commands : (E, A, 2)
        What they are to do, speed in m/s and yaw rate in rad/s.
    given : dict
        What `envs.crew_kernel.CrewTables` of all banks have in common.
    first : (E,) int64
        The car whose breach was the first that counted, -1 so far.
    stepped_in : (E, N) int64
        In how many ticks of the last step a shield has changed each car's command.
    """

    def __init__(self, settings: Settings, envs: int, roles: Roles, pay: Pay) -> None:
        super().__init__(settings, envs)
        self.roles, self._names = roles, settings.sample.names
        self._cars = len(self._names)
        self.learned = list(roles.learned)
        self.agents = [agent_name(car) for car in self.learned]
        self.observation_space = spaces.Box(-1.0, 1.0, (settings.layout.size + len(NAMES),), np.float32)
        self.board = Board(envs, settings, self._cars, len(PAID))
        self.told = np.zeros((envs * self._cars, len(NAMES)), dtype=np.float32)
        self.first: Ints = np.full(envs, -1, dtype=np.int64)
        self.stepped_in: Ints = np.zeros((envs, self._cars), dtype=np.int64)
        self.commands = np.zeros((envs, len(self.learned), 2))
        self.given: dict[str, Any] = {
            "who": np.array(list(dict.fromkeys((EGO, *self.learned))), dtype=np.int64),
            "weights": pay.weights, "debts": pay.debts, "told": self.told, "first": self.first,
        }  # fmt: skip
        if roles.ego is not None and (settings.disturbed or not Egos(roles.ego).is_compiled):
            self.draws_ahead = False  # whoever asks egos in a bank asks those of all its trials

    def shield(self, agent: str, overtakes: str, field: str) -> None:
        """Keep an agent within the rules from the next trials on; it may cross the centre line when `overtakes` says.

        Raises
        ------
        InputError
            If there is no such agent, which stands in `field`, or no such way to overtake.
        """
        if agent not in self.agents:
            raise no_agent(field, agent, self.agents)
        self.roles.shields[self.learned[self.agents.index(agent)]] = check_overtakes(overtakes)
        self.draw_anew()

    def is_terminal(self, env: int) -> bool:
        """Tell whether an environment's trial has ended before its time, whatever the reason."""
        ending = self.ending(env)
        return ending is not None and ending.end is not End.DURATION

    def _put(self, actions: Any) -> None:
        """Write the commands of the actions of all learners, (E, A, ...), onto the board."""
        flat: Any = np.asarray(actions)
        if flat.shape[:2] != self.commands.shape[:2]:
            envs, agents, _ = self.commands.shape
            expected = f"one for each of {agents} cars of {envs} environments"
            raise InputError("not actions", field="action", value=flat.shape, expected=expected)
        commands = self.settings.actions.commands(flat.reshape(-1, *flat.shape[2:]))
        self.commands[:] = commands.reshape(self.commands.shape)

    def command(self, commands: Any) -> None:
        """Step all environments with commands of all learners, (E, A, 2), speed in m/s and yaw rate in rad/s."""
        self.commands[:] = commands
        self.advance()

    def _seated(self, drawn: Sequence[Instance]) -> list[tuple[Bank, int]]:
        for instance in drawn:
            if instance.names != self._names:
                expected = ", ".join(self._names)
                raise InputError("trials have other cars", field="e-agents", value=instance.names, expected=expected)
        bank = CrewBank(drawn, self)
        return [(bank, row) for row in range(len(drawn))]

    def bank(self, env: int) -> CrewBank:
        """Return the bank of an environment's trial."""
        bank, _ = self.seat(env)
        assert isinstance(bank, CrewBank)
        return bank

    def of_learners(self, name: str) -> Any:
        """Return results of the cars that learners drive in the last step, (E, A, ...), by their name on the board."""
        whole: Any = self.board.arrays[name]
        return whole.reshape(len(self), self._cars, *whole.shape[1:])[:, self.learned]

    @property
    def observed(self) -> npt.NDArray[np.float32]:
        """The observation of each car that a learner drives, (E, A, F): flat, then what it is told of the ego."""
        whole = np.concatenate([self.board.arrays["flat"], self.told], axis=1)
        return whole.reshape(len(self), self._cars, -1)[:, self.learned]

    @property
    def state(self) -> npt.NDArray[np.float32]:
        """The state of all cars of each environment, (E, N `OF_A_CAR`), for critics that see more than one car does.

        Of each car: where it is, as shares of the size of the network from its middle; its heading, cosine and sine;
        speed and yaw rate, as shares of the top ones; its propositions as flags, as in a flat observation.
        """
        whole = np.zeros((len(self), self._cars, OF_A_CAR), dtype=np.float32)
        bounds, cars = self.settings.sample.problem.car.bounds, slice(0, self._cars)
        for bank, rows, envs in self._grouped(range(len(self))):
            state, labels = bank.group.state, bank.group.labels
            for row, env in zip(map(int, rows), map(int, envs), strict=True):
                low, high = _box(bank.group.instances[row].problem)
                middle, half = 0.5 * (low + high), 0.5 * float((high - low).max())
                whole[env, :, 0] = (state.x[row, cars] - middle[0]) / half
                whole[env, :, 1] = (state.y[row, cars] - middle[1]) / half
            whole[envs, :, 2], whole[envs, :, 3] = state.c[rows, cars], state.s[rows, cars]
            whole[envs, :, 4] = state.speed[rows, cars] / bounds.speed
            whole[envs, :, 5] = state.yaw_rate[rows, cars] / bounds.yaw_rate
            bits = labels.bits[rows, cars][..., None].astype(np.int64) >> np.arange(SIZE.FLAGS)
            whole[envs, :, 6:] = bits & 1
        return whole.reshape(len(self), -1)


def _box(problem: Problem) -> tuple[Floats, Floats]:
    """Return the lower left and upper right corner of the box of a network's intersections, and a metre about it."""
    points = problem.network.points
    return points.min(axis=0) - 1.0, points.max(axis=0) + 1.0


def with_learners(instance: Instance, learned: Sequence[int]) -> Instance:
    """Return an instance in which learners drive the e-agents of these numbers."""
    agents = tuple(
        EAgent(REMOTE, agent.name, LEARNER) if car in learned else agent
        for car, agent in enumerate(instance.e_agents, start=1)
    )
    return replace(instance, e_agents=agents)
