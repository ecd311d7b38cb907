"""A machine of another tool, followed on the road: where it is in its play, and what it says to do.

In the game both sides move in turn; on the road a turn takes as long as it takes. So the machine is asked anew with
each change, and goes on by a turn only when the ego has done what it said, or when it said to stay. Where the
play is none that it can be in, as when an assumed place has been revised, a state is taken in which some play of the
game could have come there; if there is none, the machine does not win. A machine that begins elsewhere than the ego,
or answers a move of the game by none of its own, is at fault, unless somebody is there to drive in its place.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Final, NamedTuple

from dubins_traffic.errors import DubinsTrafficError
from dubins_traffic.synthesis.board import Board
from dubins_traffic.synthesis.foreign.machine import Letter, Machine, Sides, State
from dubins_traffic.synthesis.road_play import MoveList, RoadPlay
from dubins_traffic.synthesis.specification import EGO, car_bits, inputs_of, order_name
from dubins_traffic.synthesis.strategy import Advice


class PlayPosition(NamedTuple):
    """A position by number, and the cell of each car, the ego's first."""

    position: int
    cells: tuple[int, ...]


class Labelled:
    """The game with cars that have names."""

    def __init__(self, board: Board, moves: MoveList) -> None:
        self.board = board
        self._moves = moves
        self._bits = [car_bits(car, board.road_cells.cells) for car in range(board.others + 1)]
        self._inputs = frozenset(inputs_of(board))

    def letter(self, place: PlayPosition) -> Letter:
        """Return what the environment says of a place: the cells of its cars and the order among them."""
        bits = {
            name: bool(cell >> bit & 1)
            for names, cell in zip(self._bits[1:], place.cells[1:], strict=True)
            for bit, name in enumerate(names)
        }
        orders = dict.fromkeys((name for name in self._inputs if name not in bits), False)
        for first, second in self._before(place):
            if EGO not in (first, second) and first < second:
                orders[order_name(first, second)] = True
        return bits | {name: value for name, value in orders.items() if name in self._inputs}

    def _before(self, place: PlayPosition) -> Iterator[tuple[int, int]]:
        """Yield who waits before whom at a crossing."""
        nodes = self.board.road_cells.nodes
        car_in = {cell: car for car, cell in enumerate(place.cells)}
        for node, scene in zip(nodes, self.board.scenes(place.position), strict=True):
            queue = [car_in[len(nodes) + node.inbound[slot]] for slot, _ in scene.queue]
            if node.crossing:
                yield from ((one, other) for k, one in enumerate(queue) for other in queue[k + 1 :])

    def ego_cell(self, answer: Letter) -> int:
        """Return the cell to which an answer sends the ego; propositions that are missing count as false."""
        return sum(answer.get(name, False) << bit for bit, name in enumerate(self._bits[EGO]))

    def moved(self, place: PlayPosition, cell: int) -> PlayPosition | None:
        """Return the place after the ego has gone to a cell, None if it may not."""
        cell_now = place.cells[EGO]
        if cell == cell_now:
            return place
        options = self._moves.of_ego(place.position)[1:]
        road_cells, nodes = self.board.road_cells, len(self.board.road_cells.nodes)
        if cell_now < nodes:
            free = [
                nodes + lane for lane in road_cells.nodes[cell_now].exits if nodes + lane not in place.cells
            ]
        else:
            free = [road_cells.lane_end[cell_now - nodes][0]]
        ways = dict(zip(free, options, strict=False))
        return PlayPosition(ways[cell], (cell, *place.cells[1:])) if cell in ways else None

    def turns(self, place: PlayPosition) -> Iterator[PlayPosition]:
        """Yield the places that the environment may make of one, itself among them."""
        for position in sorted(self._moves.of_others(place.position)):
            if position < self.board.positions:
                yield from self._named(place, position)

    def _named(self, place: PlayPosition, position: int) -> Iterator[PlayPosition]:
        """Yield the ways in which named cars may come to a position."""
        taken = self._taken(position) - {place.cells[EGO]}
        for cells in self._assigned(place.cells[1:], taken):
            yield PlayPosition(position, (place.cells[EGO], *cells))

    def _taken(self, position: int) -> frozenset[int]:
        """Return the cells that are taken in a position."""
        nodes = self.board.road_cells.nodes
        cells: set[int] = set()
        for number, (node, scene) in enumerate(zip(nodes, self.board.scenes(position), strict=True)):
            if scene.inside is not None:
                cells.add(number)
            slots = [*(slot for slot, _ in scene.queue), *scene.parked]
            cells |= {len(nodes) + node.inbound[slot] for slot in slots}
        return frozenset(cells)

    def _assigned(self, cells: Sequence[int], taken: frozenset[int]) -> Iterator[tuple[int, ...]]:
        """Yield the cells to which cars may have gone such that they take just these, each one of its own."""
        if not cells:
            yield ()
            return
        first, *rest = cells
        for cell in (first, *self.board.road_cells.following(first)):
            if cell in taken:
                for others in self._assigned(rest, taken - {cell}):
                    yield (cell, *others)

    def follows(self, before: PlayPosition, after: PlayPosition) -> bool:
        """Say whether the environment may have made one place of another, whose ego is where it was."""
        if before.cells[EGO] != after.cells[EGO]:
            return False
        steps = zip(before.cells[1:], after.cells[1:], strict=True)
        near = all(one == other or other in self.board.road_cells.following(one) for one, other in steps)
        return near and after.position in self._moves.of_others(before.position)


