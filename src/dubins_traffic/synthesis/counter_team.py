"""The e-agents `counter`: one team that plays the counterstrategy of the game of cells on the roads."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from math import hypot
from typing import TYPE_CHECKING, Any, Final

import numpy as np

from dubins_traffic.agents.lawful import drivers_of
from dubins_traffic.cars.state import Labels, State
from dubins_traffic.cars.tables import pack_obstacles
from dubins_traffic.errors import InputError
from dubins_traffic.kernels.arrays import Floats
from dubins_traffic.kernels.records import table
from dubins_traffic.policies.rules.fitness import check_fit, check_speeds
from dubins_traffic.policies.rules.policy import decide
from dubins_traffic.policies.rules.room import MARGIN
from dubins_traffic.policies.rules.tables import KIND, VIOLATION, Driver, Drivers, Traffic, scratch
from dubins_traffic.problem.kinds import COUNTER
from dubins_traffic.roads.packing import pack
from dubins_traffic.rules.parameters import RuleParameters
from dubins_traffic.rules.propositions import FLAG
from dubins_traffic.synthesis.assumption import Assumption, Order
from dubins_traffic.synthesis.board import Board
from dubins_traffic.synthesis.counter import Counterstrategy, Moment, followed, moment_of, story_of
from dubins_traffic.synthesis.game import build
from dubins_traffic.synthesis.instance import assumption_of, cells_of
from dubins_traffic.synthesis.queues import Scene
from dubins_traffic.synthesis.road_play import RoadPlay, Sight, Sighting, sighted
from dubins_traffic.synthesis.solver import solve
from dubins_traffic.synthesis.specification import EGO

if TYPE_CHECKING:
    from dubins_traffic.problem.instance import Instance


NO_GOAL: Final = -2
"""Stands for the goals of the cars in the law's tables: no intersection, since the strategy sends the cars."""
NOT_LIKED: Final = 100.0
"""Cost, in metres, of an exit that the strategy does not choose."""
BEFORE_LINE: Final = 0.2
"""A car that shall have no place in the order of arrival stands this far before it could take one, metres."""
COMMITTED: Final = 0.85
"""A car nearer than this to the middle of a disc, in units of R, is on its way to an exit and keeps to it."""
COUNTERSTRATEGY: Final = "counterstrategy"
"""Kind of the events that describe how the team keeps the ego from a goal."""


