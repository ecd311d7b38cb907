"""A strategy against everything that the environment may do: it wins, or a play in which it does not is found.

With a strategy that has a memory, the game is the environment's alone: a finite graph of places and memories. The
strategy wins if it always makes a move of the game, is never rammed, and no play that goes on in the graph keeps a goal
from it while each debt is unpaid only for a while. Whether there is such a play is a question of fair cycles, which
are found as the greatest set Z of nodes away from the goal from each of which, for each debt, a node of Z that does
not owe it is reached within Z (Emerson and Lei, LICS 1986).
"""

from __future__ import annotations

from collections import deque
from collections.abc import Hashable, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any, Final, Protocol, TypeAlias

import numpy as np

from dubins_traffic.errors import InputError
from dubins_traffic.problem.instance import Instance
from dubins_traffic.problem.kinds import COUNTER, parameters_of
from dubins_traffic.synthesis.archive import SUFFIXES
from dubins_traffic.synthesis.foreign.machine import Machine
from dubins_traffic.synthesis.foreign.player import Answer, Labelled, MachinePlayer, PlayPosition, check_fit
from dubins_traffic.synthesis.foreign.read import read_machine
from dubins_traffic.synthesis.game import Game, Progress
from dubins_traffic.synthesis.instance import start_cells, start_positions
from dubins_traffic.synthesis.positions import Cells, Flags
from dubins_traffic.synthesis.road_play import MoveList
from dubins_traffic.synthesis.specification import EGO
from dubins_traffic.synthesis.strategy import Strategy

MOST_NODES: Final = 1_000_000
"""Most places with memories that are looked at."""
FORMAT: Final = "dubins-traffic counter-play"
VERSION: Final = 1
Memory: TypeAlias = Hashable


class Player(Protocol):
    """A strategy with what it remembers; `foreign.player.MachinePlayer` is one, and `RankedPlayer`."""

    def begin(self, place: PlayPosition) -> Memory | None:
        """Return what it remembers at the start; None if it does not begin there."""
        ...

    def why_no_beginning(self, place: PlayPosition) -> str:
        """Return why it does not begin at a place."""
        ...

    def answer(self, place: PlayPosition, memory: Any) -> Answer | None:
        """Return what it does in its turn; None if that is no move of the game."""
        ...

    def why_no_move(self, place: PlayPosition, memory: Any) -> str:
        """Return what it does where that is no move of the game."""
        ...


@dataclass(frozen=True, slots=True)
class RankedPlayer:
    """A strategy of ours in the game; what it remembers is the goal that it seeks."""

    game: Labelled
    strategy: Strategy
    ego_cell: Cells
    """Of each position."""

    def begin(self, place: PlayPosition) -> int | None:
        """Return the goal that it seeks first; None if it does not win from the place."""
        return self._next(place.position, 0) if self.strategy.wins(place.position) else None

    def why_no_beginning(self, place: PlayPosition) -> str:
        """Return why it does not begin at a place."""
        return f"has no rank where the cars are in cells {place.cells}"

    def answer(self, place: PlayPosition, memory: int) -> Answer | None:
        """Return the move to the position of lowest rank; None if none has a rank."""
        position = self.strategy.best(np.array(self.game.options(place)), memory)
        if position is None:
            return None
        after = self.game.moved(place, int(self.ego_cell[position]))
        return None if after is None else Answer(self._next(position, memory), after)

    def why_no_move(self, place: PlayPosition, memory: int) -> str:
        """Return that no move has a rank."""
        name = self.strategy.board.road_cells.target_name(memory)
        return f"has no rank, on the way to {name}, wherever it goes from cells {place.cells}"

    def _next(self, position: int, goal: int) -> int:
        """Return the goal to seek from a position where `goal` was sought."""
        ranks = self.strategy.ranks
        return (goal + 1) % len(ranks) if ranks[goal].rank[position] == 0 else goal


