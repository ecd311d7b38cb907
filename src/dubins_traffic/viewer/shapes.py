"""What pictures show, as one list of shapes from the ground up: Matplotlib, SVG and pixels are painted from it.

Places are metres, world frame. A painter says how long a metre is in its own unit, a point or a pixel (`Width.at`).
"""

from __future__ import annotations

import math
from collections.abc import Collection, Sequence
from typing import Final, NamedTuple, TypeAlias

import numpy as np

from dubins_traffic.cars.body import Body, Car, Disc, DiscObstacle
from dubins_traffic.cars.state import Frames, Pose
from dubins_traffic.kernels.arrays import Floats
from dubins_traffic.problem.instance import Problem
from dubins_traffic.roads.network import RoadNetwork
from dubins_traffic.rules.parameters import RuleParameters
from dubins_traffic.viewer import palette
from dubins_traffic.viewer.marks import Mark, goal_numbers
from dubins_traffic.viewer.scene import centre_paths, lane_hints, road_lines, short

KERB: Final = 0.03
"""Width of a kerb, metres."""
KERB_PIXELS: Final = 0.8
"""Least width of a kerb, points or pixels."""
DASH: Final = (0.2, 0.16)
"""Strokes and gaps of centre lines, metres."""


class Width(NamedTuple):
    """The width of a line, or the height of letters: `metres`, at least and at most so many points or pixels."""

    metres: float = 0.0
    least: float = 0.0
    most: float = math.inf
    rim: float = 0.0
    """Metres that are added, at least `least_rim` points or pixels."""
    least_rim: float = 0.0

    def at(self, scale: float) -> float:
        """Return the width where a metre has so many points or pixels."""
        rim = max(self.rim * scale, self.least_rim)
        return min(max(self.metres * scale, self.least), self.most) + rim


CENTRE: Final = Width(0.045, 0.8)
"""Of the broken lines in the middle of roads."""
HINT: Final = Width(0.04, 0.7)
"""Of the chevrons on lanes."""


class Line(NamedTuple):
    """A line from point to point."""

    points: Floats
    """(P, 2)."""
    colour: str
    width: Width
    dash: tuple[float, float] | None = None
    """Lengths of strokes and gaps, metres."""
    opacity: float = 1.0
    round: bool = True
    """Whether its ends are round; else they are cut off straight."""
    fades: float = 0.0
    """Points or pixels of a metre below which it fades."""

    def opacity_at(self, scale: float) -> float:
        """Return the opacity where a metre has so many points or pixels."""
        return self.opacity * min(1.0, scale / self.fades) if self.fades else self.opacity


class Region(NamedTuple):
    """A filled polygon with a line about it."""

    points: Floats
    fill: str
    edge: str | None
    width: float = 1.0
    """Of the line about it, points or pixels."""
    label: str | None = None
    """What a legend calls it."""


class Circle(NamedTuple):
    """A filled circle with a line about it."""

    x: float
    y: float
    radius: float
    fill: str
    edge: str
    width: float = 1.0
    """Of the line about it, points or pixels."""
    opacity: float = 1.0
    """Of the filling."""
    dash: float = 0.0
    """Length of the strokes of the line about it, points or pixels; 0 for an unbroken one."""
    label: str | None = None


class Text(NamedTuple):
    """Words about a point."""

    x: float
    y: float
    words: str
    colour: str
    size: Width
    """Of the letters; where they would be smaller than `size.least`, there are none."""
    bold: bool = False
    halo: bool = False
    number: str | None = None
    """What a painter writes that knows digits alone."""

    def size_at(self, scale: float) -> float:
        """Return the height of letters where a metre has so many points or pixels, 0 if there are none."""
        size = min(self.size.metres * scale, self.size.most)
        return size if size >= self.size.least else 0.0


class Sign(NamedTuple):
    """A mark of a contact, a cross, or of a breach, a triangle."""

    x: float
    y: float
    kind: str
    fill: str
    edge: str
    label: str


Shape: TypeAlias = Line | Region | Circle | Text | Sign


def roads(network: RoadNetwork, car: Car) -> list[Shape]:
    """Return the surfaces of roads with their kerbs, and centre lines."""
    lines, wide = road_lines(network), car.road_width
    kerb = Width(wide, rim=2.0 * KERB, least_rim=2.0 * KERB_PIXELS)
    shapes: list[Shape] = [Line(line, palette.KERB_COLOUR, kerb) for line in lines]
    shapes += [Line(line, palette.ROAD_COLOUR, Width(wide)) for line in lines]
    return shapes


def centres(network: RoadNetwork, car: Car) -> list[Shape]:
    """Return the broken lines in the middle of roads."""
    return [
        Line(path, palette.LINE_COLOUR, CENTRE, DASH, round=False)
        for path in centre_paths(network, 0.5 * car.road_width)
    ]


def hints(network: RoadNetwork, car: Car) -> list[Shape]:
    """Return the chevrons that point the way one drives on a lane."""
    return [Line(hint, palette.HINT_COLOUR, HINT, fades=20.0) for hint in lane_hints(network, car.w)]


def stops(problem: Problem) -> list[Shape]:
    """Return the lines at which cars stop before crossings."""
    width = Width(1.4 * CENTRE.metres, 1.4 * CENTRE.least)
    return [Line(np.stack(ends), palette.LINE_COLOUR, width, round=False) for ends in stop_lines(problem)]


