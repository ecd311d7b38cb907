"""Car models: the seam for cars that move otherwise than the Dubins car, and the registry of models.

The kernels of `cars.motion` move the Dubins car. Another model is a Python class that returns, for each tick, the arcs
that a car drives; the embedded simulator moves the car along them and finds all contacts on the way
(`simulators.modelled`). A new model is a file and a line in `BUILT_IN`, or a class outside the package
(docs/extending/car-model.md).
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from functools import cache
from math import ceil
from typing import Any, ClassVar, Final, Protocol, TypeAlias, cast, runtime_checkable

from dubins_traffic import outside
from dubins_traffic.cars.body import DUBINS, Car
from dubins_traffic.errors import InputError
from dubins_traffic.kernels.angles import sincos
from dubins_traffic.outside import Seam

BUILT_IN: Mapping[str, str] = {
    DUBINS: "dubins_traffic.cars.dynamics:Dubins",
    "bicycle": "dubins_traffic.cars.dynamics:Bicycle",
}
"""The models of this package by name, ``module:Class``."""
GROUP: Final = "dubins_traffic.car_models"
"""Group of the entry points by which other packages offer models."""
MOST_ARCS: Final = 256
"""Most arcs that a model may return for one tick."""
_SEAM = Seam(
    "car.model",
    "car model",
    ("begin", "clip", "advance"),
    "begin(car, period, parameters), clip(speed, yaw rate) -> (speed, yaw rate) and "
    "advance(speed, yaw rate) -> [(speed, yaw rate, seconds), ...]",
)
Arc: TypeAlias = tuple[float, float, float]
"""Speed (m/s), yaw rate (rad/s), and how long both hold (s)."""
FINEST = 1.0 / 240.0
"""Longest time for which the curvature is held, seconds; so the arcs are within 1e-4 m of the exact motion."""
MOST_PARTS = 200
"""Most parts into which a tick is divided."""
LEAST, MOST = 1e-6, 1e6
"""Bounds on every parameter: beyond them the yaw rate of an arc may overflow, whatever the command."""
STEEPEST = 1.5
"""Largest tangent of the steering angle: a wheel at 56 degrees."""


class MotionModel(Protocol):
    """How one car answers its commands. The constructor takes no arguments; one object moves one car of one trial.

    Its answers must depend on nothing but its parameters and the commands since `begin`. A class attribute
    `parameters`, a mapping of defaults, names the parameters it takes. A fork of a trial goes on with a deep copy.
    """

    def begin(self, car: Car, period: float, parameters: Mapping[str, Any]) -> None:
        """Begin a trial, in which the car stands at first; `period` is the length of a tick, s."""
        ...

    def clip(self, speed: float, yaw_rate: float) -> tuple[float, float]:
        """Return the command that takes effect in the coming tick, (m/s, rad/s); it is what records hold.

        A command that `clip` has returned must be returned unchanged when it is given instead, so that records can be
        run again. The simulator clips to the car's bounds as well.
        """
        ...

    def advance(self, speed: float, yaw_rate: float) -> Sequence[Arc]:
        """Return the arcs that the car drives in the coming tick, given the clipped command; together they last a tick.

        The simulator clips the arcs to the car's bounds.
        """
        ...


@runtime_checkable
class Stops(Protocol):
    """A car model that is told when a contact has fixed its car."""

    def stop(self) -> None:
        """Take note that a contact in the tick just ended has fixed the car: it stands."""
        ...


class Dubins:
    """The Dubins car: a command holds at once and for the whole tick."""

    def begin(self, car: Car, period: float, parameters: Mapping[str, Any]) -> None:  # noqa: ARG002
        """Keep the length of a tick."""
        self._period = period

    def clip(self, speed: float, yaw_rate: float) -> tuple[float, float]:
        """Return the command unchanged; the simulator clips it to the car's bounds."""
        return speed, yaw_rate

    def advance(self, speed: float, yaw_rate: float) -> Sequence[Arc]:
        """Return the one arc of the tick."""
        return ((speed, yaw_rate, self._period),)


def names() -> Mapping[str, str]:
    """Return the models of this and other packages: name to one line of description."""
    makers = {**{name: outside.find(place, _SEAM) for name, place in BUILT_IN.items()}, **_others()}
    return {name: ((maker.__doc__ or "").strip().splitlines() or [""])[0] for name, maker in makers.items()}


def check_name(spec: str) -> None:
    """Refuse a text that is neither the name of a model nor of the form ``module:Class``; nothing is imported.

    Raises
    ------
    InputError
        Of the field ``model``.
    """
    if spec in BUILT_IN or outside.is_place(spec) or spec in _others():
        return
    known = ", ".join([*BUILT_IN, *_others()])
    expected = f"one of {known}, module:Class or path/to/file.py:Class"
    raise InputError("unknown car model", field="model", value=spec, expected=expected)


