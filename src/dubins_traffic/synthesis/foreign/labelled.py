"""Positions with cars that have names, as specifications have them: letters, and moves by the moves of the game."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import NamedTuple

from dubins_traffic.synthesis.board import Board
from dubins_traffic.synthesis.foreign.machine import Letter, Machine, Sides
from dubins_traffic.synthesis.road_play import MoveList
from dubins_traffic.synthesis.specification import EGO, car_bits, inputs_of, order_name


class Place(NamedTuple):
    """A position by number, and the cell of each car, the ego's first."""

    position: int
    cells: tuple[int, ...]


class Labelled:
    """The game with cars that have names.

    Parameters
    ----------
    board : Board
        The game.
    moves : MoveList
        Its moves.
    """

    def __init__(self, board: Board, moves: MoveList) -> None:
        self.board = board
        self._moves = moves
        self._bits = [car_bits(car, board.arena.cells) for car in range(board.others + 1)]
        self._inputs = frozenset(inputs_of(board))

    def letter(self, place: Place) -> Letter:
        """Return what the environment says of a place: the cells of its cars and the order among them."""
        found = {
            name: bool(cell >> bit & 1)
            for names, cell in zip(self._bits[1:], place.cells[1:], strict=True)
            for bit, name in enumerate(names)
        }
        orders = dict.fromkeys((name for name in self._inputs if name not in found), False)
        for first, second in self._before(place):
            if EGO not in (first, second) and first < second:
                orders[order_name(first, second)] = True
        return found | {name: value for name, value in orders.items() if name in self._inputs}

    def _before(self, place: Place) -> Iterator[tuple[int, int]]:
        """Yield who waits before whom at a crossing."""
        nodes = self.board.arena.nodes
        car_in = {cell: car for car, cell in enumerate(place.cells)}
        for node, scene in zip(nodes, self.board.scenes(place.position), strict=True):
            queue = [car_in[len(nodes) + node.inbound[slot]] for slot, _ in scene.queue]
            if node.crossing:
                yield from ((one, other) for k, one in enumerate(queue) for other in queue[k + 1 :])

    def ego_cell(self, answer: Letter) -> int:
        """Return the cell to which an answer sends the ego; propositions that are missing count as false."""
        return sum(answer.get(name, False) << bit for bit, name in enumerate(self._bits[EGO]))

    def moved(self, place: Place, cell: int) -> Place | None:
        """Return the place after the ego has gone to a cell, None if it may not."""
        own = place.cells[EGO]
        if cell == own:
            return place
        options = self._moves.of_ego(place.position)[1:]
        arena, nodes = self.board.arena, len(self.board.arena.nodes)
        if own < nodes:
            free = [nodes + lane for lane in arena.nodes[own].exits if nodes + lane not in place.cells]
        else:
            free = [arena.lane_end[own - nodes][0]]
        ways = dict(zip(free, options, strict=False))
        return Place(ways[cell], (cell, *place.cells[1:])) if cell in ways else None

    def turns(self, place: Place) -> Iterator[Place]:
        """Yield the places that the environment may make of one, itself among them."""
        for position in sorted(self._moves.of_others(place.position)):
            if position < self.board.positions:
                yield from self._named(place, position)

    def _named(self, place: Place, position: int) -> Iterator[Place]:
        """Yield the ways in which named cars may come to a position."""
        taken = self._taken(position) - {place.cells[EGO]}
        for cells in self._assigned(place.cells[1:], taken):
            yield Place(position, (place.cells[EGO], *cells))

    def _taken(self, position: int) -> frozenset[int]:
        """Return the cells that are taken in a position."""
        nodes = self.board.arena.nodes
        found: set[int] = set()
        for number, (node, scene) in enumerate(zip(nodes, self.board.scenes(position), strict=True)):
            if scene.inside is not None:
                found.add(number)
            slots = [*(slot for slot, _ in scene.queue), *scene.parked]
            found |= {len(nodes) + node.inbound[slot] for slot in slots}
        return frozenset(found)

    def _assigned(self, cells: Sequence[int], taken: frozenset[int]) -> Iterator[tuple[int, ...]]:
        """Yield the cells to which cars may have gone such that they take just these, each one of its own."""
        if not cells:
            yield ()
            return
        first, *rest = cells
        for cell in (first, *self.board.arena.following(first)):
            if cell in taken:
                for others in self._assigned(rest, taken - {cell}):
                    yield (cell, *others)

    def follows(self, before: Place, after: Place) -> bool:
        """Say whether the environment may have made one place of another, whose ego is where it was."""
        if before.cells[EGO] != after.cells[EGO]:
            return False
        steps = zip(before.cells[1:], after.cells[1:], strict=True)
        near = all(one == other or other in self.board.arena.following(one) for one, other in steps)
        return near and after.position in self._moves.of_others(before.position)


def misfit(board: Board, machine: Machine) -> tuple[str, str] | None:
    """Return a proposition in which a machine and a game differ, and how; None if there is none."""
    bits = car_bits(EGO, board.arena.cells)
    own = {*bits, *(order_name(EGO, car) for car in range(1, board.others + 1))}
    known = own.union(inputs_of(board))
    for name in machine.names:
        if name not in known:
            return name, "a strategy for another problem"
    for name in bits:
        if name not in machine.names:
            return name, "a strategy for another problem"
    sides = machine.sides or Sides((), ())
    for name in sides.read:
        if name in own:
            return name, "a strategy that reads what the ego chooses"
    for name in sides.answered:
        if name not in own:
            return name, "a strategy that chooses for the others"
    return None
