"""The controller `synthesized`: plays a winning strategy of the game of cells on the road."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Final

import numpy as np

from dubins_traffic.cars.state import EGO, Command, Observation
from dubins_traffic.controllers.rules import Rules
from dubins_traffic.controllers.shield import override_text
from dubins_traffic.kernels.arrays import Floats
from dubins_traffic.policies.rules.exits import BACK
from dubins_traffic.policies.rules.room import MARGIN
from dubins_traffic.policies.rules.tables import Drivers
from dubins_traffic.record.sink import BY_RULES, BY_STRATEGY, DECIDED, SHIELD
from dubins_traffic.routing.lane_graph import nearest_stage
from dubins_traffic.rules.parameters import RuleParameters
from dubins_traffic.shield.filter import ShieldFilter
from dubins_traffic.synthesis.foreign.adviser import MachineAdviser
from dubins_traffic.synthesis.foreign.machine import Machine
from dubins_traffic.synthesis.foreign.player import check_fit
from dubins_traffic.synthesis.foreign.read import read_machine
from dubins_traffic.synthesis.game import build
from dubins_traffic.synthesis.instance import board_of, cells_of
from dubins_traffic.synthesis.road_play import RoadPlay, Sight, Sighting
from dubins_traffic.synthesis.solver import solve
from dubins_traffic.synthesis.strategy import Advice, Adviser, Ranked, Strategy

if TYPE_CHECKING:
    from dubins_traffic.problem.instance import Problem

NO_GOAL: Final = -2
"""Stands for the vertex of the only stage in the law's tables: none, since the strategy seeks the goals."""
NO_STAGE: Final = -1
SECOND_BEST: Final = 2.5
"""Cost, metres, of an exit for each exit that the strategy prefers: the law takes it if there is no room elsewhere."""
HURRY: Final = 0.6
"""An ego that the strategy makes wait enters this long before it would lose its place in the order, seconds."""
LOOK: Final = 1.0
"""Seconds after which the play considers anew where unseen cars may be."""
STRATEGY_LEFT: Final = "strategy_left"
STRATEGY_RESUMED: Final = "strategy_resumed"
"""Kinds of events: the position has become one from which the strategy does not win, or wins again."""


@dataclass
class _Pursuit:
    """The goals that the ego seeks, and the play that says what to do.

    `ways` (M, L) are the metres from each lane to the goal of each stage, at that goal already to the next; `goals` are
    the goals of the stages, by their places in `RoadCells`, and `vertices` their intersections.
    """

    adviser: Adviser
    play: RoadPlay
    ways: Floats
    goals: list[int]
    vertices: list[int]
    stage: int = NO_STAGE
    advice: Advice | None = None
    wins: bool = True
    reports: list[tuple[str, str]] = field(default_factory=list[tuple[str, str]])


