"""What a strategy says to an ego before an intersection: whether to enter, and which way out it likes best."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

from dubins_traffic.synthesis.board import Board
from dubins_traffic.synthesis.road_play import EGO_CAR, RoadPlay
from dubins_traffic.synthesis.strategy import Strategy


@dataclass(frozen=True, slots=True)
class Advice:
    """What to do at the end of a lane.

    Attributes
    ----------
    node : int
        The intersection ahead.
    enter : bool
        Whether to enter it as soon as the rules allow, or to wait.
    exits : tuple of int
        Lanes out that are free in the game, the best first; empty where the ego may not enter yet.
    """

    node: int
    enter: bool
    exits: tuple[int, ...]


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
    strategy : Strategy
        The ego's.
    play : RoadPlay
        Where the play is.
    goal, following : int
        The goal that is sought, and the one to seek after it (places in `Arena.goals`).
    """
    board = strategy.board
    nodes = len(board.arena.nodes)
    position, cell = play.position, play.cells[EGO_CAR]
    if position is None or cell < nodes or not strategy.wins(position):
        return None
    node = board.arena.lane_end[cell - nodes][0]
    options = play.moves.of_ego(position)
    if len(options) == 1:
        return Advice(node, True, ())
    inside = options[1]
    own = strategy.ranks[goal].rank
    after = strategy.ranks[following if own[inside] == 0 else goal].rank
    free = [
        lane
        for lane in board.arena.nodes[node].exits
        if nodes + lane not in play.cells or nodes + lane == cell
    ]
    ways = zip(free, play.moves.of_ego(inside)[1:], strict=True)
    ranked = sorted((int(after[then]), lane) for lane, then in ways if after[then] >= 0)
    enters = own[inside] >= 0 and (own[position] < 0 or own[inside] <= own[position])
    return Advice(node, bool(enters), tuple(lane for _, lane in ranked))
