"""The world of a trial as SDF: roads, ground, obstacles, cars, and the plugin that steps it; and its elements.

Roads look like those of 2016, and are written alone as the program genroad did. A car is a hull on two driven wheels
and two casters, like a Kobuki.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from enum import StrEnum
from os import PathLike
from pathlib import Path
from typing import TYPE_CHECKING, Final
from xml.etree import ElementTree
from xml.etree.ElementTree import Element

import numpy as np

from dubins_traffic.cars.body import Body, Disc, DiscObstacle, Obstacle, PolygonObstacle
from dubins_traffic.cars.state import Pose
from dubins_traffic.files import packed, require_output, write_text
from dubins_traffic.kernels.arrays import Floats, Ints
from dubins_traffic.problem.instance import Instance

if TYPE_CHECKING:
    from dubins_traffic.roads.network import RoadNetwork

Child = Element | str | float | int


def tag(name: str, /, *children: Child, **attributes: str) -> Element:
    """Return an element with children; texts and numbers become its text, numbers to their last bit."""
    element = Element(name, attributes)
    for child in children:
        if isinstance(child, Element):
            element.append(child)
        else:
            element.text = child if isinstance(child, str) else repr(child)
    return element


def numbers(name: str, *values: float) -> Element:
    """Return an element whose text is a row of numbers."""
    return tag(name, " ".join(repr(value) for value in values))


def pose(x: float, y: float, z: float, roll: float = 0.0, pitch: float = 0.0, yaw: float = 0.0) -> Element:
    """Return a pose: metres and radians."""
    return numbers("pose", x, y, z, roll, pitch, yaw)


def box(x: float, y: float, z: float) -> Element:
    """Return the geometry of a box by its lengths in metres."""
    return tag("geometry", tag("box", numbers("size", x, y, z)))


def sphere(radius: float) -> Element:
    """Return the geometry of a sphere of `radius` metres."""
    return tag("geometry", tag("sphere", tag("radius", radius)))


def cylinder(radius: float, length: float) -> Element:
    """Return the geometry of an upright cylinder, metres."""
    return tag("geometry", tag("cylinder", tag("radius", radius), tag("length", length)))


def visual(name: str, where: Element, geometry: Element, colour: Sequence[float]) -> Element:
    """Return the visual of a link; `colour` is red, green, blue in [0, 1]."""
    paint = tag("material", *(numbers(kind, *colour, 1.0) for kind in ("ambient", "diffuse")))
    return tag("visual", where, geometry, paint, name=name)


def text(root: Element) -> str:
    """Return the document, indented, ending in a line feed."""
    ElementTree.indent(root)
    return '<?xml version="1.0"?>\n' + ElementTree.tostring(root, encoding="unicode") + "\n"


WIDTH: Final = 1.2
"""Of a road, metres: 4w for w = 0.3 m."""
MARKER: Final = 0.12
"""Width of the marker between the lanes, metres."""
THICKNESS: Final = 0.002
SAGITTA: Final = 0.02
"""Largest distance of the shown chords from a curve, metres."""
SURFACE_COLOUR: Final = (0.25, 0.25, 0.27)
MARKER_COLOUR: Final = (0.9, 0.8, 0.2)


def roads(network: RoadNetwork, width: float = WIDTH) -> list[Element]:
    """Return a model per segment, and per chord of those that bend.

    It reaches half its width beyond both ends of the segment, so that corners are paved, and beyond the ends of a
    chord as far as closes the gap to the next on the outer side.

    Parameters
    ----------
    network : RoadNetwork
        Of which roads are made.
    width : float
        Of a road, metres.
    """
    made: list[Element] = []
    owner, first, last = network.bars(SAGITTA)
    step = last - first
    lengths = np.sqrt((step * step).sum(axis=1))
    beyond = _beyond(owner, step / lengths[:, None], width)
    for k, length in enumerate(lengths.tolist()):
        x0, y0 = first[k].tolist()
        dx, dy = step[k].tolist()
        begin, end = beyond[k].tolist()
        where = (x0 + 0.5 * dx, y0 + 0.5 * dy, 0.0)
        height = 0.5 * THICKNESS
        place = pose(0.5 * (end - begin), 0.0, height)
        surface = visual("surface", place, box(length + begin + end, width, THICKNESS), SURFACE_COLOUR)
        marker = visual("marker", pose(0.0, 0.0, 2 * height), box(length, MARKER, THICKNESS), MARKER_COLOUR)
        link = tag("link", surface, marker, name="road")
        yaw = math.atan2(dy, dx)
        made.append(tag("model", tag("static", "true"), pose(*where, yaw=yaw), link, name=f"road_{k}"))
    return made


def _beyond(owner: Ints, along: Floats, width: float) -> Floats:
    """Return how far the bars of segments `owner` with directions `along` (K, 2) reach beyond both ends, (K, 2)."""
    beyond = np.full((len(owner), 2), 0.5 * width)
    on = owner[1:] == owner[:-1]
    cosine = (along[1:] * along[:-1]).sum(axis=1)
    sine = np.abs(along[:-1, 0] * along[1:, 1] - along[:-1, 1] * along[1:, 0])
    gap = 0.5 * width * sine / (1.0 + cosine)
    beyond[1:, 0] = np.where(on, gap, beyond[1:, 0])
    beyond[:-1, 1] = np.where(on, gap, beyond[:-1, 1])
    return beyond


GROUND: Final = 1
"""Bit of the collision masks of the ground, wheels and casters."""
HULLS: Final = 2
"""Bit of the collision masks of hulls and obstacles: they meet each other and nothing else."""

MASS: Final = 2.3
WHEEL_MASS: Final = 0.05
WHEEL_RADIUS: Final = 0.035
TRACK: Final = 0.23
"""Distance of the wheels' points of contact, metres."""
GRIP: Final = 10.0
"""Coefficient of friction of a wheel on the ground."""
TORQUE: Final = 1.6
"""Largest torque of the motor of a wheel, N m."""
BUMPER: Final = 0.02
"""Height at which hulls touch, metres: that of the centre of mass."""
HEIGHT: Final = 0.12
CLEARANCE: Final = 0.01
STIFFNESS: Final = 1e5
"""Of the tyres, N/m."""
DAMPING: Final = 1e3
"""Of the tyres, N s/m."""
LIFT: Final = 0.0005
"""Gap between casters and ground while the car is level, metres: so it never rests on four points."""
BEHIND: Final = 0.01
"""How far the centre of mass lies behind the axle, metres."""
SCRAPE: Final = 0.3
"""Coefficient of friction between hulls."""

