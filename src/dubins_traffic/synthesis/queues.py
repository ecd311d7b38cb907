"""What may stand at one node, and how that changes: the alphabet of which positions are words.

A *scene* is all that concerns a node: who is in it, and who waits in its lanes, in which order. A position gives each
node a scene. Scenes of nodes with equally many lanes and equal rules are the same, so they are numbered once a *kind*.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import combinations, permutations, product
from typing import Final, NamedTuple

import numpy as np

from dubins_traffic.kernels.arrays import Ints
from dubins_traffic.synthesis.assumption import Arriving, Assumption, Forfeits, Order


class _Who(NamedTuple):
    """Who waits, or is in a node."""

    OTHER: int = 0
    """An e-agent."""
    EGO: int = 1
    """The ego."""
    RENEWED: int = 2
    """An e-agent that has given up its place once in this wait."""
    PARKED: int = 3
    """An e-agent in a lane that has not come to its end (only where E5 is left out)."""


WHO: Final = _Who()
SLOTS: Final = 4
"""At most four roads meet."""
IMPOSSIBLE: Final = -1


@dataclass(frozen=True, slots=True)
class NodeKind:
    """Nodes whose scenes are the same."""

    slots: int
    """Lanes that end at the node, at most `SLOTS`."""
    ordered: bool
    """Whether there is an order of arrival."""
    jumped: bool
    """Whether e-agents ignore that order."""
    forfeits: Forfeits
    """Whether they may give up their place."""
    parks: bool
    """Whether they may stay away from the end of the lane."""
    owed: bool
    """Whether an e-agent that may enter owes it (E3 at crossings, E5 elsewhere, if the way out allows)."""

    @classmethod
    def of(cls, slots: int, crossing: bool, assumed: Assumption) -> NodeKind:
        """Return the kind of a node."""
        ordered = crossing and assumed.order is not Order.NONE
        return cls(
            slots,
            ordered,
            ordered and assumed.order is Order.IGNORED,
            assumed.forfeits if ordered else Forfeits.NEVER,
            crossing and assumed.arrives is Arriving.NEVER,
            assumed.enters if crossing else assumed.arrives is not Arriving.NEVER,
        )


@dataclass(frozen=True, slots=True)
class Scene:
    """Who is at a node."""

    inside: int | None = None
    """`WHO.OTHER` or `WHO.EGO`."""
    queue: tuple[tuple[int, int], ...] = ()
    """Who waits, first in order first; without an order, sorted."""
    parked: tuple[int, ...] = ()
    """Slots of those that have not come to the end of the lane, sorted."""

    @property
    def taken(self) -> int:
        """Slots that are taken, as bits."""
        return sum(1 << slot for slot in (*self.parked, *(slot for slot, _ in self.queue)))

    @property
    def egos(self) -> int:
        """How often the ego is here: 0 or 1."""
        return (self.inside == WHO.EGO) + sum(who == WHO.EGO for _, who in self.queue)

    @property
    def others(self) -> int:
        """How many e-agents are here."""
        return (self.inside is not None) + len(self.queue) + len(self.parked) - self.egos

    def without(self, slot: int) -> Scene:
        """Return the scene without the car in a slot."""
        return replace(
            self,
            queue=tuple(entry for entry in self.queue if entry[0] != slot),
            parked=tuple(other for other in self.parked if other != slot),
        )


def scenes(kind: NodeKind, others: int) -> list[Scene]:
    """Return all scenes of a kind with at most so many e-agents, the empty one first."""
    possible: list[Scene] = []
    whos = (WHO.OTHER, WHO.EGO, WHO.RENEWED) if kind.forfeits is Forfeits.ONCE else (WHO.OTHER, WHO.EGO)
    for count in range(min(kind.slots, others + 1) + 1):
        for taken in (permutations if kind.ordered else combinations)(range(kind.slots), count):
            for queue in product(whos, repeat=count):
                rest = [slot for slot in range(kind.slots) if slot not in taken] if kind.parks else []
                for parking in range(len(rest) + 1):
                    for parked in combinations(rest, parking):
                        for inside in (None, WHO.OTHER, WHO.EGO):
                            scene = Scene(inside, tuple(zip(taken, queue, strict=True)), parked)
                            if scene.egos <= 1 and scene.others <= others:
                                possible.append(scene)
    return possible


@dataclass(frozen=True)
class Scenery:
    """The scenes of a kind and their changes, by number."""

    kind: NodeKind
    """The kind."""
    scenes: list[Scene]
    """By number."""

    @cached_property
    def number(self) -> dict[Scene, int]:
        """The number of each scene."""
        return {scene: number for number, scene in enumerate(self.scenes)}

    def _numbers(self, changed: list[Scene | None]) -> Ints:
        return np.array(
            [IMPOSSIBLE if scene is None else self.number.get(scene, IMPOSSIBLE) for scene in changed],
            dtype=np.int64,
        )

    def described(self) -> dict[str, Ints]:
        """Return what the scenes hold: others, egos, inside (0: nobody), taken and owing slots, parked slots.

        `open` and `may_forfeit` are the slots whose e-agent may enter or give up its place, as bits.
        """
        rows = {
            "others": [scene.others for scene in self.scenes],
            "egos": [scene.egos for scene in self.scenes],
            "inside": [0 if scene.inside is None else scene.inside + 1 for scene in self.scenes],
            "taken": [scene.taken for scene in self.scenes],
            "parked": [sum(1 << slot for slot in scene.parked) for scene in self.scenes],
            "others_slots": [self._of_others(scene) for scene in self.scenes],
            "open": [self._open(scene) for scene in self.scenes],
            "owing": [self._owing(scene) for scene in self.scenes],
            "may_forfeit": [self._may_forfeit(scene) for scene in self.scenes],
        }
        return {name: np.array(row, dtype=np.int64) for name, row in rows.items()}

    @staticmethod
    def _of_others(scene: Scene) -> int:
        return scene.taken - sum(1 << slot for slot, who in scene.queue if who == WHO.EGO)

    def _open(self, scene: Scene) -> int:
        if scene.inside is not None:
            return 0
        if self.kind.jumped or not self.kind.ordered:
            return self._of_others(scene)
        return self._first(scene)

    @staticmethod
    def _first(scene: Scene) -> int:
        return 1 << scene.queue[0][0] if scene.queue and scene.queue[0][1] != WHO.EGO else 0

    def _owing(self, scene: Scene) -> int:
        if not self.kind.owed or scene.inside is not None:
            return 0
        if self.kind.ordered:
            return self._first(scene)
        return sum(1 << slot for slot, who in scene.queue if who != WHO.EGO)

    def _may_forfeit(self, scene: Scene) -> int:
        if self.kind.forfeits is Forfeits.NEVER:
            return 0
        return sum(1 << slot for slot, who in scene.queue if who == WHO.OTHER)

    def left(self) -> Ints:
        """Return the scene (C,) after whoever is in the node has left it."""
        return self._numbers([None if scene.inside is None else replace(scene, inside=None) for scene in self.scenes])

    def entered(self) -> Ints:
        """Return the scene (C, slots) after the e-agent in a slot has entered."""
        return self._by_slot(
            lambda scene, slot: (
                replace(scene.without(slot), inside=WHO.OTHER) if self._open(scene) >> slot & 1 else None
            )
        )

    def removed(self) -> Ints:
        """Return the scene (C, slots) without the e-agent in a slot, which will take a new place in the order."""
        return self._by_slot(
            lambda scene, slot: (
                scene.without(slot) if (self._may_forfeit(scene) >> slot & 1) or slot in scene.parked else None
            )
        )

    def _by_slot(self, change: Callable[[Scene, int], Scene | None]) -> Ints:
        rows = [change(scene, slot) for scene in self.scenes for slot in range(self.kind.slots)]
        return self._numbers(rows).reshape(len(self.scenes), self.kind.slots)

    def ego_entered(self) -> Ints:
        """Return the scene (C,) after the ego has entered from its lane."""
        entered: list[Scene | None] = []
        for scene in self.scenes:
            places = [place for place, (_, who) in enumerate(scene.queue) if who == WHO.EGO]
            may = scene.inside is None and bool(places) and (places[0] == 0 or not self.kind.ordered)
            slot = scene.queue[places[0]][0] if may else 0
            entered.append(replace(scene.without(slot), inside=WHO.EGO) if may else None)
        return self._numbers(entered)

    def arrived(self) -> Ints:
        """Return the scene (C, slots, 4) after each of `WHO` has come into a slot."""
        rows = [
            self._arrival(scene, slot, who)
            for scene in self.scenes
            for slot in range(self.kind.slots)
            for who in (WHO.OTHER, WHO.EGO, WHO.RENEWED, WHO.PARKED)
        ]
        return self._numbers(rows).reshape(len(self.scenes), self.kind.slots, 4)

    def _arrival(self, scene: Scene, slot: int, who: int) -> Scene | None:
        if scene.taken >> slot & 1 or (who == WHO.EGO and scene.egos):
            return None
        if who == WHO.PARKED:
            return replace(scene, parked=tuple(sorted((*scene.parked, slot))))
        queue = (*scene.queue, (slot, who))
        return replace(scene, queue=queue if self.kind.ordered else tuple(sorted(queue)))


def scenery(kind: NodeKind, others: int) -> Scenery:
    """Return the scenes of a kind with at most so many e-agents."""
    return Scenery(kind, scenes(kind, others))
