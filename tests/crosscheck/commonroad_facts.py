"""Run by the Python that has commonroad-io: what it finds in a scenario, as JSON."""

from __future__ import annotations

import json
import sys

import numpy as np
from commonroad.common.file_reader import CommonRoadFileReader  # pyright: ignore[reportMissingImports]

scenario, _ = CommonRoadFileReader(sys.argv[1]).open()
network = scenario.lanelet_network


def metres(line: np.ndarray) -> float:
    """Return the length of a polyline."""
    return float(np.hypot(*np.diff(line, axis=0).T).sum())


ends = {lanelet.lanelet_id: (lanelet.left_vertices[0], lanelet.left_vertices[-1]) for lanelet in network.lanelets}
found = {
    "junctions": sorted(
        ends[next(iter(own.incomings)).incoming_lanelets.copy().pop()][1].tolist() for own in network.intersections
    ),
    "signs": sorted(str(own.traffic_sign_elements[0].traffic_sign_element_id) for own in network.traffic_signs),
    "lanes": sorted(
        [
            *lanelet.left_vertices[0].tolist(),
            *lanelet.left_vertices[-1].tolist(),
            metres(lanelet.left_vertices),
        ]
        for lanelet in network.lanelets
    ),
    "turns": sum(len(lanelet.successor) for lanelet in network.lanelets),
}
print(json.dumps(found))
