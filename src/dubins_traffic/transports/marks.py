"""What RViz and Foxglove are shown of a trial: marks of roads, goals, obstacles, cars and breaches, in the frame `map`.

Bags of ROS 2 and sessions over it make messages of them, `visualization_msgs/msg/Marker`.
"""

from __future__ import annotations

from dataclasses import dataclass

from dubins_traffic.cars.body import Body, DiscObstacle, Rectangle
from dubins_traffic.problem.instance import Problem

ROADS, CARS, BREACHES = (f"/dubins_traffic/{name}" for name in ("roads", "cars", "breaches"))
"""Topics: the first when a trial is prepared, the second in each frame, the third when a rule is broken."""
ARROW, CUBE, CYLINDER, STRIP, TEXT = 0, 1, 3, 4, 9
"""Types of markers."""
ADD, DELETE_ALL = 0, 3
"""What is done with a marker, or with all that were shown before."""
SHOWN_FOR = 3
"""Seconds for which a breach is shown."""
GREY, LINE, PALE, GREEN, BROWN, BLUE, ORANGE, RED = (
    (0.35, 0.35, 0.38), (0.9, 0.9, 0.9), (0.45, 0.45, 0.48), (0.3, 0.7, 0.35), (0.5, 0.35, 0.2), (0.15, 0.4, 0.8),
    (0.9, 0.55, 0.1), (0.85, 0.1, 0.1),
)  # fmt: skip
Three = tuple[float, float, float]


@dataclass(frozen=True, slots=True)
class Mark:
    """One mark; a later one of the same group and number takes its place.

    `scale` (m) are its extents, `color` its red, green and blue, `place` (m) its centre, `turn` the last two parts of
    the quaternion that turns it about the vertical, `points` (m) those of a strip, in its own frame, and `seconds` for
    how long it is shown, 0 until it is replaced.
    """

    group: str
    number: int
    kind: int
    scale: Three
    color: Three
    place: Three = (0.0, 0.0, 0.0)
    turn: tuple[float, float] = (0.0, 1.0)
    points: tuple[tuple[float, float], ...] = ()
    text: str = ""
    seconds: int = 0


def of_world(problem: Problem) -> list[Mark]:
    """Return marks of what does not move: roads, their middle lines, discs of intersections, goals, obstacles."""
    network, wide, across = problem.network, 2.0 * problem.car.lane_width, 2.0 * problem.intersection_radius
    shown: list[Mark] = []
    for s in range(network.lanes // 2):
        points = tuple((x, y) for x, y in network.lane_curve(2 * s, 0.0).tolist())
        shown.append(Mark("roads", s, STRIP, (wide, 0.0, 0.0), GREY, points=points))
        shown.append(Mark("lines", s, STRIP, (0.03, 0.0, 0.0), LINE, (0.0, 0.0, 0.01), points=points))
    for v, (x, y) in enumerate(network.points.tolist()):
        color = GREEN if v in problem.goal_vertices else PALE
        shown.append(Mark("intersections", v, CYLINDER, (across, across, 0.01), color, (x, y, 0.005)))
    for k, obstacle in enumerate(problem.obstacles):
        if isinstance(obstacle, DiscObstacle):
            size = (2.0 * obstacle.radius, 2.0 * obstacle.radius, 0.3)
            shown.append(Mark("obstacles", k, CYLINDER, size, BROWN, (obstacle.x, obstacle.y, 0.15)))
        else:
            corners = (*obstacle.vertices, obstacle.vertices[0])
            shown.append(Mark("obstacles", k, STRIP, (0.05, 0.0, 0.0), BROWN, (0.0, 0.0, 0.1), points=corners))
    return shown


def of_car(n: int, body: Body, x: float, y: float, turn: tuple[float, float]) -> list[Mark]:
    """Return marks of the body of car n and of an arrow along its heading."""
    if isinstance(body, Rectangle):
        kind, size = CUBE, (body.length, body.width, 0.2)
    else:
        kind, size = CYLINDER, (2.0 * body.radius, 2.0 * body.radius, 0.2)
    return [
        Mark("bodies", n, kind, size, BLUE if n == 0 else ORANGE, (x, y, 0.1), turn),
        Mark("headings", n, ARROW, (0.3, 0.05, 0.05), LINE, (x, y, 0.22), turn),
    ]


def of_breach(tick: int, said: str, x: float, y: float) -> Mark:
    """Return the mark of a breach: a text over the car that broke a rule."""
    return Mark("breaches", tick, TEXT, (0.0, 0.0, 0.3), RED, (x, y, 0.5), text=said, seconds=SHOWN_FOR)
