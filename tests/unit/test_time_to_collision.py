"""Times to collision of pairs whose times can be told by hand."""

from __future__ import annotations

import math

import numpy as np
import pytest

from dubins_traffic.scoring.time_to_collision import time_to_touch

PAIRS = {
    "head on": ((10.0, 0.0, -2.0, 0.0), 4.5),
    "already touching": ((0.6, 0.8, 5.0, 5.0), 0.0),
    "just touching, driving apart": ((1.0, 0.0, 1.0, 0.0), 0.0),
    "driving apart": ((10.0, 0.0, 2.0, 0.0), math.inf),
    "standing": ((10.0, 0.0, 0.0, 0.0), math.inf),
    "passing by at a distance": ((10.0, 1.5, -2.0, 0.0), math.inf),
    "off the middle": ((5.0, 0.6, -1.0, 0.0), 4.2),
    "from the side": ((3.0, 4.0, -0.6, -0.8), 4.0),
    "far and slow": ((1e6, 0.0, -1e-3, 0.0), (1e6 - 1.0) / 1e-3),
}


@pytest.mark.parametrize("pair", PAIRS)
def test_time_until_a_pair_touches(pair: str) -> None:
    place, expected = PAIRS[pair]
    x, y, vx, vy = (np.array([[value]]) for value in place)
    assert time_to_touch(x, y, vx, vy, 1.0)[0, 0] == pytest.approx(expected, rel=1e-12)
