"""The controller of a learned policy: a network on the flat observation, read from a file of ours."""

from __future__ import annotations

import zipfile
import zlib
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final, Protocol, cast

import numpy as np
import numpy.typing as npt

from dubins_traffic import files
from dubins_traffic.cars.state import Command, Observation
from dubins_traffic.errors import InputError
from dubins_traffic.kernels.arrays import Floats
from dubins_traffic.learning.flat import FlatObserver

if TYPE_CHECKING:
    from dubins_traffic.problem.instance import Problem


FORMAT: Final = "dubins-traffic policy"
"""Value of the array `format` in a policy's file."""
MOST: Final = 1 << 24
"""Most bytes of such a file."""
_DAMAGED: Final = (OSError, ValueError, EOFError, KeyError, TypeError, zipfile.BadZipFile, zlib.error)
"""Errors that NumPy raises for files that it can't read."""
_HEAD: Final = ("names", "cars", "frame_skip", "choices")
"""Arrays of a policy's file beside its layers, `weights0`, `bias0`, `weights1`, ..."""
Layer = tuple[Floats, Floats]


class Acts(Protocol):
    """A policy that drives, as `Policy` does; with no `names` it is shown the whole flat observation."""

    @property
    def names(self) -> tuple[str, ...]:
        """As of `Policy`."""
        ...

    @property
    def inputs(self) -> int:
        """How many numbers it is shown, V."""
        ...

    @property
    def cars(self) -> int:
        """As of `Policy`."""
        ...

    @property
    def frame_skip(self) -> int:
        """As of `Policy`."""
        ...

    def act(self, seen: npt.NDArray[Any]) -> Floats:
        """As of `Policy`."""
        ...


@dataclass(frozen=True)
class Policy:
    """A network: each layer is ``w v + b``, with a hyperbolic tangent between two.

    Attributes
    ----------
    names : tuple of str
        Names of the numbers of the flat observation that make up the input (`learning.flat.Layout`).
    cars : int
        Other cars that the flat observation shows.
    frame_skip : int
        Ticks for which an action is held.
    layers : tuple of ((H, V), (H,))
        Weights and biases. The last has two rows, of whose sums the hyperbolic tangents are the action; or as many as
        there are `choices`, of which that with the largest sum is taken.
    choices : (K, 2)
        Actions to choose from, shares of speed and yaw rate; none where actions are continuous.
    """

    names: tuple[str, ...]
    cars: int
    frame_skip: int
    layers: tuple[Layer, ...]
    choices: Floats = field(default_factory=lambda: np.zeros((0, 2)))

    def __post_init__(self) -> None:
        width = len(self.names)
        for k, (weights, bias) in enumerate(self.layers):
            last = k == len(self.layers) - 1
            rows = (len(self.choices) or 2) if last else len(bias)
            _check(f"weights{k}", weights, (rows, width))
            _check(f"bias{k}", bias, (rows,))
            width = rows
        _check("choices", self.choices, (len(self.choices), 2))
        if not self.layers or np.abs(self.choices).max(initial=0.0) > 1.0:
            which, expected = ("choices", "-1 to 1") if self.layers else ("weights0", "a layer")
            raise InputError("not a policy", field=which, expected=expected)
        if self.frame_skip < 1 or self.cars < 0:
            raise InputError("not a policy", field="frame_skip", value=self.frame_skip, expected=">= 1")

    @property
    def inputs(self) -> int:
        """How many numbers it is shown, V."""
        return len(self.names)

    def act(self, seen: npt.NDArray[Any]) -> Floats:
        """Return the action, shares (-1 to 1) of the largest speed and yaw rate, (2,), for the input `seen`, (V,)."""
        for weights, bias in self.layers[:-1]:
            seen = np.tanh(weights @ seen + bias)
        weights, bias = self.layers[-1]
        sums: Floats = weights @ seen + bias
        return self.choices[sums.argmax()] if len(self.choices) else np.tanh(sums)

    def save(self, path: str | Path, *, overwrite: bool = False) -> None:
        """Write the policy to a file `*.npz`; InputError as of `files.require_output`."""
        files.require_output(path, "a policy", (".npz",), overwrite=overwrite)
        arrays: dict[str, Any] = {name: np.asarray(getattr(self, name)) for name in _HEAD}
        for k, (weights, bias) in enumerate(self.layers):
            arrays |= {f"weights{k}": weights, f"bias{k}": bias}

        def write(neighbour: Path) -> None:
            with neighbour.open("wb") as stream:
                np.savez(stream, allow_pickle=False, format=np.array(FORMAT), **arrays)

        files.replace_file(Path(path), write)


