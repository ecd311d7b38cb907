"""What is written in the format of another program is read again to a nanometre, also where it bends or is turned."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from dubins_traffic.roads.formats import registry
from dubins_traffic.roads.formats.registry import WritesMaps
from dubins_traffic.roads.from_grid import most_segments
from dubins_traffic.roads.generate import generate
from dubins_traffic.roads.maps.losses import Losses
from dubins_traffic.roads.network import RoadNetwork
from tests.foreign_maps import FOREIGN

NANOMETRE = 1e-9


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
@given(network=networks())
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
