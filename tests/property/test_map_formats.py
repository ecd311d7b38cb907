"""What is written in the format of another program is read again to a nanometre, also where it bends or is turned.

A program that passes over our instructions finds the same network there within the tolerance of an import.
"""

from __future__ import annotations

import re
from dataclasses import replace
from xml.etree.ElementTree import fromstring

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from dubins_traffic.maps.losses import Losses
from dubins_traffic.maps.polylines import to_segments
from dubins_traffic.maps.settings import ImportSettings
from dubins_traffic.roads.formats import registry
from dubins_traffic.roads.formats.registry import WritesMaps
from dubins_traffic.roads.generate import generate, most_segments
from dubins_traffic.roads.network import RoadNetwork
from tests.foreign_maps import FOREIGN
from tests.roadnets import winding

NANOMETRE = 1e-9
SEEDS = st.integers(0, 2**32 - 1)
INSTRUCTION = re.compile(r"<\?dubins-traffic [^>]*\?>\n")
TOLERANCE = ImportSettings().tolerance


@st.composite
def networks(draw: st.DrawFn) -> RoadNetwork:
    """Draw a random network, straight or bent, with a unit and a rigid motion of its own."""
    count = draw(st.integers(2, 9))
    roads = draw(st.integers(count - 1, most_segments(count)))
    bent = draw(st.sampled_from((0.0, 0.0, 0.5, 1.0)))
    made = generate(count, roads, draw(st.integers(0, 2**64 - 1)), bent=bent)
    moved = tuple(draw(st.floats(-bound, bound)) for bound in (1e3, 1e3, 7.0))
    length = made.length * draw(st.floats(1.0, 20.0))
    return replace(made, length=length, transform=moved)


@pytest.mark.parametrize("name", [*FOREIGN, "rnd-json", "rnd-text"])
@settings(max_examples=40, deadline=None, derandomize=True)
@given(network=networks() | SEEDS.map(winding))
def test_what_is_written_is_read_again_to_a_nanometre(name: str, network: RoadNetwork) -> None:
    form = registry.load(name)
    assert isinstance(form, WritesMaps)
    again = RoadNetwork.from_text(form.write(network.to_document()), "town", form)
    assert (again.length, again.transform) == (network.length, network.transform)
    assert (again.ends == network.ends).all()
    assert np.abs(again.points - network.points).max() < NANOMETRE
    assert np.abs(again.lengths - network.lengths).max() < NANOMETRE
    assert (again.bent == network.bent).all()
    for lane in range(network.lanes):
        there, back = (each.lane_curve(lane, -0.3) for each in (network, again))
        assert there.shape == back.shape
        assert np.abs(there - back).max() < NANOMETRE
    if name in FOREIGN:
        losses = again.known[registry.LOSSES]
        assert isinstance(losses, Losses)
        assert losses.is_whole


def nearest(network: RoadNetwork, wanted: RoadNetwork) -> list[int]:
    """Return the number of the intersection of `network` that lies where each of `wanted` lies."""
    away = np.hypot(*(network.points[:, None] - wanted.points[None]).T)
    assert away.min(axis=1).max() < NANOMETRE * 1e3
    return away.argmin(axis=1).tolist()


@pytest.mark.parametrize("name", FOREIGN)
@settings(max_examples=25, deadline=None, derandomize=True)
@given(network=SEEDS.map(winding))
def test_without_our_instructions_it_is_the_same_within_the_tolerance(name: str, network: RoadNetwork) -> None:
    form = registry.load(name)
    assert isinstance(form, WritesMaps)
    text, count = INSTRUCTION.subn("", form.write(network.to_document()))
    assert count == 1 + sum(1 for own in network.corners if own)
    again = RoadNetwork.from_text(text, "town", form)
    losses = again.known[registry.LOSSES]
    assert isinstance(losses, Losses)
    assert losses.is_whole, losses.lines()
    there = nearest(again, network)
    lanes = {again.lane_ends(lane): lane for lane in range(again.lanes)}
    assert len(lanes) == again.lanes == network.lanes
    for lane in range(network.lanes):
        first, last = network.lane_ends(lane)
        other = lanes[there[first], there[last]]
        one, two = network.lane_curve(lane, 0.0), again.lane_curve(other, 0.0)
        assert max(to_segments(one, two).max(), to_segments(two, one).max()) < 1.1 * TOLERANCE
        assert abs(network.lengths[lane >> 1] - again.lengths[other >> 1]) < 5.0 * TOLERANCE


@settings(max_examples=25, deadline=None, derandomize=True)
@given(network=networks() | SEEDS.map(winding))
def test_files_tell_the_lengths_of_roads_whichever_way_one_drives(network: RoadNetwork) -> None:
    forms = {name: registry.load(name) for name in ("sumo", "opendrive")}
    roots = {
        name: fromstring(form.write(network.to_document()))
        for name, form in forms.items()
        if isinstance(form, WritesMaps)
    }
    edges = {each.get("id"): each.find("lane") for each in roots["sumo"].iter("edge")}
    roads = {each.get("id"): each for each in roots["opendrive"].iter("road")}
    for s, length in enumerate(network.lengths.tolist()):
        for element in (edges[f"s{s}"], edges[f"-s{s}"], roads[f"{s}"]):
            assert element is not None
            assert float(element.get("length", "nan")) == pytest.approx(length, abs=NANOMETRE)
