"""Simulators by name."""

from __future__ import annotations

from collections.abc import Mapping

from dubins_traffic.errors import InputError
from dubins_traffic.protocols import Simulator

_DESCRIPTIONS = {
    "embedded": "exact arcs and contacts, batches, equal bytes for equal seeds; the default",
}


def names() -> Mapping[str, str]:
    """Return the simulators: name to one line of description."""
    return dict(_DESCRIPTIONS)


def load(name: str) -> Simulator:
    """Return a new simulator.

    Raises
    ------
    InputError
        If there is none of that name.
    """
    if name == "embedded":
        from dubins_traffic.simulators.embedded import Embedded

        return Embedded()
    raise InputError(
        "unknown simulator", field="simulator", value=name, expected=f"one of {', '.join(_DESCRIPTIONS)}"
    )