def _check(name: str, array: Floats, shape: tuple[int, ...]) -> None:
    """Refuse an array that has not this shape, or has numbers that are not finite."""
    if array.shape != shape or not np.isfinite(array).all():
        raise InputError("not a policy", field=name, value=array.shape, expected=f"finite numbers {shape}")


def is_policy(path: str | Path) -> bool:
    """Tell whether the file at `path` has the format of a policy."""
    return _format(path) == FORMAT


def load(path: str | Path) -> Policy:
    """Return the policy in a file.

    Raises
    ------
    InputError
        If there is none.
    """
    try:
        if Path(path).stat().st_size > MOST:
            raise InputError("too large", file=str(path), expected=f"at most {MOST} bytes")
        with Path(path).open("rb") as stream, np.load(stream, allow_pickle=False) as kept:
            arrays = {name: kept[name] for name in kept.files if name != "format"}
        return _policy(arrays)
    except InputError as error:
        raise error.within(file=str(path)) from None
    except FileNotFoundError:
        raise InputError("no such file", file=str(path)) from None
    except _DAMAGED as error:
        raise InputError(f"can't be read as a policy ({error})", file=str(path)) from None


def _policy(arrays: Mapping[str, Any]) -> Policy:
    layers: list[Layer] = []
    while f"weights{len(layers)}" in arrays:
        k = len(layers)
        weights, bias = (np.asarray(arrays[f"{name}{k}"], dtype=np.float64) for name in ("weights", "bias"))
        layers.append((weights, bias))
    names = tuple(str(name) for name in cast("list[str]", arrays["names"].tolist()))
    choices = np.asarray(arrays["choices"], dtype=np.float64)
    return Policy(names, int(arrays["cars"]), int(arrays["frame_skip"]), tuple(layers), choices)


def _format(path: str | Path) -> str:
    try:
        with Path(path).open("rb") as stream, np.load(stream, allow_pickle=False) as kept:
            return str(kept["format"]) if "format" in kept else ""
    except _DAMAGED:
        return ""


class Learned:
    """Drives by a learned policy.

    Parameters
    ----------
    policy : Acts
        The policy, `Policy` or another.
    """

    def __init__(self, policy: Acts) -> None:
        self._policy = policy

    def start(self, problem: Problem) -> None:
        """Look up the policy's inputs in the flat observation of the problem.

        Raises
        ------
        InputError
            If the problem's flat observation lacks one of the inputs, or has more or fewer numbers.
        """
        self._observe = FlatObserver(problem, self._policy.cars)
        places = {name: k for k, name in enumerate(self._observe.layout.names)}
        names = self._policy.names or tuple(places)
        missing = [name for name in names if name not in places]
        if missing:
            raise InputError("not in the observation", field="names", value=missing[0], expected="a name of Layout")
        if self._policy.inputs != len(names):
            expected = f"{len(names)} numbers, those of {len(self._policy.names) or 'all'} names of Layout"
            raise InputError("does not fit", field="input", value=self._policy.inputs, expected=expected)
        self._places = np.array([places[name] for name in names], dtype=np.int64)
        bounds = problem.car.bounds
        low = -bounds.speed if bounds.speed_min is None else bounds.speed_min
        self._half = 0.5 * (bounds.speed - low), bounds.yaw_rate
        self._middle = 0.5 * (bounds.speed + low)
        self._command = Command(0.0, 0.0)

    def act(self, observation: Observation) -> Command:
        """Return the policy's action as a command, or hold the last one within `frame_skip` ticks."""
        seen = self._observe(observation)
        if observation.tick % self._policy.frame_skip == 0:
            speed, turn = self._policy.act(seen[self._places]).tolist()
            self._command = Command(speed * self._half[0] + self._middle, turn * self._half[1])
        return self._command


def player(path: str | Path) -> Learned:
    """Return the controller of the policy in a file."""
    return Learned(load(path))


SPEEDS: Final = (0.0, 0.5, 1.0)
"""Speeds of discrete actions: from the middle of the car's range (0 where it may reverse) to its top speed."""
TURNS: Final = (-1.0, -0.25, 0.0, 0.25, 1.0)
"""Yaw rates of discrete actions, as shares of the top yaw rate; action ``5 j + k`` is speed j and turn k."""
CHOICES: Final[Floats] = np.array([(speed, turn) for speed in SPEEDS for turn in TURNS])
"""Both shares of each discrete action, (15, 2)."""
CHOICES.flags.writeable = False
