"""The car in Gazebo: two driven wheels and two casters below a hull, like a Kobuki."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final
from xml.etree.ElementTree import Element

from dubins_traffic.cars.body import Body, Disc
from dubins_traffic.cars.state import Pose
from dubins_traffic.kernels.arrays import Floats
from dubins_traffic.simulators.gazebo.sdf import box, cylinder, numbers, pose, sphere, tag, visual

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
    return (
        MASS * (width + height) / 12.0,
        MASS * (length + height) / 12.0,
        MASS * (length + width) / 12.0,
    )


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
    rolls = tag(
        "collision", tag("max_contacts", 1), sphere(WHEEL_RADIUS), surface(GRIP, GROUND), name="rolls"
    )
    seen = visual(
        "wheel", numbers("pose", 0, 0, 0, 1.5707963267948966, 0, 0), cylinder(WHEEL_RADIUS, 0.02), DARK
    )
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
