"""Counterstrategies: how the environment keeps the ego from a goal where it can, and keeps its own assumption.

From a position that is lost for a goal (`solver.Loss`) the environment has, for each debt, moves that pay it after some
turns, while the ego does not get to where it would win. The environment pays its debts in turn.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from dubins_traffic.errors import InputError
from dubins_traffic.kernels.arrays import Ints
from dubins_traffic.synthesis.arrays import Flags, Numbers
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
        return self.solution.game.turns_of(position).astype(np.int64)

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
        rows, ends = self._safe_moves(owing, self._keeping(level))
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

    def _safe_moves(self, positions: Ints, safe: Flags) -> tuple[Ints, Numbers]:
        """Return the moves of the environment from sorted `positions` to where it is `safe`: places in it, and ends."""
        rows: list[Ints] = []
        ends: list[Numbers] = []
        for turns in self.solution.game.turns():
            low, high = np.searchsorted(positions, (turns.first, turns.first + len(turns.at) - 1))
            own = positions[low:high] - turns.first
            row, edge = _edges(turns.at, own)
            good = safe[turns.to[edge]]
            rows.append(row[good] + low)
            ends.append(turns.to[edge[good]])
        return np.concatenate(rows), np.concatenate(ends)

    def _worst(self, reached: Ints, turns: Ints) -> Ints:
        """Return the most turns that the ego can make of each of the positions reached."""
        game = self.solution.game
        inner = reached[reached < game.positions]
        rows, edges = _edges(game.ego_at, inner)
        worst = np.zeros(reached.size, dtype=np.int64)
        np.maximum.at(worst, rows, turns[game.ego_to[edges]])
        return worst


def _edges(at: Ints, positions: Ints) -> tuple[Ints, Ints]:
    """Return all edges from `positions`, those from p being at[p] to at[p + 1]: places in `positions`, and edges."""
    sizes = at[positions + 1] - at[positions]
    rows = np.repeat(np.arange(positions.size), sizes)
    starts = np.cumsum(sizes) - sizes
    return rows, np.arange(rows.size) - starts[rows] + at[positions][rows]
