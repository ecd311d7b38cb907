"""Strategies: a rank table for each goal, kept in a file, checked, and asked for moves and for advice on the road.

The ego moves to the position of lowest rank for the goal it seeks; having reached it, it seeks the next. A file is a
NumPy archive (`.npz`): `header`, JSON in UTF-8 bytes with the game and the version of the format, and for each goal k
the arrays `rank_k`, `start_k` and `debt_k` (`solver.Ranks`).

A check of the ranks goes move by move; nothing of the solver is used. Its conditions are local, and together they
suffice. Where a goal has not been reached, whatever the environment does, the ego can get to a rank below the layer,
or it stays in the layer and the environment owes what the layer says. Layers fall only finitely often, so a play that
never reaches the goal stays in one layer, where one debt is owed for ever: the environment has failed. Where the goal
has been reached, the ego stays where the next goal has ranks.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any, Final, Protocol

import numpy as np
from pydantic import BaseModel, ConfigDict, Field, ValidationError

from dubins_traffic.errors import DubinsTrafficError, InputError
from dubins_traffic.roads.network import RoadNetwork
from dubins_traffic.synthesis.archive import Archive, save_arrays
from dubins_traffic.synthesis.assumption import Assumption
from dubins_traffic.synthesis.board import MOST_OTHERS, Board
from dubins_traffic.synthesis.fixpoint import NO_DEBT
from dubins_traffic.synthesis.game import LARGEST_CHOICE, MOST_POSITIONS, Game, room
from dubins_traffic.synthesis.moves import Work, list_moves
from dubins_traffic.synthesis.positions import Flags, Numbers
from dubins_traffic.synthesis.road_cells import RoadCells
from dubins_traffic.synthesis.road_play import EGO_CAR, RoadPlay
from dubins_traffic.synthesis.solver import Ranks, Solution

FORMAT: Final = "dubins-traffic strategy"
VERSION: Final = 2


@dataclass(frozen=True)
class Strategy:
    """How the ego wins."""

    board: Board
    """What the numbers of positions mean."""
    ranks: tuple[Ranks, ...]
    """One table a goal, in the order of `RoadCells.goals`."""

    @classmethod
    def of(cls, solution: Solution) -> Strategy:
        """Return the strategy that was found with a solution."""
        return cls(solution.game.board, solution.ranks)

    def wins(self, position: int) -> bool:
        """Say whether the strategy wins from a position in which the environment is to move."""
        return 0 <= position < self.board.positions and all(
            ranks_of_goal.rank[position] >= 0 for ranks_of_goal in self.ranks
        )

    def check_fit(self, road_cells: RoadCells, others: int) -> None:
        """Refuse the strategy for roads, goals or a number of e-agents other than its own (InputError)."""
        cells = self.board.road_cells
        differences = {
            "network": cells.network.to_document() != road_cells.network.to_document(),
            "goals": set(cells.goals) != set(road_cells.goals),
            "order_degree": cells.order_degree != road_cells.order_degree,
            "cars": self.board.others != others,
        }
        for name, differ in differences.items():
            if differ:
                raise InputError("a strategy for another problem", field=name, expected="that of this problem")

    def first(self) -> int:
        """Return the first position from which the strategy wins; InputError if there is none."""
        won = np.logical_and.reduce([ranks_of_goal.rank >= 0 for ranks_of_goal in self.ranks])
        if not won.any():
            raise InputError("a strategy that wins from nowhere", expected="some position")
        return int(np.argmax(won))

    def choose(self, position: int, goal: int) -> int:
        """Return the position to which the ego moves from `position`, or that itself if it stays.

        InputError if the strategy does not win from there.
        """
        board = self.board
        out = room(board, 1, LARGEST_CHOICE)
        list_moves(board.tables, position, Work.of(board), out)
        best = self.best(out.ego_to[: out.used[0].ego_to], goal)
        if best is None:
            raise InputError("the strategy does not win from there", field="position", value=position)
        return best

    def best(self, options: Numbers, goal: int) -> int | None:
        """Return which of some positions has the lowest rank for a goal, the first of several; None if none has one."""
        ranks = self.ranks[goal].rank[options]
        if (ranks < 0).all():
            return None
        return int(options[np.argmin(np.where(ranks < 0, np.iinfo(np.int32).max, ranks))])

    def save(self, path: str | Path, *, overwrite: bool = False) -> None:
        """Write the strategy to a file, as `save_arrays` does."""
        road_cells = self.board.road_cells
        header = {
            "format": FORMAT,
            "version": VERSION,
            "network": road_cells.network.to_document(),
            "goals": [list(road_cells.network.intersections[goal]) for goal in road_cells.goals],
            "order_degree": road_cells.order_degree,
            "cars": self.board.others,
            "assume": list(self.board.assumption.words()),
        }
        arrays: dict[str, Any] = {
            **{f"rank_{k}": _narrow(ranks_of_goal.rank) for k, ranks_of_goal in enumerate(self.ranks)},
            **{f"start_{k}": ranks_of_goal.start for k, ranks_of_goal in enumerate(self.ranks)},
            **{f"debt_{k}": ranks_of_goal.debt for k, ranks_of_goal in enumerate(self.ranks)},
        }
        save_arrays(path, header, arrays, overwrite=overwrite)

    @classmethod
    def load(cls, path: str | Path) -> Strategy:
        """Return the strategy in a file.

        Raises
        ------
        InputError
            If it can't be read, is no strategy, of an unknown version, or has no rank in any position for some goal.
            Whether it wins elsewhere is for `check_ranks`.
        """
        with Archive(path, "strategy") as archive:
            try:
                strategy = _strategy(archive)
                strategy.first()
            except InputError as error:
                raise error if error.file else error.within(file=str(path)) from None
        return strategy


class _Header(BaseModel):
    """What the header of a file says of the game, as `Strategy.save` writes it."""

    model_config = ConfigDict(strict=True)

    network: dict[str, Any]
    goals: list[Annotated[list[int], Field(min_length=2, max_length=2)]]
    order_degree: Annotated[int, Field(ge=1)]
    cars: Annotated[int, Field(ge=1, le=MOST_OTHERS)]
    assume: list[str]


def _narrow(rank: Numbers) -> Any:
    """Return ranks in 16 bits where they fit."""
    return rank.astype(np.int16) if rank.max(initial=0) < 2**15 else rank


def _strategy(archive: Archive) -> Strategy:
    header = _header(archive)
    network = RoadNetwork.from_document(header.network)
    goals = [network.vertex((x, y)) for x, y in header.goals]
    road_cells = RoadCells.of(network, goals, header.order_degree)
    board = Board(road_cells, Assumption.parse(header.assume), header.cars)
    if not 0 < board.positions < MOST_POSITIONS:
        raise InputError("no game", field="header.cars", value=header.cars, expected="one that has positions")
    return Strategy(board, tuple(_ranks(archive, board, k) for k in range(len(road_cells.targets))))


def _ranks(archive: Archive, board: Board, target: int) -> Ranks:
    """Return the tables for one target; InputError if they are none of the game."""
    count, debts = board.positions, board.road_cells.cells + len(board.road_cells.goals)
    rank = archive.array(f"rank_{target}", np.int32, count, exactly=True)
    start = archive.array(f"start_{target}", np.int32, count + 1)
    debt = archive.array(f"debt_{target}", np.int16, len(start), exactly=True)
    tables = ((f"rank_{target}", rank, len(start)), (f"start_{target}", start, len(start)))
    for name, table, end in (*tables, (f"debt_{target}", debt, debts)):
        low = 0 if table is start else -1
        if table.min(initial=0) < low or table.max(initial=-1) >= end:
            raise InputError("tables of another game", field=name, expected=f"numbers from {low} to {end - 1}")
    return Ranks(rank.astype(np.int32), start.astype(np.int32), debt.astype(np.int16))


def _header(archive: Archive) -> _Header:
    header = archive.header()
    if header.get("format") != FORMAT:
        raise InputError("no strategy", field="format", value=header.get("format"), expected=FORMAT)
    if header.get("version") != VERSION:
        raise InputError("of an unknown version", field="version", value=header.get("version"), expected=str(VERSION))
    try:
        return _Header.model_validate(header)
    except ValidationError as error:
        (first, *_) = error.errors(include_url=False)
        place = ".".join(str(part) for part in first["loc"])
        raise InputError("not as in a strategy", field=f"header.{place}", expected=first["msg"]) from None


@dataclass(frozen=True, slots=True)
class Advice:
    """What to do at the end of a lane."""

    node: int
    """The intersection ahead."""
    enter: bool
    """Whether to enter it as soon as the rules allow, or to wait."""
    exits: tuple[int, ...]
    """Lanes out that are free in the game, the best first; empty where the ego may not enter yet."""


class Adviser(Protocol):
    """Who says what to do before intersections, in one trial."""

    @property
    def board(self) -> Board:
        """The game."""
        ...

    def wins(self, play: RoadPlay) -> bool:
        """Say whether the strategy wins from where a play is, which has a position."""
        ...

    def advise(self, play: RoadPlay, goal: int, following: int) -> Advice | None:
        """Return what to do; None where the ego is at no lane's end or where the strategy does not win."""
        ...


