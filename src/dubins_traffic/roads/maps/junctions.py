"""Where roads end together: ends that belong together are one junction, and its place follows from their directions."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import NamedTuple

import numpy as np

from dubins_traffic.kernels.arrays import Floats
from dubins_traffic.roads.maps.model import Junction
from dubins_traffic.roads.maps.union import Union

SAME = 1e-6
"""Ends nearer than this are one point."""
PARALLEL = 0.02
"""Least eigenvalue, for each end, of the lines through them: below it they hardly cross."""


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
        crossing = np.asarray(
            np.linalg.solve(whole, (across @ ends[:, :, None]).sum(axis=0)[:, 0]), dtype=np.float64
        )
        reach = float(np.sqrt(((ends - mean) ** 2).sum(axis=1)).max())
        if float(np.sqrt(((crossing - mean) ** 2).sum())) <= 2.0 * reach:
            return float(crossing[0]), float(crossing[1])
    return float(mean[0]), float(mean[1])
