"""A machine of another tool, followed on the road: where it is in its play, and what it says to do.

In the game both sides move in turn; on the road a turn takes as long as it takes. So the machine is asked anew with
each change, and goes on by a turn only when the ego has done what it said, or when it said to stay. Where the
play is none that it can be in, as when an assumed place has been revised, a state is taken in which some play of the
game could have come there; if there is none, the machine does not win. A machine that begins elsewhere than the ego,
or answers a move of the game by none of its own, is at fault, unless somebody is there to drive in its place.
"""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass
from typing import Final

from dubins_traffic.errors import DubinsTrafficError
from dubins_traffic.synthesis.board import Board
from dubins_traffic.synthesis.foreign.machine import Machine, State
from dubins_traffic.synthesis.foreign.player import Answer, Labelled, MachinePlayer, PlayPosition
from dubins_traffic.synthesis.road_play import MoveList, RoadPlay
from dubins_traffic.synthesis.specification import EGO
from dubins_traffic.synthesis.strategy import Advice

MOST_PLACES: Final = 100_000
"""Places with states of the machine that are looked at in advance."""


@dataclass(frozen=True, slots=True)
class Turn:
    """The ego's turn: the machine in `state` reads `place`, which the environment has made of `before`."""

    before: PlayPosition
    place: PlayPosition
    state: State


class MachineAdviser:
    """What a machine says to the ego, in one trial.

    Parameters
    ----------
    fallback : bool
        Whether the ego goes on without the machine where that makes no move of the game.
    """

    def __init__(self, board: Board, machine: Machine, *, fallback: bool = False) -> None:
        self.board = board
        self._game = Labelled(board, MoveList(board))
        self._player = MachinePlayer(self._game, machine)
        self._fallback = fallback
        self._turn: Turn | None = None
        self._begun = False
        self._sure = True
        self._known: dict[PlayPosition, list[State]] = {}

    def wins(self, play: RoadPlay) -> bool:
        """Say whether the machine has an answer where a play is; the errors are those of `advise`."""
        self._follow(play)
        return self._turn is not None

    def advise(self, play: RoadPlay, goal: int, following: int) -> Advice | None:  # noqa: ARG002
        """Return what the machine says, None where the ego is at no lane's end or where it has no answer.

        It seeks goals in an order of its own, so `goal` and `following` don't matter.

        DubinsTrafficError if the machine begins elsewhere, or has made no move of the game, and there is no fallback.
        """
        self._follow(play)
        turn, nodes = self._turn, len(self.board.road_cells.nodes)
        if turn is None or play.cells[EGO] < nodes or turn.place.cells != tuple(play.cells):
            return None
        node = self.board.road_cells.lane_end[play.cells[EGO] - nodes][0]
        answer = self._player.answer(turn.place, turn.state)
        if answer is None or answer.place.cells[EGO] != node:
            return Advice(node, False, ())
        after = self._answer_in_time(answer.place, answer.memory)
        out = answer.place if after is None else after.place
        exits = () if out.cells[EGO] == node else (out.cells[EGO] - nodes,)
        return Advice(node, True, exits)

    def _follow(self, play: RoadPlay) -> None:
        """Bring the machine to where the play is."""
        if play.position is None:
            return
        place = PlayPosition(play.position, tuple(play.cells))
        if not self._begun:
            self._begun = True
            self._begin(place)
        elif self._turn is None or self._turn.place != place:
            followed = self._followed(place)
            self._sure = followed is not None
            guessed = (Turn(place, place, state) for state in self._known.get(place, ()))
            self._turn = followed or next(guessed, None)
        if self._turn is not None:
            turn = self._waited(self._turn)
            self._turn = turn
            if self._player.answer(turn.place, turn.state) is None:
                self._turn = None
                if self._sure:
                    self._stray(self._player.why_no_move(turn.place, turn.state))

    def _begin(self, place: PlayPosition) -> None:
        """Let the machine begin where the ego starts."""
        first = self._player.begin(place)
        if first is None:
            self._stray(self._player.why_no_beginning(place))
            return
        self._turn = Turn(place, place, first)
        self._explore(place, first)

    def _stray(self, what: str) -> None:
        """Take note that the machine makes no move of the game."""
        if not self._fallback:
            advice = "with +fallback behind its file, the ego goes on by the rules"
            raise DubinsTrafficError(f"the strategy {what} ({advice})")

    def _followed(self, place: PlayPosition) -> Turn | None:
        """Return the turn at a place to which the play has led by moves of the game, None if there is none."""
        old = self._turn
        if old is None:
            return None
        answer = self._player.answer(old.place, old.state)
        if answer is not None and answer.place.cells[EGO] == place.cells[EGO]:
            if answer.place == place or self._game.follows(answer.place, place):
                return Turn(answer.place, place, answer.memory)
        elif self._game.follows(old.before, place):
            return Turn(old.before, place, old.state)
        return None

    def _waited(self, turn: Turn) -> Turn:
        """Return the turn after those in which the ego stays and nobody else moves; the same if it stays for ever."""
        seen: set[State] = set()
        now = turn
        while now.state not in seen:
            seen.add(now.state)
            answer = self._player.answer(now.place, now.state)
            if answer is None or answer.place != now.place:
                return now
            now = Turn(now.place, now.place, answer.memory)
        return turn

    def _answer_in_time(self, place: PlayPosition, state: State) -> Answer | None:
        """Return the first answer that moves the ego, if nobody else moves; None if it stays for ever."""
        turn = self._waited(Turn(place, place, state))
        answer = self._player.answer(turn.place, turn.state)
        return None if answer is None or answer.place == place else answer

    def _explore(self, place: PlayPosition, state: State) -> None:
        """Note in which states the machine may be where, in the plays from a place."""
        waiting: deque[tuple[PlayPosition, State]] = deque([(place, state)])
        seen = {(place, state)}
        while waiting and len(seen) < MOST_PLACES:
            here, now = waiting.popleft()
            for turn in self._game.turns(here):
                states = self._known.setdefault(turn, [])
                if now in states:
                    continue
                states.append(now)
                answer = self._player.answer(turn, now)
                if answer is not None and (answer.place, answer.memory) not in seen:
                    seen.add((answer.place, answer.memory))
                    waiting.append((answer.place, answer.memory))