@dataclass(frozen=True, slots=True)
class Ranked:
    """What our own strategy says, by its ranks."""

    strategy: Strategy

    @property
    def board(self) -> Board:
        """The game."""
        return self.strategy.board

    def wins(self, play: RoadPlay) -> bool:
        """Say whether the strategy wins from where a play is."""
        return play.position is not None and self.strategy.wins(play.position)

    def advise(self, play: RoadPlay, goal: int, following: int) -> Advice | None:
        """Return what the strategy says (`advise`)."""
        return advise(self.strategy, play, goal, following)


def advise(strategy: Strategy, play: RoadPlay, goal: int, following: int) -> Advice | None:
    """Return what the strategy says, None where the ego is at no lane's end or where it does not win.

    Parameters
    ----------
    play : RoadPlay
        Where the play is.
    goal, following : int
        The goal that is sought, and the one to seek after it (places in `RoadCells.goals`).
    """
    board = strategy.board
    nodes = len(board.road_cells.nodes)
    position, cell = play.position, play.cells[EGO_CAR]
    if position is None or cell < nodes or not strategy.wins(position):
        return None
    node = board.road_cells.lane_end[cell - nodes][0]
    options = play.moves.of_ego(position)
    if len(options) == 1:
        return Advice(node, True, ())
    inside = options[1]
    rank = strategy.ranks[goal].rank
    after = strategy.ranks[following if rank[inside] == 0 else goal].rank
    free = [
        lane for lane in board.road_cells.nodes[node].exits if nodes + lane not in play.cells or nodes + lane == cell
    ]
    ways = zip(free, play.moves.of_ego(inside)[1:], strict=True)
    ranked = sorted((int(after[then]), lane) for lane, then in ways if after[then] >= 0)
    enters = rank[inside] >= 0 and (rank[position] < 0 or rank[inside] <= rank[position])
    return Advice(node, bool(enters), tuple(lane for _, lane in ranked))


