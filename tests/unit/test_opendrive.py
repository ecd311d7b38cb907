"""OpenDRIVE as others write it: connecting roads in junctions, lane offsets and sections, clothoids and cubics."""

from __future__ import annotations

from collections.abc import Callable
from math import cos, pi, sin

import numpy as np
import pytest
from scipy.integrate import quad

from dubins_traffic.maps.opendrive import OpenDrive
from dubins_traffic.maps.polylines import to_segments
from dubins_traffic.maps.settings import ImportSettings
from dubins_traffic.roads.network import RoadNetwork
from tests.room import lacking

LANE = '<lane id="{}" type="driving"><width sOffset="0" a="3.2" b="0" c="0" d="0"/></lane>'
BOTH = f'<laneSection s="0"><left>{LANE.format(1)}</left><right>{LANE.format(-1)}</right></laneSection>'
RIGHT = f'<laneSection s="0"><right>{LANE.format(-1)}</right></laneSection>'
TOLERANCES = (0.02, 0.1, 0.5)


def road(name: str, geometry: str, lanes: str = BOTH, link: str = "", junction: str = "-1", length: float = 90) -> str:
    """Return a road."""
    head = f'<road id="{name}" junction="{junction}" length="{length}"><link>{link}</link>'
    return f"{head}<planView>{geometry}</planView><lanes>{lanes}</lanes></road>"


def line(x: float, y: float, heading: float, length: float, shape: str = "<line/>", s: float = 0.0) -> str:
    """Return a piece of geometry, by default a straight one."""
    return f'<geometry s="{s!r}" x="{x!r}" y="{y!r}" hdg="{heading!r}" length="{length!r}">{shape}</geometry>'


def whole(*roads: str) -> str:
    """Return a map of roads, with one junction 7."""
    return f'<OpenDRIVE><header revMajor="1" revMinor="6"/>{"".join(roads)}<junction id="7"/></OpenDRIVE>'


def crossing(*, linked: str) -> str:
    """Return four roads that end 10 m from the origin and the roads that connect them in junction 7.

    They are linked to the junction, or to their connecting roads.
    """
    rows: list[str] = []
    for k in range(4):
        there = 0.5 * pi * k + 0.1 * (k == 3)
        to = '<predecessor elementType="junction" elementId="7"/>'
        if linked == "roads":
            to = f'<predecessor elementType="road" elementId="{10 + k}" contactPoint="start"/>'
        rows.append(road(str(k), line(10 * cos(there), 10 * sin(there), there, 80), BOTH, to))
        after = (k + 1) % 4
        ends = (
            f'<predecessor elementType="road" elementId="{k}" contactPoint="start"/>'
            f'<successor elementType="road" elementId="{after}" contactPoint="start"/>'
        )
        turn = line(10 * cos(there), 10 * sin(there), there + pi, 15.7, '<arc curvature="-0.1"/>')
        rows.append(road(str(10 + k), turn, RIGHT, ends, "7", 15.7))
    return whole(*rows)


@pytest.mark.parametrize("linked", ["junction", "roads"])
def test_roads_that_connect_others_in_a_junction_show_which_meet(linked: str) -> None:
    document, losses = OpenDrive().reduced(crossing(linked=linked))
    network = RoadNetwork.from_document(document)
    assert losses.is_whole
    assert len(losses.fates) == 4
    assert sorted(network.degrees.tolist()) == [1, 1, 1, 1, 4]
    # The roads meet where they would if they went on, at the origin.
    middle = network.points[network.degrees.argmax()]
    assert np.abs(middle).max() < 0.01
    assert network.lengths.tolist() == pytest.approx([90.0 * 0.6 / 3.2] * 4, rel=1e-3)
    assert lacking(network) == []


def test_the_line_between_directions_follows_the_lane_offset() -> None:
    shift = '<laneOffset s="0" a="0" b="0" c="0" d="0"/><laneOffset s="50" a="0" b="0" c="0.0024" d="-0.000032"/>'
    shift += '<laneOffset s="100" a="2" b="0" c="0" d="0"/>'
    text = whole(road("1", line(0, 0, 0.0, 150), shift + BOTH, length=150))
    (found,) = OpenDrive().read_map(text).roads
    assert found.line[0].tolist() == [0.0, 0.0]
    assert found.line[-1] == pytest.approx([150.0, 2.0])
    assert to_segments(np.array([[75.0, 1.0]]), found.line)[0] < 0.01


