"""How many e-agents an ego on fixed routes provably wins against, without solving a game.

The ego keeps to shortest routes and moves whenever it may. Suppose that it waits in a cell for ever, for the next cell
of its route. Under E1 to E5 then everything that can be reached from that next cell, except through the ego or by who
is excused by it, is held for ever by e-agents (`docs/theory.md`); but bends and dead ends that are no crossings may be
left empty. So fewer e-agents than the smallest such region has cells can't stop it.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Iterable

from dubins_traffic.synthesis.assumption import Arriving, Assumption, Forfeits, Leaving, Order
from dubins_traffic.synthesis.road_cells import RoadCells


def route_bound(road_cells: RoadCells, assumption: Assumption) -> int:
    """Return the most e-agents against which an ego on shortest routes is proved to win from everywhere.

    Parameters
    ----------
    assumption : Assumption
        The proof needs E1 to E5, E4 in full, that forfeits are bounded, and crossings wherever three roads meet; it
        does not need E6. Without these the bound is 0.
    """
    kept = [assumption.yields, assumption.enters]
    kept += [assumption.leaves is Leaving.OWED, assumption.arrives is not Arriving.NEVER]
    kept += [node.crossing or len(node.inbound) == 1 for node in road_cells.nodes]
    if assumption.order is not Order.KEPT or assumption.forfeits is Forfeits.ALWAYS or not all(kept):
        return 0
    full = assumption.arrives is Arriving.MOVES_UP
    regions = (region(road_cells, ahead, cell, full=full) for cell, ahead in waits(road_cells))
    return min(map(len, regions), default=road_cells.cells) - 1


def waits(road_cells: RoadCells) -> set[tuple[int, int]]:
    """Return where an ego on shortest routes may have to wait, and for which cell."""
    pairs: set[tuple[int, int]] = set()
    for nodes in road_cells.targets:
        far = distances(road_cells, nodes)
        for cell, distance in far.items():
            pairs |= {(cell, ahead) for ahead in road_cells.following(cell) if far.get(ahead) == distance - 1}
    return pairs


def distances(road_cells: RoadCells, targets: Iterable[int]) -> dict[int, int]:
    """Return how many moves each cell is from the nearest target; without those from which none can be reached."""
    before: dict[int, list[int]] = {}
    for cell in range(road_cells.cells):
        for ahead in road_cells.following(cell):
            before.setdefault(ahead, []).append(cell)
    far = dict.fromkeys(targets, 0)
    waiting = deque(far)
    while waiting:
        cell = waiting.popleft()
        for earlier in before.get(cell, ()):
            if earlier not in far:
                far[earlier] = far[cell] + 1
                waiting.append(earlier)
    return far


def region(road_cells: RoadCells, first: int, ego: int, *, full: bool) -> set[int]:
    """Return the cells that are held for ever if `first` is, and the ego stays in the cell `ego`.

    `full`: whether who is before a bend or dead end that is clear goes in though its exits are taken, so that these
    are held too.
    """
    cells = {first}
    waiting = [first]
    while waiting:
        cell = waiting.pop()
        if _excused(road_cells, cell, ego):
            continue
        for ahead in road_cells.following(cell):
            if ahead != ego and ahead not in cells:
                cells.add(ahead)
                waiting.append(ahead)
    nodes = road_cells.nodes
    return {cell for cell in cells if full or cell == first or cell >= len(nodes) or nodes[cell].crossing}


def _excused(road_cells: RoadCells, cell: int, ego: int) -> bool:
    """Say whether who holds a cell need not go on because of the ego, though the ego is not in the next one.

    So it is in and before a bend through which the ego passes, and before a bend or dead end out of which only the
    lane of the ego leads.
    """
    count = len(road_cells.nodes)
    node = cell if cell < count else road_cells.lane_end[cell - count][0]
    if road_cells.nodes[node].crossing:
        return False
    return ego == road_cells.opposite(node) or (cell >= count and road_cells.following(node) == (ego,))