EGO_COLOUR: Final = (0.8, 0.25, 0.1)
OTHER_COLOUR: Final = (0.15, 0.35, 0.7)
DARK: Final = (0.1, 0.1, 0.1)


@dataclass(frozen=True, slots=True)
class Drive:
    """Where the wheels are: `track` between them and `base` from the axle to each caster, metres."""

    track: float
    base: float

    @staticmethod
    def below(body: Body) -> Drive:
        """Return a Kobuki's drive, made narrower or shorter where `body` is."""
        half_length = body.radius if isinstance(body, Disc) else 0.5 * body.length
        return Drive(min(TRACK, 0.65 * body.width), 0.7 * half_length)

    def wheels(self, speed: Floats, yaw_rate: Floats) -> tuple[Floats, Floats]:
        """Return the rates of the left and the right wheels, rad/s, for m/s and rad/s of the cars."""
        lead = 0.5 * self.track * yaw_rate
        return (speed - lead) / WHEEL_RADIUS, (speed + lead) / WHEEL_RADIUS


def model(name: str, start: Pose, body: Body, *, ego: bool) -> Element:
    """Return a car at `start`."""
    drive = Drive.below(body)
    side = 0.5 * drive.track
    base = tag(
        "link",
        _inertial(MASS, -BEHIND, BUMPER, _moments(body)),
        _hull(body),
        _visual(body, EGO_COLOUR if ego else OTHER_COLOUR),
        *(_caster(place, x) for place, x in (("front", drive.base), ("rear", -drive.base))),
        name="base",
    )
    wheels = [_wheel(where, y) for where, y in (("left", side), ("right", -side))]
    joints = [_joint(where) for where in ("left", "right")]
    return tag(
        "model",
        pose(start.x, start.y, 0.0, yaw=start.theta),
        tag("allow_auto_disable", "false"),
        base,
        *wheels,
        *joints,
        name=name,
    )


