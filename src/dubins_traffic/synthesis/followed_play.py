"""A counter-play, followed on the road: what the environment does next, whatever time a turn takes there.

In the game the sides move in turn; on the road the ego may go on while the e-agents are still on their way, and they
wait for it. Where the ego has gone elsewhere than in the play, the play goes on from the next place at which the cars
are where they are now, or at least the ego.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from dubins_traffic.errors import InputError
from dubins_traffic.synthesis.board import Board
from dubins_traffic.synthesis.specification import EGO


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