class CounterTeam:
    """Drives all e-agents of a trial, which are of kind `counter` (a `protocols.Driver`).

    They hold places and make way as the counterstrategy says, or as a counter-play that their parameters tell. They
    keep those rules that the problem assumes of them. If the ego wins the game, they drive at random.
    """

    def reset(self, instances: Sequence[Instance], state: State) -> None:
        """Solve the game of a trial; InputError unless it is the only trial and all its e-agents are of this kind."""
        if len(instances) != 1 or any(agent.kind != COUNTER for agent in instances[0].e_agents):
            raise InputError(
                "e-agents of this kind share a trial with no other kind, and are not batched",
                field="type",
                value=COUNTER,
                expected="one trial whose e-agents are all of this kind",
            )
        (instance,) = instances
        problem = instance.problem
        check_fit(problem, owes=False)
        check_speeds(instance)
        self._roads = pack([problem.network], [problem.car.lane_width])
        self._obstacles = pack_obstacles([problem.obstacles])
        self._drivers = _drivers(instance)
        self._scratch = scratch(state.x.shape[1], len(problem.network.segments), self._obstacles)
        self._points: list[list[float]] = problem.network.points.tolist()
        rules = RuleParameters.from_mapping(problem.rules)
        self._radius, self._reach = problem.intersection_radius, problem.car.body.reach
        self._line = rules.approach_distance + BEFORE_LINE
        self._period = problem.period
        board = Board(cells_of(problem), _assumed(instance), len(instance.e_agents))
        self._board = board
        self._guide = _followed(instance, board) or Counterstrategy(solve(build(board)))
        self._play = RoadPlay(board, Sight.of_all(problem.rate), instance.names)
        self._targets = [-1] * len(instance.starts)
        self._scenes: list[Scene] = []
        self._jumps = board.assumption.order is not Order.KEPT
        self._times = [round(seconds * problem.rate) for seconds in _times(board, rules)]
        self._since: dict[int, int] = {}
        follows = isinstance(self._guide, FollowedPlay)
        told = "a counter-play is followed" if follows else f"assumed: {board.assumption}"
        self._reports = [(COUNTERSTRATEGY, told)]
        self._is_told = False

    def decide(self, tick: int, state: State, labels: Labels, commands: Floats) -> None:
        """Write the commands of these cars for [t_k, t_k+1) into `commands` (1, N, 2)."""
        cars = [sighted(0, n, state, labels) for n in range(int(state.count[0]))]
        if self._play.follow(tick, cars):
            self._choose(tick, cars)
        if self._jumps:
            self._jump(cars)
        tables = (self._roads, self._obstacles, self._drivers, self._scratch)
        decide(tick, commands, Traffic(state, labels, *tables))
        for car in cars[1:]:
            if self._targets[car.car] == self._play.cells[car.car]:
                self._hold(car, commands[0, car.car])

    def report(self) -> Sequence[tuple[str, str]]:
        """Return, once, a description of how the team keeps the ego from a goal."""
        if not self._reports:
            return ()
        reports, self._reports = self._reports, []
        return reports

    def reseed(self, seed: int) -> None:
        """Let what is drawn from now on follow from another seed."""
        self._drivers.seed[:] = seed

    def _choose(self, tick: int, cars: Sequence[Sighting]) -> None:
        """Choose the cells to which the cars go in this turn, and set the law's tables accordingly."""
        self._targets = [-1] * len(self._play.cells)
        position = self._play.position
        after = None if position is None else self._turn(tick, position)
        if after is None:
            return
        self._scenes = self._board.scenes(after)
        for car in cars[1:]:
            self._send(car)

    def _turn(self, tick: int, position: int) -> int | None:
        """Set the cells to which the cars go from a position; return the position after that, None if there is none."""
        board, cells, guide = self._board, tuple(self._play.cells), self._guide
        if isinstance(guide, FollowedPlay):
            self._targets = list(guide.wanted(cells))
            turn = (cells[EGO], *self._targets[1:])
            same = (
                after
                for after in self._play.moves.of_others(position)
                if after < board.positions and sorted(moment_of(board, after).cells) == sorted(turn)
            )
            return next(same, position)
        if not any(loss.lost[position] for loss in guide.solution.losses):
            return None
        if not self._is_told:
            self._is_told = True
            self._reports += [(COUNTERSTRATEGY, line.strip()) for line in story_of(guide, position)]
        after, _ = guide.choose(position, self._most_urgent(tick, guide.debts(position)))
        if after == guide.solution.game.positions:
            return None
        self._targets = list(followed(board, Moment(cells, {}), moment_of(board, after)).cells)
        return after

    def _most_urgent(self, tick: int, owed: Sequence[int]) -> int:
        """Return which of what is owed is due first, by the tick since which it is owed and the time allowed."""
        self._since = {debt: self._since.get(debt, tick) for debt in owed}
        return min(owed, key=lambda debt: (self._since[debt] + self._times[debt], debt), default=0)

    def _jump(self, cars: Sequence[Sighting]) -> None:
        """Let the cars that are sent into an intersection enter it when it is clear, whatever the order of arrival."""
        for car in cars[1:]:
            enters = 0 <= self._targets[car.car] < len(self._board.road_cells.nodes)
            clear = car.propositions.bits & FLAG.CLEAR != 0
            self._drivers.car[0, car.car].violations = VIOLATION.ROLLING if enters and clear else 0

    def _send(self, car: Sighting) -> None:
        """Let the law take a car to its target."""
        road_cells, cells = self._board.road_cells, self._play.cells
        nodes = len(road_cells.nodes)
        target, cell = self._targets[car.car], cells[car.car]
        own_car = self._drivers.car[0, car.car]
        prices = self._drivers.distance[car.car]
        if target < nodes and cell >= nodes:
            free = [lane for lane in road_cells.nodes[target].exits if nodes + lane not in cells]
            liked = free or list(road_cells.nodes[target].exits)
        elif target >= nodes and cell < nodes and not self._is_turning(car, cell):
            liked = [target - nodes]
        else:
            return
        prices[:] = NOT_LIKED
        prices[liked] = 0.0
        v = road_cells.nodes[target if target < nodes else cell].vertex
        if own_car.lane >= 0 and road_cells.network.lane_ends(int(own_car.lane))[1] == v:
            own_car.next_lane = liked[0]

    def _is_turning(self, car: Sighting, node: int) -> bool:
        """Tell whether a car in a disc is on its way to an exit; one that stands in it has stopped at its edge."""
        return self._distance(car, node) < COMMITTED * self._radius

    def _distance(self, car: Sighting, node: int) -> float:
        x, y = self._points[self._board.road_cells.nodes[node].vertex]
        return hypot(x - car.pose.x, y - car.pose.y)

    def _hold(self, car: Sighting, command: Floats) -> None:
        """Make a car stand: in its disc, before the disc ahead, or farther back if it is to have no place."""
        road_cells, cell = self._board.road_cells, self._play.cells[car.car]
        nodes = len(road_cells.nodes)
        if cell < nodes:
            if car.propositions.at == road_cells.nodes[cell].vertex and not self._is_turning(car, cell):
                command[:] = 0.0
            return
        if car.propositions.crosses >= 0 or car.propositions.lane != cell - nodes:
            return
        node, slot = road_cells.lane_end[cell - nodes]
        edge = self._radius + self._reach + (self._line if slot in self._scenes[node].parked else MARGIN)
        room = max(0.0, self._distance(car, node) - edge)
        if command[0] * self._period > room:
            command[:] = room / self._period, 0.0


