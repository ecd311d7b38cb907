"""Models of the trials configuration: what it may say, and the defaults."""

from __future__ import annotations

import json
import math
from collections.abc import Sequence
from typing import Annotated, Any, Literal, cast

from pydantic import AfterValidator, ConfigDict, Field, WithJsonSchema, model_validator

from dubins_traffic.cars.body import Obstacle
from dubins_traffic.errors import InputError
from dubins_traffic.problem import limits
from dubins_traffic.problem.faults import Careful, Open, Strict, fault
from dubins_traffic.problem.formulas import Formulas
from dubins_traffic.problem.kinds import KINDS, NAMES_2016, NetworkPoint
from dubins_traffic.problem.parts import (
    ROADS,
    CarModel,
    Disturbances,
    LaserSwitch,
    Length,
    ObstacleModel,
    RoadReference,
    Rules,
)
from dubins_traffic.roads.generate import MOST_INTERSECTIONS, most_segments
from dubins_traffic.rules.parameters import RuleParameters

NAME = r"^[A-Za-z][A-Za-z0-9_/]*$"


def check_start(value: object) -> object:
    """Return a start: a word, or (x, y, theta)."""
    if value in ("drawn", "origin"):
        return value
    return check_pose(value)


def _numbers(value: object) -> list[float]:
    """Return `value` as a list of finite numbers, an empty list if it is anything else."""
    row = cast("Sequence[object]", value) if isinstance(value, list | tuple) else ()
    numbers = [float(x) for x in row if isinstance(x, int | float) and not isinstance(x, bool) and abs(x) < 1e300]
    return numbers if len(numbers) == len(row) else []


def check_pose(value: object) -> tuple[float, float, float]:
    """Return a pose (x, y, theta), metres and radians."""
    row = _numbers(value)
    if len(row) == 3 and max(abs(row[0]), abs(row[1]), abs(row[2])) <= limits.METRES:
        return row[0], row[1], row[2]
    raise fault("not a pose", f"[x, y, theta], m and rad, none above {limits.METRES:g}")


def check_heading(value: object) -> tuple[float, ...]:
    """Return a pose (x, y, theta), or (x, y, cos, sin) as it is."""
    row = _numbers(value)
    if len(row) != 4:
        return check_pose(value)
    x, y, c, s = row
    if max(abs(x), abs(y)) > limits.METRES or abs(c * c + s * s - 1.0) > 1e-6:
        raise fault("not a pose", f"[x, y, cos, sin] with a heading of length 1, at most {limits.METRES:g} m")
    return x, y, c, s


POSE_SCHEMA: dict[str, Any] = {
    "type": "array",
    "prefixItems": [{"type": "number"}] * 3,
    "minItems": 3,
    "maxItems": 3,
}
HEADING_SCHEMA: dict[str, Any] = {"type": "array", "items": {"type": "number"}, "minItems": 3, "maxItems": 4}
GivenPose = Annotated[Any, AfterValidator(check_pose), WithJsonSchema(POSE_SCHEMA)]
GivenHeading = Annotated[Any, AfterValidator(check_heading), WithJsonSchema(HEADING_SCHEMA)]
Start = Annotated[
    Any, AfterValidator(check_start), WithJsonSchema({"anyOf": [{"enum": ["drawn", "origin"]}, POSE_SCHEMA]})
]


def _ordered(bounds: list[int]) -> list[int]:
    if bounds[0] > bounds[1]:
        raise fault("bounds in the wrong order", "[low, high] with low <= high")
    return bounds


DurationBounds = Annotated[
    list[Annotated[int, Field(ge=1, le=limits.SECONDS)]],
    Field(min_length=2, max_length=2),
    AfterValidator(_ordered),
]
GoalBounds = Annotated[
    list[Annotated[int, Field(ge=0, le=limits.GOALS)]],
    Field(min_length=2, max_length=2),
    AfterValidator(_ordered),
]

TrialCount = Annotated[int, Field(ge=1, le=limits.TRIALS)]
Seconds = Annotated[float, Field(gt=0, le=limits.SECONDS)]
Goals = Annotated[list[NetworkPoint], Field(max_length=limits.GOALS)]


