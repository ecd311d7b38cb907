"""The cells of the game on a road network: places of one car each, and which lead where.

A cell is a *node* or a lane. An intersection is one node, entered from all its lanes and left by any lane out of it.
In a bend that is no crossing opposing cars pass each other, as they do on the road: such a bend is two nodes, each
with one lane in and one lane out.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Final

from dubins_traffic.errors import InputError
from dubins_traffic.roads.network import RoadNetwork

LARGEST_NODES: Final = 250
"""Nodes of the largest game; they are numbered in bytes."""


@dataclass(frozen=True)
class Node:
    """A cell in an intersection."""

    vertex: int
    """The intersection."""
    inbound: tuple[int, ...]
    """Lanes that end here; the place of a lane in this tuple is its slot."""
    exits: tuple[int, ...]
    """Lanes out."""
    crossing: bool
    """Whether the rules of crossings hold here."""


@dataclass(frozen=True)
class RoadCells:
    """The cells of a network: its nodes 0 to V-1, then its lanes V to V+L-1."""

    network: RoadNetwork
    """The roads."""
    order_degree: int
    """Least degree of an intersection that is a crossing."""
    goals: tuple[int, ...]
    """Intersections."""
    nodes: tuple[Node, ...]
    """In the order of their intersections."""

    @classmethod
    def of(cls, network: RoadNetwork, goals: Sequence[int], order_degree: int = 1) -> RoadCells:
        """Return the cells of a network.

        Parameters
        ----------
        goals : sequence of int
            Intersections that the ego is to visit; each counts once.
        order_degree : int
            Least degree of an intersection that is a crossing.

        Raises
        ------
        InputError
            If there is no goal, or the network has too many intersections for the game.
        """
        if not goals:
            raise InputError("no goals", field="goals", expected="at least one")
        nodes: list[Node] = []
        for v, degree in enumerate(network.degrees.tolist()):
            out = network.arms(v)
            crossing = degree >= order_degree
            if degree == 2 and not crossing:
                first, second = out
                nodes += [Node(v, (first ^ 1,), (second,), False), Node(v, (second ^ 1,), (first,), False)]
            else:
                nodes.append(Node(v, tuple(lane ^ 1 for lane in out), out, crossing))
        if len(nodes) > LARGEST_NODES:
            raise InputError(
                "too large a network for the game",
                value=f"{len(nodes)} cells in intersections",
                expected=f"at most {LARGEST_NODES}",
            )
        return cls(network, order_degree, tuple(dict.fromkeys(goals)), tuple(nodes))

    @property
    def cells(self) -> int:
        """Number of cells."""
        return len(self.nodes) + self.network.lanes

    @cached_property
    def lane_end(self) -> tuple[tuple[int, int], ...]:
        """Node and slot in which each lane ends."""
        ends = {lane: (n, slot) for n, node in enumerate(self.nodes) for slot, lane in enumerate(node.inbound)}
        return tuple(ends[lane] for lane in range(self.network.lanes))

    def nodes_of(self, vertex: int) -> tuple[int, ...]:
        """Return the nodes in an intersection."""
        return tuple(n for n, node in enumerate(self.nodes) if node.vertex == vertex)

    @cached_property
    def goal_nodes(self) -> tuple[tuple[int, ...], ...]:
        """The nodes in each goal."""
        return tuple(self.nodes_of(goal) for goal in self.goals)

    @cached_property
    def targets(self) -> tuple[tuple[int, ...], ...]:
        """The nodes in which the ego is to be again and again: those of each goal; of a single one also all others.

        A goal is visited once more only after the ego has been at another intersection. With several goals each
        takes care of the others.
        """
        if len(self.goals) > 1:
            return self.goal_nodes
        return *self.goal_nodes, tuple(n for n, node in enumerate(self.nodes) if node.vertex not in self.goals)

    def target_name(self, target: int) -> str:
        """Return how people call one of `targets`."""
        if target >= len(self.goals):
            return "any other intersection"
        return str(list(self.network.intersections[self.goals[target]]))

    def opposite(self, node: int) -> int:
        """Return the other node of a bend that is two, else -1."""
        return next((n for n in self.nodes_of(self.nodes[node].vertex) if n != node), -1)

    def following(self, cell: int) -> tuple[int, ...]:
        """Return the cells to which a car may move from `cell`."""
        count = len(self.nodes)
        if cell < count:
            return tuple(count + lane for lane in self.nodes[cell].exits)
        return (self.lane_end[cell - count][0],)

    def name(self, cell: int) -> str:
        """Return how people call a cell, by lattice points: ``[0, 1]`` or ``[0, 1] > [0, 2]``."""
        points = self.network.intersections
        count = len(self.nodes)
        if cell >= count:
            first, last = (list(points[v]) for v in self.network.lane_ends(cell - count))
            return f"{first} > {last}"
        node = self.nodes[cell]
        place = str(list(points[node.vertex]))
        if len(self.nodes_of(node.vertex)) == 1:
            return place
        first, _ = self.network.lane_ends(node.inbound[0])
        return f"{place} from {list(points[first])}"
