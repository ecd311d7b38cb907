"""Solving a game: where the ego wins, by which ranks, and where only because the environment can't keep its assumption.

The game is GR(1): if each debt is paid infinitely often, the ego is at each goal infinitely often. It wins in
nu Z . AND_j mu Y . (goal_j and Cpre(Z)) or Cpre(Y) or OR_i nu X . (Cpre(Y or X) and debt_i), after Piterman, Pnueli
and Sa'ar (VMCAI 2006), the goals computed side by side.
"""

from __future__ import annotations

from concurrent.futures import ThreadPoolExecutor, wait
from dataclasses import dataclass, field
from typing import Final

import numpy as np

from dubins_traffic.synthesis.fixpoint import (
    UNRANKED,
    GoalSearch,
    Graph,
    assign_owners,
    forced,
    reach,
    reverse,
)
from dubins_traffic.synthesis.game import WORKERS, Game, Progress, room
from dubins_traffic.synthesis.positions import Cells, Flags, Numbers, Work

LOOK: Final = 0.1
"""Seconds between two looks at how far a search has come."""


@dataclass(frozen=True)
class Ranks:
    """How to get to one goal: move to the position of lowest rank, and wait while the environment owes."""

    rank: Numbers
    """Shape (N,). 0 at the goal, -1 where the ego does not get there."""
    start: Numbers
    """Shape (R,). First rank of the layer of each rank. In a layer the ego waits; otherwise it gets to lower ranks
    in each turn.
    """
    debt: Cells
    """Shape (R,). What the environment owes in a layer (`game.Game.owed`), or -1 where it can't keep the ego in the
    layer.
    """


@dataclass(frozen=True)
class _Ranked:
    """The ranks of a goal, and whether being friendly has cost any position."""

    ranks: Ranks
    unfriendly: bool


@dataclass(frozen=True)
class Loss:
    """Positions that are lost for one goal, once those lost before are avoided."""

    goal: int
    """The goal that the environment can keep from the ego."""
    target: Flags
    """Shape (N,). Where the goal would have counted as reached."""
    lost: Flags
    """Shape (N,). The positions."""


@dataclass(frozen=True)
class Solution:
    """Who wins a game."""

    game: Game
    """The game."""
    winning: Flags
    """Shape (N,). Where the ego wins."""
    vacuous: Flags
    """Shape (N,). Where it wins, but only by bringing the environment to where it can't keep its assumption."""
    ranks: tuple[Ranks, ...]
    """The strategy, one table a goal, for all winning positions that are not vacuous; it never does so."""
    losses: tuple[Loss, ...] = field(repr=False)
    """Why the others are lost, in order; none is lost twice."""

    @property
    def everywhere(self) -> bool:
        """Whether the ego wins from every position."""
        return bool(self.winning.all())


def graph(game: Game) -> Graph:
    """Return what the kernels are given of a game; one thread at a time may use that of a lean game."""
    count = game.positions
    back_at = np.zeros(count + 1, dtype=np.int64)
    back = np.empty(game.ego_to.shape[0], dtype=np.int32)
    reverse(game.ego_at, game.ego_to, back_at, back)
    owner = np.empty(game.owed.shape[0], dtype=np.int32)
    assign_owners(game.owed_at, owner)
    out = room(game.board, 0, 0)
    if not game.lean:
        out = out._replace(to=game.to, moved=game.moved)
    whole = Graph(
        game.lean,
        game.board.tables,
        Work.of(game.board),
        out,
        game.to_at,
        out.to,
        out.moved,
        game.ego_at,
        game.ego_to,
        back_at,
        back,
        game.owed_at,
        game.owed,
        game.owed_mask,
        owner,
    )
    return for_thread(game, whole)


def for_thread(game: Game, shared: Graph) -> Graph:
    """Return a graph for one more thread."""
    if not game.lean:
        return shared
    out = room(game.board, 1, game.most_moves)
    return shared._replace(work=Work.of(game.board), out=out, to=out.to, moved=out.moved)


