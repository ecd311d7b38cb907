"""Boxes for strangers' controllers: what they see, what they may use, and how they end.

`boxed_controller` returns a controller that drives in a box; `available_layers` says what this machine can enforce.
The names below are loaded when they are first used: each box imports this package for its shim, and none of them.
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from dubins_traffic.sandbox.available import available_layers
    from dubins_traffic.sandbox.box import Box, BoxOverError
    from dubins_traffic.sandbox.controller import BoxedController, boxed_controller
    from dubins_traffic.sandbox.layers import Layers
    from dubins_traffic.sandbox.limits import BoxEnd, Limits, owner_of

_PLACES = {
    "available_layers": "available",
    "Box": "box",
    "BoxOverError": "box",
    "BoxedController": "controller",
    "boxed_controller": "controller",
    "Layers": "layers",
    "BoxEnd": "limits",
    "Limits": "limits",
    "owner_of": "limits",
}

__all__ = [
    "Box",
    "BoxEnd",
    "BoxOverError",
    "BoxedController",
    "Layers",
    "Limits",
    "available_layers",
    "boxed_controller",
    "owner_of",
]


def __getattr__(name: str) -> Any:
    if name not in _PLACES:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    value = getattr(import_module(f"{__name__}.{_PLACES[name]}"), name)
    globals()[name] = value
    return value