class Synthesized(Rules):
    """Chooses exits and when to wait by a winning strategy; otherwise drives as the controller `rules`.

    Parameters
    ----------
    strategy : Strategy or Machine, optional
        The strategy to play, of this package or another tool; by default the game is solved when the trial starts.
    fallback : bool
        Whether the ego goes on by the rules where a strategy of another tool begins elsewhere, or makes no move of the
        game; otherwise that is a fault which ends the trial.

    Notes
    -----
    The strategy is asked whenever the game's position has changed while the ego is in a lane. Where it says nothing,
    since the ego is behind another car, the ego goes on as `rules` does. Where the strategy does not win, for instance
    since the others have broken their assumption, the ego drives as `rules` under the shield until the strategy wins
    again. That shield overtakes as `rules` does: often a car that is parked for good has broken the assumption.
    """

    def __init__(self, strategy: Strategy | Machine | None = None, *, fallback: bool = False) -> None:
        super().__init__()
        self._strategy = strategy
        self._fallback = fallback
        self._pursuit: _Pursuit | None = None
        self._shield_filter = ShieldFilter(overtakes="law")

    def start(self, problem: Problem) -> None:
        """Solve the game if no strategy was given; InputError if it is too large, or the strategy does not fit."""
        super().start(problem)
        self._pursuit = None
        drivers = self._drivers
        if drivers is None or not problem.e_agents:
            return
        adviser = _adviser(self._strategy, problem, fallback=self._fallback)
        self._shield_filter.start(problem)
        rules = RuleParameters.from_mapping(problem.rules)
        self._period = problem.period
        self._edge = problem.intersection_radius + problem.car.body.reach + MARGIN
        self._patience = (rules.forfeit_time - HURRY) * problem.rate
        road_cells = adviser.board.road_cells
        vertices: list[int] = drivers.stage.tolist()
        self._pursuit = _Pursuit(
            adviser,
            RoadPlay(adviser.board, _sight(problem), ("ego", *problem.e_agents)),
            _ways(drivers, [road_cells.network.arms(v) for v in vertices]),
            [road_cells.goals.index(v) for v in vertices],
            vertices,
        )
        ego = drivers.car[0, EGO]
        ego.first, ego.last, ego.place = 0, 1, 0
        self._drivers = drivers.replace(stage=np.array([NO_GOAL]), distance=np.zeros((1, road_cells.network.lanes)))
        self._points: list[list[float]] = problem.network.points.tolist()

    def act(self, observation: Observation) -> Command:
        """Return the command of the law, with the exit and the waiting that the strategy chooses."""
        pursuit = self._pursuit
        if pursuit is None:
            return super().act(observation)
        self._follow(pursuit, observation)
        command = super().act(observation)
        if not pursuit.wins:
            return self._guarded(pursuit, observation, command)
        return self._waiting(pursuit, observation, command)

    @property
    def play(self) -> RoadPlay | None:
        """The play that is followed; None where there is no game, without goals or other cars."""
        return None if self._pursuit is None else self._pursuit.play

    def report(self) -> Sequence[tuple[str, str]]:
        """Return the events of the play since the last call."""
        if self._pursuit is None or not self._pursuit.reports:
            return ()
        reports, self._pursuit.reports = self._pursuit.reports, []
        return reports

    def _follow(self, pursuit: _Pursuit, seen: Observation) -> None:
        """Update the play to what is seen, and ask the strategy if the position has changed."""
        cars = [Sighting(EGO, seen.pose, seen.propositions)]
        cars += [Sighting(car.index, car.pose, car.propositions) for car in seen.others]
        changed = pursuit.play.follow(seen.tick, cars)
        if pursuit.stage == NO_STAGE:
            lane, segment = seen.propositions.lane, seen.propositions.segment
            pursuit.stage = nearest_stage(pursuit.ways, 0, len(pursuit.ways), lane, segment)
        elif seen.propositions.at == pursuit.vertices[pursuit.stage]:
            pursuit.stage = (pursuit.stage + 1) % len(pursuit.goals)
        elif not changed:
            return
        pursuit.reports += pursuit.play.noted
        pursuit.play.noted.clear()
        self._ask(pursuit, seen)

    def _ask(self, pursuit: _Pursuit, seen: Observation) -> None:
        """Ask the strategy, and set the law's costs so that it takes the exit that the strategy prefers."""
        drivers = self._drivers
        assert drivers is not None
        stages = len(pursuit.goals)
        goal, following = pursuit.goals[pursuit.stage], pursuit.goals[(pursuit.stage + 1) % stages]
        if pursuit.play.position is not None:
            self._note_wins(pursuit, pursuit.adviser.wins(pursuit.play))
        drivers.distance[0] = pursuit.ways[pursuit.stage]
        pursuit.advice = None
        if seen.propositions.crosses >= 0:
            return
        pursuit.advice = pursuit.adviser.advise(pursuit.play, goal, following)
        if isinstance(pursuit.adviser, MachineAdviser) and pursuit.play.at_lanes_end:
            pursuit.reports.append((DECIDED, BY_RULES if pursuit.advice is None else BY_STRATEGY))
        if pursuit.advice is None or not pursuit.advice.exits:
            return
        lane = seen.propositions.lane
        node = pursuit.adviser.board.road_cells.nodes[pursuit.advice.node]
        for place, out in enumerate(_liked(pursuit.advice.exits, node.exits, drivers.distance[0])):
            back = BACK if out == lane ^ 1 and len(node.exits) > 1 else 0.0
            drivers.distance[0, out] = SECOND_BEST * place - back
            if place == 0 and drivers.car[0, EGO].lane == lane:
                drivers.car[0, EGO].next_lane = out

    @staticmethod
    def _note_wins(pursuit: _Pursuit, wins: bool) -> None:
        if wins != pursuit.wins:
            pursuit.wins = wins
            pursuit.reports.append((STRATEGY_RESUMED if wins else STRATEGY_LEFT, ""))

    def _guarded(self, pursuit: _Pursuit, seen: Observation, command: Command) -> Command:
        """Return a command as the shield changes it."""
        given = self._shield_filter.filter(seen, command)
        intervention = self._shield_filter.intervention
        if intervention is not None:
            pursuit.reports.append((SHIELD, override_text(intervention.asked, intervention.given, intervention.reason)))
        return given

    def _waiting(self, pursuit: _Pursuit, seen: Observation, command: Command) -> Command:
        """Return `command`, or the command to wait before the disc if the strategy says so and the place is kept."""
        drivers, advice = self._drivers, pursuit.advice
        if advice is None or advice.enter or seen.propositions.crosses >= 0 or drivers is None:
            return command
        if drivers.car[0, EGO].turn > self._patience:
            return command
        x, y = self._points[pursuit.adviser.board.road_cells.nodes[advice.node].vertex]
        room = max(0.0, math.hypot(x - seen.pose.x, y - seen.pose.y) - self._edge)
        if command.speed * self._period <= room:
            return command
        return Command(room / self._period, 0.0)