def _times(board: Board, rules: RuleParameters) -> list[float]:
    """Return the time that the rules allow for each debt, seconds: of nodes, then lanes, then goals."""
    road_cells = board.road_cells
    lanes = [
        rules.enter_time if road_cells.nodes[node].crossing else rules.rest_time for node, _ in road_cells.lane_end
    ]
    return [*[rules.exit_time] * len(road_cells.nodes), *lanes, *[rules.goal_time] * len(road_cells.goals)]


def _assumed(instance: Instance) -> Assumption:
    """Return which rules the team keeps: as its cars' parameters say, or as the problem assumes."""
    agreed = _common(instance, "assume", "make the same assumption")
    assumed = assumption_of(instance.problem) if agreed is None else Assumption.parse(agreed.split(","))
    if not assumed.yields:
        raise InputError("they ram nobody", field="assume", value=str(assumed), expected="E2 among them")
    return assumed


def _followed(instance: Instance, board: Board) -> FollowedPlay | None:
    """Return the play that the cars' parameters tell, None if they tell none."""
    turns, again = (_common(instance, name, "follow the same play") for name in ("turns", "again"))
    if turns is None:
        return None
    play = FollowedPlay(turns, again)
    play.check_fit(board)
    return play


def _common(instance: Instance, name: str, must: str) -> Any:
    """Return the parameter that all cars of a team have alike; InputError, which says what they `must` do, if not."""
    first, *others = (agent.parameters[name] for agent in instance.e_agents)
    if any(other != first for other in others):
        raise InputError(
            f"the e-agents of one team must {must}", field=name,
            value=sorted({str(first), *map(str, others)}), expected="equal values for all e-agents of the kind counter",
        )  # fmt: skip
    return first


def _drivers(instance: Instance) -> Drivers:
    """Return the team's cars as the law's tables: each on a round without goals, with exit costs of its own."""
    problem, cars = instance.problem, len(instance.starts)
    rows = table(Driver, (1, cars))
    for n, agent in enumerate(instance.e_agents, start=1):
        car = rows[0, n]
        car.kind, car.first, car.last, car.place = KIND.ROUND, n, n + 1, n
        car.speed = min(agent.parameters["speed"], problem.car.bounds.speed)
    net, goals = np.zeros(1, dtype=np.int64), np.full(cars, NO_GOAL, dtype=np.int64)
    prices = np.zeros((cars, problem.network.lanes))
    return drivers_of([instance], net, rows, goals, prices)


@dataclass
class FollowedPlay:
    """Where a counter-play is.

    `turns` has the cells of all cars, the ego's first, at the start and after each turn of the environment and of the
    ego in turn; from `again` on it repeats, or it ends, None.
    """

    turns: Sequence[Sequence[int]]
    again: int | None
    _at: int = 0

    def check_fit(self, board: Board) -> None:
        """Refuse a play that is none of a game's: InputError."""
        cars, cells = board.others + 1, board.road_cells.cells
        for number, turn in enumerate(self.turns):
            if len(turn) != cars or not all(0 <= cell < cells for cell in turn):
                raise InputError(
                    "no turn of this game", field=f"parameters.turns.{number}", value=list(turn),
                    expected=f"{cars} cells, each from 0 to {cells - 1}",
                )  # fmt: skip
        last = len(self.turns) - 1
        if self.again is not None and not (self.again < last and self.again % 2 == last % 2 == 0):
            raise InputError(
                "a play does not begin anew there", field="parameters.again", value=self.again,
                expected=f"an even number below {last}, and an odd number of turns",
            )  # fmt: skip

    def wanted(self, cells: Sequence[int]) -> Sequence[int]:
        """Return the cells of all cars after the environment's next turn, where they are in `cells` now."""
        if cells[EGO] not in (self.turns[self._at][EGO], self._answered(self._at)[EGO]):
            self._at = self._resumed(cells)
        for _ in self.turns:
            after = self._next(self._at)
            if after is None or tuple(cells) != tuple(self._answered(self._at)):
                break
            self._at = after
        return self.turns[min(self._at + 1, len(self.turns) - 1)]

    def _answered(self, at: int) -> Sequence[int]:
        """Return the cells after the ego's answer to that."""
        return self.turns[min(at + 2, len(self.turns) - 1)]

    def _next(self, at: int) -> int | None:
        """Return the place after one at which the environment is to move; None at the end."""
        if at + 2 >= len(self.turns) - 1 and self.again is not None:
            return self.again
        return at + 2 if at + 2 < len(self.turns) else None

    def _resumed(self, cells: Sequence[int]) -> int:
        """Return where to go on: at the next place with all cars where they are, else with the ego there."""
        places: list[int] = []
        at: int | None = self._at
        while at is not None and at not in places:
            places.append(at)
            at = self._next(at)
        same = [at for at in places if tuple(self.turns[at]) == tuple(cells)]
        near = [at for at in places if self.turns[at][EGO] == cells[EGO]]
        return next(iter(same or near), self._at)
