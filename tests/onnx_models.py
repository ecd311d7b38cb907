"""Models of ONNX for tests: those of our policies' files, and small ones that lack something."""

from __future__ import annotations

import json
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import onnx
from onnx import TensorProto, helper, numpy_helper

from dubins_traffic.learning.policy import Policy

OPERATORS = 17
"""A version of the operators that all libraries know."""


def exported(policy: Policy, path: Path) -> Path:
    """Write a policy as a model that returns the action, or the sums of its choices."""
    nodes: list[Any] = []
    arrays: dict[str, Any] = {}
    last = "seen"
    for k, (weights, bias) in enumerate(policy.layers):
        arrays |= {f"w{k}": weights.T, f"b{k}": bias}
        final = k == len(policy.layers) - 1
        whole = final and len(policy.choices) > 0
        nodes.append(helper.make_node("Gemm", [last, f"w{k}", f"b{k}"], ["action" if whole else f"sum{k}"]))
        if not whole:
            last = "action" if final else f"part{k}"
            nodes.append(helper.make_node("Tanh", [f"sum{k}"], [last]))
    properties = {"names": json.dumps(policy.names), "cars": policy.cars, "frame_skip": policy.frame_skip}
    if len(policy.choices):
        properties["choices"] = json.dumps(policy.choices.tolist())
    return written(path, nodes, arrays, width=len(policy.names), properties=properties)


def written(
    path: Path,
    nodes: Sequence[Any],
    arrays: Mapping[str, Any],
    *,
    width: int | str | None,
    properties: Mapping[str, Any] | None = None,
    domains: Iterable[str] = (),
    returns: int = TensorProto.FLOAT,
    apart: bool = False,
) -> Path:
    """Write a model from `seen`, a batch of `width` numbers, to `action`; `apart` keeps its arrays in another file."""
    kept = [numpy_helper.from_array(np.asarray(own, np.float32), name) for name, own in arrays.items()]
    seen = helper.make_tensor_value_info("seen", TensorProto.FLOAT, ["batch", width])
    action = helper.make_tensor_value_info("action", returns, None)
    graph = helper.make_graph(list(nodes), "policy", [seen], [action], kept)
    known = [helper.make_opsetid("", OPERATORS), *(helper.make_opsetid(own, 1) for own in domains)]
    model = helper.make_model(graph, opset_imports=known, ir_version=9)
    helper.set_model_props(model, {name: str(value) for name, value in (properties or {}).items()})
    onnx.save(model, path, save_as_external_data=apart, location=f"{path.name}.data", size_threshold=0)
    return path


def product(path: Path, width: int, outputs: int, **more: Any) -> Path:
    """Write a model that multiplies what it sees by a matrix of zeros."""
    node = helper.make_node("MatMul", ["seen", "w"], ["action"])
    return written(path, [node], {"w": np.zeros((width, outputs))}, width=width, **more)
