"""Pictures of a network, an instance or a recorded trial (optional extra ``plot``)."""

from __future__ import annotations

import importlib
import os
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeAlias

import numpy as np

from dubins_traffic.cars.body import Body, Car, Disc, DiscObstacle, Obstacle
from dubins_traffic.cars.state import Frames, Pose
from dubins_traffic.errors import InputError, MissingExtraError
from dubins_traffic.files import replace_file
from dubins_traffic.kernels.arrays import Floats
from dubins_traffic.problem.instance import Instance, Problem
from dubins_traffic.roads.network import RoadNetwork
from dubins_traffic.viewer import palette
from dubins_traffic.viewer.marks import goal_numbers
from dubins_traffic.viewer.scene import Extent, centre_lines, extent, lane_hints, obstacle_points

if TYPE_CHECKING:
    from dubins_traffic.record.reader import Record

SUFFIXES = (".pdf", ".png", ".svg")
SIDE_RANGE = (4.5, 13.0)
INCHES_PER_METRE = 0.55
MARGIN = 0.5
KERB = 0.03
LABEL_POINTS = 8.0
LEGEND_COLUMN = 1.15
LEGEND_ROW = 0.2
STYLE: dict[str, Any] = {
    "svg.hashsalt": "dubins-traffic",
    "svg.fonttype": "path",
    "pdf.compression": 6,
    "font.family": "DejaVu Sans",
    "path.simplify": True,
    "savefig.facecolor": "white",
}
METADATA: dict[str, dict[str, Any]] = {
    ".png": {"Software": None},
    ".svg": {"Date": None, "Creator": None},
    ".pdf": {"CreationDate": None, "Creator": None, "Producer": None},
}


Subject: TypeAlias = "RoadNetwork | Instance | Record"


def write_plot(path: str | os.PathLike[str], subject: Subject) -> None:
    """Draw `subject` into the file `path`: PNG, SVG or PDF, by its suffix.

    Parameters
    ----------
    path : path
        The picture to write; it appears only when complete.
    subject : RoadNetwork, Instance or Record
        A network; an instance (network, goals, obstacles, cars at their starts); or a record: the instance, the
        paths of all cars, contacts, and the cars where they ended. Equal subjects give equal bytes with equal
        versions of matplotlib.

    Raises
    ------
    InputError
        If the suffix is none of these, or the file can't be written.
    MissingExtraError
        If matplotlib is not installed.
    """
    target = Path(path)
    suffix = target.suffix.lower()
    if suffix not in SUFFIXES:
        raise InputError(
            "not a picture",
            file=str(target),
            value=target.suffix,
            expected=f"a suffix of {', '.join(SUFFIXES)}",
        )
    try:
        matplotlib: Any = importlib.import_module("matplotlib")
    except ImportError:
        raise MissingExtraError("plotting", "plot") from None
    with matplotlib.rc_context(STYLE):
        figure = _draw(subject)
        look: dict[str, Any] = {"format": suffix[1:], "metadata": METADATA[suffix], "dpi": 160}
        replace_file(target, lambda draft: figure.savefig(draft, **look))


def _draw(subject: Subject) -> Any:
    if isinstance(subject, RoadNetwork):
        canvas = _Canvas(subject, Car(), ())
        canvas.roads()
        rows, columns = subject.shape
        count = len(subject.segments)
        canvas.finish(f"Road network, {columns} x {rows}, {count} segment{'s' * (count != 1)}")
        return canvas.figure
    instance = subject if isinstance(subject, Instance) else subject.instance
    frames = None if isinstance(subject, Instance) else subject.frames
    problem = instance.problem
    spans = [obstacle_points(obstacle) for obstacle in problem.obstacles]
    poses = np.array([[start.x, start.y] for start in instance.starts]).reshape(-1, 2)
    spans += [poses - problem.car.body.reach, poses + problem.car.body.reach]
    if frames is not None:
        spans.append(np.stack([frames.x, frames.y], axis=-1))
    canvas = _Canvas(problem.network, problem.car, spans)
    canvas.roads()
    canvas.goals(problem)
    canvas.obstacles(problem.obstacles)
    heading = f"Trial {instance.trial} of seed {instance.seed}"
    if isinstance(subject, Instance) or frames is None:
        canvas.cars(instance, instance.starts)
        canvas.finish(f"{heading}, {instance.duration:g} s")
        return canvas.figure
    canvas.trial(instance, frames)
    span = (len(frames) - 1) / frames.rate
    how = "cut off" if subject.ending is None else subject.ending.end.value.replace("_", " ")
    canvas.finish(f"{heading}, {span:.4g} s, end: {how}")
    return canvas.figure