def begun(car: Car, period: float) -> MotionModel:
    """Return a new object of a car's model, begun.

    Raises
    ------
    InputError
        If its class can't be found or made, lacks something of `MotionModel`, takes other parameters, or raises.
    """
    spec = car.model
    place = BUILT_IN.get(spec, spec)
    maker: Callable[[], Any] = _others()[spec] if not outside.is_place(place) else outside.find(place, _SEAM)
    model = cast(MotionModel, outside.make_strictly(maker, spec, _SEAM))
    parameters = outside.parameters_of(model, car.parameters, "car.parameters")
    try:
        model.begin(car, period, parameters)
    except InputError:
        raise
    except Exception as error:
        problem = f"{type(model).__name__} raised {outside.plainly(error)} in begin"
        raise _SEAM.refuse(problem, spec, "a car model that can begin") from error
    return model


def require_dubins(car: Car, who: str) -> None:
    """Refuse a car of another model on behalf of `who`, the part of the package that supports the Dubins car only.

    Raises
    ------
    InputError
        Of the field ``car.model``.
    """
    if car.model != DUBINS:
        raise InputError(f"{who} for the Dubins car only", field="car.model", value=car.model, expected=DUBINS)


@cache
def _others() -> Mapping[str, Callable[[], Any]]:
    return outside.of_packages(GROUP)


def forget() -> None:
    """Forget the models of other packages, so that the next call looks for them again."""
    _others.cache_clear()


class Bicycle:
    """A car that speeds up, brakes and steers at limited rates, with `wheelbase` metres between its axles.

    It can't turn in place. A command asks for a speed and, as yaw rate over speed, for a curvature of its path; a
    command to stand leaves the wheel as it is. The speed rises by `acceleration` (m/s^2) and falls, also through 0, by
    `braking` (m/s^2); the steering angle changes by `steering_rate` (rad/s). The curvature is the tangent of that angle
    over `wheelbase` (m).
    """

    parameters: ClassVar = {"wheelbase": 0.2, "acceleration": 1.5, "braking": 3.0, "steering_rate": 2.0}

    def begin(self, car: Car, period: float, parameters: Mapping[str, Any]) -> None:
        """Begin a trial: the car stands, with the wheel straight.

        Raises
        ------
        InputError
            If a parameter is no number from `LEAST` to `MOST`.
        """
        for name, value in parameters.items():
            if isinstance(value, bool) or not isinstance(value, int | float) or not LEAST <= value <= MOST:
                expected = f"a number from {LEAST:g} to {MOST:g}"
                raise InputError("out of range", field=f"car.parameters.{name}", value=value, expected=expected)
        self._base = float(parameters["wheelbase"])
        self._gain, self._loss = float(parameters["acceleration"]), float(parameters["braking"])
        parts = min(max(1, ceil(period / FINEST - 1e-9)), MOST_PARTS)
        self._parts = parts
        self._step = period / parts
        cosine, sine = sincos(min(0.5 * float(parameters["steering_rate"]) * self._step, 0.5))
        self._half_turn = sine / cosine
        radius = car.bounds.turning_radius
        self._most = min(self._base / radius, STEEPEST) if radius > 0.0 else STEEPEST
        self._speed = self._tangent = 0.0

    def clip(self, speed: float, yaw_rate: float) -> tuple[float, float]:
        """Return the command unchanged: it sets the targets of speed and steering angle, which are approached."""
        return speed, yaw_rate

    def advance(self, speed: float, yaw_rate: float) -> Sequence[tuple[float, float, float]]:
        """Return the arcs of the tick: each has the mean speed of its two ends, and the curvature of its middle."""
        wanted = self._base * yaw_rate / speed if speed != 0.0 else self._tangent
        wanted = min(max(wanted, -self._most), self._most)
        arcs: list[tuple[float, float, float]] = []
        for _ in range(self._parts):
            middle = _turned(self._tangent, wanted, self._half_turn)
            self._tangent = _turned(middle, wanted, self._half_turn)
            for mean, seconds in self._speeds(speed):
                arcs.append((mean, mean * middle / self._base, seconds))
        return arcs

    def stop(self) -> None:
        """Set the speed to 0, since a contact has fixed the car; the wheel stays as it is."""
        self._speed = 0.0

    def _speeds(self, goal: float) -> Sequence[tuple[float, float]]:
        """Change the speed toward `goal` for one part of the tick; return (mean speed, m/s, seconds) of its pieces.

        There are two pieces if the goal is reached within the part.
        """
        speeds: list[tuple[float, float]] = []
        left = self._step
        while left > 0.0 and self._speed != goal:
            through = self._speed * goal < 0.0
            target = 0.0 if through else goal
            rate = self._loss if abs(target) < abs(self._speed) else self._gain
            needed = abs(target - self._speed) / rate
            before = self._speed
            if needed <= left:
                self._speed = target
                spent = needed
            else:
                self._speed += rate * left if target > before else -rate * left
                spent = left
            speeds.append((0.5 * (before + self._speed), spent))
            left -= spent
        if left > 0.0:
            speeds.append((self._speed, left))
        return speeds


def _turned(tangent: float, wanted: float, step: float) -> float:
    """Return the tangent of a steering angle turned toward tangent `wanted` by the angle whose tangent is `step`."""
    if wanted > tangent:
        below = 1.0 - tangent * step
        return min((tangent + step) / below, wanted) if below > 0.0 else wanted
    return max((tangent - step) / (1.0 + tangent * step), wanted) if 1.0 + tangent * step > 0.0 else wanted
