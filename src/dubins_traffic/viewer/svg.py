"""Small pictures as SVG text, for notebooks: no library is needed, and nothing is loaded from elsewhere."""

from __future__ import annotations

import html
import math
from collections.abc import Iterable, Mapping, Sequence

import numpy as np

from dubins_traffic.cars.body import Car
from dubins_traffic.cars.state import Pose
from dubins_traffic.kernels.arrays import Floats
from dubins_traffic.problem.instance import Instance, Problem
from dubins_traffic.roads.network import RoadNetwork
from dubins_traffic.viewer import palette, shapes
from dubins_traffic.viewer.marks import Mark
from dubins_traffic.viewer.scene import Extent, extent, obstacle_points
from dubins_traffic.viewer.shapes import Circle, Line, Region, Shape, Sign, Text, Width

WIDTH, HEIGHT = 460.0, 400.0
"""Most pixels of a picture."""
MARGIN = 0.3
"""Metres around the roads."""
SIGN = 5.0
"""Half the size of a mark, pixels."""
LETTERS = Width(0.0, 11.0, 11.0)
NAMED = 12
"""Most cars that bear their names."""
VERDICT_COLOURS: Mapping[str, str] = {
    "satisfied": palette.GOAL_COLOUR,
    "unfinished": "#56B4E9",
    "excused": "#E69F00",
    "violated": palette.CONTACT_COLOUR,
    "untold": palette.FAINT_COLOUR,
}


class Drawing:
    """A picture of a road network in the making; `svg` returns it.

    Parameters
    ----------
    network : RoadNetwork
        What lies at the bottom.
    car : Car
        Whose width sets that of the roads.
    spans : sequence of array (..., 2)
        Points besides the roads for which there must be room, world frame, metres.
    """

    def __init__(self, network: RoadNetwork, car: Car, spans: Sequence[Floats] = ()) -> None:
        box = extent(network, 0.5 * car.road_width, *spans)
        self.box = Extent(box.left - MARGIN, box.bottom - MARGIN, box.right + MARGIN, box.top + MARGIN)
        self.scale = min(WIDTH / self.box.width, HEIGHT / self.box.height, 60.0)
        self.parts: list[str] = []
        self.draw([*shapes.roads(network, car), *shapes.centres(network, car)])

    def svg(self, title: str) -> str:
        """Return the picture; `title` is what is read aloud."""
        width, height = self.box.width * self.scale, self.box.height * self.scale
        return (
            f'<svg xmlns="http://www.w3.org/2000/svg" role="img" width="{width:.0f}" height="{height:.0f}" '
            f'viewBox="0 0 {width:.1f} {height:.1f}" style="max-width:100%;height:auto">'
            f"<title>{html.escape(title)}</title>"
            f'<rect width="100%" height="100%" fill="{palette.GROUND_COLOUR}"/>{"".join(self.parts)}</svg>'
        )

    def draw(self, drawn: Iterable[Shape]) -> None:
        """Draw shapes."""
        self.parts += [self._element(shape) for shape in drawn]

    def _at(self, x: float, y: float) -> tuple[float, float]:
        """Return a point of the world in pixels."""
        return (x - self.box.left) * self.scale, (self.box.top - y) * self.scale

    def _points(self, points: Iterable[Sequence[float]]) -> str:
        """Return points of the world as the attribute of a line."""
        return " ".join("{:.1f},{:.1f}".format(*self._at(float(x), float(y))) for x, y in points)

    def _element(self, shape: Shape) -> str:
        """Return the element of a shape."""
        if isinstance(shape, Line):
            more = ' stroke-linecap="round"' if shape.round else ""
            if shape.dash is not None:
                more += ' stroke-dasharray="{:.1f} {:.1f}"'.format(*(self.scale * part for part in shape.dash))
            if (opacity := shape.opacity_at(self.scale)) < 1.0:
                more += f' stroke-opacity="{opacity:.2g}"'
            return (
                f'<polyline points="{self._points(shape.points)}" fill="none" stroke="{shape.colour}" '
                f'stroke-width="{shape.width.at(self.scale):.1f}" stroke-linejoin="round"{more}/>'
            )
        if isinstance(shape, Region):
            edge = "" if shape.edge is None else f' stroke="{shape.edge}" stroke-width="{shape.width:.1f}"'
            return f'<polygon points="{self._points(shape.points)}" fill="{shape.fill}"{edge}/>'
        x, y = self._at(shape.x, shape.y)
        if isinstance(shape, Circle):
            return (
                f'<circle cx="{x:.1f}" cy="{y:.1f}" r="{shape.radius * self.scale:.1f}" fill="{shape.fill}" '
                f'fill-opacity="{shape.opacity:g}" stroke="{shape.edge}" stroke-width="{shape.width:g}"/>'
            )
        if isinstance(shape, Sign):
            return self._sign(shape, x, y)
        return (
            f'<text x="{x:.1f}" y="{y:.1f}" fill="{shape.colour}" font-size="{shape.size.at(self.scale):g}" '
            'text-anchor="middle" dominant-baseline="middle" font-family="sans-serif" paint-order="stroke" '
            f'stroke="#ffffff" stroke-width="2.5" stroke-opacity="0.8">{html.escape(shape.words)}</text>'
        )

    def _sign(self, sign: Sign, x: float, y: float) -> str:
        size = SIGN
        if sign.kind == "contact":
            ends = f"M{x - size:.1f} {y - size:.1f}l{2 * size} {2 * size}m0 -{2 * size}l-{2 * size} {2 * size}"
            return f'<path d="{ends}" fill="none" stroke="{sign.fill}" stroke-width="2.2"/>'
        corners = [(x, y - size), (x + 0.9 * size, y + 0.6 * size), (x - 0.9 * size, y + 0.6 * size)]
        points = " ".join(f"{px:.1f},{py:.1f}" for px, py in corners)
        return f'<polygon points="{points}" fill="{sign.fill}" stroke="{sign.edge}" stroke-width="1.6"/>'

    def problem(self, problem: Problem) -> None:
        """Draw the goals and the obstacles."""
        self.draw([*shapes.goals(problem), *shapes.obstacles(problem)])

    def names(self, problem: Problem) -> None:
        """Write the names of the goals."""
        self.draw(shapes.goal_names(problem, LETTERS))

    def cars(self, instance: Instance, poses: Sequence[Pose]) -> None:
        """Draw the cars, and their names above them if they are few."""
        body = instance.problem.car.body
        self.draw(shapes.cars(body, instance.names, poses))
        if len(poses) <= NAMED:
            lift = body.reach + 8.0 / self.scale
            ink = palette.INK_COLOUR
            self.draw(
                Text(pose.x, pose.y + lift, name, ink, LETTERS)
                for name, pose in reversed(list(zip(instance.names, poses, strict=True)))
            )


