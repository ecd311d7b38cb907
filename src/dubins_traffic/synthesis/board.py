"""Positions by number: a perfect numbering of all ways to put the cars on the cells, and its tables.

A position gives each node a scene (`queues`) such that all of them together hold the ego once and the e-agents.
Positions are ordered as words of scenes; the number of a position is how many come before it. It is a sum over the
nodes that are not empty, of entries of one table: no hashing, and no list of positions.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Final, NamedTuple

import numpy as np

from dubins_traffic.kernels.arrays import Ints
from dubins_traffic.kernels.records import Rows, record, table
from dubins_traffic.synthesis.assumption import Arriving, Assumption, Forfeits, Leaving
from dubins_traffic.synthesis.queues import IMPOSSIBLE, SLOTS, WHO, NodeKind, Scene, Scenery, scenery
from dubins_traffic.synthesis.road_cells import RoadCells

MOST_OTHERS: Final = 62
"""E-agents of the largest game; their moves are bits of a number."""


@record
class BoardNumbers:
    """What the whole game depends on."""

    others: int
    """How many e-agents there are."""
    positions: int
    """How many positions."""
    cells: int
    """How many cells."""
    yields: int
    """1 if E2 is assumed."""
    leaves: int
    """1 if E4 is assumed."""
    frees: int
    """1 if E6 is assumed."""
    unmet: int
    """1 if e-agents that meet in a bend excuse each other (E4)."""
    moves_up: int
    """1 if only the ego, in the way out, excuses who does not enter (E5)."""


class BoardTables(NamedTuple):
    """What the kernels are given: V nodes, L lanes, the scenes of all kinds one after another.

    Attributes
    ----------
    base : (V,) int64
        Where the scenes of the node's kind begin.
    scene_count : (V,) int64
        How many there are.
    offset_at : (V+1,) int64
        Where the node's part of `offset` begins.
    offset : int64
        [e-agents left, ego left, scene] of each node: positions before the first that continues with the scene.
    inbound : (V, 4) int64
        Lane of each slot, or -1.
    exit_at : (V+1,) int64
        Where the exits of each node begin in `exits`.
    exits, lane_node, lane_slot : int64
        Lanes out of the nodes; where each lane ends.
    others, egos, inside, taken, parked, others_slots, open, owing, may_forfeit, left, ego_entered : (C,) int64
        See `queues.Scenery`; scenes are numbered within their kind.
    entered, removed : (C, 4) int64
        By slot.
    arrived : (C, 4, 4) int64
        By slot and who arrives.
    sorts : (V,) int64
        Whether there is an order of arrival at the node.
    newcomer, renewed : (V,) int64
        Who an e-agent is that comes into a lane to the node, and who has taken a new place.
    goal : (V,) int64
        The goal to which the node belongs, or -1.
    goal_nodes : (G,) int64
        How many nodes each goal has.
    crossing, opposite : (V,) int64
        Whether the node is a crossing; the other node of a bend, or -1.
    settings : (1,)
        Numbers, and what is assumed.
    """

    base: Ints
    scene_count: Ints
    offset_at: Ints
    offset: Ints
    inbound: Ints
    exit_at: Ints
    exits: Ints
    lane_node: Ints
    lane_slot: Ints
    others: Ints
    egos: Ints
    inside: Ints
    taken: Ints
    parked: Ints
    others_slots: Ints
    open: Ints
    owing: Ints
    may_forfeit: Ints
    left: Ints
    ego_entered: Ints
    entered: Ints
    removed: Ints
    arrived: Ints
    sorts: Ints
    newcomer: Ints
    renewed: Ints
    goal: Ints
    goal_nodes: Ints
    crossing: Ints
    opposite: Ints
    settings: Rows[BoardNumbers]


@dataclass(frozen=True)
class Board:
    """All positions of the ego and a number of e-agents on the cells of a road network."""

    road_cells: RoadCells
    """The cells."""
    assumption: Assumption
    """What decides which positions there are, beside the cells."""
    others: int
    """E-agents, at most `MOST_OTHERS`."""

    @cached_property
    def _kinds(self) -> list[NodeKind]:
        return [NodeKind.of(len(node.inbound), node.crossing, self.assumption) for node in self.road_cells.nodes]

    @cached_property
    def sceneries(self) -> dict[NodeKind, Scenery]:
        """The scenes of each kind of node."""
        return {kind: scenery(kind, self.others) for kind in dict.fromkeys(self._kinds)}

    def scenery(self, node: int) -> Scenery:
        """Return the scenes of a node."""
        return self.sceneries[self._kinds[node]]

    @cached_property
    def _completions(self) -> list[list[list[int]]]:
        """Ways [node][e-agents left][ego left] to fill this node and those after it."""
        last = [[0, 0] for _ in range(self.others + 1)]
        last[0][0] = 1
        ways = [last]
        for kind in reversed(self._kinds):
            many: dict[tuple[int, int], int] = {}
            for scene in self.sceneries[kind].scenes:
                many[scene.others, scene.egos] = many.get((scene.others, scene.egos), 0) + 1
            after = ways[-1]
            ways.append(
                [
                    [
                        sum(
                            times * after[left - others][ego - egos]
                            for (others, egos), times in many.items()
                            if others <= left and egos <= ego
                        )
                        for ego in (0, 1)
                    ]
                    for left in range(self.others + 1)
                ]
            )
        return ways[::-1]

    @cached_property
    def positions(self) -> int:
        """Number of positions."""
        return self._completions[0][self.others][1]

    def _offsets(self, node: int) -> Ints:
        """Return [e-agents left, ego left, scene] of `BoardTables.offset` for a node."""
        after = self._completions[node + 1]
        rows = np.zeros((self.others + 1, 2, len(self.scenery(node).scenes)), dtype=np.int64)
        for left in range(self.others + 1):
            for ego in (0, 1):
                sizes = [
                    after[left - scene.others][ego - scene.egos] if scene.others <= left and scene.egos <= ego else 0
                    for scene in self.scenery(node).scenes
                ]
                rows[left, ego, 1:] = np.cumsum(sizes)[:-1]
        return rows

    @cached_property
    def tables(self) -> BoardTables:
        """What the kernels are given."""
        nodes = self.road_cells.nodes
        begin: dict[NodeKind, int] = {}
        for kind in self.sceneries:
            begin[kind] = sum(len(self.sceneries[earlier].scenes) for earlier in begin)
        offsets = [self._offsets(n).ravel() for n in range(len(nodes))]
        ends = np.array(self.road_cells.lane_end, dtype=np.int64).reshape(-1, 2)
        exits = [list(node.exits) for node in nodes]
        return BoardTables(
            base=_ints(begin[kind] for kind in self._kinds),
            scene_count=_ints(len(self.sceneries[kind].scenes) for kind in self._kinds),
            offset_at=_starts(len(part) for part in offsets),
            offset=np.concatenate(offsets),
            inbound=_padded([list(node.inbound) for node in nodes]),
            exit_at=_starts(len(lanes) for lanes in exits),
            exits=_ints(lane for lanes in exits for lane in lanes),
            lane_node=ends[:, 0].copy(),
            lane_slot=ends[:, 1].copy(),
            **self._changes(),
            sorts=_ints(kind.ordered for kind in self._kinds),
            newcomer=_ints(WHO.PARKED if kind.parks else WHO.OTHER for kind in self._kinds),
            renewed=_ints(WHO.RENEWED if kind.forfeits is Forfeits.ONCE else WHO.OTHER for kind in self._kinds),
            goal=_ints(self._goal_of(node.vertex) for node in nodes),
            goal_nodes=_ints(len(nodes_of_goal) for nodes_of_goal in self.road_cells.goal_nodes),
            crossing=_ints(node.crossing for node in nodes),
            opposite=_ints(self.road_cells.opposite(n) for n in range(len(nodes))),
            settings=self._settings(),
        )

    def _settings(self) -> Rows[BoardNumbers]:
        """Return `BoardTables.settings`."""
        settings, assumption = table(BoardNumbers, 1), self.assumption
        row = settings[0]
        row.others, row.positions, row.cells = self.others, self.positions, self.road_cells.cells
        row.yields, row.frees = assumption.yields, assumption.frees
        row.leaves, row.unmet = assumption.leaves is not Leaving.NEVER, assumption.leaves is Leaving.UNMET
        row.moves_up = assumption.arrives is Arriving.MOVES_UP
        return settings

    def _changes(self) -> dict[str, Ints]:
        """Return the tables of the scenes of all kinds, padded to four slots."""
        tables_of_kinds: dict[str, list[Ints]] = {}
        for of_kind in self.sceneries.values():
            pad = SLOTS - of_kind.kind.slots
            described = of_kind.described() | {"left": of_kind.left(), "ego_entered": of_kind.ego_entered()}
            for name, row in described.items():
                tables_of_kinds.setdefault(name, []).append(row)
            for name, changed in (("entered", of_kind.entered()), ("removed", of_kind.removed())):
                tables_of_kinds.setdefault(name, []).append(_wider(changed, ((0, 0), (0, pad))))
            tables_of_kinds.setdefault("arrived", []).append(_wider(of_kind.arrived(), ((0, 0), (0, pad), (0, 0))))
        return {name: np.concatenate(parts) for name, parts in tables_of_kinds.items()}

    def _goal_of(self, vertex: int) -> int:
        return self.road_cells.goals.index(vertex) if vertex in self.road_cells.goals else -1

    def number(self, scenes: Sequence[Scene]) -> int:
        """Return the number of the position with these scenes, one a node.

        KeyError if it is none of the positions.
        """
        numbers = [self.scenery(n).number[scene] for n, scene in enumerate(scenes)]
        left, ego, total = self.others, 1, 0
        if (sum(s.others for s in scenes), sum(s.egos for s in scenes)) != (left, ego):
            raise KeyError("other cars than those of the game")
        for n, scene in enumerate(scenes):
            start = int(self.tables.offset_at[n])
            total += int(self.tables.offset[start + (left * 2 + ego) * len(self.scenery(n).scenes) + numbers[n]])
            left, ego = left - scene.others, ego - scene.egos
        return total

    def scenes(self, position: int) -> list[Scene]:
        """Return the scene of every node in a position."""
        left, ego, rest = self.others, 1, position
        scenes_of_nodes: list[Scene] = []
        for n in range(len(self.road_cells.nodes)):
            at_node = self.scenery(n).scenes
            start = int(self.tables.offset_at[n]) + (left * 2 + ego) * len(at_node)
            row = self.tables.offset[start : start + len(at_node)]
            number = int(np.searchsorted(row, rest, side="right")) - 1
            rest -= int(row[number])
            scenes_of_nodes.append(at_node[number])
            left, ego = left - at_node[number].others, ego - at_node[number].egos
        return scenes_of_nodes


def _ints(values: Iterable[int]) -> Ints:
    return np.array(list(values), dtype=np.int64)


def _starts(sizes: Iterable[int]) -> Ints:
    return np.concatenate([[0], np.cumsum(list(sizes))]).astype(np.int64)


def _padded(rows: Sequence[Sequence[int]]) -> Ints:
    return np.array([[*row, *[-1] * (SLOTS - len(row))] for row in rows], dtype=np.int64)


def _wider(table: Ints, padding: Sequence[tuple[int, int]]) -> Ints:
    return np.pad(table, padding, constant_values=IMPOSSIBLE)
