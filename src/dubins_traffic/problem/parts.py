"""Models of the parts that configurations and instances share, and their core values."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING, Annotated, Any, Literal

from pydantic import (
    AfterValidator,
    BeforeValidator,
    ConfigDict,
    Field,
    WithJsonSchema,
    create_model,
    model_validator,
)

from dubins_traffic.cars.body import (
    Body,
    Bounds,
    Car,
    Disc,
    DiscObstacle,
    Obstacle,
    PolygonObstacle,
    Rectangle,
)
from dubins_traffic.cars.dynamics import check_name
from dubins_traffic.errors import InputError
from dubins_traffic.problem import limits
from dubins_traffic.problem.faults import Strict, fault
from dubins_traffic.rules.parameters import RuleParameters

Length = Annotated[float, Field(ge=limits.LEAST, le=limits.METRES)]
Angle = Annotated[float, Field(ge=-1e6, le=1e6)]
Width = Annotated[float, Field(ge=limits.WIDTHS[0], le=limits.WIDTHS[1])]
Coordinate = Annotated[float, Field(ge=-limits.METRES, le=limits.METRES)]
Point = Annotated[list[Coordinate], Field(min_length=2, max_length=2)]
LatticePoint = Annotated[list[int], Field(min_length=2, max_length=2)]
_CAR = Car()


class Laser(Strict):
    """A laser scanner on the car's centre; the defaults are the layout of 2016."""

    rays: Annotated[int, Field(ge=1, le=limits.RAYS)] = Field(default=300, description="number of rays")
    angle_min: Angle = Field(default=-2.0, description="bearing of the first ray, rad")
    angle_max: Angle = Field(default=2.0, description="bearing of the last ray, rad")
    range_min: Annotated[float, Field(ge=0, le=limits.METRES)] = Field(default=0.08, description="smallest range, m")
    range_max: Length = Field(default=5.0, description="largest range, m")
    rate: Annotated[float, Field(gt=0, le=limits.RATE)] = Field(default=10.0, description="scans per second")

    @model_validator(mode="after")
    def _ordered(self) -> Laser:
        if self.angle_max < self.angle_min or self.angle_max - self.angle_min > 2 * math.pi + 1e-9:
            raise fault(
                "not a field of view",
                "angle_min <= angle_max <= angle_min + 2 pi",
                "angle_max",
                self.angle_max,
            )
        if self.range_max <= self.range_min:
            raise fault("not a range", f"a number > range_min = {self.range_min}", "range_max", self.range_max)
        return self


class Disturbances(Strict):
    """Seeded disturbances, of the ego or of all cars that a trial drives itself; only commands of the ego get lost."""

    position_noise: Annotated[float, Field(ge=0, le=limits.METRES)] = Field(
        default=0.0,
        description="standard deviation of the observed position, m; draws are cut at three of them",
    )
    heading_noise: Annotated[float, Field(ge=0, le=10)] = Field(
        default=0.0,
        description="standard deviation of the observed heading, rad; draws are cut at three of them",
    )
    command_delay: Annotated[int, Field(ge=0, le=limits.DELAY)] = Field(
        default=0, description="ticks by which commands take effect late"
    )
    command_loss: Annotated[float, Field(ge=0, le=1)] = Field(
        default=0.0, description="probability that a command is lost and the last one stays in force"
    )
    cars: Literal["ego", "all"] = Field(
        default="ego",
        description="whose commands are late and who sees noisy poses: the ego, or e-agents too",
    )

    def document(self) -> dict[str, Any]:
        """Return the document; it says whose they are only if e-agents have them too."""
        return self.model_dump(exclude={"cars"} if self.cars == "ego" else None)

    @property
    def reach_e_agents(self) -> bool:
        """Whether e-agents have to reckon with late commands or noisy poses."""
        return self.cars == "all" and bool(self.command_delay or self.position_noise or self.heading_noise)


class DiscModel(Strict):
    """A round body."""

    radius: Length = Field(default=Disc().radius, description="radius, m")


class RectangleModel(Strict):
    """A rectangular body."""

    length: Length = Field(description="extent along the heading, m")
    width: Length = Field(description="extent across the heading, m")


class BodyModel(Strict):
    """The body that collides: a disc or a rectangle."""

    model_config = ConfigDict(json_schema_extra={"minProperties": 1, "maxProperties": 1})

    disc: DiscModel | None = Field(default=None, description="a round body")
    rectangle: RectangleModel | None = Field(default=None, description="a rectangular body")

    @model_validator(mode="after")
    def _one(self) -> BodyModel:
        if (self.disc is None) == (self.rectangle is None):
            raise fault("not one body", "either disc or rectangle")
        return self

    def core(self) -> Body:
        """Return the body itself."""
        if self.rectangle is not None:
            return Rectangle(self.rectangle.length, self.rectangle.width)
        return Disc(self.disc.radius if self.disc else Disc().radius)