LOST = np.int32(2**31 - 1)
"""Stands for no rank, so that less is better."""


class StrategyError(DubinsTrafficError):
    """A strategy does not do what it promises; the message names a position and a goal."""


def check_ranks(game: Game, ranks: Sequence[Ranks]) -> None:
    """Check that the ego wins by these ranks from every position that has one.

    StrategyError if it does not: names the first position where a condition above fails.
    """
    for goal, ranks_of_goal in enumerate(ranks):
        following = ranks[(goal + 1) % len(ranks)]
        reached = ranks_of_goal.rank == 0
        if (reached & ~game.at_target(goal)).any():
            raise _error(game, goal, reached & ~game.at_target(goal), "has rank 0 away from the goal")
        best = answers(game, ranks_of_goal)
        wrong = _astray(game, ranks_of_goal, best)
        if wrong.any():
            raise _error(game, goal, wrong, "leads to no lower rank while nothing is owed")
        lost = reached & (_worst(game, answers(game, following)) == LOST)
        lost |= reached & (following.rank < 0)
        if lost.any():
            raise _error(game, goal, lost, "leads from the goal to where the next one is not reached")


def answers(game: Game, ranks: Ranks) -> Numbers:
    """Return the lowest rank (N+1,) to which the ego can get from each position in its turn, or `LOST`."""
    worth = np.where(ranks.rank < 0, LOST, ranks.rank)
    lowest = np.minimum.reduceat(worth[game.ego_to], game.ego_at[:-1])
    return np.append(lowest, LOST).astype(np.int32)


def _astray(game: Game, ranks: Ranks, best: Numbers) -> Flags:
    """Return where (N,) a rank promises what the moves don't keep."""
    count = game.positions
    held = ranks.rank > 0
    layer = np.where(held, ranks.rank, 0)
    below = np.where(held, np.append(ranks.start, LOST)[layer], LOST)
    debt = np.where(held, np.append(ranks.debt, NO_DEBT)[layer], NO_DEBT).astype(np.int16)
    owner = np.repeat(np.arange(count), np.diff(game.owed_at))
    owing = np.zeros(count, dtype=np.bool_)
    owing[owner[game.owed == debt[owner]]] = True
    after = np.searchsorted(ranks.start, ranks.start, side="right").astype(np.int32)
    bound = np.where(owing, np.append(after, LOST)[layer], below)
    return held & (_worst(game, best) >= bound)


def _worst(game: Game, best: Numbers) -> Numbers:
    """Return the highest of `best` (N+1,) to which the environment can bring the ego from each position (N,)."""
    worst = [np.maximum.reduceat(best[turns.to], turns.at[:-1]) for turns in game.turns()]
    return np.concatenate(worst)


def _error(game: Game, goal: int, wrong: Flags, fault: str) -> StrategyError:
    position = int(np.flatnonzero(wrong)[0])
    name = game.board.road_cells.target_name(goal)
    return StrategyError(f"position {position}, on the way to {name}: {fault} ({int(wrong.sum())} such)")
