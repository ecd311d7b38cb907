"""The graph of a map: strands, which are roads one after another, between junctions where others end.

Junctions that are nearer to each other than a road must be long become one in their middle (`Contraction`).
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from heapq import heapify, heappop, heappush

import numpy as np

from dubins_traffic.kernels.arrays import Floats
from dubins_traffic.maps.model import Junction, Road
from dubins_traffic.maps.polylines import along, at, cleaned, stretch, to_segments
from dubins_traffic.roads.room import LARGEST_DEGREE


@dataclass(frozen=True, slots=True)
class Strand:
    """Roads of which each goes on where the one before ends: their numbers, both ends, the line."""

    roads: tuple[int, ...]
    first: str
    last: str
    line: Floats

    @property
    def length(self) -> float:
        """Metres along the line."""
        return float(along(self.line)[-1])

    def backward(self) -> Strand:
        """Return the same from the other end."""
        return Strand(self.roads[::-1], self.last, self.first, self.line[::-1])

    def end_at(self, name: str) -> Strand:
        """Return the same, so that it ends at a junction."""
        return self if self.last == name else self.backward()


def strands_of(roads: Sequence[Road], numbers: Iterable[int], junctions: Mapping[str, Junction]) -> list[Strand]:
    """Return the strands of some roads: two that meet alone at a junction become one."""
    rows: dict[int, Strand] = {}
    meet: dict[str, list[int]] = {}
    for key, number in enumerate(numbers):
        road = roads[number]
        line = _anchored(road, junctions)
        rows[key] = Strand((number,), road.first, road.last, line)
        for end in (road.first, road.last):
            meet.setdefault(end, []).append(key)
    for name, keys in meet.items():
        if len(keys) == 2 and keys[0] != keys[1]:
            _join(rows, meet, name, *keys)
    return list(rows.values())


def _anchored(road: Road, junctions: Mapping[str, Junction]) -> Floats:
    """Return the line of a road from junction to junction; it may end at their borders in the file."""
    first, last = np.array(junctions[road.first][:2]), np.array(junctions[road.last][:2])
    return cleaned(np.concatenate([first[None], road.line, last[None]]))


def _join(rows: dict[int, Strand], meet: dict[str, list[int]], name: str, one: int, other: int) -> None:
    """Replace two strands that meet at a junction by one."""
    head, tail = rows[one].end_at(name), rows[other].end_at(name).backward()
    line = np.concatenate([head.line, tail.line[1:]])
    rows[one] = Strand(head.roads + tail.roads, head.first, tail.last, line)
    del rows[other]
    meet[name].clear()
    keys = meet[tail.last]
    keys[keys.index(other)] = one


def cut(strands: list[Strand], straight: float) -> tuple[list[Strand], dict[str, Junction]]:
    """Return strands without loops and twins, and the junctions that were put in.

    A strand that ends where it begins is cut in three, the longer of two between the same junctions in two, where it is
    straightest. What is too short for that is left out.

    Parameters
    ----------
    strands : list of Strand
        As `strands_of` returns them.
    straight : float
        How long a road is straight at both ends.
    """
    made: list[Strand] = []
    added: dict[str, Junction] = {}
    seen: set[tuple[str, str]] = set()
    for strand in sorted(strands, key=lambda each: each.length):
        ends = min(strand.first, strand.last), max(strand.first, strand.last)
        parts = 3 if strand.first == strand.last else 2 if ends in seen else 1
        seen.add(ends)
        made += _split(strand, parts, straight, added)
    return made, added


def _split(strand: Strand, parts: int, straight: float, added: dict[str, Junction]) -> list[Strand]:
    """Return a strand in parts of about equal length; none if they are too short."""
    if parts == 1:
        return [strand]
    length = strand.length
    if length < 2.0 * parts * straight:
        return []
    cuts = [0.0]
    names = [strand.first]
    for k in range(1, parts):
        where = _straightest(strand.line, length * k / parts, straight, 0.3 * length / parts)
        name = f"{strand.first}..{strand.last}#{strand.roads[0]}.{k}"
        x, y = at(strand.line, where).tolist()
        added[name] = Junction(x, y)
        cuts.append(where)
        names.append(name)
    cuts.append(length)
    names.append(strand.last)
    return [
        Strand(strand.roads, names[k], names[k + 1], stretch(strand.line, cuts[k], cuts[k + 1])) for k in range(parts)
    ]


def _straightest(line: Floats, where: float, straight: float, play: float) -> float:
    """Return the place near `where` about which a line is straightest."""
    best, least = where, np.inf
    for step in np.linspace(-play, play, 21).tolist():
        part = stretch(line, where + step - straight, where + step + straight)
        off = float(to_segments(part, part[[0, -1]]).max()) + 1e-3 * abs(step) / max(play, 1e-9)
        if off < least:
            best, least = where + step, off
    return best


def moved(strand: Strand, name: str, new: str, place: tuple[float, float]) -> Strand:
    """Return a strand that ends at another junction instead of `name`: its line goes on to there."""
    whole = strand.end_at(name)
    line = cleaned(np.concatenate([whole.line, np.array([place])]))
    return replace(whole, last=new, line=line)


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
        stuck: list[int] = []
        for s in numbers:
            if s in self._short:
                first, last = self._ends(s)
                degrees = len(self._meet[first]), len(self._meet[last])
                inner = min(degrees) > 1 and first != last
                if not inner or sum(degrees) - 2 > LARGEST_DEGREE:
                    stuck.append(s)
        self._stay.update(end for s in stuck for end in self._ends(s))
        return stuck

    def _merge(self, s: int) -> set[int]:
        """Replace a strand and both its ends by one junction in its middle; return the strands that end there."""
        gone = self._rows.pop(s)
        del self._short[s]
        a, b = self._junctions[gone.first], self._junctions[gone.last]
        place = 0.5 * (a.x + b.x), 0.5 * (a.y + b.y)
        name = f"{gone.first}+{gone.last}"
        self._junctions[name] = Junction(*place, a.all_way_stop and b.all_way_stop)
        ends = [self._meet.pop(end) for end in (gone.first, gone.last)]
        self._meet[name] = [k for end in ends for k in end if k != s]
        for end, way_end in zip((gone.first, gone.last), ends, strict=True):
            for k in way_end:
                while k != s and end in (self._rows[k].first, self._rows[k].last):
                    self._rows[k] = moved(self._rows[k], end, name, place)
        touched = set(self._meet[name])
        for k in touched:
            self._measure(k)
        return touched