class BoundsModel(Strict):
    """Bounds on commands."""

    speed: Annotated[float, Field(ge=limits.LEAST, le=limits.SPEED)] = Field(
        default=_CAR.bounds.speed, description="largest speed, m/s"
    )
    yaw_rate: Annotated[float, Field(ge=limits.LEAST, le=limits.RATE)] = Field(
        default=_CAR.bounds.yaw_rate, description="largest yaw rate, rad/s; times the period at most 1/2"
    )
    speed_min: Annotated[float, Field(ge=-limits.SPEED, le=limits.SPEED)] | None = Field(
        default=None,
        description="smallest speed, m/s, at most the largest; null: the car reverses as fast as it drives",
    )
    turning_radius: Annotated[float, Field(ge=0, le=limits.METRES)] = Field(
        default=0.0, description="smallest turning radius, m; 0: it turns in place"
    )

    @model_validator(mode="after")
    def _ordered(self) -> BoundsModel:
        if self.speed_min is not None and self.speed_min > self.speed:
            raise fault("above speed", f"a number <= {self.speed}", "speed_min", self.speed_min)
        return self

    def core(self) -> Bounds:
        """Return the bounds themselves."""
        return Bounds(self.speed, self.yaw_rate, self.speed_min, self.turning_radius)


def _known_model(spec: str) -> str:
    try:
        check_name(spec)
    except InputError as error:
        raise fault(error.problem, error.expected or "") from None
    return spec


class CarModel(Strict):
    """The car; all cars of a trial are alike."""

    w: Width = Field(default=_CAR.w, description="nominal width that sets the roads (lanes 2w, roads 4w), m")
    body: BodyModel = Field(default=BodyModel(disc=DiscModel()), description="the body that collides")
    bounds: BoundsModel = Field(default=BoundsModel(), description="bounds on commands")
    model: Annotated[str, AfterValidator(_known_model)] = Field(
        default=_CAR.model, description="how it moves: dubins, or module:Class of a car model of one's own"
    )
    parameters: dict[str, Any] = Field(default={}, description="parameters of that model")

    def core(self) -> Car:
        """Return the car itself."""
        return Car(self.w, self.body.core(), self.bounds.core(), self.model, self.parameters)

    @staticmethod
    def document(car: Car) -> dict[str, Any]:
        """Return the document of `car`."""
        body, bounds = car.body, car.bounds
        if isinstance(body, Disc):
            shape: dict[str, Any] = {"disc": {"radius": body.radius}}
        else:
            shape = {"rectangle": {"length": body.length, "width": body.width}}
        limits_ = {
            "speed": bounds.speed,
            "yaw_rate": bounds.yaw_rate,
            "speed_min": bounds.speed_min,
            "turning_radius": bounds.turning_radius,
        }
        document: dict[str, Any] = {"w": car.w, "body": shape, "bounds": limits_}
        if car.model != _CAR.model:
            document |= {"model": car.model, "parameters": dict(car.parameters)}
        return document


class DiscObstacleModel(Strict):
    """A static disc."""

    x: Coordinate = Field(description="x of the centre, m")
    y: Coordinate = Field(description="y of the centre, m")
    radius: Length = Field(description="radius, m")


class PolygonModel(Strict):
    """A static simple polygon."""

    vertices: Annotated[list[Point], Field(min_length=3, max_length=limits.CORNERS)] = Field(
        description="corners in order, each [x, y], m"
    )

    @model_validator(mode="after")
    def _simple(self) -> PolygonModel:
        _check_polygon(self.vertices)
        return self


