"""Where ends of roads meet in a junction, and which two directions are one road, which many formats give as two."""

from __future__ import annotations

from collections.abc import Hashable, Iterable, Mapping
from typing import Generic, NamedTuple, TypeVar

import numpy as np

from dubins_traffic.kernels.arrays import Floats
from dubins_traffic.maps.model import Corner, Junction, Road
from dubins_traffic.maps.polylines import along, at

Member = TypeVar("Member", bound=Hashable)
SAME = 1e-6
"""Ends nearer than this are one point."""
PARALLEL = 0.02
"""Least eigenvalue, for each end, of the lines through them: below it they hardly cross."""
APART = 1.0
"""Most metres between the lines of two directions that are one road."""
_SAMPLES = 33


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


class End(NamedTuple):
    """An end of a road: the road's name, and whether the road begins there."""

    road: str
    begins: bool

    @property
    def name(self) -> str:
        """A name for it."""
        return f"{self.road}{'<' if self.begins else '>'}"


def joined_where_equal(union: Union[End], lines: Mapping[str, Floats]) -> None:
    """Join the ends of lines that are at one point."""
    near: dict[tuple[int, int], list[tuple[End, Floats]]] = {}
    for name, line in lines.items():
        for end, place in ((End(name, True), line[0]), (End(name, False), line[-1])):
            x, y = int(np.floor(place[0])), int(np.floor(place[1]))
            for cell in ((x + i, y + j) for i in (-1, 0, 1) for j in (-1, 0, 1)):
                for other, there in near.get(cell, []):
                    if float(np.abs(place - there).max()) <= SAME:
                        union.join((other, end))
            near.setdefault((x, y), []).append((end, place))


def junctions_of(
    union: Union[End], lines: Mapping[str, Floats], stops: Iterable[End] = ()
) -> tuple[dict[str, Junction], dict[End, str]]:
    """Return the junctions of the ends of lines, and the name of that at each end; at `stops` everybody stops."""
    groups: dict[End, list[End]] = {}
    for name in lines:
        for end in (End(name, True), End(name, False)):
            groups.setdefault(union.root(end), []).append(end)
    stopping = {union.root(end) for end in stops}
    junctions: dict[str, Junction] = {}
    names: dict[End, str] = {}
    for root, ends in groups.items():
        x, y = _place([lines[end.road] if end.begins else lines[end.road][::-1] for end in ends])
        junctions[root.name] = Junction(x, y, root in stopping)
        names |= dict.fromkeys(ends, root.name)
    return junctions, names


def _place(lines: list[Floats]) -> tuple[float, float]:
    """Return where lines, that begin at a junction, would meet: the point nearest to what they go on to backwards."""
    ends = np.array([line[0] for line in lines])
    mean = ends.mean(axis=0)
    if float(np.abs(ends - ends[0]).max()) <= SAME:
        return float(ends[0, 0]), float(ends[0, 1])
    step = np.array([line[1] - line[0] for line in lines])
    unit = step / np.maximum(np.sqrt((step * step).sum(axis=1)), 1e-300)[:, None]
    across = np.eye(2)[None] - unit[:, :, None] * unit[:, None, :]
    whole = across.sum(axis=0)
    if float(np.linalg.eigvalsh(whole)[0]) > PARALLEL * len(lines):
        crossing = np.asarray(np.linalg.solve(whole, (across @ ends[:, :, None]).sum(axis=0)[:, 0]), dtype=np.float64)
        reach = float(np.sqrt(((ends - mean) ** 2).sum(axis=1)).max())
        if float(np.sqrt(((crossing - mean) ** 2).sum())) <= 2.0 * reach:
            return float(crossing[0]), float(crossing[1])
    return float(mean[0]), float(mean[1])


class OneWay(NamedTuple):
    """One direction of a road: its line runs between the two directions, from `first` to `last`."""

    name: str
    first: str
    last: str
    line: Floats
    lanes: int
    lane_width: float
    corners: tuple[Corner, ...] | None = None
    closed: bool = False


def paired(directions: list[OneWay]) -> list[Road]:
    """Return the roads of directions; of several that could be the other way of one the nearest is."""
    waiting: dict[tuple[str, str], list[OneWay]] = {}
    roads: list[Road] = []
    for one in directions:
        back = waiting.get((one.last, one.first), [])
        gaps = [gap(one.line, other.line[::-1]) for other in back]
        if gaps and min(gaps) <= APART:
            roads.append(_joined(back.pop(gaps.index(min(gaps))), one))
        else:
            waiting.setdefault((one.first, one.last), []).append(one)
    lonely = [one for group in waiting.values() for one in group]
    return roads + [
        Road(one.name, one.first, one.last, one.line, one.lanes, 0, one.lane_width, one.corners, one.closed)
        for one in lonely
    ]


def _joined(one: OneWay, back: OneWay) -> Road:
    width = max(one.lane_width, back.lane_width)
    closed = one.closed or back.closed
    return Road(one.name, one.first, one.last, one.line, one.lanes, back.lanes, width, one.corners, closed)


def gap(one: Floats, other: Floats) -> float:
    """Return the largest distance of two lines at equal shares of their lengths."""
    step = spread(one) - spread(other)
    return float(np.sqrt((step * step).sum(axis=1)).max())


def spread(line: Floats) -> Floats:
    """Return points at equal shares of a line's length."""
    return at(line, np.linspace(0.0, float(along(line)[-1]), _SAMPLES))