class AgentEntry0(Open):
    """An e-agent of 2016."""

    type: str = Field(description='what drives it, such as "wander/wander"')
    name: str = Field(pattern=NAME, description="its name, used in labels and messages")


class AgentEntry(Careful):
    """One e-agent, or `count` of them."""

    type: str = Field(
        description="what drives it: wander, loop, follow, parked, scripted, lawful, nemesis, counter, "
        '"wander/wander", or remote or package/executable: a program elsewhere, or module:Class'
    )
    name: str = Field(
        default="agent", pattern=NAME, description="its name; with count the names are this and 0, 1, 2, ..."
    )
    count: Annotated[int, Field(ge=0, le=limits.CARS)] | None = Field(default=None, description="how many of them")
    parameters: dict[str, Any] = Field(default={}, description="parameters of its kind")
    start: GivenPose = Field(default=None, description="[x, y, theta]; left out: drawn")

    @model_validator(mode="after")
    def _single_start(self) -> AgentEntry:
        if self.start is not None and self.count is not None and self.count > 1:
            raise fault("one start for several e-agents", "1, or left out, where start is given", "count", self.count)
        return self

    @model_validator(mode="after")
    def _parameters_in_place(self) -> AgentEntry:
        kind = KINDS.get(NAMES_2016.get(self.type, self.type))
        for key, value in (self.model_extra or {}).items():
            if kind is not None and key in kind.model_fields:
                raise fault("a parameter out of place", f"it in parameters: {{{key}: ...}}", key, value)
        return self


class RandomNetwork(Strict):
    """A random planar network, another one in each trial."""

    intersections: Annotated[int, Field(ge=2, le=MOST_INTERSECTIONS)] = Field(description="number of intersections N")
    segments: Annotated[int, Field(ge=1, le=2 * MOST_INTERSECTIONS)] = Field(
        description="number of segments, N - 1 up to floor(2N - 2 sqrt N)"
    )
    min_angle: Annotated[float, Field(gt=0, le=math.pi)] = Field(
        default=math.pi / 3,
        description="smallest angle between two segments at an intersection, rad, or what the rules need if larger",
    )
    rigid_motion: bool = Field(default=False, description="whether the network is turned and moved at random")
    bent: Annotated[float, Field(ge=0, le=1)] = Field(
        default=0.0, description="about which share of the segments bend, where there is room"
    )

    @model_validator(mode="after")
    def _possible(self) -> RandomNetwork:
        n = self.intersections
        most = most_segments(n)
        if not n - 1 <= self.segments <= most:
            raise fault(
                "not a number of segments",
                f"an integer between {n - 1} and {most} for {n} intersections",
                "segments",
                self.segments,
            )
        return self


class GridNetwork(Strict):
    """A grid, with a share of its segments removed at random in each trial."""

    rows: Annotated[int, Field(ge=1, le=limits.INTERSECTIONS)] = Field(description="intersections along y")
    columns: Annotated[int, Field(ge=1, le=limits.INTERSECTIONS)] = Field(description="intersections along x")
    length: Length = Field(default=3.0, description="length of a segment, m")
    removed: Annotated[float, Field(ge=0, le=1)] = Field(default=0.0, description="share of segments removed")
    rigid_motion: bool = Field(default=False, description="whether the grid is turned and moved at random")

    @model_validator(mode="after")
    def _possible(self) -> GridNetwork:
        if not 2 <= self.rows * self.columns <= limits.INTERSECTIONS:
            raise fault("not a grid", f"rows times columns between 2 and {limits.INTERSECTIONS}")
        return self


class NetworkModel(Strict):
    """The road network: another one in each trial, random or a grid, or that of a file."""

    model_config = ConfigDict(json_schema_extra={"minProperties": 1, "maxProperties": 1})

    random: RandomNetwork | None = Field(default=None, description="a random planar network")
    grid: GridNetwork | None = Field(default=None, description="a grid with segments removed")
    file: Annotated[str, Field(min_length=1)] | None = Field(default=None, description="a path, as in rnd")

    @model_validator(mode="before")
    @classmethod
    def _no_path(cls, value: object) -> object:
        if isinstance(value, str):
            raise fault("a path alone", f'{{"file": {json.dumps(value)}}}, or the path as rnd')
        return value

    @model_validator(mode="after")
    def _one(self) -> NetworkModel:
        if (self.random, self.grid, self.file).count(None) != 2:
            raise fault("not one network", "one of random, grid and file")
        return self