def network_picture(network: RoadNetwork) -> str:
    """Return the picture of a road network."""
    return Drawing(network, Car()).svg(f"Road network, {network.summary}")


def problem_picture(problem: Problem) -> str:
    """Return the picture of a problem: network, goals and obstacles."""
    drawing = Drawing(problem.network, problem.car, _fixed(problem))
    drawing.problem(problem)
    drawing.names(problem)
    return drawing.svg(f"Problem, {problem.summary}")


def trial_picture(
    instance: Instance,
    poses: Sequence[Pose] | None = None,
    paths: Sequence[Floats] = (),
    marks: Sequence[Mark] = (),
) -> str:
    """Return the picture of an instance or a trial of it.

    Parameters
    ----------
    instance : Instance
        What was run, or will be.
    poses : sequence of Pose, optional
        Where the cars are drawn; by default at their starts.
    paths : sequence of (P, 2) arrays
        The way of each car, the ego first, world frame, metres.
    marks : sequence of Mark
        Contacts and breaches.
    """
    problem = instance.problem
    poses = instance.starts if poses is None else poses
    spans = [*_fixed(problem), np.array([[pose.x, pose.y] for pose in poses]).reshape(-1, 2), *paths]
    drawing = Drawing(problem.network, problem.car, spans)
    drawing.problem(problem)
    drawing.draw(shapes.ways(paths))
    drawing.cars(instance, poses)
    drawing.draw(shapes.signs(marks))
    drawing.names(problem)
    return drawing.svg(f"{instance.title}, {problem.summary}")


def bars(rows: Mapping[str, Mapping[str, int]]) -> str:
    """Return bars of counts, one a row, cut by what is counted; what it is stands under them."""
    names = list(dict.fromkeys(name for row in rows.values() for name in row))
    spare = iter(palette.AGENT_COLOURS)
    colours = {name: VERDICT_COLOURS.get(name) or next(spare, "#6E7681") for name in names}
    left, width, high = 120.0, WIDTH - 130.0, 24.0
    parts: list[str] = []
    for place, (row, counts) in enumerate(rows.items()):
        x, y = left, 6.0 + place * high
        parts.append(_label(_cut(row), left - 8.0, y + 11.0, 'text-anchor="end"'))
        for name, number in counts.items():
            wide = width * number / max(1, sum(counts.values()))
            parts.append(
                f'<rect x="{x:.1f}" y="{y:.1f}" width="{wide:.1f}" height="16" fill="{colours[name]}">'
                f"<title>{html.escape(name)}: {number}</title></rect>"
            )
            x += wide
    y = 6.0 + len(rows) * high + 12.0
    x = left
    for name in names:
        total = sum(row.get(name, 0) for row in rows.values())
        label = f"{_cut(name)} {total}"
        parts.append(
            f'<rect x="{x:.1f}" y="{y - 8:.1f}" width="9" height="9" fill="{colours[name]}"/>'
            + _label(label, x + 13.0, y)
        )
        x += 26.0 + 6.4 * len(label)
        if x > WIDTH - 90.0:
            x, y = left, y + 16.0
    height = math.ceil(y + 8.0)
    return (
        f'<svg xmlns="http://www.w3.org/2000/svg" role="img" width="{WIDTH:.0f}" height="{height}" '
        f'viewBox="0 0 {WIDTH:.0f} {height}" font-family="sans-serif" font-size="11" '
        'style="max-width:100%;height:auto">'
        f"<title>Shares</title>{''.join(parts)}</svg>"
    )


def _fixed(problem: Problem) -> list[Floats]:
    """Return the corners of the goals' discs and of the obstacles."""
    goals = problem.network.points[list(problem.goal_vertices)].reshape(-1, 2)
    reach = problem.intersection_radius
    return [goals - reach, goals + reach, *(obstacle_points(one) for one in problem.obstacles)]


def _label(words: str, x: float, y: float, more: str = "") -> str:
    return f'<text x="{x:.0f}" y="{y:.0f}" fill="currentColor" {more}>{html.escape(words)}</text>'


def _cut(words: str, limit: int = 18) -> str:
    return words if len(words) <= limit else f"{words[: limit - 1]}…"
