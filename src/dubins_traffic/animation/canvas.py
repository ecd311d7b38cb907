"""The canvas of pictures: roads, goals, obstacles, cars and paths drawn with Matplotlib, from the ground up."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from itertools import groupby
from typing import Any, cast

import numpy as np

from dubins_traffic.cars.body import Car
from dubins_traffic.cars.state import Pose
from dubins_traffic.kernels.arrays import Floats
from dubins_traffic.problem.instance import Instance, Problem
from dubins_traffic.roads.network import RoadNetwork
from dubins_traffic.viewer import palette, shapes
from dubins_traffic.viewer.figures import figure_class
from dubins_traffic.viewer.marks import Mark
from dubins_traffic.viewer.scene import Extent, extent
from dubins_traffic.viewer.shapes import Circle, Line, Region, Shape, Sign, Text, Width

SIDE_RANGE = (4.5, 13.0)
INCHES_PER_METRE = 0.55
MARGIN = 0.5
LEGEND_COLUMN = 1.15
LEGEND_ROW = 0.2


class Canvas:
    """One pair of axes in metres, drawn upon from the ground up."""

    def __init__(self, network: RoadNetwork, car: Car, spans: Sequence[Floats]) -> None:
        self.network, self.car = network, car
        box = extent(network, 0.5 * car.road_width, *spans)
        self.box = Extent(box.left - MARGIN, box.bottom - MARGIN, box.right + MARGIN, box.top + MARGIN)
        longest = max(self.box.width, self.box.height)
        inches = min(max(INCHES_PER_METRE * longest, SIDE_RANGE[0]), SIDE_RANGE[1])
        self.scale = inches / longest
        self.points = 72.0 * self.scale
        self.figure: Any = figure_class()(layout=None)
        self.axes: Any = self.figure.add_axes((0.0, 0.0, 1.0, 1.0))
        self.handles: list[tuple[str, Any]] = []
        self.things: dict[str, Any] = {}
        self.order = 1.0

    def draw(self, drawn: Iterable[Shape]) -> dict[str, Any]:
        """Draw shapes over what is there, and return by their labels what a legend shows of them."""
        shown: dict[str, Any] = {}
        for look, run in groupby(drawn, key=self._look):
            self.order += 0.01
            if look is not None:
                self._lines([shape for shape in run if isinstance(shape, Line)])
                continue
            for shape in run:
                if isinstance(shape, Text):
                    self._text(shape)
                elif not isinstance(shape, Line):
                    patch = self._sign(shape) if isinstance(shape, Sign) else self._patch(shape)
                    if shape.label is not None:
                        shown.setdefault(shape.label, patch)
        return shown

    def _look(self, shape: Shape) -> tuple[Any, ...] | None:
        """Return what lines have in common that are drawn together; None for other shapes."""
        return (shape.colour, shape.width, shape.dash, shape.opacity) if isinstance(shape, Line) else None

    def _lines(self, lines: Sequence[Line]) -> None:
        """Draw lines that look the same."""
        from matplotlib.collections import LineCollection
        from matplotlib.lines import Line2D

        first = lines[0]
        width = first.width.at(self.points)
        end, opacity = "round" if first.round else "butt", first.opacity_at(self.points)
        if len(lines) == 1 and first.dash is None:
            line = Line2D(
                *np.asarray(first.points).T, color=first.colour, linewidth=width, alpha=opacity, zorder=self.order,
                solid_capstyle=cast(Any, end), solid_joinstyle="round",
            )  # fmt: skip
            self.axes.add_line(line)
            return
        style: Any = "solid"
        if first.dash is not None:
            style = [(0.0, tuple(part * self.points / width for part in first.dash))]
        group = LineCollection(
            [np.asarray(line.points) for line in lines],
            linewidths=width,
            colors=first.colour,
            linestyles=style,
            alpha=opacity,
            capstyle=cast(Any, end),
            joinstyle="round",
            zorder=self.order,
        )
        self.axes.add_collection(group, autolim=False)

    def _patch(self, shape: Region | Circle) -> Any:
        from matplotlib.colors import to_rgba
        from matplotlib.patches import Circle as Disc
        from matplotlib.patches import Polygon

        look: dict[str, Any] = {
            "edgecolor": shape.edge or "none",
            "linewidth": shape.width,
            "zorder": self.order,
        }
        if isinstance(shape, Region):
            patch: Any = Polygon(shape.points, closed=True, facecolor=shape.fill, **look)
        else:
            face = to_rgba(shape.fill, shape.opacity)
            patch = Disc((shape.x, shape.y), shape.radius, facecolor=face, **look)
        self.axes.add_patch(patch)
        return patch

    def _sign(self, sign: Sign) -> Any:
        (mark,) = self.axes.plot(
            [sign.x],
            [sign.y],
            linestyle="none",
            marker={"contact": "X", "breach": "^"}[sign.kind],
            markersize=min(9.0, max(5.0, 0.3 * self.points)),
            markerfacecolor=sign.fill,
            markeredgecolor=sign.edge,
            markeredgewidth=0.8,
            zorder=self.order,
        )
        return mark

    def _text(self, text: Text) -> None:
        from matplotlib.patheffects import withStroke

        size = text.size_at(self.points)
        if size == 0.0:
            return
        self.axes.text(
            text.x,
            text.y,
            text.words,
            fontsize=size,
            color=text.colour,
            ha="center",
            va="center",
            zorder=self.order,
            fontweight="bold" if text.bold else "normal",
            path_effects=[withStroke(linewidth=1.4, foreground="white")] if text.halo else None,
            parse_math=False,
            clip_on=True,
        )

    def roads(self) -> None:
        """Draw surfaces with kerbs, centre lines, hints of directions and lattice points."""
        network, car = self.network, self.car
        self.draw([*shapes.roads(network, car), *shapes.centres(network, car), *shapes.hints(network, car)])
        self.draw(shapes.places(network, car))

    def problem(self, problem: Problem) -> None:
        """Draw the goals' discs and the obstacles; `names` numbers the goals."""
        self.things |= self.draw([*shapes.goals(problem), *shapes.obstacles(problem)])

    def names(self, problem: Problem) -> None:
        """Write the names of the goals."""
        radius = problem.intersection_radius
        self.draw(shapes.goal_names(problem, Width(0.34 * radius, 3.0, 9.0), lift=0.62 * radius))

    def cars(self, instance: Instance, poses: Sequence[Pose]) -> None:
        """Draw bodies with their headings.

        So many cars that colours come again bear their names, and only the ego stands in the legend.
        """
        crowd = len(poses) > 1 + len(palette.AGENT_COLOURS)
        names = instance.names
        shown = self.draw(shapes.cars(self.car.body, names, poses))
        self.handles += [(name, patch) for name, patch in shown.items() if name == names[0] or not crowd]
        if crowd:
            lift, ink = self.car.body.reach + 5.0 / self.points, palette.INK_COLOUR
            size = Width(5.5 / self.points, 0.0, 5.5)
            self.draw(
                Text(pose.x, pose.y + lift, name, ink, size, halo=True)
                for name, pose in reversed(list(zip(names, poses, strict=True)))
            )

    def trial(
        self,
        instance: Instance,
        lines: Sequence[Floats],
        starts: Sequence[Pose],
        ends: Sequence[Pose],
        marks: Sequence[Mark],
    ) -> None:
        """Draw the paths of all cars, where they began and ended, contacts and breaches."""
        from matplotlib.lines import Line2D

        self.draw([*shapes.ways(lines), *shapes.cars(self.car.body, instance.names, starts, ghost=True)])
        self.cars(instance, ends)
        self.things |= self.draw(shapes.signs(marks))
        start = Line2D([], [], linestyle="none", marker="o", markerfacecolor="none", markeredgecolor="#555555")
        end = Line2D([], [], linestyle="none", marker="o", markerfacecolor="#555555", markeredgecolor="#222222")
        self.things |= {"start": start, "end": end}

    def finish(self, title: str) -> None:
        """Set the frame, the scale, the title and the legend; the figure's size follows from the roads."""
        entries = [*reversed(self.handles), *self.things.items()]
        width = max(self.box.width * self.scale, 4.0)
        height = self.box.height * self.scale
        rows = -(-len(entries) // max(1, int(width / LEGEND_COLUMN)))
        columns = -(-len(entries) // max(1, rows))
        left, right, top, bottom = 0.6, 0.18, 0.4, 0.5 + LEGEND_ROW * rows
        whole = (width + left + right, height + top + bottom)
        self.figure.set_size_inches(*whole)
        self.axes.set_position((left / whole[0], bottom / whole[1], width / whole[0], height / whole[1]))
        spare = 0.5 * (width / self.scale - self.box.width)
        self.axes.set_xlim(self.box.left - spare, self.box.right + spare)
        self.axes.set_ylim(self.box.bottom, self.box.top)
        self.axes.set_aspect("equal", adjustable="box")
        self.axes.set_facecolor(palette.GROUND_COLOUR)
        self.axes.tick_params(colors=palette.FAINT_COLOUR, labelsize=7.5, length=3, width=0.6)
        for spine in self.axes.spines.values():
            spine.set(color=palette.KERB_COLOUR, linewidth=0.6)
        self.axes.set_xlabel("x (m)", fontsize=8, color=palette.FAINT_COLOUR, labelpad=2)
        self.axes.set_ylabel("y (m)", fontsize=8, color=palette.FAINT_COLOUR, labelpad=2)
        self.axes.set_title(title, fontsize=10, color=palette.INK_COLOUR, loc="left", pad=6)
        if not entries:
            return
        across = [entry for column in range(columns) for entry in entries[column::columns]]
        self.figure.legend(
            [handle for _, handle in across],
            [name for name, _ in across],
            loc="upper center",
            bbox_to_anchor=((left + 0.5 * width) / whole[0], (bottom - 0.36) / whole[1]),
            ncols=columns,
            fontsize=8,
            labelcolor=palette.INK_COLOUR,
            frameon=False,
            borderaxespad=0.0,
            handlelength=1.3,
            handleheight=1.0,
            columnspacing=1.4,
        )