def misfit(board: Board, machine: Machine) -> tuple[str, str] | None:
    """Return a proposition in which a machine and a game differ, and how; None if there is none."""
    bits = car_bits(EGO, board.road_cells.cells)
    its_inputs = {*bits, *(order_name(EGO, car) for car in range(1, board.others + 1))}
    known = its_inputs.union(inputs_of(board))
    for name in machine.names:
        if name not in known:
            return name, "a strategy for another problem"
    for name in bits:
        if name not in machine.names:
            return name, "a strategy for another problem"
    sides = machine.sides or Sides((), ())
    for name in sides.read:
        if name in its_inputs:
            return name, "a strategy that reads what the ego chooses"
    for name in sides.answered:
        if name not in its_inputs:
            return name, "a strategy that chooses for the others"
    return None


MOST_PLACES: Final = 100_000
"""Places with states of the machine that are looked at in advance."""


@dataclass(frozen=True, slots=True)
class Turn:
    """The ego's turn: the machine in `state` reads `place`, which the environment has made of `before`."""

    before: PlayPosition
    place: PlayPosition
    state: State


@dataclass(frozen=True, slots=True)
class _Answer:
    """What a machine says: its next state, and the place after the ego's move."""

    state: State
    place: PlayPosition


class MachineAdviser:
    """What a machine says to the ego, in one trial.

    Parameters
    ----------
    fallback : bool
        Whether the ego goes on without the machine where that makes no move of the game.
    """

    def __init__(self, board: Board, machine: Machine, *, fallback: bool = False) -> None:
        self.board = board
        self._machine = machine
        self._fallback = fallback
        self._game: Labelled | None = None
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
        answer = self._answer(turn.place, turn.state)
        if answer is None or answer.place.cells[EGO] != node:
            return Advice(node, False, ())
        after = self._answer_in_time(answer.place, answer.state)
        out = answer.place if after is None else after.place
        exits = () if out.cells[EGO] == node else (out.cells[EGO] - nodes,)
        return Advice(node, True, exits)

    def _follow(self, play: RoadPlay) -> None:
        """Bring the machine to where the play is."""
        if play.position is None:
            return
        if self._game is None:
            self._game = Labelled(self.board, play.moves)
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
            if self._answer(turn.place, turn.state) is None:
                self._turn = None
                if self._sure:
                    self._stray(self._wrong_move(turn))

    def _begin(self, place: PlayPosition) -> None:
        """Let the machine read the first letter, to which it answers with the cell in which the ego starts."""
        first = self._machine.step(self._machine.begin(), self._labelled.letter(place))
        if first is None:
            self._stray("has no answer to the first position")
            return
        cell = self._labelled.ego_cell(first[1])
        if cell != place.cells[EGO]:
            self._stray(f"begins in cell {cell}, and the ego starts in cell {place.cells[EGO]}")
            return
        self._turn = Turn(place, place, first[0])
        self._explore(place, first[0])

    @property
    def _labelled(self) -> Labelled:
        assert self._game is not None
        return self._game

    def _stray(self, what: str) -> None:
        """Take note that the machine makes no move of the game."""
        if not self._fallback:
            advice = "with +fallback behind its file, the ego goes on by the rules"
            raise DubinsTrafficError(f"the strategy {what} ({advice})")

    def _wrong_move(self, turn: Turn) -> str:
        """Say what the machine answers in a turn in which that is no move of the game."""
        step = self._machine.step(turn.state, self._labelled.letter(turn.place))
        if step is None:
            return f"has no answer where the cars are in cells {turn.place.cells}"
        way = f"from cell {turn.place.cells[EGO]} to cell {self._labelled.ego_cell(step[1])}"
        return f"sends the ego {way}, which is no move of the game"

    def _followed(self, place: PlayPosition) -> Turn | None:
        """Return the turn at a place to which the play has led by moves of the game, None if there is none."""
        old = self._turn
        if old is None:
            return None
        answer = self._answer(old.place, old.state)
        if answer is not None and answer.place.cells[EGO] == place.cells[EGO]:
            if answer.place == place or self._labelled.follows(answer.place, place):
                return Turn(answer.place, place, answer.state)
        elif self._labelled.follows(old.before, place):
            return Turn(old.before, place, old.state)
        return None

    def _waited(self, turn: Turn) -> Turn:
        """Return the turn after those in which the ego stays and nobody else moves; the same if it stays for ever."""
        seen: set[State] = set()
        now = turn
        while now.state not in seen:
            seen.add(now.state)
            answer = self._answer(now.place, now.state)
            if answer is None or answer.place != now.place:
                return now
            now = Turn(now.place, now.place, answer.state)
        return turn

    def _answer_in_time(self, place: PlayPosition, state: State) -> _Answer | None:
        """Return the first answer that moves the ego, if nobody else moves; None if it stays for ever."""
        turn = self._waited(Turn(place, place, state))
        answer = self._answer(turn.place, turn.state)
        return None if answer is None or answer.place == place else answer

    def _answer(self, place: PlayPosition, state: State) -> _Answer | None:
        """Return what the machine answers to a place; None if nothing, or a move that is none of the game."""
        step = self._machine.step(state, self._labelled.letter(place))
        if step is None:
            return None
        after = self._labelled.moved(place, self._labelled.ego_cell(step[1]))
        return None if after is None else _Answer(step[0], after)

    def _explore(self, place: PlayPosition, state: State) -> None:
        """Note in which states the machine may be where, in the plays from a place."""
        waiting: deque[tuple[PlayPosition, State]] = deque([(place, state)])
        seen = {(place, state)}
        while waiting and len(seen) < MOST_PLACES:
            here, now = waiting.popleft()
            for turn in self._labelled.turns(here):
                states = self._known.setdefault(turn, [])
                if now in states:
                    continue
                states.append(now)
                answer = self._answer(turn, now)
                if answer is not None and (answer.place, answer.state) not in seen:
                    seen.add((answer.place, answer.state))
                    waiting.append((answer.place, answer.state))