def solve(game: Game, *, progress: Progress | None = None, workers: int = WORKERS) -> Solution:
    """Return who wins a game, and how.

    Parameters
    ----------
    workers : int
        Threads; no more than there are goals are used.
    """
    solver = _Solver(game, progress, workers)
    friendly, ranks, losses, spoiled = solver.winning(friendly=True)
    winning = friendly
    if spoiled:
        winning, _, losses, _ = solver.winning(friendly=False)
    return Solution(game, winning, winning & ~friendly, ranks, losses)


class _Solver:
    """The outer fixpoint of one game."""

    def __init__(self, game: Game, progress: Progress | None, workers: int) -> None:
        self._game = game
        self._graph = graph(game)
        self._progress = progress
        self._workers = workers

    def winning(self, *, friendly: bool) -> tuple[Flags, tuple[Ranks, ...], tuple[Loss, ...], bool]:
        """Return the winning positions, the ranks, the losses, and whether being friendly has cost any position."""
        count = self._game.positions
        goals = range(len(self._game.board.road_cells.targets))
        won = np.ones(count, dtype=np.bool_)
        ways = [won] * len(goals)
        losses: list[Loss] = []
        spoiled = False
        while True:
            targets = self._targets(won)
            ranked_goals = self._searched(targets, friendly)
            spoiled = spoiled or any(way.unfriendly for way in ranked_goals)
            ways = [way.ranks.rank != UNRANKED for way in ranked_goals]
            before = won
            for goal in goals:
                lost = won & ~ways[goal]
                if lost.any():
                    losses.append(Loss(goal, targets[goal], lost))
                won = won & ways[goal]
            if won.sum() in (before.sum(), 0):
                return won, tuple(_within(way.ranks, won) for way in ranked_goals), tuple(losses), spoiled

    def _targets(self, won: Flags) -> list[Flags]:
        """Return, for each goal, where it has been reached and the ego stays where it has won."""
        targets = [self._game.at_target(goal) for goal in range(len(self._game.board.road_cells.targets))]
        if won.all():
            return targets
        kept = np.empty(won.shape, dtype=np.bool_)
        ready = np.empty(len(won) + 1, dtype=np.uint8)
        forced(self._graph, won, ready, kept)
        return [target & kept for target in targets]

    def _searched(self, targets: list[Flags], friendly: bool) -> list[_Ranked]:
        """Return the ways to all goals: side by side, or for the sake of memory one after the other."""
        if not self._game.lean:
            return self._side_by_side(targets, friendly, "solve")
        ranked: list[_Ranked] = []
        for k, target in enumerate(targets):
            ranked += self._side_by_side([target], friendly, f"solve, goal {k + 1} of {len(targets)}")
        return ranked

    def _side_by_side(self, targets: list[Flags], friendly: bool, what: str) -> list[_Ranked]:
        """Return the ways to these targets; interrupted by Ctrl-C."""
        game = self._game
        searches = [GoalSearch.of(game.positions, game.owed.shape[0], game.debts) for _ in targets]
        with ThreadPoolExecutor(self._workers) as pool:
            try:
                cells = game.board.road_cells.cells
                running = {
                    pool.submit(reach, for_thread(game, self._graph), target, cells, friendly, search)
                    for target, search in zip(targets, searches, strict=True)
                }
                while running:
                    done, running = wait(running, timeout=LOOK)
                    self._tell(searches, what)
                    for future in done:
                        future.result()
            except BaseException:
                for search in searches:
                    search.control[0].stopped = 1
                raise
        return [_ranked(search) for search in searches]

    def _tell(self, searches: list[GoalSearch], what: str) -> None:
        if self._progress:
            ranked = sum(int(search.control[0].ranked) for search in searches)
            self._progress(what, ranked / (len(searches) * self._game.positions))


def _ranked(search: GoalSearch) -> _Ranked:
    """Return what a search has found; its room may go."""
    used = int(search.control[0].next_rank)
    ranks = Ranks(search.rank, search.start[:used].copy(), search.debt[:used].copy())
    return _Ranked(ranks, bool(search.control[0].unfriendly))


def _within(ranks: Ranks, won: Flags) -> Ranks:
    """Return the ranks of the positions that are won."""
    rank = np.where(won, ranks.rank, np.int32(UNRANKED)).astype(np.int32, copy=False)
    return Ranks(rank, ranks.start, ranks.debt)
