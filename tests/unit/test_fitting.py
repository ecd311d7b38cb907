"""Lines of any kind as control polygons rounded by arcs: within the tolerance, wide enough, straight at both ends."""

from __future__ import annotations

from math import cos, hypot, pi, sin

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from dubins_traffic.maps.drafting import on_itself, spread
from dubins_traffic.maps.fitting import Fit, Limits, fit
from dubins_traffic.maps.opendrive import Placed, clothoid, cubic, cubic_over
from dubins_traffic.maps.polylines import rounded, to_segments, true_length
from dubins_traffic.maps.settings import ImportSettings
from dubins_traffic.roads.chains import chain

LIMITS = Limits(0.1, 4.8, 9.0)


def keeps(line: np.ndarray, found: Fit, limits: Limits) -> bool:
    """Whether a fit keeps what it must; its pieces are those of a network."""
    start, end = tuple(line[0].tolist()), tuple(line[-1].tolist())
    pieces = chain(start, found.corners, end)
    ends = pieces[0].length >= limits.straight - 1e-6 and pieces[-1].length >= limits.straight - 1e-6
    return ends and all(radius >= limits.radius - 1e-9 for _, _, radius in found.corners)


def test_a_straight_road_has_no_corners() -> None:
    found = fit(np.array([[0.0, 0.0], [30.0, 0.02], [60.0, 0.0]]), LIMITS)
    assert found is not None
    assert (found.corners, found.lost) == ((), 0.0)


def test_an_arc_between_lines_is_one_corner() -> None:
    corner = ((50.0, 0.0, 30.0),)
    line = rounded(np.zeros(2), corner, np.array([50.0, 50.0]), 1e-3)
    found = fit(line, LIMITS)
    assert found is not None
    assert found.lost == 0.0
    assert len(found.corners) <= 2
    assert keeps(line, found, LIMITS)


@pytest.mark.parametrize(
    "line",
    [
        clothoid(Placed(3.0, -2.0, 0.7, 120.0), 0.0, 0.05),
        clothoid(Placed(0.0, 0.0, 0.0, 200.0), -0.02, 0.02),
        cubic(Placed(0.0, 0.0, 1.0, 0.0), np.array([0, 120.0, 0, 0]), np.array([0, 0, 90.0, -60.0]), 1.0),
        cubic_over(Placed(5.0, 5.0, -2.0, 90.0), np.array([0.0, 0.0, 4e-3, -3e-5])),
    ],
    ids=("clothoid", "s", "parametric cubic", "cubic"),
)
def test_curves_are_fitted_within_the_tolerance(line: np.ndarray) -> None:
    # The straight ends cost something where a curve bends at its very end.
    found = fit(line, LIMITS)
    assert found is not None
    assert keeps(line, found, LIMITS)
    assert found.worst < 1.0
    assert found.lost < 20.0
    inner = line[(np.hypot(*(line - line[0]).T) > 20.0) & (np.hypot(*(line - line[-1]).T) > 20.0)]
    curve = rounded(line[0], found.corners, line[-1], 1e-3)
    assert to_segments(inner, curve).max() <= 0.1 + 1e-3


def test_clothoids_are_those_of_fresnel() -> None:
    """A clothoid of unit rate from the origin: C(2), S(2) with the angle s^2 / 2, by SciPy's integrals."""
    from scipy.special import fresnel

    end = clothoid(Placed(0.0, 0.0, 0.0, 2.0), 0.0, 2.0)[-1]
    root = np.sqrt(np.pi)
    sine, cosine = fresnel(2.0 / root)
    assert np.abs(end - root * np.array([cosine, sine])).max() < 1e-6


def test_a_kink_is_rounded_as_little_as_may_be() -> None:
    line = np.array([[0.0, 0.0], [40.0, 0.0], [40.0, 40.0]])
    found = fit(line, LIMITS)
    assert found is not None
    assert [corner[2] for corner in found.corners] == pytest.approx([4.8])
    assert found.worst == pytest.approx(4.8 * (2.0**0.5 - 1.0), abs=0.02)


