import math

import numpy as np
from mpmath import mp

from dubins_traffic.kernels.trig import advance, arc_factors, sincos


def test_sincos_is_within_one_ulp() -> None:
    mp.prec = 200
    rng = np.random.default_rng(1)
    angles = np.concatenate([rng.uniform(-b, b, 2000) for b in (0.8, 10.0, 1e3, 1e6)])
    for theta in [0.0, -0.0, math.pi, -math.pi / 2, *angles]:
        for ours, true in zip(sincos(theta), (mp.cos(theta), mp.sin(theta)), strict=True):
            assert abs(ours - true) <= math.ulp(float(true))


def test_arc_factors_match_their_definition() -> None:
    mp.prec = 200
    for d in np.linspace(-0.5, 0.5, 1001):
        along, across = arc_factors(d)
        exact = (mp.sin(d) / d, (1 - mp.cos(d)) / d) if d else (1, 0)
        assert abs(along - exact[0]) < 3e-16
        assert abs(across - exact[1]) < 1e-16


def test_a_heading_stays_a_unit_vector() -> None:
    pose = (0.0, 0.0, *sincos(0.3))
    for _ in range(100_000):
        pose = advance(*pose, 0.7, 3.0, 1 / 30)
    assert abs(pose[2] ** 2 + pose[3] ** 2 - 1) < 1e-15
    assert abs(math.remainder(math.atan2(pose[3], pose[2]) - 0.3 - 100_000 * 0.1, 2 * math.pi)) < 1e-9
