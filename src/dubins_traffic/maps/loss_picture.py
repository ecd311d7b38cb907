"""What was lost of a map when it became a network, as a picture (optional extra ``plot``)."""

from __future__ import annotations

import os
from itertools import pairwise
from math import ceil
from typing import Any, NamedTuple

import numpy as np

from dubins_traffic.kernels.arrays import Floats
from dubins_traffic.maps.losses import Fate, Losses, Reason
from dubins_traffic.maps.polylines import simplified
from dubins_traffic.viewer import palette
from dubins_traffic.viewer.figures import figure_class, write_figure

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
NETWORK_COLOUR = "#BBD7EA"
WIDTH = 9.0
"""Inches."""
TALLEST, LOWEST = 1.0, 0.3
"""Height of the map, in `WIDTH` and in its own width."""
NARROWEST, BESIDE, ABOVE, ROW = 7.0, 0.75, 1.35, 0.2
"""Inches: least of a picture; beside the map; above and below it without the legend; of a row of the legend."""
FINEST = 2e-4
"""Lines are drawn within this share of the picture."""
NETWORK, HELD, DROPPED = 4.5, 1.8, 1.0
"""Points."""


def write_losses(path: str | os.PathLike[str], losses: Losses, *, overwrite: bool = False) -> None:
    """Draw what became of the roads of a map into the file `path`: PNG, SVG or PDF, by its suffix.

    Raises
    ------
    InputError
        As `animation.plot.write_plot`.
    MissingExtraError
        If matplotlib is not installed.
    """
    write_figure(path, lambda: _draw(losses), overwrite=overwrite)


def _draw(losses: Losses) -> Any:
    points = np.concatenate([fate.line for fate in losses.fates])
    low, high = points.min(axis=0), points.max(axis=0)
    span = np.maximum(high - low, 1.0)
    span = np.maximum(span, LOWEST * float(span[0]))
    groups = _groups(losses, FINEST * float(span.max()))
    wide = min(WIDTH, WIDTH * TALLEST * float(span[0] / span[1]))
    height = wide * float(span[1] / span[0]) + ABOVE + ROW * ceil(0.5 * len(groups))
    figure: Any = figure_class()(figsize=(max(wide + BESIDE, NARROWEST), height), layout="constrained")
    axes: Any = figure.add_subplot()
    for order, group in enumerate(groups):
        axes.add_collection(group.collection(1.0 + 0.1 * order))
    middle = 0.5 * (low + high)
    for limit, centre, size in zip((axes.set_xlim, axes.set_ylim), middle, 0.53 * span, strict=True):
        limit(centre - size, centre + size)
    axes.set_aspect("equal")
    axes.tick_params(labelsize=8.0)
    axes.set_xlabel("metres of the map", fontsize=9.0)
    axes.set_title(losses.lines()[0].replace("; ", ";\n"), fontsize=9.0)
    figure.legend(loc="outside lower center", ncols=2, fontsize=8.0, frameon=False)
    return figure


class _Group(NamedTuple):
    """Lines of one colour, with what the legend says of them."""

    label: str
    colour: str
    points: float
    lines: list[Floats]

    def collection(self, order: float) -> Any:
        from matplotlib.collections import LineCollection

        style: dict[str, Any] = {"colors": self.colour, "linewidths": self.points, "zorder": order}
        return LineCollection(self.lines, label=self.label, capstyle="round", joinstyle="round", **style)


def _groups(losses: Losses, finest: float) -> list[_Group]:
    """Return what is drawn, from below to above: what was dropped, the network, and which roads it holds."""
    lines: dict[str, list[Floats]] = {name: [] for name in COLOURS}
    for fate in losses.fates:
        for name, line in _parts(fate):
            lines[name].append(simplified(line, finest))
    kept = sum(fate.kept for fate in losses.fates if fate.fate != "dropped")
    held = sum(fate.length for fate in losses.fates if fate.fate != "dropped")
    told = {KEPT: f"{KEPT} ({kept:.0f} m)", OFF: f"{OFF} ({held - kept:.0f} m)"}
    for fate, reason, number, metres in losses.rows():
        if fate == "dropped":
            told[reason] = f"dropped: {reason} ({number}, {metres:.0f} m)"
    dropped = [
        _Group(told[name], COLOURS[name], DROPPED, lines[name])
        for name in COLOURS
        if lines[name] and name not in (KEPT, OFF)
    ]
    network = [simplified(line, finest) for line in losses.network]
    of_map = [_Group(told[name], COLOURS[name], HELD, lines[name]) for name in (KEPT, OFF) if lines[name]]
    return [*dropped, _Group("the network", NETWORK_COLOUR, NETWORK, network), *of_map]


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
