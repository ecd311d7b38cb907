"""The game with cars that have names, and a machine of another tool that makes its moves in it."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import NamedTuple

from dubins_traffic.errors import InputError
from dubins_traffic.synthesis.board import Board
from dubins_traffic.synthesis.foreign.machine import Letter, Machine, Sides, State
from dubins_traffic.synthesis.road_play import MoveList
from dubins_traffic.synthesis.specification import EGO, car_bits, inputs_of, order_name, outputs_of


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

    def is_ego_last(self, place: PlayPosition) -> bool:
        """Tell whether nobody waits behind the ego, as the specification has it at the start."""
        return all(first != EGO for first, _ in self._before(place))

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

    def options(self, place: PlayPosition) -> list[int]:
        """Return the positions that the ego may make of a place, that in which it stays first."""
        return self._moves.of_ego(place.position)

    def moved(self, place: PlayPosition, cell: int) -> PlayPosition | None:
        """Return the place after the ego has gone to a cell, None if it may not."""
        cell_now = place.cells[EGO]
        if cell == cell_now:
            return place
        options = self.options(place)[1:]
        road_cells, nodes = self.board.road_cells, len(self.board.road_cells.nodes)
        if cell_now < nodes:
            free = [nodes + lane for lane in road_cells.nodes[cell_now].exits if nodes + lane not in place.cells]
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


def check_fit(board: Board, machine: Machine) -> None:
    """Refuse a machine whose propositions are not those of a game; InputError names one in which they differ."""
    bits = car_bits(EGO, board.road_cells.cells)
    its_inputs = {*bits, *(order_name(EGO, car) for car in range(1, board.others + 1))}
    known = its_inputs.union(inputs_of(board))
    sides = machine.sides or Sides((), ())
    faults = (
        *((name, "for another problem") for name in machine.names if name not in known),
        *((name, "for another problem") for name in bits if name not in machine.names),
        *((name, "that reads what the ego chooses") for name in sides.read if name in its_inputs),
        *((name, "that chooses for the others") for name in sides.answered if name not in its_inputs),
    )
    if faults:
        name, how = faults[0]
        expected = f"to read {', '.join(inputs_of(board))}; to answer {', '.join(outputs_of(board))}"
        raise InputError(f"a strategy {how}", field=name, expected=expected)


@dataclass(frozen=True, slots=True)
class Answer:
    """What a strategy says in the ego's turn: what it remembers then, and the place after the ego's move."""

    memory: State
    place: PlayPosition


@dataclass(frozen=True, slots=True)
class MachinePlayer:
    """A machine in the game; what it remembers is its state."""

    game: Labelled
    machine: Machine

    def begin(self, place: PlayPosition) -> State | None:
        """Return the state after the first letter; None unless it is answered with the cell in which the ego starts."""
        first = self.machine.step(self.machine.begin(), self.game.letter(place))
        return None if first is None or self.game.ego_cell(first[1]) != place.cells[EGO] else first[0]

    def why_no_beginning(self, place: PlayPosition) -> str:
        """Return why the machine does not begin at a place."""
        first = self.machine.step(self.machine.begin(), self.game.letter(place))
        if first is None:
            return "has no answer to the first position"
        return f"begins in cell {self.game.ego_cell(first[1])}, and the ego starts in cell {place.cells[EGO]}"

    def answer(self, place: PlayPosition, memory: State) -> Answer | None:
        """Return what the machine answers to a place; None if nothing, or a move that is none of the game."""
        step = self.machine.step(memory, self.game.letter(place))
        if step is None:
            return None
        after = self.game.moved(place, self.game.ego_cell(step[1]))
        return None if after is None else Answer(step[0], after)

    def why_no_move(self, place: PlayPosition, memory: State) -> str:
        """Return what the machine answers in a turn in which that is no move of the game."""
        step = self.machine.step(memory, self.game.letter(place))
        if step is None:
            return f"has no answer where the cars are in cells {place.cells}"
        way = f"from cell {place.cells[EGO]} to cell {self.game.ego_cell(step[1])}"
        return f"sends the ego {way}, which is no move of the game"
