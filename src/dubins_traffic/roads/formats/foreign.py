"""What the formats of other programs have in common: they are read into a road map, which is reduced to a network."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Mapping
from typing import Any

from dubins_traffic.roads.maps.model import RoadMap
from dubins_traffic.roads.maps.ours import road_map
from dubins_traffic.roads.maps.reduction import Reduction, reduction
from dubins_traffic.roads.maps.settings import ImportSettings


class ForeignFormat(ABC):
    """A map format of another program: what it reads is reduced to what a network can hold."""

    name: str
    suffixes: tuple[str, ...]
    description: str

    @abstractmethod
    def sniff(self, text: str) -> bool:
        """Tell whether a text is of this format, from its beginning."""

    @abstractmethod
    def read_map(self, text: str, file: str | None = None) -> RoadMap:
        """Return the map in a text; InputError if it is broken."""

    def read(self, text: str, file: str | None = None) -> Mapping[str, Any]:
        """Return the RND document of the network to which a text is reduced, with usual `ImportSettings`."""
        return self.reduced(text, file).document

    def reduced(
        self,
        text: str,
        file: str | None = None,
        settings: ImportSettings | None = None,
        *,
        own_lanes: bool = False,
    ) -> Reduction:
        """Return the network to which a text is reduced, and what was lost; see `roads.maps.reduction.reduction`."""
        return reduction(self.read_map(text, file), settings, file, own_lanes=own_lanes)


class WrittenFormat(ForeignFormat):
    """A map format of another program that can be written, too."""

    @abstractmethod
    def write_map(self, made: RoadMap) -> str:
        """Return the text of a map whose roads have one lane in each direction."""

    def write(self, document: Mapping[str, Any]) -> str:
        """Return the text of an RND document."""
        return self.write_map(road_map(document))
