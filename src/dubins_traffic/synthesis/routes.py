"""How many e-agents an ego on fixed routes provably wins against, without solving a game.

The ego keeps to shortest routes and moves whenever it may. Suppose that it waits in a cell for ever, for the next cell
of its route. Under E1 to E5 then everything that can be reached from that next cell, except through the ego or by who
is excused by it, is held for ever by e-agents (`docs/theory.md`); but bends and dead ends that are no crossings may be
left empty. So fewer e-agents than the smallest such region has cells can't stop it.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Iterable

from dubins_traffic.synthesis.arena import Arena
from dubins_traffic.synthesis.assumption import Arriving, Assumption, Forfeits, Leaving, Order


def route_bound(arena: Arena, assumption: Assumption) -> int:
    """Return the most e-agents against which an ego on shortest routes is proved to win from everywhere.

    Parameters
    ----------
    assumption : Assumption
        The proof needs E1 to E5, E4 in full, that forfeits are bounded, and crossings wherever three roads meet; it
        does not need E6. Without these the bound is 0.
    """
    kept = [assumption.yields, assumption.enters]
    kept += [assumption.leaves is Leaving.OWED, assumption.arrives is not Arriving.NEVER]
    kept += [node.crossing or len(node.inbound) == 1 for node in arena.nodes]
    if assumption.order is not Order.KEPT or assumption.forfeits is Forfeits.ALWAYS or not all(kept):
        return 0
    full = assumption.arrives is Arriving.MOVES_UP
    regions = (region(arena, ahead, cell, full=full) for cell, ahead in waits(arena))
    return min(map(len, regions), default=arena.cells) - 1


def waits(arena: Arena) -> set[tuple[int, int]]:
    """Return where an ego on shortest routes may have to wait, and for which cell."""
    pairs: set[tuple[int, int]] = set()
    for nodes in arena.targets:
        far = distances(arena, nodes)
        for cell, distance in far.items():
            pairs |= {(cell, ahead) for ahead in arena.following(cell) if far.get(ahead) == distance - 1}
    return pairs


def distances(arena: Arena, targets: Iterable[int]) -> dict[int, int]:
    """Return how many moves each cell is from the nearest target; without those from which none can be reached."""
    before: dict[int, list[int]] = {}
    for cell in range(arena.cells):
        for ahead in arena.following(cell):
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


def region(arena: Arena, first: int, ego: int, *, full: bool) -> set[int]:
    """Return the cells that are held for ever if `first` is, and the ego stays in the cell `ego`.

    `full`: whether who is before a bend or dead end that is clear goes in though its exits are taken, so that these
    are held too.
    """
    cells = {first}
    waiting = [first]
    while waiting:
        cell = waiting.pop()
        if _excused(arena, cell, ego):
            continue
        for ahead in arena.following(cell):
            if ahead != ego and ahead not in cells:
                cells.add(ahead)
                waiting.append(ahead)
    nodes = arena.nodes
    return {cell for cell in cells if full or cell == first or cell >= len(nodes) or nodes[cell].crossing}


def _excused(arena: Arena, cell: int, ego: int) -> bool:
    """Say whether who holds a cell need not go on because of the ego, though the ego is not in the next one.

    So it is in and before a bend through which the ego passes, and before a bend or dead end out of which only the
    lane of the ego leads.
    """
    count = len(arena.nodes)
    node = cell if cell < count else arena.lane_end[cell - count][0]
    if arena.nodes[node].crossing:
        return False
    return ego == arena.opposite(node) or (cell >= count and arena.following(node) == (ego,))
