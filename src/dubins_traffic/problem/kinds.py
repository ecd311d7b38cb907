"""The kinds of e-agents, their names of 2016 and their parameters: the one table of them.

The agents' room drives what is listed here; documents are checked against it. `EAgent.parameters` always holds all
parameters of the kind, defaults filled in, and for a `loop` the cycle that was drawn.
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from itertools import pairwise
from typing import Annotated, Any, Literal, cast

from pydantic import (
    AfterValidator,
    Field,
    SerializerFunctionWrapHandler,
    field_validator,
    model_serializer,
    model_validator,
)

from dubins_traffic.errors import InputError
from dubins_traffic.outside import is_place
from dubins_traffic.problem import limits
from dubins_traffic.problem.faults import Strict, fault, parse
from dubins_traffic.problem.instance import FREE, NUDGED

Speed = Annotated[float, Field(ge=limits.LEAST, le=limits.SPEED)]
Distance = Annotated[float, Field(ge=0, le=limits.METRES)]
Seconds = Annotated[float, Field(ge=0, le=limits.SECONDS)]
Share = Annotated[float, Field(ge=0, le=1)]
NetworkPoint = Annotated[
    list[
        Annotated[
            float,
            Field(ge=-limits.METRES, le=limits.METRES),
            AfterValidator(lambda number: int(number) if number.is_integer() else number),
        ]
    ],
    Field(min_length=2, max_length=2),
]
"""A point of a network's own frame; whole numbers are integers."""
TimedCommand = Annotated[list[float], Field(min_length=3, max_length=3)]
Whim = Annotated[list[float], Field(min_length=5, max_length=5)]
PATIENCE = (
    "seconds it stands for others before it drives on past those not in its way, and turns round if "
    "its way stays barred; null: it stands for ever"
)


class Wander(Strict):
    """The reference behaviour of 2016: a random walk on the right lanes, turn in place, then drive."""

    speed: Speed = Field(default=0.5, description="speed between turns, m/s")
    yaw_rate: Speed = Field(default=0.9, description="yaw rate of turns in place, rad/s")
    offset: Annotated[float, Field(ge=0, le=1)] = Field(
        default=0.7, description="how far right of the centre line it drives, in lane widths"
    )
    bearing_tolerance: Annotated[float, Field(gt=0, le=3)] = Field(
        default=0.07, description="it turns in place while the bearing error exceeds this, rad"
    )
    waypoint_radius: Annotated[float, Field(gt=0, le=limits.METRES)] = Field(
        default=0.075, description="a waypoint is reached within this distance, m"
    )
    stop_range: Distance = Field(default=0.5, description="it stops while a laser return is below this, m")
    ego_range: Distance = Field(default=1.0, description="it does not drive while the ego is within this, m")
    patience: Seconds | None = Field(
        default=None,
        description="seconds it stands for others before it drives on past those not in its way, and turns round if "
        "its way stays barred; null: it stands for ever, as in 2016",
    )


class Loop(Strict):
    """Drives round a cycle of segments on the right lanes."""

    cycle: list[NetworkPoint] | None = Field(
        default=None,
        min_length=2,
        max_length=limits.GOALS,
        description="lattice points of the intersections, in order, the last joined to the first; null: drawn",
    )
    speed: Speed = Field(default=0.5, description="speed, m/s")
    yaw_rate: Speed = Field(default=0.9, description="largest yaw rate, rad/s")
    stop_range: Distance = Field(default=0.5, description="gap to what is ahead at which it stops, m")
    patience: Seconds | None = Field(default=5.0, description=PATIENCE)


class Follow(Strict):
    """Follows behind the ego along the ego's own path."""

    gap: Distance = Field(default=1.0, description="distance kept behind the ego, along its path, m")
    speed: Speed = Field(default=0.5, description="largest speed, m/s")
    yaw_rate: Speed = Field(default=0.9, description="largest yaw rate, rad/s")
    patience: Seconds | None = Field(default=5.0, description=PATIENCE)
    sensing_only: bool = Field(default=False, description="whether it sees the ego within the sensing radius only")


class Parked(Strict):
    """Stands where it starts and, after a time, drives off as `wander` does."""

    vacates_after: Seconds | None = Field(default=30.0, description="seconds until it drives off; null: never")
    speed: Speed = Field(default=0.5, description="speed once it drives, m/s")
    patience: Seconds | None = Field(default=5.0, description=PATIENCE)


class Scripted(Strict):
    """Plays given commands, then stands."""

    commands: list[TimedCommand] = Field(
        max_length=limits.COMMANDS, description="a list of [seconds, speed in m/s, yaw rate in rad/s]"
    )
    repeat: bool = Field(default=False, description="whether the commands begin again after the last")


