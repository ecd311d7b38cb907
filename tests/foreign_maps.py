"""Small maps of other programs, as texts, for tests."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any

from dubins_traffic.roads.formats import registry
from dubins_traffic.roads.formats.registry import WritesMaps
from dubins_traffic.roads.network import RoadNetwork

FOREIGN = ("commonroad", "lanelet2", "opendrive", "sumo")
"""Formats of other programs that are written, too."""
BENT: Mapping[str, Any] = {
    "version": 2,
    "length": 1,
    "segments": [[0, 0, 20, 0], [0, 0, 10, 15, 0, 15, 3], [20, 0, 10, 15, 20, 8, 4], [10, 15, 10, 30]],
}
"""A triangle with a stub: one straight road, two that bend, and a crossing."""


def written(name: str, document: Mapping[str, Any] | None = None) -> str:
    """Return a network, by default a grid, in a format."""
    form = registry.load(name)
    assert isinstance(form, WritesMaps)
    return form.write(RoadNetwork.grid(2, 3).to_document() if document is None else document)


def sumo(edges: Sequence[str], nodes: Mapping[str, tuple[float, float]]) -> str:
    """Return a net of SUMO: edges as ``from to lanes attributes``, one-way, and nodes by name."""
    rows = [f'<junction id="{name}" type="priority" x="{x}" y="{y}"/>' for name, (x, y) in nodes.items()]
    for edge in edges:
        first, last, lanes, *more = edge.split(" ", 3)
        inner = "".join(f'<lane id="{first}{last}_{k}" index="{k}"/>' for k in range(int(lanes)))
        rows.append(f'<edge id="{first}{last}" from="{first}" to="{last}" {"".join(more)}>{inner}</edge>')
    return f'<net version="1.20">{"".join(rows)}</net>'


def both(*roads: str) -> list[str]:
    """Return the edges of roads ``from to lanes`` in both directions."""
    found: list[str] = []
    for road in roads:
        first, last, rest = road.split(" ", 2)
        found += [f"{first} {last} {rest}", f"{last} {first} {rest}"]
    return found


def opendrive(geometry: str, lanes: str = "", link: str = "") -> str:
    """Return an OpenDRIVE map of one road with some geometry."""
    lane = '<lane id="{}" type="driving"><width sOffset="0" a="3.2" b="0" c="0" d="0"/></lane>'
    usual = f"<left>{lane.format(1)}</left><right>{lane.format(-1)}</right>"
    section = f'<lanes><laneSection s="0">{lanes or usual}</laneSection></lanes>'
    road = f'<road id="1" junction="-1" length="100">{link}<planView>{geometry}</planView>{section}</road>'
    return f'<OpenDRIVE><header revMajor="1" revMinor="6"/>{road}</OpenDRIVE>'


def changed(name: str, old: str, new: str) -> Callable[[], str]:
    """Return what makes a text of a format in which the first `old` stands as `new`."""

    def make() -> str:
        text = written(name)
        assert old in text, old
        return text.replace(old, new, 1)

    return make