class EgoModel(Strict):
    """The ego."""

    start: Start = Field(
        default="drawn",
        description='[x, y, theta], "drawn", or "origin" (the world\'s origin if on the road, else drawn)',
    )


class Settings0(Open):
    """Trials configuration, version 0: as in 2016. Unknown keys are kept."""

    version: Annotated[int, Field(ge=0, le=0)] = Field(description="0")
    problem_domain: Literal["dubins_traffic"] = Field(description='"dubins_traffic"')
    rnd: RoadReference = Field(description=ROADS)
    e_agents: list[AgentEntry0] = Field(
        default=[], alias="e-agents", max_length=limits.CARS, description="the e-agents"
    )
    number_trials: TrialCount = Field(default=1, description="number of trials")
    duration_bounds: DurationBounds = Field(default=[30, 90], description="[low, high], whole seconds, both included")
    number_goals_bounds: GoalBounds = Field(default=[1, 4], description="[low, high], both included")


VERSION_0_KEYS = frozenset(info.alias or name for name, info in Settings0.model_fields.items())


class World(Careful):
    """What configurations and instances of version 1 say alike."""

    e_agents: list[AgentEntry] = Field(default=[], alias="e-agents", max_length=limits.CARS, description="the e-agents")
    intersection_radius: Length | None = Field(default=None, description="R, m; left out: 1.0 m * w / 0.3 m")
    car: CarModel = Field(default=CarModel(), description="the car; all cars are alike")
    rate: Annotated[float, Field(gt=0, le=limits.RATE)] = Field(default=30.0, description="control rate, Hz")
    sensing_radius: Length = Field(default=5.0, description="distance within which other cars are seen, m")
    laser: LaserSwitch = Field(default=None, description="laser; true: the layout of 2016")
    obstacles: list[ObstacleModel] = Field(default=[], max_length=limits.OBSTACLES, description="static obstacles")
    disturbances: Disturbances = Field(default=Disturbances(), description="seeded disturbances")
    end_on_collision: bool = Field(default=False, description="whether a collision of the ego ends the trial")
    rules: Rules = Field(default=None, description="rules to judge; true: with all defaults")
    formulas: Formulas = Field(
        default={}, description="formulas to judge beside the task, by name: temporal logic over propositions"
    )
    simulator: Annotated[str, Field(min_length=1)] = Field(default="embedded", description="name of the simulator")

    @model_validator(mode="after")
    def _bounded(self) -> World:
        total = sum(1 if entry.count is None else entry.count for entry in self.e_agents)
        if total > limits.CARS:
            raise fault("too many e-agents", f"at most {limits.CARS} in all", "e-agents", total)
        check_period(self.rate, self.car)
        try:
            RuleParameters.from_mapping(self.rule_parameters)
        except InputError as error:
            raise fault(error.problem, error.expected or "", f"rules.{error.field}", error.value) from None
        return self

    @property
    def radius(self) -> float:
        """R, metres."""
        return self.car.w / 0.3 if self.intersection_radius is None else self.intersection_radius

    @property
    def rule_parameters(self) -> dict[str, Any]:
        """All parameters of the rules by name, empty if they are not to be judged."""
        return self.rules.on_roads(self.car.w) if self.rules else {}

    @property
    def obstacle_values(self) -> tuple[Obstacle, ...]:
        """The static obstacles."""
        return tuple(obstacle.core() for obstacle in self.obstacles)


