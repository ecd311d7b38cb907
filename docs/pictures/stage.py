"""What the pictures of the task are drawn with: panels of roads and cars, by the viewer's own drawing."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import matplotlib
import numpy as np
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Circle, FancyArrowPatch, Polygon

from dubins_traffic.animation.canvas import Canvas
from dubins_traffic.cars.body import Car
from dubins_traffic.cars.state import Pose
from dubins_traffic.files import replace_file
from dubins_traffic.problem.instance import EAgent, Instance, Problem
from dubins_traffic.roads.network import RoadNetwork
from dubins_traffic.rules.parameters import RuleParameters
from dubins_traffic.viewer import palette, shapes
from dubins_traffic.viewer.figures import METADATA, STYLE
from dubins_traffic.viewer.scene import Extent

Point = tuple[float, float]
Box = tuple[float, float, float, float]

RULES = RuleParameters()
CAR = Car()
W = CAR.w
RHO = CAR.body.reach
R = 1.0
ARM = 5.0
STAR = RoadNetwork(((0, 1, 1, 1), (1, 0, 1, 1), (1, 1, 2, 1), (1, 2, 1, 1)), ARM, (-ARM, -ARM, 0.0), (3, 3))
ROAD = RoadNetwork(((0, 0, 1, 0),), 12.0, (-6.0, 0.0, 0.0), (1, 2))

INK, FAINT = palette.INK_COLOUR, palette.FAINT_COLOUR
GOOD, BAD = palette.GOAL_COLOUR, palette.CONTACT_COLOUR
SCALE = 0.66
TEXT = 9.0
GAP, HEAD, EDGE = 0.14, 0.34, 0.06
TITLES = {"good": ("\u2713 ", "#00684B"), "bad": ("\u2717 ", "#A84300"), "plain": ("", INK)}


def instance(network: RoadNetwork, poses: Sequence[Pose], goals: Sequence[tuple[int, int]] = ()) -> Instance:
    """Return an instance with the ego at the first pose and the e-agents A, B, ... at the others."""
    names = tuple("ABCDEFG"[: len(poses) - 1])
    problem = Problem(
        network=network,
        goals=tuple(goals),
        intersection_radius=R,
        car=CAR,
        rate=30.0,
        sensing_radius=5.0,
        laser=None,
        obstacles=(),
        e_agents=names,
        rules={},
    )
    agents = tuple(EAgent("drawn", name, "drawn") for name in names)
    return Instance(problem, tuple(poses), 1.0, agents, 1, 0)


def pose(x: float, y: float, degrees: float) -> Pose:
    """Return the pose at (x, y) with a heading in degrees."""
    angle = np.deg2rad(degrees)
    return Pose(x, y, float(np.cos(angle)), float(np.sin(angle)))


def inward(bearing: float, gap: float) -> Pose:
    """Return the pose in the right lane of the arm at `bearing` degrees, `gap` metres before the disc, toward it."""
    along = float(np.sqrt((R + RHO + gap) ** 2 - W**2))
    a = np.deg2rad(bearing)
    place = along * np.array([np.cos(a), np.sin(a)]) + W * np.array([-np.sin(a), np.cos(a)])
    return pose(float(place[0]), float(place[1]), bearing + 180.0)


def outward(bearing: float, gap: float) -> Pose:
    """Return the pose in the right lane of the arm at `bearing` degrees, `gap` metres beyond the disc, leaving it."""
    along = float(np.sqrt((R + RHO + gap) ** 2 - W**2))
    a = np.deg2rad(bearing)
    place = along * np.array([np.cos(a), np.sin(a)]) + W * np.array([np.sin(a), -np.cos(a)])
    return pose(float(place[0]), float(place[1]), bearing)


def bend(*points: Point) -> list[Point]:
    """Return a Bezier curve over three or four points."""
    rows = np.array(points, dtype=float)
    t = np.linspace(0.0, 1.0, 25)[:, None]
    while len(rows) > 3:
        first, second = bend_rows(rows[:-1], t), bend_rows(rows[1:], t)
        return [(float(x), float(y)) for x, y in (1 - t) * first + t * second]
    return [(float(x), float(y)) for x, y in bend_rows(rows, t)]


def bend_rows(rows: Any, t: Any) -> Any:
    """Return the points at `t` of the quadratic Bezier curve over three rows."""
    return (1 - t) ** 2 * rows[0] + 2 * t * (1 - t) * rows[1] + t**2 * rows[2]


class Panel:
    """One map: roads from the viewer, and signs upon them, in metres."""

    def __init__(self, figure: Figure, place: Box, network: RoadNetwork, box: Box) -> None:
        self.network = network
        self.canvas = canvas = Canvas(network, CAR, ())
        canvas.box, canvas.scale, canvas.points = Extent(*box), SCALE, 72.0 * SCALE
        canvas.figure, canvas.axes = figure, figure.add_axes(place)
        self.axes: Any = canvas.axes
        canvas.roads()
        for text in list(self.axes.texts):
            text.remove()
        self.axes.set_xlim(box[0], box[2])
        self.axes.set_ylim(box[1], box[3])
        self.axes.set_facecolor(palette.GROUND_COLOUR)
        self.axes.set_xticks([])
        self.axes.set_yticks([])
        for spine in self.axes.spines.values():
            spine.set(color=palette.KERB_COLOUR, linewidth=0.6)

    def title(self, text: str, kind: str = "plain") -> None:
        """Head the panel; `kind` is good, bad or plain."""
        mark, colour = TITLES[kind]
        self.axes.set_title(mark + text, fontsize=TEXT, color=colour, loc="left", pad=5, fontweight="bold")

    def cars(self, *poses: Pose, ghost: bool = False, names: bool = True, notes: Sequence[str] = ()) -> None:
        """Draw the ego and the e-agents A, B, ..., with their names behind them, and notes after the names."""
        tried = instance(self.network, poses)
        self.canvas.order = 5.0 if ghost else 6.0
        if ghost:
            self.canvas.draw(shapes.cars(CAR.body, tried.names, poses, ghost=True))
        else:
            self.canvas.cars(tried, poses)
        if not names:
            return
        for n, (name, p) in enumerate(zip(tried.names, poses, strict=True)):
            text = f"{name}\n{notes[n]}" if n < len(notes) and notes[n] else name
            reach = RHO + 0.07
            flat = abs(p.c) > abs(p.s)
            ha = "center" if not flat else ("right" if p.c > 0 else "left")
            va = "center" if flat else ("top" if p.s > 0 else "bottom")
            self.note(p.x - reach * p.c, p.y - reach * p.s, text, ha=ha, va=va, bold=True)

    def goal(self, name: str = "goal") -> None:
        """Draw the disc of the crossing as a goal."""
        problem = instance(self.network, [pose(0, 0, 0)], [(1, 1)]).problem
        self.canvas.order = 2.5
        self.canvas.problem(problem)
        self.note(0.0, 0.55, name, colour="#00684B", bold=True)

    def disc(self) -> None:
        """Draw the outline of the crossing's disc."""
        self.axes.add_patch(Circle((0, 0), R, fill=False, edgecolor=INK, linewidth=1.1, linestyle="--", zorder=3))

    def approach(self, *bearings: float) -> None:
        """Shade where the front of a body may be to approach, with the edge of the disc as the stop line."""
        for bearing in bearings:
            a = np.deg2rad(bearing)
            along, across = np.array([np.cos(a), np.sin(a)]), np.array([-np.sin(a), np.cos(a)])
            side = np.linspace(0.02, 2 * W - 0.02, 17)
            arcs = [
                np.sqrt(radius**2 - side**2)[:, None] * along + side[:, None] * across
                for radius in (R, R + RULES.approach_distance)
            ]
            shape = np.concatenate([arcs[0], arcs[1][::-1]])
            self.axes.add_patch(Polygon(shape, closed=True, facecolor="#F0E442", alpha=0.75, zorder=2.2))
            self.line(arcs[0], INK, width=2.6)

    def line(self, points: Any, colour: str, *, width: float = 1.6, style: str = "-", order: float = 4) -> None:
        """Draw a line through points."""
        rows = np.asarray(points, dtype=float)
        look: dict[str, Any] = {"color": colour, "linewidth": width, "linestyle": style, "zorder": order}
        self.axes.add_line(Line2D(rows[:, 0], rows[:, 1], solid_capstyle="round", **look))

    def arrow(self, points: Sequence[Point], colour: str = INK, *, width: float = 1.8, style: str = "-") -> None:
        """Draw a way through points, with a head at its end."""
        if len(points) > 2:
            self.line(points[:-1], colour, width=width, style=style, order=7)
        self._head(points[-2], points[-1], "-|>", colour, width, style)

    def span(self, first: Point, last: Point, text: str, at: Point, colour: str = INK) -> None:
        """Draw a dimension from `first` to `last`, with its name at `at`."""
        self._head(first, last, "<|-|>", colour, 0.9, "-")
        self.note(*at, text, colour=colour)

    def _head(self, a: Point, b: Point, kind: str, colour: str, width: float, style: str) -> None:
        size = 11 if width > 1 else 6
        patch = FancyArrowPatch(
            a, b, arrowstyle=kind, mutation_scale=size, color=colour, linewidth=width, linestyle=style,
            shrinkA=0, shrinkB=0, zorder=7,
        )  # fmt: skip
        self.axes.add_patch(patch)

    def band(self, left: float, right: float, low: float, high: float, colour: str) -> None:
        """Shade a box."""
        shape = [(left, low), (right, low), (right, high), (left, high)]
        self.axes.add_patch(Polygon(shape, closed=True, facecolor=colour, alpha=0.4, linewidth=0, zorder=2.2))

    def cross(self, x: float, y: float) -> None:
        """Mark a contact, or what is forbidden."""
        look: dict[str, Any] = {"markerfacecolor": BAD, "markeredgecolor": "white", "markeredgewidth": 0.9}
        self.axes.plot([x], [y], linestyle="none", marker="X", markersize=11, zorder=9, **look)

    def place(self, p: Pose, number: int) -> None:
        """Write a place in the order before a car."""
        x, y = p.x + 0.52 * p.c, p.y + 0.52 * p.s
        self.axes.add_patch(Circle((x, y), 0.19, facecolor="white", edgecolor=INK, linewidth=1.1, zorder=8))
        self.note(x, y - 0.01, str(number), size=10.5, bold=True)

    def note(self, x: float, y: float, text: str, *, colour: str = INK, size: float = TEXT - 0.5, ha: str = "center",
             va: str = "center", bold: bool = False) -> None:  # fmt: skip
        """Write into the map."""
        self.axes.text(
            x, y, text, fontsize=size, color=colour, ha=ha, va=va, zorder=10, parse_math=False, linespacing=1.15,
            fontweight="bold" if bold else "normal",
        )  # fmt: skip


