"""Simulators by name."""

from __future__ import annotations

from collections.abc import Mapping

from dubins_traffic.above import ABOVE
from dubins_traffic.errors import InputError
from dubins_traffic.protocols import Simulator

_DESCRIPTIONS = {
    "embedded": "exact arcs and contacts, batches, equal bytes for equal seeds; the default",
    "gazebo": "wheels, inertia and contact in Gazebo 11, one trial at a time; `dubins-traffic gazebo install` first",
}


def names() -> Mapping[str, str]:
    """Return the simulators: name to one line of description."""
    return dict(_DESCRIPTIONS)


def load(name: str, *, show: bool = False) -> Simulator:
    """Return a new simulator.

    Parameters
    ----------
    name : str
        One of `names`.
    show : bool
        Whether it shows what it does in a window of its own, at the pace of the clock.

    Raises
    ------
    InputError
        If there is none of that name, it can't be used here or it shows nothing.
    """
    if show and name == "embedded":
        raise InputError("shows nothing", field="simulator", value=name, expected="gazebo, for --gui")
    if name == "embedded":
        from dubins_traffic.simulators.embedded import Embedded

        return Embedded()
    if name in _DESCRIPTIONS:
        return ABOVE.parts("simulators")[name]()(show=show)
    raise InputError("unknown simulator", field="simulator", value=name, expected=f"one of {', '.join(_DESCRIPTIONS)}")