@dataclass(frozen=True, slots=True)
class CounterPlay:
    """A play that a strategy does not win: turn by turn, then from `again` on for ever.

    `turns` has the cells of all cars, the ego's first, at the start and after each turn of the environment and of the
    ego in turn. `goal` is what is kept from the ego for ever (a place in `RoadCells.targets`); where the play ends,
    `end` says with what, and both others are None.
    """

    turns: tuple[tuple[int, ...], ...]
    again: int | None
    goal: int | None
    end: str | None

    def to_document(self, game: Game) -> dict[str, Any]:
        """Return the play for machines, with the names of its cells."""
        road_cells = game.board.road_cells
        return {
            "format": FORMAT,
            "version": VERSION,
            "cells": [road_cells.name(cell) for cell in range(road_cells.cells)],
            "turns": [list(cells) for cells in self.turns],
            "again": self.again,
            "goal": None if self.goal is None else road_cells.target_name(self.goal),
            "end": self.end,
        }

    def trial(self, instance: Instance) -> Instance:
        """Return an instance in which the e-agents drive by this play: all of them are of the kind `counter`."""
        play: dict[str, Any] = {"turns": [list(cells) for cells in self.turns], "again": self.again}
        parameters = parameters_of(COUNTER, play)
        agents = (replace(agent, kind=COUNTER, type=COUNTER, parameters=parameters) for agent in instance.e_agents)
        return replace(instance, e_agents=tuple(agents))

    def lines(self, game: Game) -> list[str]:
        """Return the play for people."""
        road_cells = game.board.road_cells
        names = ["the ego", *(f"e-agent {car}" for car in range(1, game.board.others + 1))]
        lines = [f"  {names[k]} at {road_cells.name(cell)}" for k, cell in enumerate(self.turns[EGO])]
        for number, (before, after) in enumerate(zip(self.turns, self.turns[1:], strict=False), start=1):
            if self.again is not None and number == self.again + 1:
                lines.append("From here on this repeats for ever:")
            lines += [
                f"  {number}. {names[k]} goes to {road_cells.name(cell)}"
                for k, (old, cell) in enumerate(zip(before, after, strict=True))
                if cell != old
            ]
        if self.again is not None and len(set(self.turns[self.again :])) == 1:
            lines[-1] = "From here on nobody moves any more."
        return lines


@dataclass(frozen=True, slots=True)
class Check:
    """What came of a strategy in all plays: whether it wins them, and a play that it does not win."""

    nodes: int
    """Places with memories that the plays reach."""
    positions: int
    """Positions that they reach in which the environment moves."""
    kept: int
    """Of these, those from which no play is lost, whatever the strategy remembers there."""
    counter: CounterPlay | None

    @property
    def wins(self) -> bool:
        """Whether the strategy wins from all starts."""
        return self.counter is None

    @property
    def share(self) -> float:
        """The share of the positions reached from which no play is lost."""
        return self.kept / self.positions

    def to_json(self, game: Game) -> dict[str, Any]:
        """Return what came of the strategy for machines."""
        return {
            "wins": self.wins,
            "positions": self.positions,
            "share": self.share,
            "counter_play": None if self.counter is None else self.counter.to_document(game),
        }

    def lines(self, name: str, game: Game) -> list[str]:
        """Return what came of the strategy `name` for people."""
        reached = f"its plays reach {self.positions:,} positions, and it wins from {self.share:.1%} of them"
        if self.counter is None:
            return [f"{name} wins every play from where the instance starts: {reached}."]
        goal, end = self.counter.goal, self.counter.end
        why = end if goal is None else f"is kept from goal {game.board.road_cells.target_name(goal)} for ever"
        return [f"{name} does not win: {reached}. In this play it {why}:", *self.counter.lines(game)]


@dataclass
class _Graph:
    """All plays of a strategy: nodes in which the environment moves, and its moves with the ego's answers."""

    places: list[PlayPosition] = field(default_factory=list[PlayPosition])
    memories: list[Memory] = field(default_factory=list[Memory])
    parents: list[tuple[int, PlayPosition | None]] = field(default_factory=list[tuple[int, PlayPosition | None]])
    """The node from which each was reached first, -1 for a start, and the place that the environment made then."""
    sources: list[int] = field(default_factory=list[int])
    targets: list[int] = field(default_factory=list[int])
    between: list[PlayPosition] = field(default_factory=list[PlayPosition])
    """Of each move, where it leads from and to, and the place that the environment made."""
    ends: list[tuple[int, PlayPosition | None, str]] = field(default_factory=list[tuple[int, PlayPosition | None, str]])
    """The nodes at which plays end, the place that the environment made, and why."""


def read_strategy(path: str | Path) -> Machine | Strategy:
    """Return the strategy in a file, ours or another tool's; InputError if there is none."""
    return Strategy.load(path) if Path(path).suffix in SUFFIXES else read_machine(path)