class _Canvas:
    """One pair of axes in metres, drawn upon from the ground up."""

    def __init__(self, network: RoadNetwork, car: Car, spans: Sequence[Floats]) -> None:
        from matplotlib.figure import Figure

        self.network, self.car = network, car
        half = 0.5 * car.road_width
        box = extent(network, half, *spans)
        self.box = Extent(box.left - MARGIN, box.bottom - MARGIN, box.right + MARGIN, box.top + MARGIN)
        longest = max(self.box.width, self.box.height)
        inches = min(max(INCHES_PER_METRE * longest, SIDE_RANGE[0]), SIDE_RANGE[1])
        self.scale = inches / longest
        self.points = 72.0 * self.scale
        self.figure: Any = Figure(layout=None)
        self.axes: Any = self.figure.add_axes((0.0, 0.0, 1.0, 1.0))
        self.handles: list[tuple[str, Any]] = []
        self.things: dict[str, Any] = {}

    def roads(self) -> None:
        """Draw surfaces with kerbs, centre lines, hints of directions and lattice points."""
        from matplotlib.collections import LineCollection

        network, half = self.network, 0.5 * self.car.road_width
        lines = network.points[network.ends]
        thin = max(0.35, KERB * self.points)
        for width, colour in (
            (2.0 * half * self.points + 2.0 * thin, palette.KERB_COLOUR),
            (2.0 * half * self.points, palette.ROAD_COLOUR),
        ):
            surface = LineCollection(list(lines), linewidths=width, colors=colour, capstyle="round", zorder=1)
            self.axes.add_collection(surface, autolim=False)
        stroke = min(1.8, max(0.3, 0.05 * self.points))
        centre = LineCollection(
            list(centre_lines(network, half)),
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
                self._text(place, f"{x},{y}", size, palette.FAINT_COLOUR, 3)

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
            body = _outline(self.car.body, pose)
            fill, edge = ("white", colour) if ghost else (colour, palette.INK_COLOUR)
            order = 5 if ghost else 6
            (shape,) = self.axes.fill(*body.T, facecolor=fill, edgecolor=edge, linewidth=1.0, zorder=order)
            tip = _nose(self.car.body, pose)
            self.axes.fill(*tip.T, facecolor=edge if ghost else "white", edgecolor="none", zorder=order)
            if ghost:
                continue
            if crowd:
                above = np.array([pose.x, pose.y + self.car.body.reach + 5.0 / self.points])
                self._text(above, name, 5.5, palette.INK_COLOUR, 9, halo=True)
            if index == 0 or not crowd:
                self.handles.append((name, shape))

    def trial(self, instance: Instance, frames: Frames) -> None:
        """Draw the paths of all cars, where they began and ended, and contacts."""
        from matplotlib.lines import Line2D

        width = min(2.2, max(0.7, 0.07 * self.points))
        for index in reversed(range(frames.x.shape[1])):
            path = Line2D(
                frames.x[:, index],
                frames.y[:, index],
                color=palette.car_colour(index),
                linewidth=width * (1.35 if index == 0 else 1.0),
                alpha=0.9,
                solid_capstyle="round",
                solid_joinstyle="round",
                zorder=4.5 if index == 0 else 4,
            )
            self.axes.add_line(path)
        self.cars(instance, _poses(frames, 0), ghost=True)
        self.cars(instance, _poses(frames, len(frames) - 1))
        for contact in frames.contacts:
            (cross,) = self.axes.plot(
                [contact.x],
                [contact.y],
                linestyle="none",
                marker="X",
                markersize=min(9.0, max(5.0, 0.3 * self.points)),
                markerfacecolor=palette.CONTACT_COLOUR,
                markeredgecolor="white",
                markeredgewidth=0.8,
                zorder=8,
            )
            self.things.setdefault("contact", cross)
        start = Line2D(
            [], [], linestyle="none", marker="o", markerfacecolor="none", markeredgecolor="#555555"
        )
        end = Line2D(
            [], [], linestyle="none", marker="o", markerfacecolor="#555555", markeredgecolor="#222222"
        )
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


def _poses(frames: Frames, frame: int) -> list[Pose]:
    columns = zip(frames.x[frame], frames.y[frame], frames.c[frame], frames.s[frame], strict=True)
    return [Pose(float(x), float(y), float(c), float(s)) for x, y, c, s in columns]


def _outline(body: Body, pose: Pose) -> Floats:
    if isinstance(body, Disc):
        angles = np.linspace(0.0, 2.0 * np.pi, 49)[:-1]
        shape = body.radius * np.stack([np.cos(angles), np.sin(angles)], axis=1)
    else:
        shape = 0.5 * np.array([[1, 1], [-1, 1], [-1, -1], [1, -1]]) * [body.length, body.width]
    return _placed(shape, pose)


def _nose(body: Body, pose: Pose) -> Floats:
    front = body.radius if isinstance(body, Disc) else 0.5 * body.length
    side = 0.28 * body.width
    return _placed(np.array([[0.82 * front, 0.0], [0.15 * front, side], [0.15 * front, -side]]), pose)


def _placed(shape: Floats, pose: Pose) -> Floats:
    turn = np.array([[pose.c, pose.s], [-pose.s, pose.c]])
    return shape @ turn + np.array([pose.x, pose.y])
