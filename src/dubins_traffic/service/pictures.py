"""Small maps of trials, drawn from the pages that replay them: roads, goals, obstacles, and the ways of the cars."""

from __future__ import annotations

import base64
import gzip
import json
from collections.abc import Iterator
from typing import Any, Final

import numpy as np
import numpy.typing as npt

from dubins_traffic.kernels.arrays import Floats
from dubins_traffic.viewer import palette
from dubins_traffic.viewer.pages import render

POINTS: Final = 120
"""Most points of the way of a car."""
BEGINS: Final = b'id="data">'
ENDS: Final = b"</script>"
POLICY: Final = "default-src 'none'; style-src 'unsafe-inline'; frame-ancestors 'none'"
"""Of a map, which may hold a style sheet and nothing else."""
MOVES_S: Final = 30.0
"""How long a moving map takes to go through its trial."""


def map_of(page: bytes, *, moves: bool = False) -> str:
    """Return the map of a trial as SVG, from its replay, packed by gzip; `moves`: with cars that drive along them.

    For readers who want no motion there are the ways alone.
    """
    text = gzip.decompress(page)
    first = text.index(BEGINS) + len(BEGINS)
    document = json.loads(text[first : text.index(ENDS, first)])
    roads, cars, frames = document["roads"], len(document["cars"]), document["frames"]
    points = _read(roads["points"], "<f4").reshape(-1, 2)
    lines = (
        _read(roads["lines"], "<f4").reshape(-1, 2, 2)
        if "lines" in roads
        else points[_read(roads["ends"], "<i4").reshape(-1, 2)]
    )
    x, y = (_read(document["series"][name], "<f4").reshape(cars, frames) for name in "xy")
    count = min(frames, POINTS)
    chosen = [k * (frames - 1) // max(1, count - 1) for k in range(count)]
    ways = np.stack([x[:, chosen], y[:, chosen]], axis=2)
    wide = float(roads["width"])
    low, high = points.min(axis=0) - wide, points.max(axis=0) + wide
    drawn = {
        "box": f"{low[0]:.2f} {-high[1]:.2f} {high[0] - low[0]:.2f} {high[1] - low[1]:.2f}",
        "wide": wide,
        "roads": [_path(line) for line in lines],
        "goals": [_at(points[vertex]) for vertex in document["goals"]["vertices"]],
        "radius": document["goals"]["radius"],
        "obstacles": list(_obstacles(document["obstacles"])),
        "ways": [
            {"path": _path(way), "last": _at(way[-1]), "colour": car["colour"], "moves": _moves(way)}
            for way, car in reversed(list(zip(ways, document["cars"], strict=True)))
        ],
        "contacts": [_at(mark["point"]) for mark in document["marks"] if mark["kind"] == "contact" and mark["point"]],
        "looks": palette.MAP,
        "moving": moves,
        "seconds": MOVES_S,
    }
    return render("service/web/templates/map.svg.html", **drawn)


def _read(packed: str, kind: str) -> npt.NDArray[Any]:
    return np.frombuffer(base64.b64decode(packed), dtype=kind)


def _at(point: Any) -> tuple[str, str]:
    """Return a point as SVG has it, whose ordinates grow downwards."""
    return f"{float(point[0]):.2f}", f"{-float(point[1]):.2f}"


def _path(line: Floats) -> str:
    return "M" + "L".join(" ".join(_at(point)) for point in line)


def _moves(way: Floats) -> str:
    """Return the places of a car as the values of an animation."""
    return ";".join(",".join(_at(point)) for point in way)


def _obstacles(obstacles: list[dict[str, Any]]) -> Iterator[str]:
    for one in obstacles:
        if "disc" in one:
            x, y, radius = one["disc"]
            turn = np.linspace(0.0, 2.0 * np.pi, 16, endpoint=False)
            corners = np.stack([x + radius * np.cos(turn), y + radius * np.sin(turn)], axis=1)
        else:
            corners = np.asarray(one["polygon"])
        yield _path(corners) + "Z"
