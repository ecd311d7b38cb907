"""Counterstrategies: how the environment keeps the ego from a goal where it can, and keeps its own assumption.

From a position that is lost for a goal (`solver.Loss`) the environment has, for each debt, moves that pay it after some
turns, while the ego does not get to where it would win. The environment pays its debts in turn.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from dubins_traffic.errors import InputError
from dubins_traffic.kernels.arrays import Ints
from dubins_traffic.synthesis.arrays import Flags
from dubins_traffic.synthesis.solver import Solution

NEVER = np.int64(2**62)
"""Turns until a debt is paid that the environment can't pay."""


@dataclass
class Counterstrategy:
    """How the environment wins a game where the ego does not.

    Parameters
    ----------
    solution : Solution
        Who wins.
    """

    solution: Solution
    _safe: dict[int, Flags] = field(default_factory=dict[int, Flags], repr=False)
    _turns: dict[tuple[int, int], Ints] = field(default_factory=dict[tuple[int, int], Ints], repr=False)

    def level(self, position: int) -> int:
        """Return which of the losses a position belongs to.

        Raises
        ------
        InputError
            If the ego wins there.
        """
        for level, loss in enumerate(self.solution.losses):
            if loss.lost[position]:
                return level
        raise InputError("the ego wins there", field="position", value=position, expected="a lost position")

    def debts(self, position: int) -> list[int]:
        """Return what is owed in a position."""
        game = self.solution.game
        return game.owed[game.owed_at[position] : game.owed_at[position + 1]].tolist()

    def choose(self, position: int, debt: int) -> tuple[int, int]:
        """Return the position after the environment's turn, and the debt that it means to pay next.

        Parameters
        ----------
        position : int
            A lost position.
        debt : int
            What the environment has meant to pay last.
        """
        level = self.level(position)
        owed = self.debts(position)
        if debt not in owed and owed:
            later = [other for other in owed if other > debt]
            debt = min(later or owed)
        moves = self._moves(position)
        moves = moves[self._keeping(level)[moves]]
        if debt not in owed:
            return int(moves[0]), debt
        turns = self._until(level, debt)
        answers = [self._answers(move) for move in moves.tolist()]
        worst = np.array([max((turns[after] for after in own), default=0) for own in answers])
        return int(moves[np.argmin(worst)]), debt

    def _moves(self, position: int) -> Ints:
        game = self.solution.game
        return game.to[game.to_at[position] : game.to_at[position + 1]].astype(np.int64)

    def _answers(self, position: int) -> list[int]:
        game = self.solution.game
        if position == game.positions:
            return []
        return game.ego_to[game.ego_at[position] : game.ego_at[position + 1]].tolist()

    def _lost_by(self, level: int) -> Flags:
        """Return which positions (N,) are lost by that level."""
        return np.logical_or.reduce([loss.lost for loss in self.solution.losses[: level + 1]])

    def _keeping(self, level: int) -> Flags:
        """Return from which positions (N+1,) all moves of the ego lead to where it has lost by that level."""
        if level not in self._safe:
            game = self.solution.game
            lost = self._lost_by(level)
            kept = np.logical_and.reduceat(lost[game.ego_to], game.ego_at[:-1])
            self._safe[level] = np.append(kept, True)
        return self._safe[level]

    def _until(self, level: int, debt: int) -> Ints:
        """Return in how many turns (N,) the environment pays a debt, whatever the ego does; 0 where it is not owed."""
        key = level, debt
        if key not in self._turns:
            self._turns[key] = self._paid(level, debt)
        return self._turns[key]

    def _paid(self, level: int, debt: int) -> Ints:
        game = self.solution.game
        owner = np.repeat(np.arange(game.positions), np.diff(game.owed_at))
        turns = np.zeros(game.positions, dtype=np.int64)
        owing = owner[game.owed == debt]
        owing = owing[self.solution.losses[level].lost[owing]]
        turns[owing] = NEVER
        safe = self._keeping(level)
        sizes = game.to_at[owing + 1] - game.to_at[owing]
        rows = np.repeat(np.arange(owing.size), sizes)
        starts = np.cumsum(sizes) - sizes
        edges = np.arange(rows.size) - starts[rows] + game.to_at[owing][rows]
        good = safe[game.to[edges]]
        rows, ends = rows[good], game.to[edges][good]
        reached, place = np.unique(ends.astype(np.int64), return_inverse=True)
        turn = 0
        while True:
            turn += 1
            worst = self._worst(reached, turns)
            best = np.full(owing.size, NEVER)
            np.minimum.at(best, rows, worst[place])
            new = (turns[owing] == NEVER) & (best < NEVER)
            if not new.any():
                return turns
            turns[owing[new]] = turn

    def _worst(self, reached: Ints, turns: Ints) -> Ints:
        """Return the most turns that the ego can make of each of the positions reached."""
        game = self.solution.game
        inner = reached[reached < game.positions]
        sizes = game.ego_at[inner + 1] - game.ego_at[inner]
        starts = np.cumsum(sizes) - sizes
        rows = np.repeat(np.arange(inner.size), sizes)
        edges = np.arange(rows.size) - starts[rows] + game.ego_at[inner][rows]
        worst = np.zeros(reached.size, dtype=np.int64)
        if inner.size:
            worst[: inner.size] = np.maximum.reduceat(turns[game.ego_to[edges]], starts)
        return worst
