"""Junctions that are nearer to each other than a road must be long become one in their middle."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from heapq import heapify, heappop, heappush

from dubins_traffic.roads.maps.model import Junction
from dubins_traffic.roads.maps.strands import Strand, moved
from dubins_traffic.roads.room import LARGEST_DEGREE


class Contraction:
    """Strands of which the short ones vanish, the shortest first.

    Parameters
    ----------
    strands : sequence of Strand
        As `strands_of` returns them.
    junctions : dict
        All junctions by name; those that are made are added.
    least : float
        How long a strand must be, metres.

    Attributes
    ----------
    strands : list of Strand
        What is left.
    stuck : list of int
        Strands of these that are too short, while their ends can't become one. What meets them stays as it is, since it
        may lie otherwise once they are gone; elsewhere strands go on vanishing.
    """

    def __init__(self, strands: Sequence[Strand], junctions: dict[str, Junction], least: float) -> None:
        self._rows = dict(enumerate(strands))
        self._junctions = junctions
        self._least = least
        self._short: dict[int, float] = {}
        self._meet: dict[str, list[int]] = {}
        for s in self._rows:
            for end in self._ends(s):
                self._meet.setdefault(end, []).append(s)
            self._measure(s)
        self._stay: set[str] = set()
        stuck = self._stuck(self._short)
        waiting = [(length, s) for s, length in self._short.items()]
        heapify(waiting)
        while waiting:
            length, s = heappop(waiting)
            if self._short.get(s) == length and self._stay.isdisjoint(self._ends(s)):
                touched = self._merge(s)
                for other in touched & self._short.keys():
                    heappush(waiting, (self._short[other], other))
                stuck += self._stuck(touched)
        numbers = {s: k for k, s in enumerate(self._rows)}
        self.strands = list(self._rows.values())
        self.stuck = [numbers[s] for s in sorted(stuck)]

    def _ends(self, s: int) -> tuple[str, str]:
        return self._rows[s].first, self._rows[s].last

    def _measure(self, s: int) -> None:
        """Note how long a strand is if it is short."""
        self._short.pop(s, None)
        length = self._rows[s].length
        if length < self._least:
            self._short[s] = length

    def _stuck(self, numbers: Iterable[int]) -> list[int]:
        """Return those of some strands that are short, and whose ends can't become one; let these ends stay."""
        found: list[int] = []
        for s in numbers:
            if s in self._short:
                first, last = self._ends(s)
                degrees = len(self._meet[first]), len(self._meet[last])
                inner = min(degrees) > 1 and first != last
                if not inner or sum(degrees) - 2 > LARGEST_DEGREE:
                    found.append(s)
        self._stay.update(end for s in found for end in self._ends(s))
        return found

    def _merge(self, s: int) -> set[int]:
        """Replace a strand and both its ends by one junction in its middle; return the strands that end there."""
        gone = self._rows.pop(s)
        del self._short[s]
        a, b = self._junctions[gone.first], self._junctions[gone.last]
        place = 0.5 * (a.x + b.x), 0.5 * (a.y + b.y)
        name = f"{gone.first}+{gone.last}"
        self._junctions[name] = Junction(*place, a.all_way_stop and b.all_way_stop)
        ends = [self._meet.pop(end) for end in (gone.first, gone.last)]
        self._meet[name] = [k for own in ends for k in own if k != s]
        for end, own in zip((gone.first, gone.last), ends, strict=True):
            for k in own:
                while k != s and end in (self._rows[k].first, self._rows[k].last):
                    self._rows[k] = moved(self._rows[k], end, name, place)
        touched = set(self._meet[name])
        for k in touched:
            self._measure(k)
        return touched
