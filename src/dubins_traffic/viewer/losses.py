"""What was lost of a map when it became a network, as a picture (optional extra ``plot``)."""

from __future__ import annotations

import os
from itertools import pairwise
from typing import Any

import numpy as np

from dubins_traffic.kernels.arrays import Floats
from dubins_traffic.roads.maps.losses import Fate, Losses
from dubins_traffic.roads.maps.polylines import simplified
from dubins_traffic.roads.maps.reasons import Reason
from dubins_traffic.viewer import palette
from dubins_traffic.viewer.canvas import figure_class
from dubins_traffic.viewer.plot import write_figure

KEPT, OFF = "kept within the tolerance", "held, but farther off"
COLOURS: dict[str, str] = {
    KEPT: palette.EGO_COLOUR,
    OFF: palette.CONTACT_COLOUR,
    Reason.CLOSED: palette.ROAD_COLOUR,
    Reason.ONE_WAY: "#E69F00",
    Reason.LANES: "#CC79A7",
    Reason.DEGREE: "#882255",
    Reason.JUNCTIONS: "#999933",
    Reason.ANGLE: "#44AA99",
    Reason.CURVATURE: "#D55E00",
    Reason.LENGTH: "#6B5B4B",
    Reason.CROSSING: "#B3125F",
    Reason.APART: "#22272E",
}
"""Of parts of roads that are held, and of dropped roads by their reason."""
WIDTH = 9.0
"""Inches."""
FINEST = 2e-4
"""Lines are drawn within this share of the picture."""
HELD, DROPPED = 1.8, 1.0
"""Points."""


def write_losses(path: str | os.PathLike[str], losses: Losses) -> None:
    """Draw what became of the roads of a map into the file `path`: PNG, SVG or PDF, by its suffix.

    Raises
    ------
    InputError
        If the suffix is none of these, or the file can't be written.
    MissingExtraError
        If matplotlib is not installed.
    """
    write_figure(path, lambda: _draw(losses))


def _draw(losses: Losses) -> Any:
    from matplotlib.collections import LineCollection

    points = np.concatenate([fate.line for fate in losses.fates])
    low, high = points.min(axis=0), points.max(axis=0)
    span = np.maximum(high - low, 1.0)
    lines: dict[str, list[Floats]] = {name: [] for name in COLOURS}
    for fate in losses.fates:
        for name, line in _parts(fate):
            lines[name].append(simplified(line, FINEST * float(span.max())))
    height = min(max(WIDTH * float(span[1] / span[0]), 3.0), 2.0 * WIDTH)
    figure: Any = figure_class()(figsize=(WIDTH, height + 1.6), layout="constrained")
    axes: Any = figure.add_subplot()
    for name, colour in COLOURS.items():
        if lines[name]:
            held = name in (KEPT, OFF)
            drawn = LineCollection(
                lines[name],
                colors=colour,
                linewidths=HELD if held else DROPPED,
                zorder=2.0 + held,
                label=name if held else f"dropped: {name}",
                capstyle="round",
            )
            axes.add_collection(drawn)
    axes.set_xlim(low[0] - 0.03 * span[0], high[0] + 0.03 * span[0])
    axes.set_ylim(low[1] - 0.03 * span[1], high[1] + 0.03 * span[1])
    axes.set_aspect("equal")
    axes.set_xlabel("metres of the map")
    axes.set_title(losses.lines()[0].replace("; ", ";\n"), fontsize=9.0)
    figure.legend(loc="outside lower center", ncols=2, fontsize=8.0, frameon=False)
    return figure


def _parts(fate: Fate) -> list[tuple[str, Floats]]:
    """Return the parts of a road, each with the name of its colour."""
    if fate.fate == "dropped":
        return [(fate.reasons[0], fate.line)]
    cuts = np.flatnonzero(np.diff(fate.near.astype(np.int8))) + 1
    bounds = [0, *cuts.tolist(), len(fate.line)]
    return [
        (KEPT if fate.near[begin] else OFF, fate.line[begin : end + 1])
        for begin, end in pairwise(bounds)
        if len(fate.line[begin : end + 1]) > 1
    ]