def row(network: RoadNetwork, *boxes: Box) -> tuple[Figure, list[Panel]]:
    """Return a figure with one panel per box, side by side, all to one scale."""
    wide = [SCALE * (box[2] - box[0]) for box in boxes]
    tall = max(SCALE * (box[3] - box[1]) for box in boxes)
    whole = (sum(wide) + GAP * (len(boxes) - 1) + 2 * EDGE, tall + HEAD + EDGE)
    figure = Figure(figsize=whole, layout=None)
    panels: list[Panel] = []
    left = EDGE
    for box, width in zip(boxes, wide, strict=True):
        place = (left / whole[0], EDGE / whole[1], width / whole[0], SCALE * (box[3] - box[1]) / whole[1])
        panels.append(Panel(figure, place, network, box))
        left += width + GAP
    return figure, panels


def column(network: RoadNetwork, *boxes: Box) -> tuple[Figure, list[Panel]]:
    """Return a figure with one panel per box, one under another, all to one scale."""
    tall = [SCALE * (box[3] - box[1]) for box in boxes]
    wide = max(SCALE * (box[2] - box[0]) for box in boxes)
    whole = (wide + 2 * EDGE, sum(tall) + len(boxes) * HEAD + EDGE)
    figure = Figure(figsize=whole, layout=None)
    panels: list[Panel] = []
    top = whole[1]
    for box, height in zip(boxes, tall, strict=True):
        top -= HEAD + height
        place = (EDGE / whole[0], top / whole[1], SCALE * (box[2] - box[0]) / whole[0], height / whole[1])
        panels.append(Panel(figure, place, network, box))
    return figure, panels


def write(path: Path, draw: Callable[[], Figure]) -> None:
    """Draw a picture into a file, SVG or PNG by its suffix; equal code gives equal bytes."""
    with matplotlib.rc_context(STYLE):
        figure = draw()
        look: dict[str, Any] = {"format": path.suffix[1:], "metadata": METADATA[path.suffix], "dpi": 110}
        replace_file(path, lambda draft: figure.savefig(draft, **look))