class Settings(World):
    """Trials configuration, version 1: version 0 and more. Unknown keys are kept."""

    version: Annotated[int, Field(ge=0, le=1)] = Field(description="1")
    problem_domain: Literal["dubins_traffic"] = Field(description='"dubins_traffic"')
    rnd: RoadReference = Field(default=None, description=ROADS)
    network: NetworkModel | None = Field(
        default=None, description="the network of each trial, or the file of one, instead of rnd"
    )
    number_trials: TrialCount = Field(default=1, description="number of trials")
    duration: Seconds | None = Field(default=None, description="duration of every trial, s, instead of duration_bounds")
    duration_bounds: DurationBounds = Field(default=[30, 90], description="[low, high], whole seconds, both included")
    goals: Goals | None = Field(
        default=None,
        description="goals of every trial, lattice points [x, y], instead of number_goals_bounds",
    )
    number_goals_bounds: GoalBounds = Field(default=[1, 4], description="[low, high], both included")
    goal_segments_apart: Annotated[int, Field(ge=1, le=limits.INTERSECTIONS)] = Field(
        default=1, description="how many segments drawn goals are apart at least, along the roads"
    )
    goal_round_share: Annotated[float, Field(gt=0, le=1)] | None = Field(
        default=None,
        description="drawn goals: a free-flow round takes at most this share of the duration, and the ego starts on it",
    )
    ego: EgoModel = Field(default=EgoModel(), description="the ego")

    @model_validator(mode="after")
    def _consistent(self) -> Settings:
        if (self.rnd is None) == (self.network is None):
            raise fault("not one road network", "either rnd or network", "rnd", self.rnd)
        if self.duration is not None:
            check_ticks(self.duration, self.rate, "duration")
        else:
            check_ticks(self.duration_bounds[0], self.rate, "duration_bounds[0]")
            check_ticks(self.duration_bounds[1], self.rate, "duration_bounds[1]")
        return self


class InstanceModel0(Open):
    """Problem instance, version 0: as in 2016, what a controller is told. Unknown keys are kept."""

    version: Annotated[int, Field(ge=0, le=0)] = Field(description="0")
    goals: Goals = Field(description="lattice points [x, y] of intersections to visit again and again")
    rnd: RoadReference = Field(description="a road network description")
    intersection_radius: Length = Field(default=1.0, description="R, m")


INSTANCE_0_KEYS = frozenset(InstanceModel0.model_fields)


class InstanceModel(World):
    """Problem instance, version 1: version 0 and what a controller is not told. Unknown keys are kept."""

    version: Annotated[int, Field(ge=0, le=1)] = Field(description="1")
    goals: Goals = Field(description="lattice points [x, y] of intersections to visit again and again")
    rnd: RoadReference = Field(description="a road network description")
    starts: dict[str, GivenHeading] = Field(
        default={},
        description="start of each car by name: [x, y, cos, sin] or [x, y, theta]; left out: drawn",
    )
    duration: Seconds | None = Field(default=None, description="duration, s; left out: drawn, 30 to 90 whole seconds")
    seed: Annotated[int, Field(ge=0, lt=limits.SEEDS)] | None = Field(
        default=None, description="seed of all random numbers"
    )
    trial: Annotated[int, Field(ge=0, lt=limits.TRIALS)] | None = Field(default=None, description="number of the trial")

    @model_validator(mode="after")
    def _consistent(self) -> InstanceModel:
        if self.duration is not None:
            check_ticks(self.duration, self.rate, "duration")
        return self


def check_period(rate: float, car: CarModel) -> None:
    """Refuse a rate so low that a car could turn more than 1/2 rad in one tick."""
    yaw_rate = car.bounds.yaw_rate
    if yaw_rate > limits.YAW_PER_TICK * rate:
        raise fault(
            f"a car with a yaw rate of {yaw_rate:.6g} rad/s turns more than {limits.YAW_PER_TICK} rad a tick",
            f"a number >= {yaw_rate / limits.YAW_PER_TICK:.6g}, or a lower car.bounds.yaw_rate",
            "rate",
            rate,
        )


def check_ticks(duration: float, rate: float, field: str) -> None:
    """Refuse a trial of more ticks than can be counted, or of none."""
    ticks = round(duration * rate)
    if not 1 <= ticks <= limits.TICKS:
        raise fault(f"{ticks} ticks at rate {rate}", f"between 1 and {limits.TICKS} ticks", field, duration)
