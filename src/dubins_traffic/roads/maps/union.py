"""Things that belong together, joined one after another."""

from __future__ import annotations

from collections.abc import Hashable, Iterable
from typing import Generic, TypeVar

Member = TypeVar("Member", bound=Hashable)


class Union(Generic[Member]):
    """Groups of members: at first each is alone; of each group one stands for all."""

    def __init__(self) -> None:
        self._parent: dict[Member, Member] = {}

    def root(self, member: Member) -> Member:
        """Return the member that stands for all that belong together with one."""
        while self._parent.setdefault(member, member) != member:
            self._parent[member] = self._parent[self._parent[member]]
            member = self._parent[member]
        return member

    def join(self, members: Iterable[Member]) -> None:
        """Let members, and all that belong to them, belong together."""
        roots = [self.root(member) for member in members]
        for root in roots[1:]:
            self._parent[self.root(root)] = self.root(roots[0])