class _Driver(Strict):
    """Keeps the rules of the road, and goes somewhere."""

    goes: Literal["wander", "loop", "places"] = Field(
        default="wander", description="at random, round a cycle, or between random intersections"
    )
    cycle: list[NetworkPoint] | None = Field(
        default=None,
        min_length=2,
        max_length=limits.GOALS,
        description="for loop: lattice points of the intersections, in order; null: drawn",
    )
    speed: Speed = Field(default=0.5, description="speed, m/s")
    departs_after: Annotated[float, Field(ge=0, le=50)] = Field(
        default=0.0,
        description="seconds for which it parks where it starts; before a crossing it does not park",
    )


class Lawful(_Driver):
    """Keeps the rules of the road: right lane, stops, order of arrival; may be made to break named ones."""

    rolls: Share = Field(default=0.0, description="share of crossings entered without stopping or waiting (E1)")
    left: Share = Field(default=0.0, description="share of roads driven on the left (E1)")
    blocks: Share = Field(default=0.0, description="share of intersections in which it stands for 9 s (E4)")
    tailgates: Share = Field(
        default=0.0, description="share of roads on which it hangs on to the car ahead at top speed (E2)"
    )
    parks: Share = Field(default=0.0, description="share of visits to a goal at which it parks there (E4, E6)")
    parks_for: Seconds = Field(default=90.0, description="longest time for which it parks, s")


class Nemesis(Strict):
    """Spoils the ego's task within the assumption: gets to its goals first and is slow before it."""

    speed: Speed = Field(default=0.7, description="speed while the ego is not behind it, m/s")


class Choice(Strict):
    """What is chosen for one leg of a car: a lane and the disc at its end. What is null is left to the law."""

    at: Annotated[int, Field(ge=0, lt=limits.LEGS)] = Field(
        description="number of the leg; 0 is the lane in which it starts"
    )
    exit: Annotated[int, Field(ge=0, lt=limits.EXITS)] | None = Field(
        default=None,
        description="which exit of the crossing at its end, counted counter-clockwise from the way back, which is 0",
    )
    speed: Share | None = Field(default=None, description="speed in the lane, as a share of the largest")
    pause: Seconds | None = Field(default=None, description="seconds for which it pauses in the lane")
    pause_at: Share | None = Field(default=None, description="share of the lane after which it does; null: 0.5")
    hold: Seconds | None = Field(
        default=None, description="seconds of its own turn for which it holds at the line of the crossing"
    )
    dwell: Seconds | None = Field(
        default=None, description="seconds for which it stands in the disc at the end of the lane"
    )
    gap: Distance | None = Field(default=None, description="gap kept behind what is ahead in its lane, m")

    @model_serializer(mode="wrap")
    def _sparse(self, handler: SerializerFunctionWrapHandler) -> dict[str, Any]:
        return {name: value for name, value in handler(self).items() if value is not None}


class Chosen(_Driver):
    """Keeps the rules of the road, and does what a table says where they leave it a choice."""

    goes: Literal["wander", "loop", "places"] = Field(
        default="wander", description="where nothing is chosen: at random, round a cycle, or between places"
    )
    speed: Speed = Field(default=0.5, description="speed where nothing is chosen, m/s")
    choices: list[Choice] = Field(
        default=[],
        max_length=limits.LEGS,
        description="what is chosen, a row for each leg for which anything is; cut to what E3 to E5 allow",
    )

    @field_validator("choices")
    @classmethod
    def _in_order(cls, rows: list[Choice]) -> list[Choice]:
        if any(earlier.at >= later.at for earlier, later in pairwise(rows)):
            raise fault("rows out of order", "the legs `at` in rising order, each once")
        return rows


class Free(Strict):
    """Does much that E1 to E6 allow and no other kind does, by commands or at random; the law takes over in time."""

    boldness: Share = Field(default=0.8, description="share of its time in which it does not do as the law says")
    commands: list[TimedCommand] = Field(
        default=[],
        max_length=limits.COMMANDS,
        description="[seconds, speed in m/s, yaw rate in rad/s]; none: at random",
    )
    whims: list[Whim] = Field(
        default=[],
        max_length=limits.COMMANDS,
        description="the same with more to choose, in place of commands: [seconds, share of the law's speed, "
        "speed in m/s, yaw rate in rad/s, share of E3's time for which it holds at a line]; a first -1: by speed and "
        "yaw rate, a last -1: drawn",
    )
    repeat: bool = Field(
        default=False, description="whether the commands or whims begin again; else the law follows them"
    )


