"""Small pictures as SVG text, for notebooks: no library is needed, and nothing is loaded from elsewhere."""

from __future__ import annotations

import html
import math
from collections.abc import Iterable, Mapping, Sequence

import numpy as np

from dubins_traffic.cars.body import Car, DiscObstacle, Obstacle
from dubins_traffic.cars.state import Pose
from dubins_traffic.kernels.arrays import Floats
from dubins_traffic.problem.instance import Instance, Problem
from dubins_traffic.roads.network import RoadNetwork
from dubins_traffic.viewer import palette
from dubins_traffic.viewer.bodies import outline
from dubins_traffic.viewer.marks import Mark, goal_numbers
from dubins_traffic.viewer.scene import Extent, centre_paths, extent, obstacle_points, road_lines

WIDTH, HEIGHT = 460.0, 400.0
"""Most pixels of a picture."""
MARGIN = 0.3
"""Metres around the roads."""
NAMED = 12
"""Most cars that bear their names."""
VERDICT_COLOURS: Mapping[str, str] = {
    "satisfied": palette.GOAL_COLOUR,
    "unfinished": "#56B4E9",
    "excused": "#E69F00",
    "violated": palette.CONTACT_COLOUR,
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
        self.network, self.car = network, car
        box = extent(network, 0.5 * car.road_width, *spans)
        self.box = Extent(box.left - MARGIN, box.bottom - MARGIN, box.right + MARGIN, box.top + MARGIN)
        self.scale = min(WIDTH / self.box.width, HEIGHT / self.box.height, 60.0)
        self.parts: list[str] = []
        self.names: list[tuple[str, float, float]] = []
        self._roads()

    def svg(self, title: str) -> str:
        """Return the picture; `title` is what is read aloud."""
        width, height = self.box.width * self.scale, self.box.height * self.scale
        for name, x, y in self.names:
            self.text(name, x, y, "#00684B")
        return (
            f'<svg xmlns="http://www.w3.org/2000/svg" role="img" width="{width:.0f}" height="{height:.0f}" '
            f'viewBox="0 0 {width:.1f} {height:.1f}" style="max-width:100%;height:auto">'
            f"<title>{html.escape(title)}</title>"
            f'<rect width="100%" height="100%" fill="{palette.GROUND_COLOUR}"/>{"".join(self.parts)}</svg>'
        )

    def at(self, x: float, y: float) -> tuple[float, float]:
        """Return a point of the world in pixels."""
        return (x - self.box.left) * self.scale, (self.box.top - y) * self.scale

    def points(self, points: Iterable[Sequence[float]]) -> str:
        """Return points of the world as the attribute of a line."""
        return " ".join("{:.1f},{:.1f}".format(*self.at(float(x), float(y))) for x, y in points)

    def line(self, points: Iterable[Sequence[float]], colour: str, width: float, more: str = "") -> None:
        """Draw a line of `width` pixels."""
        self.parts.append(
            f'<polyline points="{self.points(points)}" fill="none" stroke="{colour}" stroke-width="{width:.1f}" '
            f'stroke-linejoin="round" {more}/>'
        )

    def shape(self, points: Iterable[Sequence[float]], fill: str, edge: str, width: float = 1.0) -> None:
        """Draw a closed shape."""
        self.parts.append(
            f'<polygon points="{self.points(points)}" fill="{fill}" stroke="{edge}" stroke-width="{width:.1f}"/>'
        )

    def circle(self, x: float, y: float, radius: float, fill: str, edge: str, more: str = "") -> None:
        """Draw a circle of `radius` metres."""
        px, py = self.at(x, y)
        self.parts.append(
            f'<circle cx="{px:.1f}" cy="{py:.1f}" r="{radius * self.scale:.1f}" fill="{fill}" stroke="{edge}" {more}/>'
        )

    def text(
        self, words: str, x: float, y: float, colour: str, lift: float = 0.0, size: float = 11.0
    ) -> None:
        """Write words about a point, `lift` pixels above it."""
        px, py = self.at(x, y)
        self.parts.append(
            f'<text x="{px:.1f}" y="{py - lift:.1f}" fill="{colour}" font-size="{size:g}" text-anchor="middle" '
            'dominant-baseline="middle" font-family="sans-serif" paint-order="stroke" stroke="#ffffff" '
            f'stroke-width="2.5" stroke-opacity="0.8">{html.escape(words)}</text>'
        )

    def _roads(self) -> None:
        lines = road_lines(self.network)
        width = self.car.road_width * self.scale
        for colour, wide in ((palette.KERB_COLOUR, width + 2.0), (palette.ROAD_COLOUR, width)):
            for ends in lines:
                self.line(ends, colour, wide, 'stroke-linecap="round"')
        for path in centre_paths(self.network, 0.5 * self.car.road_width):
            self.line(path, palette.LINE_COLOUR, 1.0, 'stroke-dasharray="4 3"')

    def problem(self, problem: Problem) -> None:
        """Draw the goals with their numbers, and the obstacles."""
        for vertex, numbers in goal_numbers(problem).items():
            x, y = self.network.points[vertex].tolist()
            more = 'fill-opacity="0.22" stroke-width="1.4"'
            self.circle(x, y, problem.intersection_radius, palette.GOAL_COLOUR, palette.GOAL_COLOUR, more)
            self.names.append((f"goal {numbers}", x, y))
        for obstacle in problem.obstacles:
            self._obstacle(obstacle)

    def _obstacle(self, obstacle: Obstacle) -> None:
        fill, edge = palette.OBSTACLE_COLOUR, palette.INK_COLOUR
        if isinstance(obstacle, DiscObstacle):
            self.circle(obstacle.x, obstacle.y, obstacle.radius, fill, edge)
        else:
            self.shape(obstacle.vertices, fill, edge)

    def cars(self, instance: Instance, poses: Sequence[Pose]) -> None:
        """Draw the cars with a stroke ahead, and their names if they are few; the ego comes last, on top."""
        body = self.car.body
        for index, (name, pose) in reversed(list(enumerate(zip(instance.names, poses, strict=True)))):
            self.shape(outline(body, pose, corners=24), palette.car_colour(index), palette.INK_COLOUR)
            ahead = (pose.x + body.reach * pose.c, pose.y + body.reach * pose.s)
            self.line([(pose.x, pose.y), ahead], "#ffffff", 1.5)
            if len(poses) <= NAMED:
                self.text(name, pose.x, pose.y, palette.INK_COLOUR, lift=body.reach * self.scale + 8.0)

    def paths(self, paths: Sequence[Floats]) -> None:
        """Draw the way of each car, (P, 2) metres, in its colour."""
        for index, path in reversed(list(enumerate(paths))):
            self.line(path, palette.car_colour(index), 2.4 if index == 0 else 1.6, 'stroke-opacity="0.9"')

    def marks(self, marks: Sequence[Mark]) -> None:
        """Draw contacts as crosses and breaches as triangles, filled if they are the ego's."""
        for mark in marks:
            if mark.point is None:
                continue
            x, y = mark.point
            size = 5.0 / self.scale
            if mark.kind == "contact":
                for way in (1.0, -1.0):
                    ends = [(x - size, y - way * size), (x + size, y + way * size)]
                    self.line(ends, palette.CONTACT_COLOUR, 2.2)
            elif mark.kind == "breach":
                colour = palette.BREACH_COLOURS[mark.car != 0]
                corners = [(x, y + size), (x + 0.9 * size, y - 0.6 * size), (x - 0.9 * size, y - 0.6 * size)]
                self.shape(corners, colour if mark.car == 0 else "#ffffff", colour, 1.6)


def network_picture(network: RoadNetwork) -> str:
    """Return the picture of a road network."""
    return Drawing(network, Car()).svg(f"Road network, {network.summary}")


def problem_picture(problem: Problem) -> str:
    """Return the picture of a problem: network, goals and obstacles."""
    drawing = Drawing(problem.network, problem.car, _fixed(problem))
    drawing.problem(problem)
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
    drawing.paths(paths)
    drawing.cars(instance, poses)
    drawing.marks(marks)
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
