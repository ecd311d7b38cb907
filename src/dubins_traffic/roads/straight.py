"""What knows straight segments only says so."""

from __future__ import annotations

import numpy as np

from dubins_traffic.errors import InputError
from dubins_traffic.roads.network import RoadNetwork


def require_straight(network: RoadNetwork, what: str) -> None:
    """Refuse a network that bends on behalf of `what`, such as ``the shield``.

    Raises
    ------
    InputError
        Naming the first segment that bends.
    """
    if not network.is_straight:
        s = int(np.flatnonzero(network.bent)[0])
        raise InputError(
            f"{what} knows straight segments only",
            field=f"rnd.segments[{s}]",
            expected="no segment that bends",
        )
