"""How cars move: the seam for models other than the Dubins car, and their registry.

The Dubins car is moved by the kernels of `cars.motion`. Another model is a class of Python that says, for each tick,
which arcs a car drives; the embedded simulator moves the car along them and finds all contacts on the way
(`simulators.modelled`). A new one is a file and a line in `BUILT_IN`, or a class outside the package
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

BUILT_IN: Mapping[str, str] = {DUBINS: "dubins_traffic.cars.dynamics:Dubins"}
"""The models of this package by name, ``module:Class``."""
GROUP: Final = "dubins_traffic.car_models"
"""Entry points of other packages."""
MOST_ARCS: Final = 256
"""Most arcs of one car in a tick."""
_SEAM = Seam(
    "car.model",
    "car model",
    ("begin", "clip", "advance"),
    "begin(car, period, parameters), clip(speed, yaw rate) -> (speed, yaw rate) and "
    "advance(speed, yaw rate) -> [(speed, yaw rate, seconds), ...]",
)

Arc: TypeAlias = tuple[float, float, float]
"""Speed, m/s, and yaw rate, rad/s, and for how many seconds they hold."""


class MotionModel(Protocol):
    """How one car answers its commands; a class without arguments, of which one object moves one car of one trial.

    It must do the same again for the same commands. A class attribute `parameters`, a mapping of defaults, says which
    parameters it takes. A fork of a trial goes on with a deep copy.
    """

    def begin(self, car: Car, period: float, parameters: Mapping[str, Any]) -> None:
        """A trial begins, in which the car stands; `period` is the length of a tick, s."""
        ...

    def clip(self, speed: float, yaw_rate: float) -> tuple[float, float]:
        """Return the command that is taken for the coming tick, m/s and rad/s: what stands in records.

        What it returns it must take as it is when that is asked for in its place, so that records can be run again.
        The car's bounds are kept by the simulator.
        """
        ...

    def advance(self, speed: float, yaw_rate: float) -> Sequence[Arc]:
        """Return the arcs that the car drives in the coming tick with the command taken; together they last the tick.

        They, too, are clipped to the car's bounds.
        """
        ...


@runtime_checkable
class Stops(Protocol):
    """A car model that wants to know when a contact has fixed its car."""

    def stop(self) -> None:
        """A contact has fixed the car in the tick that has just ended: it stands."""
        ...


class Dubins:
    """The Dubins car: what is asked for holds at once and for the whole tick."""

    def begin(self, car: Car, period: float, parameters: Mapping[str, Any]) -> None:  # noqa: ARG002
        """Take the length of a tick."""
        self._period = period

    def clip(self, speed: float, yaw_rate: float) -> tuple[float, float]:
        """Return the command; the bounds are kept by the simulator."""
        return speed, yaw_rate

    def advance(self, speed: float, yaw_rate: float) -> Sequence[Arc]:
        """Return the one arc of the tick."""
        return ((speed, yaw_rate, self._period),)


def names() -> Mapping[str, str]:
    """Return the models of this and other packages: name to one line of description."""
    makers = {**{name: outside.find(place, _SEAM) for name, place in BUILT_IN.items()}, **_others()}
    return {name: ((maker.__doc__ or "").strip().splitlines() or [""])[0] for name, maker in makers.items()}


def check_name(spec: str) -> None:
    """Refuse what neither is the name of a model nor says where a class is; nothing is loaded.

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
    """Return the model of a car at the beginning of a trial.

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
    except Exception as error:
        problem = f"{type(model).__name__} raised {outside.plainly(error)} in begin"
        raise _SEAM.refuse(problem, spec, "a car model that can begin") from error
    return model


def require_dubins(car: Car, who: str) -> None:
    """Refuse another car for `who`, what is known to be right for the Dubins car alone.

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
    """Look for the models of other packages anew when next they are asked for."""
    _others.cache_clear()
