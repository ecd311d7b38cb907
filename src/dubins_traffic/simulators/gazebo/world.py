"""The world of a trial as SDF: ground, obstacles, cars, and the plugin that steps it."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Final
from xml.etree.ElementTree import Element

from dubins_traffic.cars.body import Body, DiscObstacle, Obstacle, PolygonObstacle
from dubins_traffic.cars.state import Pose
from dubins_traffic.simulators.gazebo import vehicle
from dubins_traffic.simulators.gazebo.sdf import box, cylinder, numbers, pose, sphere, tag, text, visual

VERSION: Final = "1.6"
SOFTNESS: Final = 1e-6
"""Constraint force mixing: two wheels on one axle both resist sliding, so the exact solver needs a little of it."""
WALL: Final = 0.002
"""Thickness of the walls that a polygon is made of, metres; they stand within it."""
OBSTACLE_HEIGHT: Final = 0.3
GREY: Final = (0.45, 0.45, 0.45)


def world(
    starts: Sequence[Pose],
    body: Body,
    obstacles: Sequence[Obstacle],
    step: float,
    plugin: str,
    scenery: Sequence[Element] = (),
) -> str:
    """Return the world of a trial for Gazebo 11.

    Parameters
    ----------
    starts : sequence of Pose
        Where the cars are; the first is the ego.
    body : Body
        Of every car.
    obstacles : sequence of Obstacle
        What stands about.
    step : float
        Seconds of one iteration of the physics.
    plugin : str
        Path of the compiled world plugin.
    scenery : sequence of Element
        Further models that are only seen, such as roads.
    """
    models = bodies(starts, body, obstacles)
    solids, cars = models[: len(obstacles)], models[len(obstacles) :]
    listed = [
        *(tag("car", car.get("name", "")) for car in cars),
        *(tag("obstacle", solid.get("name", "")) for solid in solids),
    ]
    steps = tag("plugin", tag("torque", vehicle.TORQUE), *listed, name="dubins_traffic", filename=plugin)
    contents = [physics(step), numbers("gravity", 0.0, 0.0, -9.81), ground(), *scenery, *models, steps]
    return text(tag("sdf", tag("world", *contents, name="dubins_traffic"), version=VERSION))


def bodies(starts: Sequence[Pose], body: Body, obstacles: Sequence[Obstacle]) -> list[Element]:
    """Return a model of each obstacle, then one of each car at its start."""
    solids = [obstacle(f"obstacle_{k}", shape) for k, shape in enumerate(obstacles)]
    cars = [vehicle.model(car_name(n), start, body, ego=n == 0) for n, start in enumerate(starts)]
    return [*solids, *cars]


def car_name(n: int) -> str:
    """Return the name of car n in the world."""
    return "ego" if n == 0 else f"car_{n}"


def physics(step: float) -> Element:
    """Return the settings of the physics engine: as fast as possible, `step` seconds an iteration."""
    solver = tag("solver", tag("type", "world"))
    engine = tag("ode", solver, tag("constraints", tag("cfm", SOFTNESS)))
    times = (tag("max_step_size", step), tag("real_time_update_rate", 0))
    return tag("physics", *times, engine, type="ode", name="steps")


def ground() -> Element:
    """Return an endless plane; friction on it is that of what rolls there."""
    plane = tag("geometry", tag("plane", numbers("normal", 0, 0, 1), numbers("size", 1000, 1000)))
    solid = tag("collision", plane, vehicle.surface(1000.0, vehicle.GROUND), name="ground")
    return tag("model", tag("static", "true"), tag("link", solid, name="ground"), name="ground")


def obstacle(name: str, shape: Obstacle) -> Element:
    """Return an obstacle: a disc is the equator of a sphere for collisions, a polygon a ring of thin walls."""
    if isinstance(shape, DiscObstacle):
        middle = pose(shape.x, shape.y, vehicle.BUMPER)
        parts = [_solid("disc", middle, sphere(shape.radius))]
        standing = pose(shape.x, shape.y, 0.5 * OBSTACLE_HEIGHT)
        parts.append(visual("disc_seen", standing, cylinder(shape.radius, OBSTACLE_HEIGHT), GREY))
    else:
        parts = [part for k, wall in enumerate(walls(shape)) for part in _wall(f"wall_{k}", *wall)]
    return tag("model", tag("static", "true"), tag("link", *parts, name="body"), name=name)


def walls(polygon: PolygonObstacle) -> list[tuple[float, float, float, float]]:
    """Return the middle x, y, the heading and the length of a wall inside each edge of a polygon."""
    corners = polygon.vertices
    edges = list(zip(corners, corners[1:] + corners[:1], strict=True))
    inside = math.copysign(0.5 * WALL, sum(x0 * y1 - x1 * y0 for (x0, y0), (x1, y1) in edges))
    found: list[tuple[float, float, float, float]] = []
    for (x0, y0), (x1, y1) in edges:
        length = math.hypot(x1 - x0, y1 - y0)
        left = (-(y1 - y0) / length, (x1 - x0) / length)
        middle = (0.5 * (x0 + x1) + inside * left[0], 0.5 * (y0 + y1) + inside * left[1])
        found.append((*middle, math.atan2(y1 - y0, x1 - x0), length))
    return found


def _wall(name: str, x: float, y: float, yaw: float, length: float) -> tuple[Element, Element]:
    solid = _solid(name, pose(x, y, vehicle.BUMPER, yaw=yaw), box(length, WALL, OBSTACLE_HEIGHT))
    standing = pose(x, y, 0.5 * OBSTACLE_HEIGHT, yaw=yaw)
    return solid, visual(f"{name}_seen", standing, box(length, WALL, OBSTACLE_HEIGHT), GREY)


def _solid(name: str, where: Element, geometry: Element) -> Element:
    contacts = tag("max_contacts", 4)
    mask = vehicle.surface(vehicle.SCRAPE, vehicle.HULLS)
    return tag("collision", where, contacts, geometry, mask, name=name)
