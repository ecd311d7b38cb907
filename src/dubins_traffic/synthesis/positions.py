"""Room for the moves of positions, and the numbers of positions, compiled; and the narrow arrays that hold them."""

from __future__ import annotations

from typing import NamedTuple, TypeAlias

import numpy as np
import numpy.typing as npt

from dubins_traffic.kernels.arrays import Ints
from dubins_traffic.kernels.compile import jit, jit_long
from dubins_traffic.kernels.records import Rows, record, table
from dubins_traffic.synthesis.board import Board, BoardTables
from dubins_traffic.synthesis.queues import SLOTS

Numbers: TypeAlias = npt.NDArray[np.int32]
"""Numbers of positions, places in lists, ranks."""
Cells: TypeAlias = npt.NDArray[np.int16]
"""Numbers of cells and goals."""
Bytes: TypeAlias = npt.NDArray[np.uint8]
Masks: TypeAlias = npt.NDArray[np.uint8 | np.int64]
"""A bit for each e-agent that may move: bytes, unless there are more than eight."""
Flags: TypeAlias = npt.NDArray[np.bool_]


MOST_CHOICES = SLOTS + 1
"""Of one car: to stay, or to leave by one of four lanes."""


@record
class Totals:
    """What is counted of a position on the way to its moves."""

    units: int
    """How many e-agents may move."""
    arrivals: int
    """How many arrive."""
    rammed: int
    """1 if the ego may be rammed."""


@record
class Filled:
    """How many entries of the arrays of `Moves` are used."""

    to: int
    """Of `to` and `moved`."""
    ego_to: int
    """Of `ego_to`."""
    owed: int
    """Of `owed` and `owed_mask`."""


class Work(NamedTuple):
    """Room for the kernels, for n e-agents.

    Attributes
    ----------
    scenes, moved_scenes, arrived_scenes : (V,) int64
        Of the position, after departures, after arrivals.
    node, slot, choices, chosen : (n,) int64
        The e-agents that may move: where they are, how many choices they have, which is taken.
    choice : (n, 5) int64
        A `moves.CHOICE` or a lane.
    to_node, to_slot, to_who, turn : (n,) int64
        Those who arrive, by node; `turn` is the order in which they do.
    total : (1,)
        Counts.
    """

    scenes: Ints
    moved_scenes: Ints
    arrived_scenes: Ints
    node: Ints
    slot: Ints
    choices: Ints
    chosen: Ints
    choice: Ints
    to_node: Ints
    to_slot: Ints
    to_who: Ints
    turn: Ints
    total: Rows[Totals]

    @classmethod
    def of(cls, board: Board) -> Work:
        """Return room for positions of this board."""
        nodes, cars = len(board.road_cells.nodes), board.others
        shapes = dict.fromkeys(("scenes", "moved_scenes", "arrived_scenes"), (nodes,))
        shapes |= {"choice": (cars, MOST_CHOICES)}
        arrays = cls._fields[:-1]
        arrays_by_name = {name: np.zeros(shapes.get(name, (cars,)), dtype=np.int64) for name in arrays}
        return cls(**arrays_by_name, total=table(Totals, 1))


class Moves(NamedTuple):
    """Where a block of positions writes its moves; `used` says how much of each array is filled.

    Attributes
    ----------
    to : (E,) int32
        Positions after a turn of the environment.
    moved : (E,) uint8 or int64
        Which of the e-agents that may move entered or left a node, as bits.
    ego_to : (F,) int32
        Positions after a turn of the ego.
    owed : (O,) int16
        What the environment owes in a position: cells (an e-agent in it is to go on), or cells + goal (to be freed).
    owed_mask : (O,) uint8 or int64
        The bits of `moved` that end it.
    ego_cell : (N,) int16
        Cell of the ego.
    many, ego_many, owed_many : (N,) int32
        Entries of each position in the arrays above.
    used : (1,)
        Entries used of the first five arrays.
    """

    to: Numbers
    moved: Masks
    ego_to: Numbers
    owed: Cells
    owed_mask: Masks
    ego_cell: Cells
    many: Numbers
    ego_many: Numbers
    owed_many: Numbers
    used: Rows[Filled]


@jit
def unrank(t: BoardTables, position: int, scenes: Ints) -> None:
    """Set `scenes` (V,) to the scene of every node in `position` (number)."""
    left = t.settings[0].others
    ego = 1
    rest = position
    for v in range(t.base.shape[0]):
        count = t.scene_count[v]
        row = t.offset_at[v] + (left * 2 + ego) * count
        low = 0
        if rest >= t.offset[row + 1]:
            high = count
            while high - low > 1:
                middle = (low + high) >> 1
                if t.offset[row + middle] <= rest:
                    low = middle
                else:
                    high = middle
        rest -= t.offset[row + low]
        scenes[v] = low
        left -= t.others[t.base[v] + low]
        ego -= t.egos[t.base[v] + low]


@jit
def rank(t: BoardTables, scenes: Ints) -> int:
    """Return the number of the position with the scenes `scenes` (V,)."""
    left = t.settings[0].others
    ego = 1
    total = 0
    for v in range(t.base.shape[0]):
        scene = scenes[v]
        if scene != 0:
            total += int(t.offset[t.offset_at[v] + (left * 2 + ego) * t.scene_count[v] + scene])
            left -= t.others[t.base[v] + scene]
            ego -= t.egos[t.base[v] + scene]
    return total


@jit_long
def list_scenes(t: BoardTables, scenes: Ints, numbers: Numbers) -> None:
    """Set `numbers` (N, V) to the scene of every node in every position; `scenes` (V,) is room."""
    for position in range(numbers.shape[0]):
        unrank(t, position, scenes)
        for v in range(scenes.shape[0]):
            numbers[position, v] = scenes[v]
