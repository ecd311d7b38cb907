"""The canvas of pictures: roads, goals, obstacles, cars and paths drawn with Matplotlib, from the ground up."""

from __future__ import annotations

from collections.abc import Sequence
from functools import cache
from io import BytesIO
from typing import Any

import numpy as np

from dubins_traffic.cars.body import Car, DiscObstacle, Obstacle
from dubins_traffic.cars.state import Pose
from dubins_traffic.kernels.arrays import Floats
from dubins_traffic.problem.instance import Instance, Problem
from dubins_traffic.roads.network import RoadNetwork
from dubins_traffic.viewer import palette
from dubins_traffic.viewer.bodies import nose, outline
from dubins_traffic.viewer.marks import Mark, goal_numbers
from dubins_traffic.viewer.scene import Extent, centre_paths, extent, lane_hints, road_lines, short

SIDE_RANGE = (4.5, 13.0)
INCHES_PER_METRE = 0.55
MARGIN = 0.5
KERB = 0.03
LABEL_POINTS = 8.0
LEGEND_COLUMN = 1.15
LEGEND_ROW = 0.2
METADATA: dict[str, dict[str, Any]] = {
    ".png": {"Software": None},
    ".svg": {"Date": None, "Creator": None},
    ".pdf": {"CreationDate": None, "Creator": None, "Producer": None},
}


@cache
def figure_class() -> Any:
    """Return Matplotlib's figure as notebooks show it: without `pyplot` they would print its size only."""
    from matplotlib.figure import Figure

    class Picture(Figure):
        def _repr_png_(self) -> bytes:
            stream = BytesIO()
            drawn: Any = self
            drawn.savefig(stream, format="png", metadata=METADATA[".png"], dpi=110)
            return stream.getvalue()

    return Picture


