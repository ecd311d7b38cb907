"""Policies in files of ONNX, as learning libraries export them: run by ONNX Runtime, on one thread.

The model takes the flat observation, float32 (F,) or (1, F), and returns an action: two shares of speed and yaw rate
(clipped to [-1, 1]), a sum for each of some choices, of which the largest is taken, or the number of a choice. The
properties of the model, where it has them, say more: ``cars`` and ``frame_skip``, integers, ``names`` and ``choices``,
JSON lists, as of `policy.Policy`; without the last the choices are `actions.CHOICES`. A stranger's model is for a box
(`dubins_traffic.sandbox`): it is a program for a large library.
"""

from __future__ import annotations

import importlib
import importlib.util
import json
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final, cast

import numpy as np
import numpy.typing as npt

from dubins_traffic.cars.state import Command, Observation
from dubins_traffic.errors import InputError, MissingExtraError
from dubins_traffic.kernels.arrays import Floats
from dubins_traffic.learning.flat import SHOWN
from dubins_traffic.learning.policy import CHOICES, Learned

if TYPE_CHECKING:
    from dubins_traffic.problem.instance import Problem

SUFFIX: Final = ".onnx"
MOST: Final = 64 << 20
"""Most bytes of such a file."""
BOXED: Final = "/submission/policy.onnx"
"""Where a box sees the file."""
SEED: Final = 2016
"""What operators that draw random numbers begin with: the same trial again is the same."""
_STANDARD: Final = frozenset({"", "ai.onnx", "ai.onnx.ml"})
"""Domains of the operators that ONNX defines."""
_KINDS: Final = {"tensor(float)": np.float32, "tensor(double)": np.float64}
_QUIET: Final = 4
"""ONNX Runtime says nothing of its own, only why it fails."""


class OnnxPolicy:
    """A policy in a file of ONNX; whoever makes one in this process trusts the file.

    Parameters
    ----------
    path : path
        The file.

    Attributes
    ----------
    names : tuple of str
        Names of the numbers of the flat observation that make up the input; none for all of them.
    inputs : int
        How many numbers it takes.
    cars, frame_skip : int
        As of `policy.Policy`.

    Raises
    ------
    InputError
        If there is no such model: it has more than `MOST` bytes, keeps data elsewhere, uses operators that ONNX does
        not define, or does not take and return what the module says.
    MissingExtraError
        Without the extra `onnx`.
    """

    def __init__(self, path: str | Path) -> None:
        try:
            check_file(path)
            model, content = _read(Path(path))
            self._session = _session(content)
            self._input, self._kind, self._shape = _taken(self._session)
            self.inputs = self._shape[-1]
            said = {str(metadata_prop.key): str(metadata_prop.value) for metadata_prop in model.metadata_props}
            self.cars, self.frame_skip = _whole(said, "cars", 0, SHOWN), _whole(said, "frame_skip", 1, 1)
            self.names = _names(said)
            self._choices = _choices(said)
            self._check_action()
        except InputError as error:
            raise error.within(file=str(path)) from None

    def act(self, seen: npt.NDArray[Any]) -> Floats:
        """Return the action, shares (-1 to 1) of the largest speed and yaw rate, (2,), for the input `seen`, (V,)."""
        given = np.asarray(seen, dtype=self._kind).reshape(self._shape)
        output = np.asarray(self._session.run(None, {self._input: given})[0]).ravel()
        choices = self._choices
        if np.issubdtype(output.dtype, np.integer):
            if len(output) == 1 and 0 <= output[0] < len(choices):
                return choices[output[0]]
        elif len(output) == len(choices):
            return choices[output.argmax()]
        elif len(output) == 2:
            return np.clip(output.astype(np.float64), -1.0, 1.0)
        expected = f"two numbers, {len(choices)} numbers, or an integer from 0 to {len(choices) - 1}"
        raise InputError("not an action", field="output", value=output.tolist()[:4], expected=expected)

    def _check_action(self) -> None:
        """Refuse a model that returns no action where all inputs are zero."""
        try:
            self.act(np.zeros(self.inputs))
        except InputError:
            raise
        except Exception as error:
            raise InputError(f"fails: {_line(error)}", field="model", expected="a model that runs") from None


class Boxed:
    """Drives, in a box, by the file of ONNX that it sees there."""

    def start(self, problem: Problem) -> None:
        """Load the file; InputError if it is no policy, or none for the problem."""
        self._driver = Learned(OnnxPolicy(BOXED))
        self._driver.start(problem)

    def act(self, observation: Observation) -> Command:
        """Return the command, as `policy.Learned` does."""
        return self._driver.act(observation)