class ObstacleModel(Strict):
    """A static obstacle: a disc or a polygon."""

    model_config = ConfigDict(json_schema_extra={"minProperties": 1, "maxProperties": 1})

    disc: DiscObstacleModel | None = Field(default=None, description="a disc")
    polygon: PolygonModel | None = Field(default=None, description="a simple polygon, convex or not")

    @model_validator(mode="after")
    def _one(self) -> ObstacleModel:
        if (self.disc is None) == (self.polygon is None):
            raise fault("not one obstacle", "either disc or polygon")
        return self

    def core(self) -> Obstacle:
        """Return the obstacle itself."""
        if self.polygon is not None:
            return PolygonObstacle(tuple((x, y) for x, y in self.polygon.vertices))
        disc = self.disc or DiscObstacleModel(x=0.0, y=0.0, radius=1.0)
        return DiscObstacle(disc.x, disc.y, disc.radius)

    @staticmethod
    def document(obstacle: Obstacle) -> dict[str, Any]:
        """Return the document of `obstacle`."""
        if isinstance(obstacle, DiscObstacle):
            return {"disc": {"x": obstacle.x, "y": obstacle.y, "radius": obstacle.radius}}
        return {"polygon": {"vertices": [list(corner) for corner in obstacle.vertices]}}


def _rule_field(name: str, default: float) -> tuple[Any, Any]:
    if isinstance(default, int):
        return (Annotated[int, Field(ge=0, le=limits.TRIALS)], Field(default, description=name))
    return (Annotated[float, Field(ge=0, le=limits.METRES)], Field(default, description=name))


class GivenRules(Strict):
    """The parameters of the rules that a document gives."""

    def on_roads(self, w: float) -> dict[str, Any]:
        """Return all parameters by name; those left out are as usual on roads of half-lane width `w` (m)."""
        return RuleParameters.for_width(w).to_mapping() | self.model_dump(exclude_unset=True)


if TYPE_CHECKING:

    class RulesModel(GivenRules):
        """Parameters of the rules to judge."""
else:
    RulesModel = create_model(
        "RulesModel",
        __base__=GivenRules,
        __doc__="Parameters of the rules to judge; those left out have their defaults (spec.parameters).",
        **{name: _rule_field(name, value) for name, value in RuleParameters().to_mapping().items()},
    )


def _switch(value: object) -> object:
    """Read true as an object of defaults and false as null."""
    if isinstance(value, bool):
        return {} if value else None
    return value


def _with_switch(schema: dict[str, Any]) -> None:
    schema["anyOf"].append({"type": "boolean"})


Rules = Annotated[RulesModel | None, BeforeValidator(_switch), Field(json_schema_extra=_with_switch)]
LaserSwitch = Annotated[Laser | None, BeforeValidator(_switch), Field(json_schema_extra=_with_switch)]


ROADS = "a road network description (an object), or the path of one or of a map of another program"


def _check_rnd(value: Any) -> Any:
    if isinstance(value, str | dict) and value:
        return value  # pyright: ignore[reportUnknownVariableType]
    raise fault("not a road network", ROADS)


RoadReference = Annotated[Any, AfterValidator(_check_rnd), WithJsonSchema({"type": ["string", "object"]})]


def _check_polygon(corners: Sequence[Sequence[float]]) -> None:
    """Refuse corners that coincide and edges that cross."""
    count = len(corners)
    edges = [(corners[k], corners[(k + 1) % count]) for k in range(count)]
    for k, (a, b) in enumerate(edges):
        if a == b:
            raise fault(f"corners {k} and {(k + 1) % count} coincide", "a simple polygon")
    for i in range(count):
        for j in range(i + 1, count):
            neighbours = j - i == 1 or (i == 0 and j == count - 1)
            if _edges_meet(edges[i], edges[j], neighbours):
                raise fault(f"edges {i} and {j} meet", "a simple polygon")


def _edges_meet(first: tuple[Any, Any], second: tuple[Any, Any], neighbours: bool) -> bool:
    (a, b), (c, d) = first, second
    if neighbours:
        shared, p, q = (b, a, d) if b == c else (a, b, c)
        folded = _side(shared, p, q) == 0
        return folded and (p[0] - shared[0]) * (q[0] - shared[0]) + (p[1] - shared[1]) * (q[1] - shared[1]) > 0
    sides = (_side(a, b, c), _side(a, b, d), _side(c, d, a), _side(c, d, b))
    if sides[0] * sides[1] < 0 and sides[2] * sides[3] < 0:
        return True
    ends = ((a, b, c), (a, b, d), (c, d, a), (c, d, b))
    return any(side == 0 and _within(*points) for side, points in zip(sides, ends, strict=True))


def _side(a: Any, b: Any, p: Any) -> int:
    cross = (b[0] - a[0]) * (p[1] - a[1]) - (b[1] - a[1]) * (p[0] - a[0])
    return (cross > 0) - (cross < 0)


def _within(a: Any, b: Any, p: Any) -> bool:
    inside_x = min(a[0], b[0]) <= p[0] <= max(a[0], b[0])
    return inside_x and min(a[1], b[1]) <= p[1] <= max(a[1], b[1])