def test_the_longest_section_says_how_many_lanes_there_are() -> None:
    wide = BOTH.replace("</right>", f"{LANE.format(-2)}</right>")
    text = whole(road("1", line(0, 0, 0.0, 90), wide + BOTH.replace('s="0"', 's="30"', 1)))
    (found,) = OpenDrive().read_map(text).roads
    assert (found.forward, found.backward) == (1, 1)
    (other,) = OpenDrive().read_map(text.replace('s="30"', 's="60"')).roads
    assert (other.forward, other.backward) == (2, 1)


def clothoid(s: float) -> tuple[float, float]:
    """Return a place on the clothoid from curvature 0 to 0.03 in 90 m, by SciPy's quadrature."""
    rate = 0.03 / 90
    return quad(lambda t: cos(0.5 * rate * t * t), 0, s)[0], quad(lambda t: sin(0.5 * rate * t * t), 0, s)[0]


CURVES: dict[str, tuple[str, Callable[[float], tuple[float, float]], float]] = {
    "arc": ('<arc curvature="0.02"/>', lambda s: (50 * sin(s / 50), 50 - 50 * cos(s / 50)), 90.0),
    "spiral": ('<spiral curvStart="0" curvEnd="0.03"/>', clothoid, 90.0),
    "poly3": (
        '<poly3 a="0" b="0" c="0.006" d="-0.00005"/>',
        lambda u: (u, 0.006 * u**2 - 0.00005 * u**3),
        94.0,
    ),
    "paramPoly3": (
        '<paramPoly3 pRange="normalized" aU="0" bU="90" cU="0" dU="0" aV="0" bV="0" cV="60" dV="-40"/>',
        lambda u: (u, 60 * (u / 90) ** 2 - 40 * (u / 90) ** 3),
        92.9,
    ),
    "paramPoly3 by length": (
        '<paramPoly3 pRange="arcLength" aU="0" bU="1" cU="0" dU="0" aV="0" bV="0" cV="0.002" dV="0"/>',
        lambda u: (u, 0.002 * u**2),
        90.0,
    ),
}
"""Shapes, places on them by what runs along them, and their lengths; the last is at its end at 90."""


@pytest.mark.parametrize("name", CURVES)
def test_points_of_a_shape_are_where_the_standard_has_them(name: str) -> None:
    shape, place, length = CURVES[name]
    (found,) = OpenDrive().read_map(whole(road("1", line(0, 0, 0.0, length, shape)))).roads
    wanted = np.array([place(float(s)) for s in np.linspace(0.0, 85.0, 200)])
    assert to_segments(wanted, found.line).max() < 3e-3


@pytest.mark.parametrize("tolerance", TOLERANCES)
@pytest.mark.parametrize("name", CURVES)
def test_arcs_stand_for_a_shape_within_the_tolerance(name: str, tolerance: float) -> None:
    """Between straight ends of 30 m, at which no shape is lost, the whole curve is within the tolerance."""
    shape, place, length = CURVES[name]
    (alone,) = OpenDrive().read_map(whole(road("1", line(0, 0, 0.0, length, shape)))).roads
    x, y = alone.line[-1].tolist()
    step = alone.line[-1] - alone.line[-2]
    heading = float(np.arctan2(step[1], step[0]))
    geometry = line(-30, 0, 0.0, 30) + line(0, 0, 0.0, length, shape, 30.0)
    text = whole(road("1", geometry + line(x, y, heading, 30, "<line/>", 30 + length), length=60 + length))
    document, losses = OpenDrive().reduced(text, settings=ImportSettings(scale=0.2, tolerance=tolerance))
    network = RoadNetwork.from_document(document)
    assert network.bent.all()
    assert losses.kept_share > 0.99
    curve = network.lane_curve(0, 0.0, 1e-4) / 0.2
    wanted = np.array([place(float(s)) for s in np.linspace(0.0, 85.0, 200)])
    away = to_segments(wanted, curve)
    assert away.max() <= 1.05 * tolerance + 5e-3
    assert (away <= tolerance + 4e-3).mean() > 0.98


@pytest.mark.parametrize(("rule", "ends"), [("RHT", [0.0, 90.0]), ("LHT", [90.0, 0.0])])
def test_a_one_way_road_runs_as_the_traffic_of_its_country(rule: str, ends: list[float]) -> None:
    """Where traffic keeps to the left, lanes on the right of the line run against it."""
    text = whole(road("1", line(0.0, 0.0, 0.0, 90.0), RIGHT).replace("<road ", f'<road rule="{rule}" '))
    (found,) = OpenDrive().read_map(text).roads
    assert (found.forward, found.backward) == (1, 0)
    assert found.line[:, 0].tolist() == ends