def test_what_is_too_short_or_turns_back_is_refused() -> None:
    assert fit(np.array([[0.0, 0.0], [17.0, 0.0]]), LIMITS) is None
    assert fit(np.array([[0.0, 0.0], [30.0, 0.0], [0.5, 0.0]]), LIMITS) is None


def test_an_end_may_be_aimed() -> None:
    aim = (cos(0.3), sin(0.3))
    line = np.array([[0.0, 0.0], [100.0, 0.0]])
    found = fit(line, LIMITS, (aim, None))
    assert found is not None
    assert keeps(line, found, LIMITS)
    x, y, _ = found.corners[0]
    assert (x / hypot(x, y), y / hypot(x, y)) == pytest.approx(aim, abs=1e-9)


@given(
    st.lists(st.tuples(st.floats(-0.6, 0.6), st.floats(6.0, 40.0)), min_size=1, max_size=9),
    st.floats(0.0, 2.0 * pi),
)
@settings(max_examples=60, deadline=None)
def test_every_fit_keeps_the_limits(steps: list[tuple[float, float]], heading: float) -> None:
    points = [(0.0, 0.0)]
    for turn, length in steps:
        heading += turn
        points.append((points[-1][0] + length * cos(heading), points[-1][1] + length * sin(heading)))
    line = np.array(points)
    found = fit(line, LIMITS)
    if found is not None:
        assert keeps(line, found, LIMITS)
        pieces = chain(points[0], found.corners, points[-1])
        assert sum(piece.length for piece in pieces) == pytest.approx(true_length(line[[0, -1]], found.corners))


def test_arms_are_turned_as_little_as_needed() -> None:
    assert spread([0.0, pi], 1.07) == [0.0, pi]
    wanted = spread([0.0, 0.8, 3.0], 1.07)
    assert wanted is not None
    assert wanted[1] - wanted[0] >= 1.07 - 1e-6
    assert max(abs(a - b) for a, b in zip(wanted, (0.0, 0.8, 3.0), strict=True)) < 0.14
    assert spread([0.0, 0.01, 3.0], 1.07) is None
    assert spread([0.0, 1.0, 2.0, 3.0, 4.0, 5.0], 1.07) is None


def test_a_line_that_comes_near_itself_is_told_however_long_it_is() -> None:
    room = ImportSettings().room(0.1875)
    straight = np.array([[0.0, 0.0], [90_000.0, 0.0]])
    assert not on_itself(straight, room)
    wide, narrow = (np.array([[0.0, 0.0], [900.0, 0.0], [900.0, gap], [0.0, gap]]) for gap in (80.0, 6.0))
    assert not on_itself(wide, room)
    assert on_itself(narrow, room)
    crossing = np.array([[0.0, 0.0], [3000.0, 0.0], [3000.0, 2000.0], [1501.0, 2000.0], [1501.0, -50.0]])
    assert on_itself(crossing, room)


def test_a_corner_on_an_end_is_no_arc() -> None:
    """As an instruction in a map may say; nothing is divided by the length of such a leg."""
    start, end = np.array([0.0, 0.0]), np.array([10.0, 0.0])
    with np.errstate(all="raise"):
        for corner in ((0.0, 0.0, 2.0), (10.0, 0.0, 2.0), (5.0, 0.0, 0.0)):
            assert np.isfinite(rounded(start, (corner,), end, 0.01)).all()


def test_a_long_winding_road_is_fitted_in_seconds() -> None:
    """Corners go one by one: were all points measured each time, this would take many minutes."""
    x = np.linspace(0.0, 2000.0, 400)
    line = np.stack([x, 30.0 * np.sin(0.0314 * x)], axis=-1)
    found = fit(line, Limits(0.1, 4.8, 9.0))
    assert found is not None
    assert found.lost == 0.0
    assert len(found.corners) < 200