def check_strategy(
    path: str | Path,
    game: Game,
    instance: Instance,
    progress: Progress | None = None,
    held: Machine | Strategy | None = None,
) -> Check:
    """Play the strategy in a file, ours or another tool's, from where an instance starts, as `check_player` does.

    `held` is what `read_strategy` has returned of the file, if it has been read.

    Raises
    ------
    InputError
        If the file can't be read or its strategy is one for another game; if other cars start than those of the game,
        or two in one cell; and as `check_player`.
    """
    board = game.board
    named = Labelled(board, MoveList(board))
    try:
        player = _player(read_strategy(path) if held is None else held, game, named)
    except InputError as error:
        raise error if error.file else error.within(file=str(path)) from None
    cells = tuple(start_cells(board, instance))
    starts = [PlayPosition(position, cells) for position in start_positions(board, instance)]
    if isinstance(player, MachinePlayer):
        starts = [place for place in starts if named.is_ego_last(place)]
    return check_player(game, player, named, starts, progress)


def _player(strategy: Machine | Strategy, game: Game, named: Labelled) -> Player:
    board = game.board
    if not isinstance(strategy, Strategy):
        check_fit(board, strategy)
        return MachinePlayer(named, strategy)
    strategy.check_fit(board.road_cells, board.others)
    if strategy.board.assumption != board.assumption:
        raise InputError(
            "a strategy for another problem",
            field="assume",
            value=str(strategy.board.assumption),
            expected=str(board.assumption),
        )
    return RankedPlayer(named, strategy, game.ego_cell)


def check_player(
    game: Game,
    player: Player,
    named: Labelled,
    starts: Sequence[PlayPosition],
    progress: Progress | None = None,
) -> Check:
    """Play a strategy from its starts against everything that the environment may do.

    InputError if there are more than `MOST_NODES` places with memories.
    """
    graph = _explored(game, player, named, starts, progress)
    lost = _Lost(game, graph)
    bad = lost.before(lost.ending())
    counter = _ended(graph)
    for goal in range(len(game.board.road_cells.targets)):
        fair = lost.kept_from(goal)
        if fair.any():
            counter = counter or _kept(graph, lost, fair, goal)
            bad |= lost.before(fair)
    positions = np.array([place.position for place in graph.places], dtype=np.int64)
    every = np.unique(positions)
    return Check(len(graph.places), len(every), len(every) - len(np.unique(positions[bad])), counter)


def _explored(
    game: Game, player: Player, named: Labelled, starts: Sequence[PlayPosition], progress: Progress | None
) -> _Graph:
    graph = _Graph()
    number: dict[tuple[PlayPosition, Memory], int] = {}
    turns: dict[PlayPosition, list[PlayPosition]] = {}
    waiting: deque[int] = deque()

    def node(place: PlayPosition, memory: Memory, parent: int, between: PlayPosition | None) -> int:
        key = place, memory
        if key not in number:
            if len(number) == MOST_NODES:
                raise InputError(
                    "too many plays to look at",
                    value=f"more than {MOST_NODES:,} places with what the strategy remembers",
                    expected="a smaller strategy, or fewer cars",
                )
            number[key] = len(graph.places)
            graph.places.append(place)
            graph.memories.append(memory)
            graph.parents.append((parent, between))
            waiting.append(number[key])
        return number[key]

    for place in starts:
        memory = player.begin(place)
        here = node(place, memory, -1, None)
        if memory is None:
            graph.ends.append((here, None, player.why_no_beginning(place)))
    while waiting:
        here = waiting.popleft()
        place, memory = graph.places[here], graph.memories[here]
        if progress and here % 1000 == 0:
            progress(f"play, {len(graph.places):,} places", here / len(graph.places))
        if memory is None:
            continue
        if game.positions in game.turns_of(place.position):
            graph.ends.append((here, None, "is rammed: E2 is not assumed"))
        if place not in turns:
            turns[place] = list(named.turns(place))
        for turn in turns[place]:
            answer = player.answer(turn, memory)
            if answer is None:
                graph.ends.append((here, turn, player.why_no_move(turn, memory)))
                continue
            there = node(answer.place, answer.memory, here, turn)
            graph.sources.append(here)
            graph.targets.append(there)
            graph.between.append(turn)
    return graph


