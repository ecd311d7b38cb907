"""Run by the Python that has Lanelet2: what it finds in a map, as JSON."""

from __future__ import annotations

import json
import sys
from math import hypot

from lanelet2.core import AllWayStop  # pyright: ignore[reportMissingImports]
from lanelet2.io import Origin, loadRobust  # pyright: ignore[reportMissingImports]
from lanelet2.projection import UtmProjector  # pyright: ignore[reportMissingImports]

found_map, errors = loadRobust(sys.argv[1], UtmProjector(Origin(49.0, 9.0)))
rows = []
for lanelet in found_map.laneletLayer:
    points = [(point.x, point.y) for point in lanelet.leftBound]
    metres = sum(hypot(x - u, y - v) for (x, y), (u, v) in zip(points, points[1:]))  # noqa: B905, RUF007
    rows.append([*points[0], *points[-1], metres])
stops = [own for own in found_map.regulatoryElementLayer if isinstance(own, AllWayStop)]
stopping = [[lanelet.leftBound[-1].x, lanelet.leftBound[-1].y] for own in stops for lanelet in own.lanelets()[:1]]
print(json.dumps({"errors": list(errors), "lanes": sorted(rows), "junctions": sorted(stopping)}))
