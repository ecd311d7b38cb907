"""Is a recorded trial a play of the game of cells? The relation is that of docs/theory.md#the-game-and-the-road."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import asdict, dataclass
from typing import TYPE_CHECKING, Any, Final

import numpy as np

from dubins_traffic.cars.state import EGO
from dubins_traffic.errors import InputError
from dubins_traffic.synthesis.board import Board
from dubins_traffic.synthesis.instance import board_of
from dubins_traffic.synthesis.road_play import (
    NEW_TICKET,
    UNKNOWN_MOVE,
    WAITS,
    RoadPlay,
    Sight,
    Sighting,
    sighted,
)

if TYPE_CHECKING:
    from dubins_traffic.problem.instance import Problem
    from dubins_traffic.record.reader import Record
    from dubins_traffic.record.sink import Frames
    from dubins_traffic.scoring.verdict import Verdict, Violation

MOST_POSITIONS: Final = 2**31 - 1
"""Positions of the largest game whose moves are looked up; they are numbered in 32 bits."""


@dataclass(frozen=True, slots=True)
class UnknownMove:
    """A move on the road that is none of the game: when, seconds; which; and a breach of a rule by then, if any."""

    time: float
    move: str
    breach: str | None


@dataclass(frozen=True, slots=True)
class Relation:
    """What a trial is as a play of the game.

    Attributes
    ----------
    moves : int
        How many moves of cars have been looked up.
    unknown : UnknownMove, optional
        The first that the game does not know.
    renewed, reordered : int
        How often a car gave up its place in an order, which the rules allow once in a wait and this game never, and how
        often the order was another than that in which cars had come into their lanes, as in the game.
    crowded : float
        Share of the frames in which two cars were in one cell, so that a place had to be assumed for one.
    longest_move : float
        Longest time in which the ego could move in the game until it did, or the trial ended, seconds.
    """

    moves: int
    unknown: UnknownMove | None
    renewed: int
    reordered: int
    crowded: float
    longest_move: float

    @property
    def related(self) -> bool:
        """Whether each move is one of the game, up to the first breach of a rule."""
        return self.unknown is None or self.unknown.breach is not None

    def to_json(self) -> dict[str, Any]:
        """Return the relation as a JSON object."""
        return {"related": self.related, **asdict(self)}


def checked_board(problem: Problem) -> Board:
    """Return the board of a problem's game.

    InputError if the problem has no goals or no other cars, or the game has more than `MOST_POSITIONS` positions.
    """
    if not problem.e_agents:
        raise InputError("no e-agents, so there is no game", field="e-agents", expected="at least one")
    board = board_of(problem)
    if board.positions > MOST_POSITIONS:
        raise InputError(
            "too large a game to look moves up", value=f"{board.positions} positions",
            expected=f"at most {MOST_POSITIONS}, as with fewer e-agents or intersections",
        )  # fmt: skip
    return board


def relate(record: Record, verdict: Verdict) -> Relation:
    """Follow a trial as a play of the game of cells, with all cars in view.

    Parameters
    ----------
    record : Record
        The trial, with the labels that follow from its poses (`verification.worlds.from_poses`).
    verdict : Verdict
        Its judgement.

    Raises
    ------
    InputError
        As `checked_board`.
    """
    instance, frames = record.instance, record.frames
    board = checked_board(instance.problem)
    sight = Sight.of_all(frames.rate)
    play = RoadPlay(board, sight, instance.names)
    first = min(verdict.violations, key=lambda breach: breach.time, default=None)
    unknown: UnknownMove | None = None
    renewed = crowded = longest = 0
    cell, since, before = -1, -1, 0
    for tick, cars in _sightings(frames, sight.look):
        crowded += (tick - before) * play.is_crowded
        before = tick
        play.follow(tick, cars)
        for kind, detail in play.noted:
            renewed += kind == NEW_TICKET
            if kind == UNKNOWN_MOVE and unknown is None:
                unknown = _unknown(tick / frames.rate, detail, first)
        play.noted.clear()
        if play.cells[EGO] != cell:
            longest = max(longest, tick - since if since >= 0 else 0)
            cell, since = play.cells[EGO], -1
        may = play.position is not None and play.is_shown(EGO) and len(play.moves.of_ego(play.position)) > 1
        since = -1 if not may else tick if since < 0 else since
    last = len(frames) - 1
    longest = max(longest, last - since if since >= 0 else 0)
    crowded += (last - before) * play.is_crowded
    share = crowded / last if last > 0 else 0.0
    return Relation(play.checked, unknown, renewed, play.reordered, share, longest / frames.rate)


def _unknown(time: float, move: str, first: Violation | None) -> UnknownMove:
    by_then = None if first is None or first.time > time else f"{first.car} broke {first.rule}"
    return UnknownMove(time, move, by_then)


def _sightings(frames: Frames, look: int) -> Iterator[tuple[int, list[Sighting]]]:
    """Yield the frames in which a car comes into another cell or waits otherwise, and one every `look` ticks."""
    waits = frames.bits & WAITS
    changed = np.zeros(len(frames), dtype=bool)
    changed[::look] = True
    for column in (frames.crosses, frames.lane, waits):
        changed[1:] |= (column[1:] != column[:-1]).any(axis=1)
    state, labels = frames.states
    for tick in np.flatnonzero(changed).tolist():
        yield tick, [sighted(tick, n, state, labels) for n in range(frames.x.shape[1])]
