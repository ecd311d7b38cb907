"""Boxes for strangers' controllers: what they see, what they may use, and how they end.

`boxed_controller` returns a controller that drives in a box; `available_layers` says what this machine can enforce.
"""

from dubins_traffic.sandbox.available import available_layers
from dubins_traffic.sandbox.box import Box, BoxOverError
from dubins_traffic.sandbox.controller import BoxedController, boxed_controller
from dubins_traffic.sandbox.layers import Layers
from dubins_traffic.sandbox.limits import BoxEnd, Limits, owner_of

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