def stop_lines(problem: Problem) -> list[tuple[Floats, Floats]]:
    """Return the lines at which cars stop before crossings, from the middle of the road to its edge, metres."""
    if not problem.rules:
        return []
    network = problem.network
    least = RuleParameters.from_mapping(problem.rules).crossing_degree
    lines: list[tuple[Floats, Floats]] = []
    for ends, tangent, last in zip(network.ends, network.tangents, network.end_tangents, strict=True):
        for vertex, away in ((int(ends[0]), tangent), (int(ends[1]), -last)):
            if network.degrees[vertex] >= least:
                middle = network.points[vertex] + problem.intersection_radius * away
                right = np.array([-away[1], away[0]])
                lines.append((middle, middle + 0.5 * problem.car.road_width * right))
    return lines


def places(network: RoadNetwork, car: Car) -> list[Shape]:
    """Return the lattice points of intersections."""
    size = Width(0.3 * car.road_width, 2.5, 8.0)
    return [
        Text(float(place[0]), float(place[1]), f"{short(x)},{short(y)}", palette.FAINT_COLOUR, size)
        for (x, y), place in zip(network.intersections, network.points, strict=True)
    ]


def goals(problem: Problem, lit: Collection[int] | None = None) -> list[Shape]:
    """Return the discs of goals; with `lit` those of some intersections are lit, and the others are dashed."""
    radius = problem.intersection_radius
    shapes: list[Shape] = []
    for vertex in goal_numbers(problem):
        x, y = problem.network.points[vertex].tolist()
        width, opacity, dash = 1.4, 0.22, 0.0
        if lit is not None:
            width, opacity, dash = (3.0, 0.42, 0.0) if vertex in lit else (1.8, 0.16, 5.0)
        colour = palette.GOAL_COLOUR
        shapes.append(Circle(x, y, radius, colour, colour, width, opacity, dash, "goal"))
    return shapes


def goal_names(problem: Problem, size: Width, lift: float = 0.0) -> list[Shape]:
    """Return the names of goals, which number them in the order of the problem, `lift` metres above their middles."""
    shapes: list[Shape] = []
    for vertex, numbers in goal_numbers(problem).items():
        x, y = problem.network.points[vertex].tolist()
        shapes.append(Text(x, y + lift, f"goal {numbers}", palette.GOAL_INK_COLOUR, size, bold=True, number=numbers))
    return shapes


def obstacles(problem: Problem) -> list[Shape]:
    """Return the obstacles."""
    fill, edge = palette.OBSTACLE_COLOUR, palette.INK_COLOUR
    return [
        Circle(one.x, one.y, one.radius, fill, edge, label="obstacle")
        if isinstance(one, DiscObstacle)
        else Region(np.asarray(one.vertices, dtype=np.float64), fill, edge, label="obstacle")
        for one in problem.obstacles
    ]


def cars(body: Body, names: Sequence[str], poses: Sequence[Pose], *, ghost: bool = False) -> list[Shape]:
    """Return bodies with their headings, the ego on top; a `ghost` is an outline, for starts beside ends."""
    shapes: list[Shape] = []
    for index, (name, pose) in reversed(list(enumerate(zip(names, poses, strict=True)))):
        colour = palette.car_colour(index)
        fill, edge = ("#ffffff", colour) if ghost else (colour, palette.INK_COLOUR)
        shapes.append(Region(outline(body, pose), fill, edge, label=None if ghost else name))
        shapes.append(Region(nose(body, pose), edge if ghost else "#ffffff", None))
    return shapes


def ways(lines: Sequence[Floats]) -> list[Shape]:
    """Return the ways of cars, the ego's on top and thicker."""
    shapes: list[Shape] = []
    for index, line in reversed(list(enumerate(lines))):
        more = 1.35 if index == 0 else 1.0
        width = Width(0.07 * more, 0.7 * more, 2.2 * more)
        shapes.append(Line(line, palette.car_colour(index), width, opacity=0.9))
    return shapes


def signs(marks: Sequence[Mark]) -> list[Shape]:
    """Return contacts as crosses, and breaches as triangles, filled if they are the ego's."""
    shapes: list[Shape] = []
    for mark in marks:
        if mark.point is None or mark.kind not in ("contact", "breach"):
            continue
        is_ego = mark.car == 0
        breach = palette.BREACH_COLOURS[not is_ego]
        if mark.kind == "contact":
            looks = (palette.CONTACT_COLOUR, "#ffffff", "contact")
        else:
            looks = (
                breach if is_ego else "#ffffff",
                breach,
                "breach of the ego" if is_ego else "breach of others",
            )
        shapes.append(Sign(*mark.point, mark.kind, *looks))
    return shapes


def poses_at(frames: Frames, frame: int) -> list[Pose]:
    """Return the poses of all cars in a frame of a block."""
    columns = zip(frames.x[frame], frames.y[frame], frames.c[frame], frames.s[frame], strict=True)
    return [Pose(float(x), float(y), float(c), float(s)) for x, y, c, s in columns]


def outline(body: Body, pose: Pose, corners: int = 48) -> Floats:
    """Return the outline of a body in a pose, (P, 2) metres; a disc has so many corners."""
    if isinstance(body, Disc):
        angles = np.linspace(0.0, 2.0 * np.pi, corners + 1)[:-1]
        shape = body.radius * np.stack([np.cos(angles), np.sin(angles)], axis=1)
    else:
        shape = 0.5 * np.array([[1, 1], [-1, 1], [-1, -1], [1, -1]]) * [body.length, body.width]
    return _placed(shape, pose)


def nose(body: Body, pose: Pose) -> Floats:
    """Return the triangle on a body that says where it heads, (3, 2) metres."""
    front = body.radius if isinstance(body, Disc) else 0.5 * body.length
    side = 0.28 * body.width
    return _placed(np.array([[0.82 * front, 0.0], [0.15 * front, side], [0.15 * front, -side]]), pose)


def _placed(shape: Floats, pose: Pose) -> Floats:
    turn = np.array([[pose.c, pose.s], [-pose.s, pose.c]])
    return shape @ turn + np.array([pose.x, pose.y])
