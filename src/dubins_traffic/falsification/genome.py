"""What an instance of a search is made of."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from dubins_traffic.agents import choices
from dubins_traffic.cars.state import Pose
from dubins_traffic.kernels.arrays import Floats


@dataclass(frozen=True, slots=True)
class Genome:
    """What an instance of a search is made of.

    Attributes
    ----------
    base : int
        Number of the trial of the configuration whose network, goals and cars it has.
    root : int
        Number of the trial of the search that was drawn and from which this one descends.
    starts : mapping of int to Pose
        Other starts of some of its cars, by the cars' numbers.
    tables : mapping of int to (K, 7) float64
        What each e-agent chooses (`agents.choices`), by the cars' numbers.
    whims : mapping of int to (K, 5) float64
        What each free e-agent likes to do (`agents.whims`), by the cars' numbers.
    """

    base: int
    root: int
    starts: Mapping[int, Pose] = field(default_factory=dict[int, Pose])
    tables: Mapping[int, Floats] = field(default_factory=dict[int, Floats])
    whims: Mapping[int, Floats] = field(default_factory=dict[int, Floats])

    @property
    def choosing(self) -> list[int]:
        """The numbers of the cars of which something is chosen, in order."""
        return sorted({*self.tables, *self.whims})

    def to_json(self) -> dict[str, Any]:
        """Return it as a JSON object, from which `from_json` makes an equal one."""
        whims = {str(car): table.tolist() for car, table in self.whims.items()}
        return {
            "base": self.base,
            "root": self.root,
            "starts": {str(car): list(pose) for car, pose in self.starts.items()},
            "tables": {str(car): [len(table), choices.to_rows(table)] for car, table in self.tables.items()},
        } | ({"whims": whims} if whims else {})

    @staticmethod
    def from_json(document: Mapping[str, Any]) -> Genome:
        """Return the genome of a JSON object."""
        tables: dict[int, Floats] = {}
        for car, (legs, rows) in document["tables"].items():
            table = choices.empty(legs)
            known = choices.from_rows(rows)
            table[: len(known)] = known
            tables[int(car)] = table
        starts = {int(car): Pose(*pose) for car, pose in document["starts"].items()}
        whims = {int(car): np.array(rows) for car, rows in document.get("whims", {}).items()}
        return Genome(document["base"], document["root"], starts, tables, whims)