def surface(friction: float, mask: int) -> Element:
    """Return the surface of a collision shape: friction, which shapes it meets, and, on the ground, its stiffness."""
    rubs = tag("friction", tag("ode", tag("mu", friction), tag("mu2", friction)))
    meets = [tag("collide_bitmask", mask)]
    if mask == GROUND:
        meets.append(tag("ode", tag("kp", STIFFNESS), tag("kd", DAMPING)))
    return tag("surface", rubs, tag("contact", *meets))


def _inertial(mass: float, x: float, height: float, moments: tuple[float, float, float]) -> Element:
    names = ("ixx", "iyy", "izz")
    entries = [tag(name, moment) for name, moment in zip(names, moments, strict=True)]
    zeros = [tag(name, 0.0) for name in ("ixy", "ixz", "iyz")]
    return tag("inertial", pose(x, 0.0, height), tag("mass", mass), tag("inertia", *entries, *zeros))


def _moments(body: Body) -> tuple[float, float, float]:
    """Return the moments of inertia of a uniform cylinder or box, kg m^2."""
    if isinstance(body, Disc):
        level = MASS * (3.0 * body.radius * body.radius + HEIGHT * HEIGHT) / 12.0
        return level, level, 0.5 * MASS * body.radius * body.radius
    length, width = body.length * body.length, body.width * body.width
    height = HEIGHT * HEIGHT
    return (MASS * (width + height) / 12.0, MASS * (length + height) / 12.0, MASS * (length + width) / 12.0)


def _hull(body: Body) -> Element:
    """Return the collision shape: a disc is the equator of a sphere, whose contacts the engine finds exactly."""
    shape = sphere(body.radius) if isinstance(body, Disc) else box(body.length, body.width, 2.0 * BUMPER)
    contacts = tag("max_contacts", 4)
    return tag("collision", pose(0.0, 0.0, BUMPER), contacts, shape, surface(SCRAPE, HULLS), name="hull")


def _visual(body: Body, colour: tuple[float, float, float]) -> Element:
    shape = cylinder(body.radius, HEIGHT) if isinstance(body, Disc) else box(body.length, body.width, HEIGHT)
    return visual("shell", pose(0.0, 0.0, CLEARANCE + 0.5 * HEIGHT), shape, colour)


def _caster(place: str, x: float) -> Element:
    where = pose(x, 0.0, WHEEL_RADIUS + LIFT)
    return tag(
        "collision",
        where,
        tag("max_contacts", 1),
        sphere(WHEEL_RADIUS),
        surface(0.0, GROUND),
        name=f"{place}_caster",
    )


def _wheel(side: str, y: float) -> Element:
    moment = 0.4 * WHEEL_MASS * WHEEL_RADIUS * WHEEL_RADIUS
    rolls = tag("collision", tag("max_contacts", 1), sphere(WHEEL_RADIUS), surface(GRIP, GROUND), name="rolls")
    seen = visual("wheel", numbers("pose", 0, 0, 0, 1.5707963267948966, 0, 0), cylinder(WHEEL_RADIUS, 0.02), DARK)
    return tag(
        "link",
        pose(0.0, y, WHEEL_RADIUS),
        _inertial(WHEEL_MASS, 0.0, 0.0, (moment, moment, moment)),
        rolls,
        seen,
        name=f"{side}_wheel",
    )


def _joint(side: str) -> Element:
    axis = tag("axis", tag("xyz", "0 1 0"))
    return tag(
        "joint",
        tag("parent", "base"),
        tag("child", f"{side}_wheel"),
        axis,
        name=f"{side}_wheel_joint",
        type="revolute",
    )


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
    steps = tag("plugin", tag("torque", TORQUE), *listed, name="dubins_traffic", filename=plugin)
    contents = [physics(step), numbers("gravity", 0.0, 0.0, -9.81), ground(), *scenery, *models, steps]
    return text(tag("sdf", tag("world", *contents, name="dubins_traffic"), version=VERSION))


def bodies(starts: Sequence[Pose], body: Body, obstacles: Sequence[Obstacle]) -> list[Element]:
    """Return a model of each obstacle, then one of each car at its start."""
    solids = [obstacle(f"obstacle_{k}", shape) for k, shape in enumerate(obstacles)]
    cars = [model(car_name(n), start, body, ego=n == 0) for n, start in enumerate(starts)]
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
    solid = tag("collision", plane, surface(1000.0, GROUND), name="ground")
    return tag("model", tag("static", "true"), tag("link", solid, name="ground"), name="ground")


