"""All that may be chosen in one drawn trial as the points of a unit cube, for those who search in vectors."""

from __future__ import annotations

import numpy as np

from dubins_traffic.agents.choices import BOUNDS, CHOICE
from dubins_traffic.falsification.moves import Genome, lots_of, pose_at, spot_of, started, starts_of
from dubins_traffic.falsification.sampling import Source
from dubins_traffic.kernels.arrays import Floats


class Cube:
    """The trials that differ from the drawn trial `base` in what the e-agents choose, and in where cars start.

    A number for each entry of each car's table comes first (`agents.choices`), from the least to the largest value that
    it may have; then, if `starts` are asked for, one for each car whose start the configuration leaves to chance: from
    one end of the place where it stands in its lane to the other.

    Attributes
    ----------
    size : int
        How many numbers a point has.
    """

    def __init__(self, source: Source, base: int, *, starts: bool = False) -> None:
        self._drawn = source.fresh(base)
        (self._base,) = source.draw([base])
        self._shapes = {car: table.shape for car, table in self._drawn.tables.items()}
        lots = lots_of(self._base)
        spots = {car: spot_of(lots, self._base.starts[car]) for car in (source.movable if starts else ())}
        self._spots = {car: spot[0] for car, spot in spots.items() if spot is not None}
        self.size = sum(rows * columns for rows, columns in self._shapes.values()) + len(self._spots)

    def genome(self, point: Floats) -> Genome:
        """Return the genome at a point, shape (size,) from 0 to 1; cars that would be too near stay where they are."""
        low, high = BOUNDS[:, 0], BOUNDS[:, 1]
        tables: dict[int, Floats] = {}
        done = 0
        for car, (rows, columns) in self._shapes.items():
            share = point[done : done + rows * columns].reshape(rows, columns)
            done += rows * columns
            tables[car] = low + (high - low) * share
            exits = np.minimum(np.floor(share[:, CHOICE.EXIT] * (high[CHOICE.EXIT] + 1)), high[CHOICE.EXIT])
            tables[car][:, CHOICE.EXIT] = exits
        genome = Genome(self._drawn.base, self._drawn.root, {}, tables, self._drawn.whims)
        lots = lots_of(self._base)
        for (car, place), share in zip(self._spots.items(), point[done:].tolist(), strict=False):
            lot = lots.places[place]
            poses = starts_of(genome, self._base)
            poses[car] = pose_at(lots, place, lot.low + share * (lot.high - lot.low))
            genome = started(genome, self._base, poses, {car: poses[car]})
        return genome
