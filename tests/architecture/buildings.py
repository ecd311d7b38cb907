"""The buildings of the house, as the contract in pyproject.toml has them, and the check of that contract."""

from __future__ import annotations

import tomllib
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cache
from typing import Any

from grimp import ImportGraph
from importlinter import Contract, ContractCheck, fields, output

from tests.architecture.house import ROOT

ROOF = "roof"
"""What stands above all buildings."""
CORE = "core"
"""The building that all others know."""
BUILDINGS = (ROOF, "arena", "research", "bridges", CORE)


@dataclass(frozen=True)
class Town:
    """Rooms in their buildings.

    Attributes
    ----------
    building : mapping
        The building of each room.
    level : mapping
        The line of each room in its building, from the top, 0.
    arrows : set
        Pairs of buildings or rooms: what the first may know besides what all may.
    """

    building: Mapping[str, str]
    level: Mapping[str, int]
    arrows: frozenset[tuple[str, str]]

    def may_know(self, room: str, other: str) -> bool:
        """Tell whether a room may import another."""
        own, theirs = self.building[room], self.building[other]
        if room == other:
            return True
        if own == theirs:
            return self.level[room] < self.level[other]
        ends = ((first, second) for first in (room, own) for second in (other, theirs))
        return own == ROOF or theirs == CORE or any(pair in self.arrows for pair in ends)

    def rooms(self, building: str) -> list[str]:
        """Return the rooms of a building, from the top."""
        return [room for room, own in self.building.items() if own == building]


def town_of(contract: Mapping[str, Any]) -> Town:
    """Return the town that a contract describes; ValueError if a room is listed twice or an arrow has other ends."""
    building: dict[str, str] = {}
    level: dict[str, int] = {}
    for name in BUILDINGS:
        for number, line in enumerate(contract[name]):
            for room in line.split(" | "):
                if room in building:
                    raise ValueError(f"{room} is listed twice")
                building[room], level[room] = name, number
    pairs = [tuple(line.split(" -> ")) for line in contract["arrows"]]
    if any(len(pair) != 2 or not {*pair} <= {*building, *BUILDINGS} for pair in pairs):
        raise ValueError("an arrow leads from a building or room to another: A -> B")
    return Town(building, level, frozenset((first, second) for first, second in pairs))


@cache
def town() -> Town:
    """Return the town of this package."""
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))
    (contract,) = project["tool"]["importlinter"]["contracts"]
    return town_of(contract)


def faults(found: Town, rooms: set[str], imports: Sequence[tuple[str, str]]) -> Iterator[str]:
    """Yield what is wrong: rooms that no building has or that are not there, and imports that no room may make.

    Parameters
    ----------
    found : Town
        What the contract says.
    rooms : set of str
        The rooms that are there.
    imports : sequence of pairs
        Modules below the package: the first imports the second.
    """
    yield from (f"{room} is in no building" for room in sorted(rooms - found.building.keys()))
    yield from (f"there is no room {room}" for room in sorted(found.building.keys() - rooms))
    for module, other in imports:
        room, theirs = module.partition(".")[0], other.partition(".")[0]
        known = room in found.building and theirs in found.building
        if known and not found.may_know(room, theirs):
            yield f"{module} ({found.building[room]}) imports {other} ({found.building[theirs]})"


def direct_imports(graph: ImportGraph, package: str) -> list[tuple[str, str]]:
    """Return all imports between modules below a package, whose own `__init__` may import anything."""
    head = f"{package}."
    inside = sorted(name for name in graph.modules if name.startswith(head))
    return [
        (module.removeprefix(head), other.removeprefix(head))
        for module in inside
        for other in sorted(graph.find_modules_directly_imported_by(module))
        if other.startswith(head)
    ]


class BuildingsContract(Contract):
    """Rooms know what is below them in their building, core, and what the arrows say; every room is in a building."""

    roof = fields.ListField(subfield=fields.StringField())
    arena = fields.ListField(subfield=fields.StringField())
    research = fields.ListField(subfield=fields.StringField())
    bridges = fields.ListField(subfield=fields.StringField())
    core = fields.ListField(subfield=fields.StringField())
    arrows = fields.ListField(subfield=fields.StringField())

    def check(self, graph: ImportGraph, verbose: bool) -> ContractCheck:  # noqa: ARG002  # it is quick
        """Check all imports of the package."""
        contract = {name: getattr(self, name) for name in (*BUILDINGS, "arrows")}
        (package,) = self.session_options["root_packages"]
        rooms = {child.removeprefix(f"{package}.") for child in graph.find_children(package)}
        found = list(faults(town_of(contract), rooms, direct_imports(graph, package)))
        return ContractCheck(kept=not found, metadata={"faults": found})

    def render_broken_contract(self, check: ContractCheck) -> None:
        """Print what is wrong, a line each."""
        for line in check.metadata["faults"]:
            output.print_error(f"- {line}")