def check_file(path: str | Path) -> None:
    """Refuse a file that is not there, or has more than `MOST` bytes; and all without the extra `onnx`."""
    if importlib.util.find_spec("onnxruntime") is None or importlib.util.find_spec("onnx") is None:
        raise MissingExtraError("a policy in ONNX", "onnx")
    try:
        size = Path(path).stat().st_size
    except OSError:
        raise InputError("no such file", file=str(path)) from None
    if size > MOST:
        raise InputError("too large", file=str(path), value=size, expected=f"at most {MOST} bytes")


def _read(path: Path) -> tuple[Any, bytes]:
    """Return the model in a file, and the file's content; all that the model needs is there."""
    import onnx
    from google.protobuf.message import DecodeError

    content = path.read_bytes()
    try:
        model: Any = onnx.load_model_from_string(content)
    except DecodeError as error:
        raise InputError(f"can't be read: {_line(error)}", expected="a model of ONNX") from None
    local = {(str(function.domain), str(function.name)) for function in model.functions}
    for part in _parts(model):
        kind: str = part.DESCRIPTOR.name
        if kind == "TensorProto" and part.data_location == part.EXTERNAL:
            raise InputError("keeps data in another file", field=str(part.name), expected="all in this file")
        if kind == "NodeProto" and part.domain not in _STANDARD and (part.domain, part.op_type) not in local:
            name = f"{part.domain}.{part.op_type}"
            raise InputError("not an operator of ONNX", field="node", value=name, expected="its operators")
    return model, content


def _parts(message: Any) -> Iterator[Any]:
    """Yield all messages within a message of protobuf, of whatever kind and depth, itself first."""
    left = [message]
    while left:
        taken = left.pop()
        yield taken
        for field, value in taken.ListFields():
            if field.message_type is not None:
                left += [value] if hasattr(value, "ListFields") else value


def _session(content: bytes) -> Any:
    """Return what runs a model, on one thread."""
    runtime: Any = importlib.import_module("onnxruntime")  # which has no types
    runtime.set_seed(SEED)
    options = runtime.SessionOptions()
    options.intra_op_num_threads = options.inter_op_num_threads = 1
    options.log_severity_level = _QUIET
    try:
        return runtime.InferenceSession(content, options, providers=["CPUExecutionProvider"])
    except Exception as error:
        raise InputError(f"can't be run: {_line(error)}", field="model", expected="what ONNX Runtime runs") from None


def _taken(session: Any) -> tuple[str, Any, tuple[int, ...]]:
    """Return name, type and shape of what a model takes: the flat observation, alone or as a batch of one."""
    taken: list[Any] = session.get_inputs()
    if len(taken) != 1:
        names = [str(node.name) for node in taken]
        raise InputError("does not fit", field="inputs", value=names, expected="one, the flat observation")
    number = taken[0]
    shape = [side if isinstance(side, int) else 1 for side in number.shape]
    sized = bool(number.shape) and isinstance(number.shape[-1], int)
    if number.type not in _KINDS or not sized or len(shape) > 2 or shape[0] != (1 if len(shape) == 2 else shape[0]):
        expected = "float32, (F,) or (1, F)"
        raise InputError("does not fit", field=number.name, value=f"{number.type} {number.shape}", expected=expected)
    return str(number.name), _KINDS[number.type], tuple(shape)


def _whole(said: dict[str, str], name: str, least: int, usual: int) -> int:
    """Return a property that is an integer."""
    text = said.get(name, str(usual))
    if not text.isdecimal() or int(text) < least:
        raise InputError("not a number", field=name, value=text, expected=f"an integer, {least} or more")
    return int(text)


def _names(said: dict[str, str]) -> tuple[str, ...]:
    names = _listed(said, "names", "[]")
    if not all(isinstance(name, str) for name in names):
        raise InputError("not names", field="names", value=said["names"], expected="a JSON list of names")
    return tuple(names)


def _choices(said: dict[str, str]) -> Floats:
    if "choices" not in said:
        return CHOICES
    choices: Floats
    try:
        choices = np.array(_listed(said, "choices", ""), dtype=np.float64)
    except (TypeError, ValueError):
        choices = np.zeros(0)
    if choices.ndim != 2 or choices.shape[1] != 2 or not (np.abs(choices) <= 1.0).all():
        expected = "a JSON list of pairs, each number from -1 to 1"
        raise InputError("not choices", field="choices", value=said["choices"][:80], expected=expected)
    return choices


def _listed(said: dict[str, str], name: str, usual: str) -> list[Any]:
    """Return a property that is a JSON list."""
    try:
        listed = json.loads(said.get(name, usual))
    except ValueError:
        listed = None
    if not isinstance(listed, list):
        raise InputError("not a list", field=name, value=said[name][:80], expected="a JSON list")
    return cast("list[Any]", listed)


def _line(error: Exception) -> str:
    return " ".join(str(error).split())[:200]
