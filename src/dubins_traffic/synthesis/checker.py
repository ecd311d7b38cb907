"""Is a strategy right? A check of its ranks against the game, move by move; nothing of the solver is used.

The conditions are local, and together they suffice. Where a goal has not been reached, whatever the environment does,
the ego can get to a rank below the layer, or it stays in the layer and the environment owes what the layer says. Layers
fall only finitely often, so a play that never reaches the goal stays in one layer, where one debt is owed for ever: the
environment has failed. Where the goal has been reached, the ego stays where the next goal has ranks.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from dubins_traffic.errors import DubinsTrafficError
from dubins_traffic.synthesis.arrays import Flags, Numbers
from dubins_traffic.synthesis.game import Game
from dubins_traffic.synthesis.search import NO_DEBT
from dubins_traffic.synthesis.solver import Ranks

LOST = np.int32(2**31 - 1)
"""Stands for no rank, so that less is better."""


class StrategyError(DubinsTrafficError):
    """A strategy does not do what it promises; the message names a position and a goal."""


def check(game: Game, ranks: Sequence[Ranks]) -> None:
    """Check that the ego wins by these ranks from every position that has one.

    Parameters
    ----------
    game : Game
        The game.
    ranks : sequence of Ranks
        One table a goal.

    Raises
    ------
    StrategyError
        If it does not: names the first position where a condition above fails.
    """
    for goal, own in enumerate(ranks):
        following = ranks[(goal + 1) % len(ranks)]
        reached = own.rank == 0
        if (reached & ~game.at_target(goal)).any():
            raise _error(game, goal, reached & ~game.at_target(goal), "has rank 0 away from the goal")
        best = answers(game, own)
        wrong = _astray(game, own, best)
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
    name = game.board.arena.target_name(goal)
    return StrategyError(f"position {position}, on the way to {name}: {fault} ({int(wrong.sum())} such)")