class Canvas:
    """One pair of axes in metres, drawn upon from the ground up."""

    def __init__(self, network: RoadNetwork, car: Car, spans: Sequence[Floats]) -> None:
        self.network, self.car = network, car
        half = 0.5 * car.road_width
        box = extent(network, half, *spans)
        self.box = Extent(box.left - MARGIN, box.bottom - MARGIN, box.right + MARGIN, box.top + MARGIN)
        longest = max(self.box.width, self.box.height)
        inches = min(max(INCHES_PER_METRE * longest, SIDE_RANGE[0]), SIDE_RANGE[1])
        self.scale = inches / longest
        self.points = 72.0 * self.scale
        self.figure: Any = figure_class()(layout=None)
        self.axes: Any = self.figure.add_axes((0.0, 0.0, 1.0, 1.0))
        self.handles: list[tuple[str, Any]] = []
        self.things: dict[str, Any] = {}

    def roads(self) -> None:
        """Draw surfaces with kerbs, centre lines, hints of directions and lattice points."""
        from matplotlib.collections import LineCollection

        network, half = self.network, 0.5 * self.car.road_width
        lines = road_lines(network)
        thin = max(0.35, KERB * self.points)
        for width, colour in (
            (2.0 * half * self.points + 2.0 * thin, palette.KERB_COLOUR),
            (2.0 * half * self.points, palette.ROAD_COLOUR),
        ):
            surface = LineCollection(list(lines), linewidths=width, colors=colour, capstyle="round", zorder=1)
            self.axes.add_collection(surface, autolim=False)
        stroke = min(1.8, max(0.3, 0.05 * self.points))
        centre = LineCollection(
            centre_paths(network, half),
            linewidths=stroke,
            colors=palette.LINE_COLOUR,
            linestyles=[(0.0, (0.2 * self.points / stroke, 0.16 * self.points / stroke))],
            zorder=2,
        )
        self.axes.add_collection(centre, autolim=False)
        hints = LineCollection(
            list(lane_hints(network, self.car.w)),
            linewidths=stroke * 0.8,
            colors=palette.HINT_COLOUR,
            capstyle="round",
            joinstyle="round",
            zorder=2,
        )
        self.axes.add_collection(hints, autolim=False)
        size = min(LABEL_POINTS, 0.3 * 2.0 * half * self.points)
        if size >= 2.5:
            for (x, y), place in zip(network.intersections, network.points, strict=True):
                self._text(place, f"{short(x)},{short(y)}", size, palette.FAINT_COLOUR, 3)

    def goals(self, problem: Problem) -> None:
        """Draw the goals' discs, numbered in the order in which they are given."""
        from matplotlib.patches import Circle

        for vertex, numbers in goal_numbers(problem).items():
            place = self.network.points[vertex]
            disc = Circle(
                (float(place[0]), float(place[1])),
                problem.intersection_radius,
                facecolor=palette.GOAL_COLOUR + "38",
                edgecolor=palette.GOAL_COLOUR,
                linewidth=1.4,
                zorder=2.5,
            )
            self.axes.add_patch(disc)
            self.things.setdefault("goal", disc)
            size = min(9.0, 0.34 * problem.intersection_radius * self.points)
            if size >= 3.0:
                lift = np.array([0.0, 0.62 * problem.intersection_radius])
                self._text(place + lift, f"goal {numbers}", size, "#00684B", 6, bold=True)

    def obstacles(self, obstacles: Sequence[Obstacle]) -> None:
        """Draw obstacles, hatched."""
        from matplotlib.patches import Circle, Polygon

        look: dict[str, Any] = {
            "facecolor": palette.OBSTACLE_COLOUR,
            "edgecolor": palette.INK_COLOUR,
            "linewidth": 0.8,
            "zorder": 3.5,
        }
        for obstacle in obstacles:
            if isinstance(obstacle, DiscObstacle):
                patch: Any = Circle((obstacle.x, obstacle.y), obstacle.radius, **look)
            else:
                patch = Polygon(np.asarray(obstacle.vertices), closed=True, **look)
            self.axes.add_patch(patch)
            self.things.setdefault("obstacle", patch)

    def cars(self, instance: Instance, poses: Sequence[Pose], *, ghost: bool = False) -> None:
        """Draw bodies with their headings; a `ghost` is an outline, for starts beside ends.

        So many cars that colours come again bear their names, and only the ego stands in the legend.
        """
        crowd = len(poses) > 1 + len(palette.AGENT_COLOURS)
        for index, (name, pose) in reversed(list(enumerate(zip(instance.names, poses, strict=True)))):
            colour = palette.car_colour(index)
            body = outline(self.car.body, pose)
            fill, edge = ("white", colour) if ghost else (colour, palette.INK_COLOUR)
            order = 5 if ghost else 6
            (shape,) = self.axes.fill(*body.T, facecolor=fill, edgecolor=edge, linewidth=1.0, zorder=order)
            tip = nose(self.car.body, pose)
            self.axes.fill(*tip.T, facecolor=edge if ghost else "white", edgecolor="none", zorder=order)
            if ghost:
                continue
            if crowd:
                above = np.array([pose.x, pose.y + self.car.body.reach + 5.0 / self.points])
                self._text(above, name, 5.5, palette.INK_COLOUR, 9, halo=True)
            if index == 0 or not crowd:
                self.handles.append((name, shape))

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

        width = min(2.2, max(0.7, 0.07 * self.points))
        for index, line in reversed(list(enumerate(lines))):
            path = Line2D(
                line[:, 0],
                line[:, 1],
                color=palette.car_colour(index),
                linewidth=width * (1.35 if index == 0 else 1.0),
                alpha=0.9,
                solid_capstyle="round",
                solid_joinstyle="round",
                zorder=4.5 if index == 0 else 4,
            )
            self.axes.add_line(path)
        self.cars(instance, starts, ghost=True)
        self.cars(instance, ends)
        for mark in marks:
            self._mark(mark)
        start = Line2D(
            [], [], linestyle="none", marker="o", markerfacecolor="none", markeredgecolor="#555555"
        )
        end = Line2D(
            [], [], linestyle="none", marker="o", markerfacecolor="#555555", markeredgecolor="#222222"
        )
        self.things |= {"start": start, "end": end}

    def _mark(self, mark: Mark) -> None:
        if mark.point is None:
            return
        own, size = mark.car == 0, min(9.0, max(5.0, 0.3 * self.points))
        breach = palette.BREACH_COLOURS[not own]
        looks = {
            "contact": ("X", palette.CONTACT_COLOUR, "white"),
            "breach": ("^", breach if own else "white", breach),
        }
        names = {"contact": "contact", "breach": "breach of the ego" if own else "breach of others"}
        marker, fill, edge = looks[mark.kind]
        (sign,) = self.axes.plot(
            [mark.point[0]],
            [mark.point[1]],
            linestyle="none",
            marker=marker,
            markersize=size,
            markerfacecolor=fill,
            markeredgecolor=edge,
            markeredgewidth=0.8,
            zorder=8,
        )
        self.things.setdefault(names[mark.kind], sign)

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

    def _text(
        self,
        place: Floats,
        text: str,
        size: float,
        colour: str,
        order: float,
        *,
        bold: bool = False,
        halo: bool = False,
    ) -> None:
        from matplotlib.patheffects import withStroke

        self.axes.text(
            float(place[0]),
            float(place[1]),
            text,
            fontsize=size,
            color=colour,
            ha="center",
            va="center",
            zorder=order,
            fontweight="bold" if bold else "normal",
            path_effects=[withStroke(linewidth=1.4, foreground="white")] if halo else None,
            parse_math=False,
            clip_on=True,
        )
