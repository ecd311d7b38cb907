"""Car models: the seam for cars that move otherwise than the Dubins car, and the registry of models.

The kernels of `cars.motion` move the Dubins car. Another model is a Python class that returns, for each tick, the arcs
that a car drives; the embedded simulator moves the car along them and finds all contacts on the way
(`simulators.modelled`). A new model is a file and a line in `BUILT_IN`, or a class outside the package
(docs/extending/car-model.md).
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from functools import cache
from typing import Any, Final, Protocol, TypeAlias, cast, runtime_checkable

from dubins_traffic import outside
from dubins_traffic.cars.body import DUBINS, Car
from dubins_traffic.errors import InputError
from dubins_traffic.outside import Seam

BUILT_IN: Mapping[str, str] = {
    DUBINS: "dubins_traffic.cars.dynamics:Dubins",
    "bicycle": "dubins_traffic.cars.bicycle:Bicycle",
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
        raise InputError(
            f"{who} for the Dubins car only", field="car.model", value=car.model, expected=DUBINS
        )


@cache
def _others() -> Mapping[str, Callable[[], Any]]:
    return outside.of_packages(GROUP)


def forget() -> None:
    """Forget the models of other packages, so that the next call looks for them again."""
    _others.cache_clear()