class Nudged(Strict):
    """Does what another kind asks for, late and with noise on its speed."""

    kind: Literal["wander", "loop", "follow", "parked", "scripted", "lawful", "nemesis", "chosen"] = Field(
        default="lawful", description="which kind"
    )
    parameters: dict[str, Any] = Field(default={}, description="its parameters; those left out have its defaults")
    delay: Annotated[int, Field(ge=0, le=limits.REACTION)] = Field(
        default=3, description="how many ticks late it does what the kind asks for"
    )
    speed_noise: Share = Field(
        default=0.1, description="by which share its speed is more or less at most, drawn anew in each tick"
    )

    @model_validator(mode="before")
    @classmethod
    def _whole(cls, document: Any) -> Any:
        """Check the other kind's parameters, and fill in its defaults."""
        if not isinstance(document, dict):
            return document
        given = cast("dict[str, Any]", document)
        kind, parameters = given.get("kind", "lawful"), given.get("parameters", {})
        if kind in NUDGEABLE and isinstance(parameters, dict):
            try:
                return {**given, "parameters": parameters_of(kind, cast("dict[str, Any]", parameters))}
            except InputError as error:
                field = "parameters" if error.field is None else error.field
                raise fault(error.problem, str(error.expected), field, error.value) from None
        return given


class Counter(Strict):
    """Keeps the ego from a goal for ever: plays the counterstrategy of a weak assumption, or a counter-play."""

    assume: str | None = Field(
        default=None,
        description="what it keeps, as `synth --assume` takes it, such as E1,E2,E4,E5,E6; null: as the problem says",
    )
    turns: list[list[int]] | None = Field(
        default=None,
        min_length=1,
        max_length=limits.COMMANDS,
        description="a play that it follows instead, as `synth --counter-trial` writes: the cells of all cars, the "
        "ego's first, at the start and after each turn of the e-agents and of the ego",
    )
    again: Annotated[int, Field(ge=0)] | None = Field(
        default=None, description="from which of these on the play repeats; null: it ends"
    )
    speed: Speed = Field(default=0.7, description="speed, m/s")


class Remote(Strict):
    """Is driven by a program of its own, over a transport."""


COUNTER = "counter"
REMOTE = "remote"
NUDGEABLE: frozenset[str] = frozenset({"wander", "loop", "follow", "parked", "scripted", "lawful", "nemesis", "chosen"})
"""Kinds that can be nudged: those that run compiled."""
OWN = "own"
"""A class of the user's, which the type names: ``module:Class`` or ``path/to/file.py:Class``."""
KINDS: dict[str, type[Strict]] = {
    "wander": Wander,
    "loop": Loop,
    "follow": Follow,
    "parked": Parked,
    "scripted": Scripted,
    "lawful": Lawful,
    "nemesis": Nemesis,
    "chosen": Chosen,
    FREE: Free,
    NUDGED: Nudged,
    COUNTER: Counter,
    REMOTE: Remote,
}
"""Kinds by name, each with the model of its parameters; `agents.kinds` says how they drive."""
KEEP_RULES: frozenset[str] = frozenset({"lawful", "nemesis", "chosen"})
"""Kinds of e-agents that keep the rules of the road."""
ALONE: frozenset[str] = frozenset({COUNTER, OWN, REMOTE})
"""Kinds of e-agents whose trials are not batched: a driver in Python or in another process decides."""

NAMES_2016: Mapping[str, str] = {"wander/wander": "wander"}
"""Types (package/executable) of 2016, and the kinds that they are here."""

PROGRAM = r"^[A-Za-z][A-Za-z0-9_]*/[A-Za-z0-9_.-]+$"
"""Pattern of a type package/executable; if it is not known here it is a program of the user's."""


def kind_of(name: str) -> str:
    """Return the kind that a type `name`, of this package or of 2016, stands for.

    Another package/executable is of kind `remote`; a name of a class is of kind `own`.

    Raises
    ------
    InputError
        If `name` is none of these.
    """
    kind = NAMES_2016.get(name, name)
    if kind in KINDS:
        return kind
    if re.fullmatch(PROGRAM, name):
        return REMOTE
    if is_place(name):
        return OWN
    known = ", ".join([*KINDS, *NAMES_2016])
    raise InputError(
        "unknown type of e-agent",
        field="type",
        value=name,
        expected=f"one of {known}, package/executable, or module:Class",
    )


def parameters_of(kind: str, given: Mapping[str, Any]) -> dict[str, Any]:
    """Return all parameters of an e-agent of `kind`: those given, checked, and the defaults of the others.

    Parameters of a user's own class are checked when a trial begins.
    """
    if kind == OWN:
        return dict(given)
    return parse(KINDS[kind], given, field="parameters").model_dump()


def loops(kind: str, parameters: Mapping[str, Any]) -> bool:
    """Tell whether an e-agent of `kind` drives round a cycle."""
    return kind == "loop" or (kind in ("lawful", "chosen") and parameters["goes"] == "loop")


def names() -> Mapping[str, str]:
    """Return the kinds of e-agents, each with one line that says what it does."""
    return {name: (model.__doc__ or "").strip().splitlines()[0] for name, model in KINDS.items()}
