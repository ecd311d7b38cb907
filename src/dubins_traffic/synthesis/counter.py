"""Counterstrategies: how the environment keeps the ego from a goal where it can, and keeps its own assumption; and why.

From a position that is lost for a goal (`solver.Loss`) the environment has, for each debt, moves that pay it after some
turns, while the ego does not get to where it would win. The environment pays its debts in turn.
Why a game is lost is told in words: the counterstrategy is played until it repeats, and what repeats is told.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from dubins_traffic.errors import InputError
from dubins_traffic.kernels.arrays import Ints
from dubins_traffic.synthesis.assumption import Arriving, Leaving
from dubins_traffic.synthesis.board import Board
from dubins_traffic.synthesis.positions import Flags, Numbers
from dubins_traffic.synthesis.queues import WHO
from dubins_traffic.synthesis.road_cells import RoadCells
from dubins_traffic.synthesis.routes import distances
from dubins_traffic.synthesis.solver import Solution

NEVER = np.int64(2**62)
"""Turns until a debt is paid that the environment can't pay."""


@dataclass
class Counterstrategy:
    """How the environment wins a game where the ego does not."""

    solution: Solution
    """Who wins."""
    _safe: dict[int, Flags] = field(default_factory=dict[int, Flags], repr=False)
    _turns: dict[tuple[int, int], Ints] = field(default_factory=dict[tuple[int, int], Ints], repr=False)

    def level(self, position: int) -> int:
        """Return which of the losses a position belongs to; InputError if the ego wins there."""
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
        worst = np.array([max((turns[after] for after in answer), default=0) for answer in answers])
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
            places = positions[low:high] - turns.first
            row, edge = _edges(turns.at, places)
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


EGO_CAR = 0
"""The ego's place among the cars; e-agents are 1 and on."""


@dataclass(frozen=True, slots=True)
class Moment:
    """What stands where when the environment is to move."""

    cells: tuple[int, ...]
    """Of each car, the ego's first."""
    orders: dict[int, tuple[int, ...]]
    """For each node the lanes in which somebody waits in the order, first first."""
    rammed: bool = False
    """Whether an e-agent has driven into the ego."""


def story_of(counter: Counterstrategy, position: int, turns: int = 10_000) -> list[str]:
    """Return, line by line, how the environment keeps the ego from a goal.

    Parameters
    ----------
    position : int
        A lost position; where it begins.
    turns : int
        After how many turns to tell what has been seen, if nothing repeats by then.
    """
    board = counter.solution.game.board
    moments, again, goal = played(counter, position, turns)
    road_cells = board.road_cells
    name = ("goal " if goal < len(road_cells.goals) else "") + road_cells.target_name(goal)
    lines = [f"From here the ego can be kept from {name} for ever:", *_scene_lines(road_cells, moments[0])]
    if moments[-1].rammed:
        return [
            *lines,
            f"After {_turns(len(moments) - 1)} an e-agent drives into the ego: E2 is not assumed.",
        ]
    cycle = moments[again:]
    if again:
        lines.append(f"After {_turns(again)} this repeats every {_turns(len(cycle), 'turn')}:")
    else:
        lines.append(f"This repeats every {_turns(len(cycle), 'turn')}:")
    lines += [_ego_line(road_cells, cycle)]
    return lines + [_line(board, cycle, car) for car in range(1, board.others + 1)]


def _turns(count: int, one: str = "1 turn") -> str:
    return one if count == 1 else f"{count} turns"


def played(counter: Counterstrategy, position: int, turns: int) -> tuple[list[Moment], int, int]:
    """Play against an ego that heads for the goal; return the moments, the first that recurs, and the goal."""
    game = counter.solution.game
    board = game.board
    moment = moment_of(board, position)
    moments, debt = [moment], 0
    seen: dict[tuple[int, int], int] = {}
    goal = counter.solution.losses[counter.level(position)].goal
    while (position, debt) not in seen and len(moments) <= turns:
        seen[position, debt] = len(moments) - 1
        after, debt = counter.choose(position, debt)
        if after == game.positions:
            return [*moments, Moment(moment.cells, moment.orders, True)], 0, goal
        moment = followed(board, moment, moment_of(board, after))
        goal = counter.solution.losses[counter.level(position)].goal
        position = _towards(counter, after, goal)
        moment = followed(board, moment, moment_of(board, position))
        moments.append(moment)
    again = seen.get((position, debt), 0)
    return moments[: len(moments) - 1] if again or len(moments) > 1 else moments, again, goal


def _towards(counter: Counterstrategy, position: int, goal: int) -> int:
    """Return the move of an ego that takes the shortest way to a goal, or waits."""
    game = counter.solution.game
    road_cells = game.board.road_cells
    far = distances(road_cells, road_cells.targets[goal])
    options = game.ego_to[game.ego_at[position] : game.ego_at[position + 1]].tolist()
    return min(options, key=lambda option: (far.get(int(game.ego_cell[option]), road_cells.cells), option))


def moment_of(board: Board, position: int) -> Moment:
    """Return what stands where in a position; the e-agents sorted by cell."""
    road_cells = board.road_cells
    count = len(road_cells.nodes)
    ego, others = -1, list[int]()
    orders: dict[int, tuple[int, ...]] = {}
    for n, scene in enumerate(board.scenes(position)):
        lanes = [(count + road_cells.nodes[n].inbound[slot], who) for slot, who in scene.queue]
        parked = [(count + road_cells.nodes[n].inbound[slot], -1) for slot in scene.parked]
        inside = [(n, scene.inside)] if scene.inside is not None else []
        for cell, who in lanes + parked + inside:
            if who == WHO.EGO:
                ego = cell
            else:
                others.append(cell)
        if lanes:
            orders[n] = tuple(cell for cell, _ in lanes)
    return Moment((ego, *sorted(others)), orders)


