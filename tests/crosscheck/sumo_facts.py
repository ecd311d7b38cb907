"""Run by the Python that has SUMO: what its own reader finds in a net, as JSON."""

from __future__ import annotations

import json
import sys
from pathlib import Path

import sumo  # pyright: ignore[reportMissingImports]

sys.path.insert(0, str(Path(sumo.SUMO_HOME) / "tools"))
import sumolib  # pyright: ignore[reportMissingImports]

net = sumolib.net.readNet(sys.argv[1])
found = {
    "junctions": sorted([*node.getCoord(), node.getType() == "allway_stop"] for node in net.getNodes()),
    "lanes": sorted(
        [*edge.getFromNode().getCoord(), *edge.getToNode().getCoord(), lane.getLength()]
        for edge in net.getEdges()
        for lane in edge.getLanes()
    ),
    "box": list(net.getBoundary()),
    "turns": sum(len(out) for edge in net.getEdges() for out in edge.getOutgoing().values()),
}
print(json.dumps(found))
