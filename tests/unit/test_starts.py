"""Starts, drawn for one trial and for many by one kernel."""

import pytest

from dubins_traffic.problem import starts
from dubins_traffic.problem.configuration import load_config
from dubins_traffic.problem.draw import draw, draw_many


def test_starts_do_not_depend_on_how_much_scratch_there_is(monkeypatch: pytest.MonkeyPatch) -> None:
    """A trial that runs out of scratch gets more of it, alone or among many."""
    configuration = load_config("town")
    drawn = [draw(configuration, 3, trial).starts for trial in range(3)]
    monkeypatch.setattr(starts, "CUTS", 0)
    assert [draw(configuration, 3, trial).starts for trial in range(3)] == drawn
    assert [instance.starts for instance in draw_many(configuration, 3, range(3))] == drawn