def followed(board: Board, before: Moment, after: Moment) -> Moment:
    """Return the later moment with its e-agents named as in the earlier one, by which cell leads to which."""
    free = list(after.cells[1:])
    chosen: list[int] = []

    def assign(car: int) -> bool:
        if car == len(before.cells):
            return True
        cell_before = before.cells[car]
        for cell in (cell_before, *board.road_cells.following(cell_before)):
            if cell in free:
                free.remove(cell)
                chosen.append(cell)
                if assign(car + 1):
                    return True
                free.append(chosen.pop())
        return False

    assign(1)
    return Moment((after.cells[0], *chosen), after.orders)


def _scene_lines(road_cells: RoadCells, moment: Moment) -> list[str]:
    cars = ["the ego", *(f"e-agent {car}" for car in range(1, len(moment.cells)))]
    return [f"  {car} at {road_cells.name(cell)}" for car, cell in zip(cars, moment.cells, strict=True)]


def _ego_line(road_cells: RoadCells, cycle: Sequence[Moment]) -> str:
    cells = list(dict.fromkeys(moment.cells[EGO_CAR] for moment in cycle))
    if len(cells) == 1:
        return f"  the ego waits at {road_cells.name(cells[0])}"
    return "  the ego goes by " + _names(road_cells, cells)


def _line(board: Board, cycle: Sequence[Moment], car: int) -> str:
    """Return what an e-agent does while all repeats, and why it need not do anything else."""
    road_cells = board.road_cells
    cells = list(dict.fromkeys(moment.cells[car] for moment in cycle))
    if len(cells) > 1:
        return f"  e-agent {car} goes by {_names(road_cells, cells)}"
    cell = cells[0]
    why = _excuse_inside(board, cycle, cell) if cell < len(road_cells.nodes) else _excuse_lane(board, cycle, cell)
    return f"  e-agent {car} holds {road_cells.name(cell)}: {why}"


def _excuse_inside(board: Board, cycle: Sequence[Moment], cell: int) -> str:
    if board.assumption.leaves is Leaving.NEVER:
        return "E4 is not assumed, so it need not leave"
    exits = board.road_cells.following(cell)
    opposite = board.road_cells.opposite(cell)
    met = {moment.cells.index(opposite) for moment in cycle if opposite in moment.cells}
    if EGO_CAR in met or (met and board.assumption.leaves is Leaving.UNMET):
        return f"again and again {_cars(met)} {_is(met)} in the same bend"
    for moment in cycle:
        if all(lane in moment.cells for lane in exits):
            holders = _cars({moment.cells.index(lane) for lane in exits})
            return f"again and again all its exits are taken, by {holders}"
    return "E6 is not assumed, or it leaves when it must"


def _excuse_lane(board: Board, cycle: Sequence[Moment], cell: int) -> str:
    road_cells = board.road_cells
    node = road_cells.lane_end[cell - len(road_cells.nodes)][0]
    crossing = road_cells.nodes[node].crossing
    if all(cell not in moment.orders.get(node, ()) for moment in cycle):
        return "E5 is not assumed, so it need not come to the end of the lane"
    if not (board.assumption.enters if crossing else board.assumption.arrives is not Arriving.NEVER):
        return f"{'E3' if crossing else 'E5'} is not assumed, so it need not enter {road_cells.name(node)}"
    inside = {moment.cells.index(node) for moment in cycle if node in moment.cells}
    ahead = {moment.cells.index(other) for moment in cycle for other in _ahead(moment, node, cell)}
    if board.scenery(node).kind.ordered and ahead:
        return f"again and again {_cars(ahead)} {_is(ahead)} before it in the order"
    if inside:
        return f"again and again {_cars(inside)} {_is(inside)} in {road_cells.name(node)}"
    excuse = "" if crossing else _excuse_bend(board, cycle, node)
    return excuse or "it gives up its place in the order again and again"


def _excuse_bend(board: Board, cycle: Sequence[Moment], node: int) -> str:
    """Return who excuses a car that waits before a bend or dead end, though that is clear; nothing if nobody does."""
    opposite = board.road_cells.opposite(node)
    met = {moment.cells.index(opposite) for moment in cycle if opposite in moment.cells}
    if EGO_CAR in met:
        return "again and again the ego is in the bend before it"
    exits = board.road_cells.following(node)
    closing = {moment.cells.index(lane) for moment in cycle for lane in exits if lane in moment.cells}
    alone = board.assumption.arrives is Arriving.MOVES_UP
    if EGO_CAR in closing or (closing and not alone):
        return f"again and again {_cars(closing)} {_is(closing)} in the way out of {board.road_cells.name(node)}"
    if met and not alone and board.assumption.leaves is Leaving.UNMET:
        return f"again and again {_cars(met)} {_is(met)} in the bend before it"
    return ""


def _is(cars: set[int]) -> str:
    return "is" if len(cars) == 1 else "are"


def _ahead(moment: Moment, node: int, cell: int) -> tuple[int, ...]:
    order = moment.orders.get(node, ())
    return order[: order.index(cell)] if cell in order else ()


def _cars(cars: set[int]) -> str:
    names = ["the ego" if car == EGO_CAR else f"e-agent {car}" for car in sorted(cars)]
    return " and ".join(names) if len(names) < 3 else ", ".join(names[:-1]) + " and " + names[-1]


def _names(road_cells: RoadCells, cells: Sequence[int]) -> str:
    return ", ".join(road_cells.name(cell) for cell in cells)
