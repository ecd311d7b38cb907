"""The propositions of docs/rules.md that are flags, by the name under which rooms above the cars know them."""

from __future__ import annotations

from dubins_traffic.cars.propositions import FLAG, NAMES, names

__all__ = ["FLAG", "NAMES", "names"]