def obstacle(name: str, shape: Obstacle) -> Element:
    """Return an obstacle: a disc is the equator of a sphere for collisions, a polygon a ring of thin walls."""
    if isinstance(shape, DiscObstacle):
        middle = pose(shape.x, shape.y, BUMPER)
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
    sides: list[tuple[float, float, float, float]] = []
    for (x0, y0), (x1, y1) in edges:
        length = math.hypot(x1 - x0, y1 - y0)
        left = (-(y1 - y0) / length, (x1 - x0) / length)
        middle = (0.5 * (x0 + x1) + inside * left[0], 0.5 * (y0 + y1) + inside * left[1])
        sides.append((*middle, math.atan2(y1 - y0, x1 - x0), length))
    return sides


def _wall(name: str, x: float, y: float, yaw: float, length: float) -> tuple[Element, Element]:
    solid = _solid(name, pose(x, y, BUMPER, yaw=yaw), box(length, WALL, OBSTACLE_HEIGHT))
    standing = pose(x, y, 0.5 * OBSTACLE_HEIGHT, yaw=yaw)
    return solid, visual(f"{name}_seen", standing, box(length, WALL, OBSTACLE_HEIGHT), GREY)


def _solid(name: str, where: Element, geometry: Element) -> Element:
    contacts = tag("max_contacts", 4)
    mask = surface(SCRAPE, HULLS)
    return tag("collision", where, contacts, geometry, mask, name=name)


GRASS: Final = (0.35, 0.45, 0.3)


class Version(StrEnum):
    """Versions of SDF: that of Gazebo 11 and older, and that of the Gazebos after it."""

    CLASSIC = "1.6"
    NEW = "1.9"


def to_sdf(what: RoadNetwork | Instance, version: Version = Version.CLASSIC) -> str:
    """Return a world with ground, light, and a road with its marker for each segment.

    Parameters
    ----------
    what : RoadNetwork or Instance
        Whose roads are made; of an instance also its obstacles, and its cars where they start.
    version : Version
        Of SDF.
    """
    if isinstance(what, Instance):
        problem = what.problem
        models = [*roads(problem.network), *bodies(what.starts, problem.car.body, problem.obstacles)]
    else:
        models = roads(what)
    world = tag("world", numbers("gravity", 0.0, 0.0, -9.81), _sun(), _grass(), *models, name="roads")
    return text(tag("sdf", world, version=version.value))


def _grass() -> Element:
    plane = tag("geometry", tag("plane", numbers("normal", 0, 0, 1), numbers("size", 1000, 1000)))
    earth = ground()
    link = earth.find("link")
    assert link is not None
    link.append(visual("grass", pose(0.0, 0.0, 0.0), plane, GRASS))
    return earth


def outlook(network: RoadNetwork) -> list[Element]:
    """Return the elements that make a trial visible: light, roads, and a camera that sees all of them."""
    low, high = network.points.min(axis=0), network.points.max(axis=0)
    x, y = (0.5 * (low + high)).tolist()
    away = 3.0 + 1.2 * float((high - low).max())
    camera = tag("camera", pose(x, y - 0.5 * away, away, 0.0, 1.1, 0.5 * math.pi), name="view")
    return [tag("gui", camera), _sun(), *roads(network)]


def write_sdf(
    what: RoadNetwork | Instance,
    path: str | PathLike[str],
    version: Version = Version.CLASSIC,
    *,
    overwrite: bool = False,
) -> None:
    """Write `to_sdf` to a file `*.sdf`, whole or not at all.

    InputError if the path is refused (`files.require_output`), or the file can't be written.
    """
    require_output(path, "a world", packed(".sdf"), overwrite=overwrite)
    write_text(Path(path), to_sdf(what, version))


def _sun() -> Element:
    return tag(
        "light",
        pose(0.0, 0.0, 10.0),
        tag("cast_shadows", "false"),
        numbers("diffuse", 0.8, 0.8, 0.8, 1.0),
        numbers("specular", 0.1, 0.1, 0.1, 1.0),
        numbers("direction", -0.3, 0.2, -1.0),
        name="sun",
        type="directional",
    )