def player(file: str) -> Synthesized:
    """Return the controller that plays the strategy in a file; InputError if it can't be read."""
    return Synthesized(Strategy.load(file))


def foreign_player(file: str, *, fallback: bool = False) -> Synthesized:
    """Return the controller that plays the strategy of another tool in a file; InputError if it can't be read."""
    return Synthesized(read_machine(file), fallback=fallback)


def _liked(free: Sequence[int], exits: Sequence[int], distance: Floats) -> list[int]:
    """Return the exits, the preferred first: those that are free in the game, then the others by distance."""
    return [*free, *sorted(set(exits) - set(free), key=lambda lane: (distance[lane], lane))]


def _sight(problem: Problem) -> Sight:
    return Sight(
        sight=problem.sensing_radius,
        margin=problem.intersection_radius + problem.car.body.reach,
        look=max(1, round(LOOK * problem.rate)),
    )


def _ways(drivers: Drivers, arms: Sequence[Sequence[int]]) -> Floats:
    """Return `_Pursuit.ways`."""
    distance = drivers.distance.copy()
    for stage, lanes in enumerate(arms):
        distance[stage, list(lanes)] = drivers.distance[(stage + 1) % len(arms), list(lanes)]
    return distance


def _adviser(strategy: Strategy | Machine | None, problem: Problem, *, fallback: bool) -> Adviser:
    """Return the adviser for a trial; InputError if the game is too large, or the strategy of another problem."""
    if strategy is None:
        return Ranked(_solved(problem))
    if isinstance(strategy, Strategy):
        strategy.check_fit(cells_of(problem), len(problem.e_agents))
        return Ranked(strategy)
    board = board_of(problem)
    check_fit(board, strategy)
    return MachineAdviser(board, strategy, fallback=fallback)


def _solved(problem: Problem) -> Strategy:
    """Return the strategy for a problem; if the game is lost it wins nowhere. InputError if the game is too large."""
    board = board_of(problem)
    return Strategy.of(solve(build(board)))
