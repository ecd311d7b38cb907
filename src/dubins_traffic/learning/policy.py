"""The controller of a learned policy: a small network on the flat observation, read from a file."""

from __future__ import annotations

import zipfile
import zlib
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final, cast

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
_ARRAYS: Final = ("names", "cars", "frame_skip", "hidden", "hidden_bias", "out", "out_bias")


@dataclass(frozen=True)
class Policy:
    """A network of one hidden layer: actions are ``tanh(out tanh(hidden v + hidden_bias) + out_bias)``.

    Attributes
    ----------
    names : tuple of str
        Names of the numbers of the flat observation that make up the input v (`learning.flat.Layout`).
    cars : int
        Other cars that the flat observation shows.
    frame_skip : int
        Ticks for which an action is held.
    hidden, hidden_bias, out, out_bias : (H, V), (H,), (2, H), (2,)
        The weights.
    """

    names: tuple[str, ...]
    cars: int
    frame_skip: int
    hidden: Floats
    hidden_bias: Floats
    out: Floats
    out_bias: Floats

    def __post_init__(self) -> None:
        width, seen = len(self.hidden_bias), len(self.names)
        shapes = {"hidden": (width, seen), "hidden_bias": (width,), "out": (2, width), "out_bias": (2,)}
        for name, shape in shapes.items():
            found: Floats = getattr(self, name)
            if found.shape != shape or not np.isfinite(found).all():
                raise InputError(
                    "not a policy", field=name, value=found.shape, expected=f"finite numbers {shape}"
                )
        if self.frame_skip < 1 or self.cars < 0:
            raise InputError("not a policy", field="frame_skip", value=self.frame_skip, expected=">= 1")

    def act(self, seen: npt.NDArray[Any]) -> Floats:
        """Return the action, shares (-1 to 1) of the largest speed and yaw rate, (2,), for the input `seen`, (V,)."""
        return np.tanh(self.out @ np.tanh(self.hidden @ seen + self.hidden_bias) + self.out_bias)

    def save(self, path: str | Path, *, overwrite: bool = False) -> None:
        """Write the policy to a file `*.npz`; InputError as of `files.require_output`."""
        files.require_output(path, "a policy", (".npz",), overwrite=overwrite)
        arrays: dict[str, Any] = {name: np.asarray(getattr(self, name)) for name in _ARRAYS}

        def write(neighbour: Path) -> None:
            with neighbour.open("wb") as stream:
                np.savez(stream, allow_pickle=False, format=np.array(FORMAT), **arrays)

        files.replace_file(Path(path), write)


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
        with Path(path).open("rb") as stream, np.load(stream, allow_pickle=False) as found:
            arrays = {name: found[name] for name in _ARRAYS}
        return _policy(arrays)
    except InputError as error:
        raise error.within(file=str(path)) from None
    except FileNotFoundError:
        raise InputError("no such file", file=str(path)) from None
    except _DAMAGED as error:
        raise InputError(f"can't be read as a policy ({error})", file=str(path)) from None


def _policy(arrays: Mapping[str, Any]) -> Policy:
    weights = {name: np.asarray(arrays[name], dtype=np.float64) for name in _ARRAYS[3:]}
    names = tuple(str(name) for name in cast("list[str]", arrays["names"].tolist()))
    return Policy(names, int(arrays["cars"]), int(arrays["frame_skip"]), **weights)


def _format(path: str | Path) -> str:
    try:
        with Path(path).open("rb") as stream, np.load(stream, allow_pickle=False) as found:
            return str(found["format"]) if "format" in found else ""
    except _DAMAGED:
        return ""


class Learned:
    """Drives by a learned policy.

    Parameters
    ----------
    policy : Policy
        The policy.
    """

    def __init__(self, policy: Policy) -> None:
        self._policy = policy

    def start(self, problem: Problem) -> None:
        """Look up the policy's inputs in the flat observation of the problem.

        Raises
        ------
        InputError
            If the problem's flat observation lacks one of the inputs.
        """
        self._observe = FlatObserver(problem, self._policy.cars)
        places = {name: k for k, name in enumerate(self._observe.layout.names)}
        missing = [name for name in self._policy.names if name not in places]
        if missing:
            raise InputError(
                "not in the observation", field="names", value=missing[0], expected="a name of Layout"
            )
        self._places = np.array([places[name] for name in self._policy.names], dtype=np.int64)
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
