"""Roads that bend once more, slowly: from the corners, by angles and trigonometry; and curved networks for tests."""

from __future__ import annotations

import cmath
import math
from typing import NamedTuple

from dubins_traffic.roads.network import RoadNetwork


class Foot(NamedTuple):
    """Where a point lies on a road: how far off, metres along and to the left, and the direction there."""

    off: float
    along: float
    left: float
    way: complex


class Track:
    """One road of a network, from its first end."""

    def __init__(self, network: RoadNetwork, s: int) -> None:
        x0, y0, x1, y1 = network.segments[s]
        own = network.corners[s] if network.corners else ()
        given = [(x0, y0), *((x, y) for x, y, _ in own), (x1, y1)]
        tx, ty, theta = network.transform
        points = [cmath.rect(1.0, theta) * network.length * complex(x, y) + complex(tx, ty) for x, y in given]
        self.parts: list[tuple[complex, complex, float, float]] = []
        at = points[0]
        for k, (_, _, radius) in enumerate(own, 1):
            into, out = points[k] - points[k - 1], points[k + 1] - points[k]
            turn = cmath.phase(out / into)
            cut = network.length * radius * math.tan(0.5 * abs(turn))
            begin = points[k] - cut * into / abs(into)
            self.parts.append((at, into / abs(into), abs(begin - at), 0.0))
            arc = network.length * radius * abs(turn)
            self.parts.append((begin, into / abs(into), arc, turn / arc))
            at = points[k] + cut * out / abs(out)
        last = points[-1] - points[-2]
        self.parts.append((at, last / abs(last), abs(points[-1] - at), 0.0))
        self.length = sum(length for _, _, length, _ in self.parts)

    def point(self, along: float) -> tuple[complex, complex]:
        """Return the point so far along the road, and the direction there."""
        for start, way, length, bend in self.parts[:-1]:
            if along <= length:
                return self._at(start, way, bend, along)
            along -= length
        start, way, _, bend = self.parts[-1]
        return self._at(start, way, bend, along)

    def foot(self, x: float, y: float) -> Foot:
        """Return where a point lies; the first and the last line go on beyond the ends."""
        spot, done, best = complex(x, y), 0.0, Foot(math.inf, 0.0, 0.0, 1.0)
        for k, (start, way, length, bend) in enumerate(self.parts):
            if bend == 0.0:
                own = (spot - start) / way
                gone, left = own.real, own.imag
            else:
                centre = start + 1j * way / bend
                turn = cmath.phase((spot - centre) / (start - centre)) * math.copysign(1.0, bend)
                gone = turn / abs(bend)
                left = (1.0 / abs(bend) - abs(spot - centre)) * math.copysign(1.0, bend)
            near, _ = self._at(start, way, bend, min(max(gone, 0.0), length))
            outer = (k == 0 and gone < 0.0) or (k == len(self.parts) - 1 and gone > length)
            _, there = self._at(start, way, bend, gone if outer else min(max(gone, 0.0), length))
            if abs(spot - near) < best.off - 1e-12:
                best = Foot(abs(spot - near), done + gone, left, there)
            done += length
        return best

    @staticmethod
    def _at(start: complex, way: complex, bend: float, gone: float) -> tuple[complex, complex]:
        if bend == 0.0:
            return start + gone * way, way
        turned = way * cmath.exp(1j * bend * gone)
        return start + (turned - way) / (1j * bend), turned


RING = RoadNetwork(
    segments=((0, 0, 10, 0), (10, 0, 20, 0.5), (0, 10, 10, 10), (10, 10, 20, 10), (0, 0, 0, 10), (10, 0, 10, 10),
              (20, 0.5, 20, 10)),
    length=1.0,
    transform=(3.0, -2.0, 0.4),
    shape=(11, 21),
    corners=(
        ((3, 0, 1.2), (5, 2.5, 1.2), (7, 0, 1.2)),
        (),
        ((3, 10, 1.5), (5, 8.5, 1.0), (7, 10, 1.5)),
        ((13, 10, 1.5), (15, 12, 1.2), (17, 10, 1.0)),
        ((-3, 3, 2), (-3, 7, 2)),
        ((10, 3, 1.5), (12, 5, 1.5), (10, 7, 1.5)),
        (),
    ),
)  # fmt: skip
"""A network on which five of seven roads bend."""
SNAKE = RoadNetwork(
    segments=((0, 0, 4, 0), (0, 0, -2, 5), (0, 0, -3, -4.5), (4, 0, 2, -6)),
    length=2.0,
    transform=(-8.0, 5.0, 2.1),
    shape=(12, 8),
    corners=(
        ((1.2, 0, 0.5), (2, 0.8, 0.45), (2.8, 0, 0.5)),
        ((-1.5, 1, 0.6), (-0.5, 3, 1)),
        (),
        ((4, -4, 1.5),),
    ),
)
"""Roads that bend about a crossing, and dead ends."""