class _Lost:
    """Where plays of a graph are lost."""

    def __init__(self, game: Game, graph: _Graph) -> None:
        self._ends = [node for node, _, _ in graph.ends]
        self._count = len(graph.places)
        self._from = np.array(graph.sources, dtype=np.int64)
        self._to = np.array(graph.targets, dtype=np.int64)
        places = graph.places
        self._targets = [
            np.isin([place.cells[EGO] for place in places], nodes) for nodes in game.board.road_cells.targets
        ]
        owed = [game.owed[game.owed_at[place.position] : game.owed_at[place.position + 1]].tolist() for place in places]
        self.debts = sorted({debt for debts in owed for debt in debts})
        self.unowed = {debt: np.array([debt not in debts for debts in owed]) for debt in self.debts}

    def ending(self) -> Flags:
        """Return which nodes have a play that ends there."""
        ends = np.zeros(self._count, dtype=np.bool_)
        ends[self._ends] = True
        return ends

    def before(self, nodes: Flags, within: Flags | None = None) -> Flags:
        """Return the nodes that are among `nodes` or lead there, all the way `within` some."""
        reaching = nodes.copy()
        while True:
            more = reaching.copy()
            more[self._from[reaching[self._to]]] = True
            if within is not None:
                more &= within | nodes
            if (more == reaching).all():
                return reaching
            reaching = more

    def leads(self, nodes: Flags, within: Flags) -> Flags:
        """Return the nodes of `within` from which one move or more, within it, lead to `nodes`."""
        reached = self.before(nodes & within, within)
        leading = np.zeros(self._count, dtype=np.bool_)
        leading[self._from[reached[self._to]]] = True
        return leading & within

    def kept_from(self, goal: int) -> Flags:
        """Return where plays go on from which never are at a goal and owe no debt for ever."""
        fair = ~self._targets[goal]
        while True:
            smaller = self.leads(fair, fair)
            for debt in self.debts:
                smaller &= self.leads(self.unowed[debt] & smaller, smaller)
            if (smaller == fair).all():
                return fair
            fair = smaller


def _ended(graph: _Graph) -> CounterPlay | None:
    """Return the shortest play that ends by the strategy's fault; None if there is none."""
    if not graph.ends:
        return None
    node, turn, why = graph.ends[0]
    turns = _way_to(graph, node)
    return CounterPlay((*turns, *(() if turn is None else (turn.cells,))), None, None, why)


def _way_to(graph: _Graph, node: int) -> list[tuple[int, ...]]:
    """Return the turns from a start to a node."""
    way: list[tuple[int, ...]] = []
    while node >= 0:
        way.append(graph.places[node].cells)
        node, between = graph.parents[node]
        if between is not None:
            way.append(between.cells)
    return way[::-1]


def _kept(graph: _Graph, lost: _Lost, fair: Flags, goal: int) -> CounterPlay:
    """Return a play that comes to where a goal can be kept from the ego, and goes on there until it repeats."""
    moves: dict[int, list[int]] = {}
    for move, (source, target) in enumerate(zip(graph.sources, graph.targets, strict=True)):
        if fair[source] and fair[target]:
            moves.setdefault(source, []).append(move)
    node = int(np.argmax(fair))
    turns = _way_to(graph, node)
    wanted = [lost.unowed[debt] for debt in lost.debts] or [np.ones_like(fair)]
    seen: dict[int, int] = {}
    while node not in seen:
        seen[node] = len(turns) - 1
        for unowed in wanted:
            for move in _shortest(graph, moves, node, unowed):
                turns += [graph.between[move].cells, graph.places[graph.targets[move]].cells]
                node = graph.targets[move]
    return CounterPlay(tuple(turns), seen[node], goal, None)


def _shortest(graph: _Graph, moves: dict[int, list[int]], node: int, wanted: Flags) -> list[int]:
    """Return the moves, one or more, by which a node that is wanted is reached."""
    came: dict[int, int] = {}
    waiting: deque[int] = deque([node])
    while True:
        here = waiting.popleft()
        for move in moves[here]:
            there = graph.targets[move]
            if there in came:
                continue
            came[there] = move
            if wanted[there]:
                return _back(graph, came, node, there)
            waiting.append(there)


def _back(graph: _Graph, came: dict[int, int], node: int, there: int) -> list[int]:
    path = [came[there]]
    while graph.sources[path[-1]] != node:
        path.append(came[graph.sources[path[-1]]])
    return path[::-1]
